# ruff: noqa: E501 -- a deed is one line
"""What hostile planners do in one case of several, and what is to become of that case; and the same of constructors.

Each deed is Python source, executed at the first observation from 0.3 s on, with `o` the observation and `self` the
planner; what follows the bar is a pattern of the case's reason, SAME if the case must be as without the deed, or ANY if
the deed does not end its case in a certain way.
"""

from __future__ import annotations

SAME, ANY = "same", "any"
HUNG, RAISED, BAD = "^hung: no answer", "^raised: ", "^bad answer: "
CHANGED = "^changed its process: "


def DIED(how: str) -> str:  # noqa: N802
    """Return the pattern of a case whose process ended so."""
    return f"^died: its process {how}"


DEEDS: dict[str, tuple[str, str]] = {
    # --- never answers
    "sleeps": ("import time; time.sleep(1e6)", HUNG),
    "loops": ("while True: pass", HUNG),
    "loops in compiled code": ("import itertools; sum(itertools.repeat(0))", HUNG),
    "loops and catches all": ("""
while True:
    try:
        while True: pass
    except BaseException:
        pass
""", HUNG),
    "waits for itself": ("import threading; threading.Lock().__enter__(); a = threading.Lock(); a.acquire(); a.acquire()", HUNG),
    "reads standard input": ("import os; os.read(0, 1); raise ValueError('nothing there')", RAISED + "ValueError: nothing"),
    "blocks the alarm and loops": ("""
import signal, itertools
signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGALRM})
while True: pass
""", HUNG),
    "ignores the alarm and loops": ("import signal; signal.signal(signal.SIGALRM, signal.SIG_IGN)\nwhile True: pass", HUNG),
    "stops the timer and loops": ("import signal; signal.setitimer(signal.ITIMER_REAL, 0)\nwhile True: pass", HUNG),
    "stops itself": ("import os, signal; os.kill(os.getpid(), signal.SIGSTOP)", CHANGED + "it was stopped by signal 19"),
    "asks to be traced": ("import ctypes, os; ctypes.CDLL(None).ptrace(0, 0, 0, 0); os.kill(os.getpid(), 10)", CHANGED + "it was stopped by signal 10"),
    "stops its parent and loops": ("import os, signal; os.kill(os.getppid(), signal.SIGSTOP)\nwhile True: pass", HUNG),
    "waits for a child": ("import os\nif os.fork() == 0:\n    import time; time.sleep(1e6)\nos.wait()", HUNG),
    "joins a thread that loops": ("""
import threading
def turn():
    while True: pass
t = threading.Thread(target=turn, daemon=True); t.start(); t.join()
""", HUNG),
    "keeps saying that time goes on": ("""
from parcours.run import heartbeat
import itertools
while True: heartbeat.words(3)[1] = 7.0
""", HUNG),
    "matches a bad expression": ("import re; re.match(r'(a+)+$', 'a' * 60 + 'b')", HUNG),
    # --- ends its process
    "exits with 0": ("import os; os._exit(0)", DIED("ended with exit code 0")),
    "exits with 1": ("import os; os._exit(1)", DIED("ended with exit code 1")),
    "exits with 3": ("import os; os._exit(3)", DIED("ended with exit code 3")),
    "exits with the code of the tampered": ("import os; os._exit(113)", DIED("ended with exit code 113")),
    "exits in a thread": ("import os, threading, time; threading.Thread(target=os._exit, args=(4,)).start(); time.sleep(9)",
                          DIED("ended with exit code 4")),
    "kills itself": ("import os; os.kill(os.getpid(), 9)", DIED("was killed by signal 9")),
    "terminates itself": ("import os; os.kill(os.getpid(), 15)", DIED("was killed by signal 15")),
    "kills its parent": ("import os; os.kill(os.getppid(), 9)", DIED(r"was killed by signal 9 \(SIGKILL\)$")),
    "terminates its parent": ("import os; os.kill(os.getppid(), 15)", DIED(r"was killed by signal 15 \(SIGTERM\)$")),
    "kills its group": ("import os; os.killpg(0, 9)", DIED("was killed by signal 9")),
    "crashes its parent": ("import os; os.kill(os.getppid(), 11)", ANY),
    "crashes": ("import ctypes; ctypes.string_at(0)", DIED("was killed by signal 11")),
    "aborts": ("import os; os.abort()", DIED("was killed by signal 6")),
    "rings an alarm": ("import signal, time; signal.signal(14, signal.SIG_DFL); signal.alarm(1); time.sleep(9)", ANY),
    "overflows the stack of C": ("""
import ctypes
sys = __import__('sys'); sys.setrecursionlimit(10**9)
class A: pass
def f(): return f()
import functools
g = functools.reduce(lambda a, _: functools.partial(a), range(200000), lambda: 0)
def deep(x):
    for _ in range(10**6): x = [x]
    return x
import pickle
repr(deep(0))
""", ANY),
    "limits its processor time": ("""
import resource
resource.setrlimit(resource.RLIMIT_CPU, (1, 1))
import itertools; sum(itertools.repeat(0))
""", CHANGED + "it set itself a limit of 1 s of processor time"),
    # --- raises
    "sys.exit": ("import sys; sys.exit(0)", RAISED + "SystemExit: 0"),
    "SystemExit": ("raise SystemExit", RAISED + "SystemExit"),
    "KeyboardInterrupt": ("raise KeyboardInterrupt", RAISED + "KeyboardInterrupt"),
    "BaseException": ("raise BaseException('x')", RAISED + "BaseException: x"),
    "GeneratorExit": ("raise GeneratorExit", RAISED + "GeneratorExit"),
    "recursion": ("def f(): return f()\nf()", RAISED + "RecursionError"),
    "memory": ("x = []\nwhile True: x.append(bytearray(1 << 26))", f"{HUNG}|{RAISED}MemoryError"),
    "an exception whose text hangs": ("class E(Exception):\n    def __str__(self):\n        while True: pass\nraise E", HUNG),
    "an exception whose text exits": ("class E(Exception):\n    def __str__(self): raise SystemExit\nraise E", RAISED + "E "),
    "an exception whose text raises": ("class E(Exception):\n    def __str__(self): return 3\nraise E", RAISED + "E "),
    "an exception of a class that hides its name": ("class M(type):\n    def __getattribute__(c, n): raise SystemExit(0)\nclass E(Exception, metaclass=M): pass\nraise E('m')", RAISED + "E: m"),
    "an exception with an address": ("raise ValueError(object())", RAISED + r"ValueError: <object object at 0x\.\.\.>"),
    "an exception of endless text": ("raise ValueError('x' * 10**8)", RAISED + "ValueError: xxx"),
    "an exception that cannot be sent": ("""
class E(Exception):
    def __reduce__(self): return print, ('run in the parent',)
raise E('no')
""", RAISED + "E: no"),
    "an error of ours, changed": ("""
from parcours.errors import BadRequest
class Mine(BadRequest):
    def __reduce__(self): import os; return os._exit, (0,)
raise Mine('a', 'b', slug='c')
""", RAISED + "Mine: a: b"),
    # --- answers
    "a float that exits": ("""
class F(float):
    def __float__(self): raise SystemExit(3)
return F(0.1), F(0.0)
""", ANY),
    "a tuple without a length": ("class T(tuple):\n    def __len__(self): raise KeyError('len')\nreturn T((0.1, 0.0))",
                                 RAISED + "KeyError: 'len'"),
    "a tuple that never ends": ("class T(tuple):\n    def __iter__(self):\n        while True: yield 0.1\nreturn T((0.1, 0.0))", ANY),
    "a repr that hangs": ("class R:\n    def __repr__(self):\n        while True: pass\nreturn R()", HUNG),
    "a repr that exits": ("class R:\n    def __repr__(self): raise SystemExit(2)\nreturn R()", RAISED + "SystemExit: 2"),
    "an object at an address": ("return object()", BAD + r"returned <object object at 0x\.\.\.>"),
    "an array that exits": ("""
from parcours_navigation.protocol import Trajectory
class A(list):
    def __array__(self, *a, **k): raise SystemExit(9)
return Trajectory(A([[0.0, 0.0, 0.0, 0.0]]))
""", ANY),
    "an object that is all": ("""
class All:
    def __getattr__(self, name): return self
    def __eq__(self, other): return True
    def __call__(self, *a): return self
    __hash__ = None
return All()
""", f"{HUNG}|{BAD}"),
    "a class that lies": ("class L:\n    @property\n    def __class__(self): raise SystemExit(1)\nreturn L(), 0.0", ANY),
    "a million points": ("from parcours_navigation.protocol import Trajectory\nimport numpy as np\nreturn Trajectory(np.full((10**6, 4), np.nan))", f"{HUNG}|{BAD}"),
    # --- patches
    "patches numpy.zeros": ("import numpy as np; np.zeros = np.ones", CHANGED + "numpy.zeros was replaced"),
    "patches numpy.hypot": ("import numpy as np; np.hypot = lambda *a: 0.0", CHANGED + "numpy.hypot was replaced"),
    "patches numpy.searchsorted": ("import numpy as np; np.searchsorted = None", CHANGED + "numpy.searchsorted was replaced"),
    "removes numpy.array": ("import numpy as np; del np.array", CHANGED + "numpy.array was removed"),
    "patches with a thing equal to all": ("""
import numpy as np
class Equal:
    def __eq__(self, other): return True
    def __call__(self, *a, **k): raise SystemExit
np.zeros = Equal()
""", CHANGED + "numpy.zeros was replaced"),
    "patches json": ("import json; json.dumps = json.loads = None", CHANGED + "json.dumps was replaced"),
    "patches a method of the library": ("import json; json.JSONEncoder.encode = None", CHANGED + ".*encode was replaced"),
    "patches what it is shown": ("type(o).obstacles = property(lambda s: None, lambda s, v: None)", CHANGED),
    "patches a constant": ("import parcours_navigation.guests.host as h; h.NEVER = 5", CHANGED + ".*NEVER was replaced"),
    "empties builtins": ("import builtins; vars(builtins).clear()", CHANGED + ".*was removed"),
    "breaks the world's memory": ("import parcours.run.heartbeat as h; h._shared[:] = float('nan')", CHANGED),
    "looks through frames": (
        "import sys\nf = sys._getframe()\nwhile f:\n    for v in f.f_locals.values():\n"
        "        if getattr(v, 'dtype', None) is not None and v.dtype.names and v.flags.writeable: v['travelled'] = 9\n"
        "    f = f.f_back", ANY),
    "lets a thread patch later": (
        "import threading, time\ndef f():\n    time.sleep(0.02)\n    import numpy as np; np.hypot = lambda a, b: a * 0\n"
        "threading.Thread(target=f, daemon=True).start()", ANY),
    "lets a thread raise later": (
        "import ctypes, threading, time\nmain = ctypes.c_ulong(threading.get_ident())\ndef f():\n    time.sleep(0.02)\n"
        "    ctypes.pythonapi.PyThreadState_SetAsyncExc(main, ctypes.py_object(KeyError))\n"
        "threading.Thread(target=f, daemon=True).start()", ANY),
    "hides its traceback": (
        "class E(Exception):\n    __traceback__ = property(lambda s: 1 / 0)\nraise E('hidden')", "^raised: E: hidden"),
    "makes a file of the results": (
        "import shutil; shutil.rmtree(RESULTS, True); open(RESULTS, 'w').close()", ANY),
    "patches pickle": ("import pickle; pickle.dumps = None", CHANGED + "pickle.dumps was replaced"),
    "patches os.write": ("import os; os.write = lambda *a: 0", CHANGED + "os.write was replaced"),
    "patches os._exit": ("import os; os._exit = lambda *a: 0", CHANGED + "os._exit was replaced"),
    "patches os.getpid": ("import os; os.getpid = lambda: 1", CHANGED + "os.getpid was replaced"),
    "patches builtins": ("import builtins; builtins.len = lambda x: 3", CHANGED + "builtins.len was replaced"),
    "patches isinstance": ("import builtins; builtins.isinstance = lambda *a: True", CHANGED + "builtins.isinstance was"),
    "patches __import__": ("import builtins; builtins.__import__ = None", CHANGED + "builtins.__import__ was replaced"),
    "patches time": ("import time; time.time = time.monotonic = time.perf_counter = lambda: 0.0", CHANGED + "time.time was"),
    "patches our loop": ("from parcours_navigation.guests import host; host.hold = lambda *a: 1", CHANGED + "parcours_navigation.guests.host.hold"),
    "patches our host": ("from parcours_navigation.guests import host; host.conclude = None", CHANGED + ".*host.conclude was"),
    "patches threading": ("import threading; threading.Thread = threading.Lock = None", CHANGED + "threading\\.(Thread|Lock) was"),
    "patches all our functions": ("""
import sys
for name in [name for name in sys.modules if name.startswith('parcours.')]:
    module = sys.modules[name]
    for one in [one for one, value in vars(module).items() if callable(value) and not isinstance(value, type)]:
        setattr(module, one, lambda *a, **k: None)
""", CHANGED + "parcours"),
    "loads our modules again": ("""
import importlib, sys
for name in [name for name in sys.modules if name.startswith('parcours.run')]: importlib.reload(sys.modules[name])
""", CHANGED + "parcours.run"),
    "patches gc": ("import gc; gc.disable(); gc.collect = None", ANY),
    "empties sys.modules": ("import sys; sys.modules.clear()", CHANGED + "sys.modules was emptied"),
    "empties os.environ": ("import os; os.environ.clear()", SAME),
    "empties a module": ("import numpy; numpy.__dict__.clear()", CHANGED),
    # --- descriptors and limits
    "closes descriptors": ("import os; os.closerange(0, 4096)", CHANGED + "descriptors"),
    "closes all but the first": ("import os; os.closerange(3, 4096)", CHANGED + "descriptors"),
    "replaces descriptors": ("""
import os
null = os.open(os.devnull, os.O_RDWR)
for n in range(3, 64):
    if n != null: os.dup2(null, n)
""", CHANGED + "descriptors"),
    "replaces its output": ("import os; null = os.open(os.devnull, os.O_WRONLY); os.dup2(null, 1); os.dup2(null, 2)", SAME),
    "closes sys.stdout": ("import sys; sys.stdout.close(); sys.stderr.close(); sys.stdout = sys.stderr = None", SAME),
    "opens files without end": ("import os\nx = []\nwhile True: x.append(os.open(os.devnull, os.O_RDONLY))", f"{HUNG}|{RAISED}OSError"),
    "forbids files": ("import resource; resource.setrlimit(resource.RLIMIT_NOFILE, (0, 0))", CHANGED + "RLIMIT_NOFILE"),
    "forbids files for now": ("import resource; _, h = resource.getrlimit(7); resource.setrlimit(resource.RLIMIT_NOFILE, (0, h))", SAME),
    "forbids memory": ("import resource; resource.setrlimit(resource.RLIMIT_AS, (1 << 20, 1 << 20))", CHANGED + "RLIMIT_AS"),
    "forbids long files": ("import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))", CHANGED + "RLIMIT_FSIZE"),
    "sets a processor limit": ("import resource; resource.setrlimit(resource.RLIMIT_CPU, (900, 900))", CHANGED + "RLIMIT_CPU"),
    # --- settings
    "changes the folder": ("import os; os.chdir('/')", SAME),
    "removes the folder": ("import os, tempfile; d = tempfile.mkdtemp(); os.chdir(d); os.rmdir(d)", SAME),
    "changes umask": ("import os; os.umask(0o777)", SAME),
    "lets NumPy raise": ("import numpy as np; np.seterr(all='raise')", SAME),
    "sets the locale": ("import locale; locale.setlocale(locale.LC_ALL, '')", SAME),
    "sets decimal": ("import decimal; decimal.getcontext().prec = 1", SAME),
    "seeds all dice": ("import random, numpy as np; random.seed(0); np.random.seed(0)", SAME),
    "sets the recursion limit": ("import sys; sys.setrecursionlimit(60)", ANY),
    "traces": ("import sys\ndef t(*a): return t\nsys.settrace(t); sys.setprofile(t)", SAME),
    "handles signals": ("import signal\nfor n in (2, 14, 15): signal.signal(n, signal.SIG_IGN)", SAME),
    "blocks signals": ("import signal; signal.pthread_sigmask(signal.SIG_BLOCK, range(1, 32))", SAME),
    "registers faulthandler": ("import faulthandler; faulthandler.enable()", SAME),
    "disables collection": ("import gc; gc.disable(); gc.set_threshold(0)", SAME),
    "rounds otherwise": ("import ctypes; ctypes.CDLL('libm.so.6').fesetround(0x400)", CHANGED + "how the processor rounds"),
    # --- leaves something behind
    "forks a helper and crashes": ("import os, time\nif os.fork() == 0:\n    time.sleep(600); os._exit(0)\nos._exit(5)", DIED("ended with exit code 5")),
    "forks a helper": ("import os, time\nif os.fork() == 0:\n    time.sleep(600); os._exit(0)", SAME),
    "comes back twice": ("import os; os.fork()", SAME),
    "raises in a child": ("import os\nif os.fork() == 0: raise ValueError('child')", SAME),
    "forks a few": ("import os\nfor _ in range(5): os.fork()", SAME),
    "forks a demon": ("""
import os, time
if os.fork() == 0:
    os.setsid()
    if os.fork() == 0:
        time.sleep(600)
    os._exit(0)
""", SAME),
    "forks a demon and dies": ("""
import os, time
if os.fork() == 0:
    os.setsid()
    if os.fork() == 0:
        time.sleep(600)
    os._exit(0)
os.wait(); os._exit(6)
""", DIED("ended with exit code 6")),
    "starts a program": ("import subprocess; subprocess.Popen(['sleep', '600'])", SAME),
    "leaves a thread": ("import threading, time; threading.Thread(target=time.sleep, args=(600,)).start()", SAME),
    "leaves a busy thread": ("import threading\ndef f():\n    while True: pass\nthreading.Thread(target=f, daemon=True).start()", SAME),
    "registers atexit": ("import atexit, time, os; atexit.register(time.sleep, 600); atexit.register(os._exit, 3)", SAME),
    "hangs when it is deleted": ("class D:\n    def __del__(self):\n        while True: pass\nx = D(); x.me = x; del x", ANY),
    "exits when it is deleted": ("import os\nclass D:\n    def __del__(self): os._exit(8)\nx = D(); x.me = x; del x", DIED("ended with exit code 8")),
    "prints a lot": ("import os\nfor _ in range(300): os.write(1, b'x' * 100000)", SAME),
    "prints without end": ("import os\nwhile True: os.write(2, b'x' * 100000)", CHANGED + "it printed more than 64 MB in one case"),
    # --- what it is shown
    "writes over the heartbeat": ("""
from parcours.run import heartbeat
heartbeat.words(3)[:3] = 0.0, 9e99, 1e300
import os; os._exit(7)
""", DIED("ended with exit code 7")),
    "writes over all it sees": ("""
a = o.robot
while isinstance(a.base, type(a)): a = a.base
a[:] = 1e300
import os; os._exit(7)
""", DIED("ended with exit code 7")),
    "says that it is elsewhere and hangs": ("""
import sys
frame = sys._getframe()
while frame:
    memory = frame.f_locals.get('memory')
    if hasattr(memory, 'shape'): memory[:3] = -1.0, 0.0, 1e300
    frame = frame.f_back
import itertools; sum(itertools.repeat(0))
""", HUNG),
    "turns its arrays": ("o.robot.shape = (1, 5); o.obstacles.shape = (18,); o.robot.setflags(write=False)", SAME),
    "changes its task": ("object.__setattr__(o.task.limits, 'speed', -1.0); object.__setattr__(o.task, 'goal', None)", SAME),
    "removes its file": ("import os; os.remove(__file__)", SAME),
    "edits its file": ("open(__file__, 'w').write('raise SystemExit')", SAME),
    "deletes the results": ("import glob, os\nfor f in glob.glob(RESULTS + '/shard-*'): os.remove(f)", SAME),
    "writes into the results": ("import glob\nfor f in glob.glob(RESULTS + '/shard-*.parquet'): open(f, 'wb').write(b'x')", SAME),
    "writes to all descriptors": ("import os\nfor n in range(3, 40):\n    try: os.write(n, b'x' * 48)\n    except OSError: pass", CHANGED + "it wrote into the line to Parcours"),
    "writes a byte to all descriptors": ("import os\nfor n in range(3, 40):\n    try: os.write(n, b'x')\n    except OSError: pass", CHANGED + "it wrote into the line to Parcours"),
    "lets no descriptor block": ("import os\nfor n in range(3, 40):\n    try: os.set_blocking(n, False)\n    except OSError: pass", CHANGED + "descriptors"),
    # --- changes in place, and words of ours
    "replaces the code of our functions": ("""
import sys, types
def spin(*a, **k):
    while True: pass
for name in [name for name in sys.modules if name.startswith('parcours') and 'planner_' not in name]:
    for one in [one for one in vars(sys.modules[name]).values() if type(one) is types.FunctionType]:
        if not one.__code__.co_freevars: one.__code__ = spin.__code__
""", CHANGED + "__code__ of .* was replaced"),
    "replaces the defaults of our functions": ("""
import parcours.run.canaries as c, numpy as np
c.end_if.__defaults__ = (lambda *a: None, lambda *a: None, '')
np.zeros = np.ones
""", CHANGED + "__defaults__ of parcours.run.canaries.end_if was replaced"),
    "imports what changes its own functions": ("import sys\nfor name in [n for n in sys.modules if n.startswith('asyncio')]: del sys.modules[name]\nimport asyncio", SAME),
    "changes the class of a module": ("""
import parcours.run.heartbeat as h, types
class M(types.ModuleType):
    def __getattribute__(self, name): raise SystemExit(0)
h.__class__ = M
""", CHANGED + "__class__ of parcours.run.heartbeat was replaced"),
    "breaks what says where it is": ("import parcours.run.heartbeat as h; h._ENTRY = None", CHANGED + "what runs its cases raised AttributeError"),
    "becomes another program": ("import os; os.execv('/bin/sleep', ['sleep', '600'])", CHANGED + "it replaced itself by another program"),
    "lets a child become another program": ("import os\nif os.fork() == 0: os.execv('/bin/true', ['true'])\nos.wait()", SAME),
    "hangs up on itself": ("import os; os.kill(os.getpid(), 1)", DIED("was killed by signal 1 ")),
    "counts the time up": ("from parcours.run import heartbeat\nwords = heartbeat.words(3)\nwhile True: words[1] += 1.0", HUNG),
    "raises what ends a late case": ("from parcours.run.exception_text import Overdue; raise Overdue", RAISED + "Overdue$"),
    "an exception whose text is of a class": ("""
class S(str):
    def __getitem__(self, i): return self
    def __format__(self, f): raise SystemExit(0)
class E(Exception):
    def __str__(self): return S('mine')
raise E
""", RAISED + "E: mine "),
}  # fmt: skip

CONSTRUCTORS: dict[str, tuple[str, str]] = {
    # where: source, and a pattern of what the command says; SAME if the campaign must be as without it
    "import exits with 0": ("import os; os._exit(0)", "planner-ends-process"),
    "import exits with 5": ("import os; os._exit(5)", "exit code 5"),
    "import hangs": ("while True: pass", "did not within"),
    "import hangs in C": ("import itertools; sum(itertools.repeat(0))", "did not within"),
    "import sleeps and ignores signals": ("import signal, time\nfor n in range(1, 32):\n    try: signal.signal(n, signal.SIG_IGN)\n    except OSError: pass\ntime.sleep(1e6)", "did not within"),
    "import stops itself": ("import os; os.kill(os.getpid(), 19)", "it was stopped by signal 19"),
    "import crashes": ("import ctypes; ctypes.string_at(0)", "killed by signal 11"),
    "import kills its parent": ("import os; os.kill(os.getppid(), 9)", "planner-ends-process"),
    "import calls sys.exit": ("import sys; sys.exit(0)", "raised SystemExit: 0"),
    "import interrupts": ("raise KeyboardInterrupt", "raised KeyboardInterrupt"),
    "import raises with an address": ("raise ValueError(object())", r"<object object at 0x\.\.\.>"),
    "import raises what has no text": ("class E(Exception):\n    def __str__(self): raise SystemExit(3)\nraise E", "raised E"),
    "import raises one of ours that runs code": ("from parcours.errors import BadRequest\nclass E(BadRequest):\n    def __reduce__(self): import os; return os._exit, (0,)\nraise E('a', 'b', slug='c')", "raised E"),
    "import forks and sleeps": ("import os, time\nif os.fork() == 0:\n    time.sleep(600); os._exit(0)", SAME),
    "import forks and comes back": ("import os; os.fork()", SAME),
    "import starts a demon": ("import os, time\nif os.fork() == 0:\n    os.setsid()\n    if os.fork() == 0: time.sleep(600)\n    os._exit(0)", SAME),
    "import registers atexit": ("import atexit, os, time; atexit.register(time.sleep, 600); atexit.register(os._exit, 0)", SAME),
    "import prints": ("print('x' * 3_000_000)\nimport os; os.write(1, b'y' * 100)", SAME),
    "import patches numpy": ("import numpy as np; np.zeros = np.empty", "numpy.zeros was replaced"),
    "import empties sys.modules": ("import sys; sys.modules.clear()", "planner-"),
    "import closes descriptors": ("import os; os.closerange(0, 999)", "descriptors that it did not open"),
    "import deletes itself": ("import sys; del sys.modules[__name__]", SAME),
    "import removes its file": ("import os; os.path.exists(__file__) and os.remove(__file__)", SAME),
    "import leaves a thread": ("import threading, time; threading.Thread(target=time.sleep, args=(600,)).start()", SAME),
    "import changes the folder": ("import os; os.chdir('/'); os.umask(0o777)", SAME),
    "import forbids files": ("import resource; resource.setrlimit(resource.RLIMIT_NOFILE, (3, 3))", ANY),
    "import takes all memory": ("x = []\nwhile True: x.append(bytearray(1 << 26))", "raised MemoryError"),
    "import writes a pickle to the parent": ("import os\nfor n in range(3, 40):\n    try: os.write(n, b'\\0\\0\\0\\x14cos\\n_exit\\n(I0\\ntR.xxx')\n    except OSError: pass", "planner-"),
    "constructor exits with 0": ("def init(self):\n    import os; os._exit(0)", "its constructor must leave its process alone"),
    "constructor hangs": ("def init(self):\n    while True: pass", "its constructor must come to an end"),
    "constructor never ends in C": ("def init(self):\n    import itertools; sum(itertools.repeat(0))", "its constructor must come"),
    "constructor calls sys.exit": ("def init(self):\n    raise SystemExit(0)", "raised SystemExit"),
    "constructor patches builtins": ("def init(self):\n    import builtins; builtins.len = None", "planner-"),
    "constructor closes descriptors": ("def init(self):\n    import os; os.closerange(3, 999)", "descriptors that it"),
    "constructor crashes": ("def init(self):\n    import os; os.abort()", "killed by signal 6"),
    "constructor overflows": ("def init(self):\n    self.__class__()", "raised RecursionError"),
    "attributes hang": ("class Meta(type):\n    def __getattr__(cls, name):\n        while True: pass\ndef init(self): pass\nneeds = property(lambda self: all(True for _ in iter(int, 1)))", "did not within"),
    "deletion exits": ("def init(self): pass\nclass D:\n    def __del__(self): import os; os._exit(0)\nkept = D()", SAME),
}  # fmt: skip
