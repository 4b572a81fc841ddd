"""Four small graphs of ROS 2 whose callbacks come in any order: the same every time under the tester, at what price?

python bench/bench_order.py --repetitions 1000        (in an environment with rclpy and std_srvs; docs/ros2.md)

The graphs are those that the authors of ros2_def use: one message on two ways to a sink, two inputs of one node, two
publishers of one topic, two clients of one server. Each repetition is one abstract case, whose order the tester
enforces on plain nodes (`bench/order_nodes/passer.py`) at their messages; beside it the same nodes run without it.
Printed are how many orders of callbacks at the node where they meet came up among repetitions in which nodes work for
up to 0.5 ms, and the time from publishing (or calling) to the callback, hop by hop, where they do not work at all;
how much of it messages wait for their turn, which is what the order costs, not the way by the tester.
"""

from __future__ import annotations

import argparse
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from collections import Counter, defaultdict
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from parcours.abtc import Emission, Event, Reception
from parcours.run.binding import read_binding
from parcours.run.binding.slots import apart
from parcours.run.hosts.foreign.host import ForeignHost
from parcours.run.hosts.foreign.session import Session
from parcours.run.hosts.scheduling import real_time
from parcours.verdict.judgement import Verdict
from parcours_navigation.foreign.abstract import AbstractDrive
from parcours_navigation.foreign.judging import AbstractJudge
from parcours_navigation.foreign.tester_messages import Maker

PASSER = Path(__file__).with_name("order_nodes") / "passer.py"
ENVIRONMENT = "environment"

Line = tuple[str, str, tuple[str, ...]]
"""What a component does in its turn: (component, the channel that it receives, those on which it sends)."""


@dataclass(frozen=True)
class Graph:
    """Channels, what runs, and the order of turns that is demanded."""

    channels: dict[str, tuple[str, str, str]]  # (sender, receiver, topic or service)
    nodes: dict[str, str]  # component -> the words after its name and log
    order: tuple[Line, ...]


JITTER = "--jitter 0.0005"
MEET = ("Sink", "Fusion", "Server")
"""Where callbacks may come in another order."""

GRAPHS = {
    "two ways": Graph(
        {"go": (ENVIRONMENT, "Source", "/go"), "to_left": ("Source", "Left", "/in"),
         "to_right": ("Source", "Right", "/in"), "left": ("Left", "Sink", "/left"),
         "right": ("Right", "Sink", "/right"), "done": ("Sink", ENVIRONMENT, "/done")},
        {"Source": "--hears /go --says /in", "Left": f"--hears /in --says /left {JITTER}",
         "Right": f"--hears /in --says /right {JITTER}", "Sink": "--hears /left /right --says /done --times 2"},
        (("Source", "go", ("to_left", "to_right")), ("Left", "to_left", ("left",)), ("Right", "to_right", ("right",)),
         ("Sink", "right", ()), ("Sink", "left", ("done",))),
    ),
    "parallel inputs": Graph(
        {"go_x": (ENVIRONMENT, "X", "/go"), "go_y": (ENVIRONMENT, "Y", "/go"), "x": ("X", "Fusion", "/x"),
         "y": ("Y", "Fusion", "/y"), "done": ("Fusion", ENVIRONMENT, "/done")},
        {"X": f"--hears /go --says /x {JITTER}", "Y": f"--hears /go --says /y {JITTER}",
         "Fusion": "--hears /x /y --says /done --times 2"},
        (("X", "go_x", ("x",)), ("Y", "go_y", ("y",)), ("Fusion", "y", ()), ("Fusion", "x", ("done",))),
    ),
    "one topic": Graph(
        {"go_p": (ENVIRONMENT, "P", "/go"), "go_q": (ENVIRONMENT, "Q", "/go"), "of_p": ("P", "Sink", "/all"),
         "of_q": ("Q", "Sink", "/all"), "done": ("Sink", ENVIRONMENT, "/done")},
        {"P": f"--hears /go --says /all --mark 1 {JITTER}", "Q": f"--hears /go --says /all --mark 2 {JITTER}",
         "Sink": "--hears /all --says /done --times 2"},
        (("P", "go_p", ("of_p",)), ("Q", "go_q", ("of_q",)), ("Sink", "of_q", ()), ("Sink", "of_p", ("done",))),
    ),
    "service": Graph(
        {"go_p": (ENVIRONMENT, "P", "/go"), "go_q": (ENVIRONMENT, "Q", "/go"), "ask_p": ("P", "Server", "/ask"),
         "ask_q": ("Q", "Server", "/ask"), "told_p": ("Server", "P", "/ask"), "told_q": ("Server", "Q", "/ask"),
         "done_p": ("P", ENVIRONMENT, "/done_p"), "done_q": ("Q", ENVIRONMENT, "/done_q")},
        {"P": f"--hears /go --says /done_p --asks /ask {JITTER}",
         "Q": f"--hears /go --says /done_q --asks /ask --flag {JITTER}", "Server": "--serves /ask"},
        (("P", "go_p", ("ask_p",)), ("Q", "go_q", ("ask_q",)), ("Server", "ask_q", ("told_q",)),
         ("Q", "told_q", ("done_q",)), ("Server", "ask_p", ("told_p",)), ("P", "told_p", ("done_p",))),
    ),
}  # fmt: skip


def write(graph: Graph, folder: Path) -> Path:
    """Write model and binding of a graph, and return the binding's file."""
    machines: dict[str, list[str]] = {}
    for number, (component, received, sent) in enumerate(graph.order):
        message = f", message: {'; '.join(f'{one}(number)' for one in sent)}" if sent else ""
        line = f"t{number}: {{from: on, to: on, event: {received}(given){message}}}"
        machines.setdefault(component, []).append(line)
    channels = [f"  {name}: {{from: {a}, to: {b}, message: Number, topic: {topic}}}"
                for name, (a, b, topic) in graph.channels.items()]  # fmt: skip
    components = [
        f"  {name}:\n    variables: {{number: {{type: Number}}}}\n    machines:\n      pass:\n        initial: on\n"
        f"        transitions:\n" + "\n".join(f"          {line}" for line in lines)
        for name, lines in machines.items()
    ]
    (folder / "model.yaml").write_text("\n".join([
        "parcours: model/1", "name: graph", "messages: {Number: {fields: {n: {type: int}}}}", "channels:", *channels,
        "components:", *components, "",
    ]))  # fmt: skip
    bound = []
    for name, (a, b, topic) in graph.channels.items():
        if topic == "/ask":
            part = "request" if b == "Server" else "response"
            bound.append(f"  {name}: {{service: {topic}, type: std_srvs/SetBool, part: {part}, timeout: 30 s}}")
        else:
            inject = ", inject: {set: {data: k}}" if a == ENVIRONMENT else ""
            bound.append(f"  {name}: {{topic: {topic}, type: std_msgs/Int64, queue: 100{inject}}}")
    nodes = [
        f"  {name}:\n    command: {list(words(name, graph, folder))}\n    ros_node: /{name.lower()}\n    timeout: 60 s"
        for name in graph.nodes
    ]
    head = ["parcours: binding/1", "name: graph", "model: model.yaml", "transport: ros2", "constants: {k: 0}"]
    file = folder / "binding.yaml"
    file.write_text("\n".join([*head, "quiescence: 5 s", "nodes:", *nodes, "channels:", *bound, ""]))
    return file


def words(name: str, graph: Graph, folder: Path) -> tuple[str, ...]:
    return (sys.executable, str(PASSER), name.lower(), str(folder), *graph.nodes[name].split())


def events_of(graph: Graph) -> tuple[Event, ...]:
    """Return the turns of a graph as a serialised case: each node's own in their order, a message after its sending."""
    references = {name: number for number, name in enumerate(graph.nodes)}
    sender = {channel: at for at, (_, _, sent) in enumerate(graph.order) for channel in sent}
    found: list[Event] = []
    for at, (component, received, sent) in enumerate(graph.order):
        after = {one.position for one in found if one.component == component}
        after |= {sender[received]} if received in sender else set()
        sends = tuple(
            Emission(one, "environment" if graph.channels[one][1] == ENVIRONMENT else "reference",
                     references.get(graph.channels[one][1]))
            for one in sent
        )  # fmt: skip
        found.append(Event(at, at, references[component], 0, component, "pass", component, f"t{at}",
                           Reception(received, sender.get(received)), sends, tuple(sorted(after))))  # fmt: skip
    return tuple(found)


def enforced(graph: Graph, repetitions: int, folder: Path) -> float:
    """Run the repetitions under the tester, and return how long messages waited for their turn altogether [ns].

    Raises RuntimeError if the order could not be enforced in one.
    """
    events, waited = events_of(graph), 0
    with ForeignHost(read_binding(write(graph, folder)), folder / "nodes") as host:
        references = {event.reference: event.component for event in events}
        observers: list[Any] = []
        slots = apart(host.binding, references)
        session = Session(host, slots, listener=lambda one: observers[0](one) if observers else None)
        try:
            session.start()
            compiled = host.compile()
            names = [slot.component(one) for slot in session.slot_plan.slots for one in slot.node.components]
            with real_time():
                for k in range(repetitions):
                    judge = AbstractJudge(compiled, events, names)
                    judge.watch.began = session.case_began
                    observers[:] = [judge.observe]
                    AbstractDrive(session, judge, Maker(compiled, {"k": k}), events).run()
                    judgement = judge.judged().judgement
                    if judgement.verdict is not Verdict.PASS:
                        raise RuntimeError(f"repetition {k}: {judgement.why}")
                    happened = session.relay.events
                    waited += sum(one.time for one in happened if one.kind == "release")
                    waited -= sum(one.time for one in happened if one.kind == "hold")
                    happened.clear()
        finally:
            session.end()
    return waited


def free(graph: Graph, repetitions: int, folder: Path) -> float:
    """Run the repetitions without a tester: the same messages from the environment, nobody between the nodes."""
    import rclpy
    from rclpy.executors import SingleThreadedExecutor
    from std_msgs.msg import Int64

    processes = [subprocess.Popen(words(name, graph, folder), stderr=subprocess.DEVNULL) for name in graph.nodes]
    context = rclpy.Context()
    rclpy.init(context=context)
    driver, executor = rclpy.create_node("driver", context=context), SingleThreadedExecutor(context=context)
    executor.add_node(driver)
    heard: Counter[int] = Counter()
    ends = [topic for _, receiver, topic in graph.channels.values() if receiver == ENVIRONMENT]
    for topic in ends:
        driver.create_subscription(Int64, topic, lambda message: heard.update([message.data]), 100)
    go = driver.create_publisher(Int64, "/go", 100)
    try:
        listeners = sum(sender == ENVIRONMENT for sender, _, _ in graph.channels.values())
        until = time.monotonic() + 60.0
        while go.get_subscription_count() < listeners or any(not driver.count_publishers(one) for one in ends):
            if time.monotonic() > until:
                raise RuntimeError("the nodes did not come up")
            executor.spin_once(0.05)
        time.sleep(1.0)  # their own ends, which the driver does not see
        with real_time():
            for k in range(repetitions):
                go.publish(Int64(data=k))
                until = time.monotonic() + 10.0
                while heard[k] < len(ends) and time.monotonic() < until:
                    executor.spin_once(0.1)
    finally:
        rclpy.shutdown(context=context)
        for process in processes:
            process.send_signal(signal.SIGINT)
        for process in processes:
            process.wait(10.0)
    return 0.0


@dataclass(frozen=True)
class Seen:
    """What nodes wrote down: the orders of callbacks that came up, and the duration of each hop [ns].

    `waited` is how much of a hop, on average, a message waited for its turn [ns].
    """

    orders: Counter[tuple[str, ...]]
    hops: list[int]
    waited: float = 0.0


def seen(graph: Graph, folder: Path, warm_up: int) -> Seen:
    """Return what the nodes of a run wrote down; a server's calls are those of its clients, one after the other."""
    done: list[tuple[int, str, str, int, str]] = []
    for name in graph.nodes:
        turn: Counter[str] = Counter()
        for line in (folder / f"{name.lower()}.log").read_text().splitlines():
            time_, what, number, where = line.split(" ", 3)
            k = int(number)
            if k < 0:
                k, turn[f"{what} {where}"] = turn[f"{what} {where}"], turn[f"{what} {where}"] + 1
                k = k // 2 if where.endswith("answered") else k
            done.append((int(time_), what, where, k, name))
    done.sort()
    callbacks: dict[int, list[str]] = defaultdict(list)
    said: dict[tuple[str, int], list[int]] = defaultdict(list)
    hops: list[int] = []
    for when, what, where, k, name in done:
        topic = where.split(" ")[0] if not where.endswith("answered") else where
        if what == "in":
            if name in MEET:
                callbacks[k].append(f"{name} {where}")
            if said[topic, k] and k >= warm_up:
                hops.append(when - (said[topic, k].pop(0) if len(said[topic, k]) > 1 else said[topic, k][0]))
        else:
            said[topic, k].append(when)
    return Seen(Counter(tuple(each) for k, each in callbacks.items()), hops)


def both(graph: Graph, repetitions: int) -> tuple[Seen, Seen]:
    """Return what is seen of a graph under the tester, and without it."""
    found = []
    for run in (enforced, free):
        with tempfile.TemporaryDirectory() as folder:
            waited = run(graph, repetitions, Path(folder))
            one = seen(graph, Path(folder), min(20, repetitions // 2))
            found.append(replace(one, waited=waited / max(len(one.hops), 1)))
    return found[0], found[1]


CHAIN = Graph(
    {"go": (ENVIRONMENT, "Source", "/go"), "there": ("Source", "Middle", "/there"), "on": ("Middle", "Sink", "/on"),
     "done": ("Sink", ENVIRONMENT, "/done")},
    {"Source": "--hears /go --says /there", "Middle": "--hears /there --says /on", "Sink": "--hears /on --says /done"},
    (("Source", "go", ("there",)), ("Middle", "there", ("on",)), ("Sink", "on", ("done",))),
)  # fmt: skip
"""Where nothing waits for its turn. Without the tester its middle node stands for it: a relay as plain as can be."""


def chain(repetitions: int) -> tuple[list[int], list[int], list[int]]:
    """Return how long a hop takes by the tester, without it, and by a plain node in between [ns]."""
    under, _ = both(CHAIN, repetitions)
    with tempfile.TemporaryDirectory() as folder:
        free(CHAIN, repetitions, Path(folder))
        at: dict[tuple[str, str], int] = {}
        for name in CHAIN.nodes:
            for line in (Path(folder) / f"{name.lower()}.log").read_text().splitlines():
                time_, what, number, _ = line.split(" ", 3)
                at[f"{name} {what}", number] = int(time_)
    rounds = [str(k) for k in range(min(20, repetitions // 2), repetitions)]
    direct, relayed = ([at[f"{name} in", k] - at["Source out", k] for k in rounds] for name in ("Middle", "Sink"))
    return under.hops, direct, relayed


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--repetitions", type=int, default=1000, help="of the order of callbacks")
    parser.add_argument("--hops", type=int, default=1000, help="repetitions whose hops are timed")
    parser.add_argument("--graph", choices=list(GRAPHS), action="append")
    asked = parser.parse_args()
    print(f"{asked.repetitions} repetitions; orders of callbacks, hop p50 and p99 [us], and what the tester adds")
    p50, p99 = ([statistics.quantiles(one, n=100)[at] * 1e-3 for one in chain(asked.hops)] for at in (49, 98))
    for what, half, most in zip(("by the tester", "without it", "by a plain node in rclpy"), p50, p99, strict=True):
        print(
            f"a hop of a chain {what:25} {half:6.0f} {most:6.0f}   added: {half - p50[1]:+6.0f} {most - p99[1]:+6.0f}"
        )
    for name in asked.graph or list(GRAPHS):
        graph = GRAPHS[name]
        under, without = both(graph, asked.repetitions)
        idle = {one: line.replace(JITTER, "") for one, line in graph.nodes.items()}
        timed = both(replace(graph, nodes=idle), asked.hops)
        p50, p99 = ([statistics.quantiles(one.hops, n=100)[at] * 1e-3 for one in timed] for at in (49, 98))
        means = [statistics.fmean(one.hops) * 1e-3 for one in timed]
        turn = timed[0].waited * 1e-3
        line = f"{name:16} tester: {len(under.orders)} order(s) {p50[0]:6.0f} {p99[0]:6.0f}"
        line += f"   without: {len(without.orders)} order(s) {p50[1]:6.0f} {p99[1]:6.0f}"
        line += f"   added: {p50[0] - p50[1]:+6.0f} {p99[0] - p99[1]:+6.0f}"
        print(f"{line}   means: {means[0]:.0f} of which {turn:.0f} for its turn, {means[1]:.0f} without", flush=True)


if __name__ == "__main__":
    main()
