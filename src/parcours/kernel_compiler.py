"""Compiles kernels: those that only other kernels call are translated, and optimised where they are called from.

Numba optimises every function together with all that it calls, and again with every caller up to the top: of a chain
of ten, the last is optimised ten times. Here a kernel has two forms. Kernels call the inner one, which nothing has
optimised yet. Python calls the outer one, machine code made of the inner one with all that it calls, optimised once:

    Python --> outer a                  machine code
                  | inner a             linked into it, then optimised with it
                  |    | inner b        linked into a, and so into the outer one

Both are kept on disk: another outer kernel finds the inner ones there. Copies of inner kernels belong to one outer
kernel alone: the compiler may shape them as their callers need them, which it may not with what other code could call
(a tenth of the time of a planner of some hundred kernels).

Passes that look for what no kernel contains are left out (`_NEEDLESS`), and what Numba would find out again and again
is found out once, or not at all where nobody asks (`_hasten`).
"""

from __future__ import annotations

import functools
import gc
from collections.abc import Callable
from types import CodeType, FunctionType
from typing import Any, TypeVar

import llvmlite.binding as llvm
from numba.core import config, sigutils, types
from numba.core.caching import CompileResultCacheImpl, FunctionCache
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler, CompileResult, DefaultPassBuilder
from numba.core.compiler_lock import global_compiler_lock
from numba.core.compiler_machinery import PassManager
from numba.core.registry import CPUDispatcher
from numba.core.runtime import rtsys
from numba.core.types.misc import unliteral
from numba.np import numpy_support

from parcours.kernel_lowering import KernelContext, KernelLowering

D = TypeVar("D", bound=CPUDispatcher)

# Numba builds it whenever it meets a record, which took longer than loading the kernel that the record was given to.
numpy_support.as_struct_dtype = functools.cache(numpy_support.as_struct_dtype)

_KERNELS: set[CodeType] = set()
"""The code of all kernels that were asked for."""


class _OnDisk(FunctionCache):  # type: ignore[misc]
    def load_overload(self, sig: Any, target_context: Any) -> CompileResult | None:
        """Return what is kept for arguments of these types, without loading what only compiling needs.

        That would take a fifth of a start.
        """
        with self._guard_against_spurious_io_errors():
            return self._load_overload(sig, target_context)
        return None


def outer(function: Callable[..., object], options: dict[str, Any], folder: str, inner: Callable[[], _Inner]) -> _Outer:
    """Return a kernel as Python calls it.

    Args:
        folder: where machine code is kept; where numba's lies if it is empty.
        inner: gives the inner form, if machine code must be made of it.
    """
    return _kept(_Outer(function, options, inner), _WholeOnDisk, folder)


def inner(function: Callable[..., object], options: dict[str, Any], folder: str) -> _Inner:
    """Return a kernel as other kernels call it; what is compiled is kept as for `outer`."""
    return _kept(_Inner(function, targetoptions=options, pipeline_class=_LinkedCompiler), _LinkedOnDisk, folder)


def _kept(compiled: D, on_disk: type[FunctionCache], folder: str) -> D:
    _KERNELS.add(compiled.py_func.__code__)
    now, config.CACHE_DIR = config.CACHE_DIR, folder or config.CACHE_DIR
    try:
        compiled._cache = on_disk(compiled.py_func)
    finally:
        config.CACHE_DIR = now
    return compiled


class _Outer(CPUDispatcher):  # type: ignore[misc]
    """Machine code of kernels that Python calls."""

    def __init__(self, function: Callable[..., object], options: dict[str, Any], inner: Callable[[], _Inner]) -> None:
        super().__init__(function, targetoptions=options)
        self._inner = inner
        self._compiler.compile = self._optimised_with_room

    def _optimised(self, arguments: tuple[Any, ...], _: Any) -> CompileResult:
        """Return machine code of the inner form, which `compile` adds and keeps."""
        collects = gc.isenabled()
        gc.disable()  # it would look through all that the compiler keeps again and again, a tenth of the time
        try:
            inner = self._inner()
            inner.compile(arguments)
            known = inner.overloads[arguments]
            context = self.targetctx.subtarget(enable_nrt=self.targetoptions["_nrt"])
            library = _Whole(context.codegen(), known.fndesc)
            library.enable_object_caching()
            library.add_linking_library(known.library)
            context.create_cpython_wrapper(library, known.fndesc, known.environment, None, release_gil=True)
            entry = context.get_executable(library, known.fndesc, known.environment)
            return known._replace(library=library, entry_point=entry)
        finally:
            if collects:
                gc.enable()

    # CPython keeps frames in chunks of 16 KB. Where calls cross the end of one, it maps and unmaps the next chunk at
    # every call, which took a tenth of the time. A frame as large as this gets a chunk of 2 MB, and half of that is
    # left for the frames of what it calls.
    _optimised_with_room = FunctionType(_optimised.__code__.replace(co_stacksize=2**17), globals())

    def add_overload(self, cres: CompileResult) -> None:
        """Add it, and let it know the environments of inner kernels, which have no code of their own."""
        for environment in cres._find_referenced_environments():
            cres.codegen.set_env(environment.env_name, environment)
        super().add_overload(cres)


class _Code(JITCodeLibrary):  # type: ignore[misc]
    """Code of a kernel, outer or inner."""

    def _optimize_functions(self, module: Any) -> None:
        """Optimise each function by itself."""
        module.data_layout = self._codegen._data_layout
        passes, builder = self._codegen._function_pass_manager()
        for function in module.functions:
            if not function.is_declaration:
                passes.run(function, builder)

    def _finalize_dynamic_globals(self) -> None:
        """Look for none: the context allows none."""


class _Whole(_Code):
    """Code of an outer kernel with all that it calls.

    Args:
        codegen: as of any library.
        kernel: describes the kernel itself.
    """

    def __init__(self, codegen: Any, kernel: Any) -> None:
        super().__init__(codegen, kernel.qualname)
        self._kernel = kernel

    def _optimize_final_module(self) -> None:
        """Optimise it, knowing that all but the kernel itself is called from here only.

        Environments of other kernels are dropped unless some code reads them: to load one, its module is imported.
        """
        for function in self._final_module.functions:
            if function.linkage == llvm.Linkage.linkonce_odr:
                is_kernel = function.name == self._kernel.llvm_func_name
                function.linkage = llvm.Linkage.external if is_kernel else llvm.Linkage.internal
        for environment in self._environments():
            environment.linkage = llvm.Linkage.internal
        passes = llvm.create_new_module_pass_manager()
        passes.add_global_dead_code_eliminate_pass()
        passes.run(self._final_module, self._codegen._pass_builder())
        for environment in self._environments():
            environment.linkage = llvm.Linkage.common
        super()._optimize_final_module()

    def _environments(self) -> list[Any]:
        own, variables = self._kernel.env_name, self._final_module.global_variables
        return [one for one in variables if one.name.startswith("_ZN08NumbaEnv") and one.name != own]

    @property
    def counts_references(self) -> bool:
        """Whether something in it makes arrays, or holds on to one."""
        return any(function.name.startswith("NRT_") for function in self._final_module.functions)

    def serialize_using_object_code(self) -> tuple[str, str, tuple[bytes, bytes]]:
        """Return machine code and the name of what Python calls, for the process that loads it: nothing links to it."""
        name = self._kernel.llvm_cpython_wrapper_name
        named = llvm.parse_assembly(f'define void @"{name}"() {{ ret void }}').as_bitcode()
        return self.name, "object", (self._get_compiled_object(), named)


class _WholeFile(CompileResultCacheImpl):  # type: ignore[misc]
    def reduce(self, cres: CompileResult) -> tuple[bool, tuple[Any, ...]]:
        """Return what to keep."""
        return cres.library.counts_references, super().reduce(cres)

    def rebuild(self, target_context: Any, payload: tuple[bool, tuple[Any, ...]]) -> CompileResult:
        """Return what was kept."""
        counts_references, kept = payload
        if counts_references:
            rtsys.initialize(target_context)  # it compiles the functions that count, a fiftieth of a start
        return super().rebuild(target_context, kept)


class _WholeOnDisk(_OnDisk):
    _impl_class = _WholeFile


_NEEDLESS = frozenset({
    "with_lifting", "make_function_op_code_to_jit_function", "inline_inlinables", "inline_overloads", "find_literally",
    "literal_unroll", "LiteralPropagation", "Rewrite dynamic raises", "annotate_types", "dump_parfor_diagnostics",
})  # fmt: skip
_OF_ARRAYS = frozenset({"inline_closure_likes", "nopython_rewrites", "ir_legalization"})  # for kernels that make some


@functools.cache
def _hasten() -> None:
    """Patch Numba to do once what it otherwise repeats, and nothing that nobody asks for.

    All that Numba compiles in this process goes through it; only the message about shapes is another one.
    """
    from numba import extending
    from numba.core import base, postproc, targetconfig, transforms
    from numba.core.typing import templates
    from numba.np import arrayobj

    # Every pass writes down the types of the arguments.
    types.Record.__repr__ = functools.cache(types.Record.__repr__)  # type: ignore[method-assign]
    look_up, numbers = types.Function.get_call_type, (types.Integer, types.Float, types.Boolean)

    @functools.cache
    def remembered(operator: Any, context: Any, arguments: Any) -> Any:
        return look_up(operator, context, arguments, {})

    def get_call_type(function: Any, context: Any, args: Any, kws: Any) -> Any:
        is_operator = getattr(function.typing_key, "__module__", "") == "_operator" and not kws
        if is_operator and all(isinstance(one, numbers) for one in args):
            return remembered(function, context, args)
        return look_up(function, context, args, kws)

    types.Function.get_call_type = get_call_type  # type: ignore[method-assign,assignment]

    # At every call of what it ships, Numba compares two sets of compiler flags, mostly equal, one flag after the other.
    config_class = targetconfig.TargetConfig
    compare = config_class.__eq__

    def is_same(flags: Any, others: Any) -> Any:
        return (type(flags) is type(others) and flags._values == others._values) or compare(flags, others)

    config_class.__eq__ = is_same

    # LLVM is locked and unlocked at every step, and Numba reports each time, though nobody listens.
    llvm.ffi.lib._lock._cblist.clear()

    # Every call of what Numba ships looks at the signature of its implementation.
    base._has_loc = functools.cache(base._has_loc)

    process = postproc.PostProcessor.run

    def process_kernel(self: Any, emit_dels: bool = False, extend_lifetimes: bool = False) -> None:
        if emit_dels or self.func_ir.func_id.code not in _KERNELS:
            process(self, emit_dels, extend_lifetimes)
        else:  # generators and passes that are left out ask which variables live where
            self.func_ir.blocks = transforms.canonicalize_cfg(self.func_ir.blocks)
            self.func_ir.generator_info = None

    postproc.PostProcessor.run = process_kernel

    decorator = templates._OverloadFunctionTemplate._get_jit_decorator

    def without_address(self: Any) -> Any:
        return functools.partial(decorator(self), no_cfunc_wrapper=True)

    templates._OverloadFunctionTemplate._get_jit_decorator = without_address

    def shapes_differ(source: Any, target: Any) -> None:
        raise ValueError("cannot assign an array to a slice of a different shape")

    def compiled(source: Any, target: Any) -> Any:
        return shapes_differ

    extending.overload(shapes_differ)(compiled)
    arrayobj.raise_with_shape_context = shapes_differ  # Numba's own takes seconds to compile


class _LinkedCompiler(Compiler):  # type: ignore[misc]
    """Leaves out the passes that find nothing in a kernel, which saves a tenth of the time."""

    def compile_extra(self, func: Callable[..., object]) -> CompileResult:
        """Compile for other kernels, nothing that Python could call."""
        self.state.flags.no_compile = self.state.flags.no_cpython_wrapper = True
        self.state.library = _Linked(self.state.targetctx.codegen(), func.__qualname__)
        return super().compile_extra(func)

    def define_pipelines(self) -> list[PassManager]:
        """Return the passes."""
        _hasten()
        self.state.targetctx.__class__ = KernelContext  # the state has a copy of its own
        needless = _NEEDLESS if self.state.flags.nrt else _NEEDLESS | _OF_ARRAYS
        pipeline = PassManager("kernel")
        for one, description in DefaultPassBuilder.define_nopython_pipeline(self.state).passes:
            if one.name() == KernelLowering.name():
                pipeline.add_pass(KernelLowering, description)
            elif one.name() not in needless:
                pipeline.add_pass(one, description)
        pipeline.finalize()
        return [pipeline]


class _Linked(_Code):
    """Code of an inner kernel with all that it calls: neither optimised nor loaded."""

    def _optimize_final_module(self) -> None:
        """Leave that to the outer kernel."""

    def _finalize_final_module(self) -> None:
        """Let it be linked more than once."""
        for function in self._final_module.functions:
            if not function.is_declaration and function.linkage == llvm.Linkage.external:
                function.linkage = llvm.Linkage.linkonce_odr
        self._shared_module = self._final_module
        self._finalized = True

    def serialize_using_object_code(self) -> tuple[str, str, bytes]:
        """Return it as it is: there is no object code."""
        state: tuple[str, str, bytes] = self.serialize_using_bitcode()
        return state


class _LinkedFile(CompileResultCacheImpl):  # type: ignore[misc]
    def get_filename_base(self, fullname: str, abiflags: str) -> str:
        """Return the name of a file beside that of the outer kernel."""
        return f"inner-{super().get_filename_base(fullname, abiflags)}"

    def rebuild(self, target_context: Any, payload: tuple[Any, ...]) -> CompileResult:
        """Return what was kept."""
        (name, _, bitcode), fndesc, env, signature, objectmode, lifted, typeann, reload_init, environments = payload
        library = _Linked(target_context.codegen(), name)
        library._final_module = llvm.parse_bitcode(bitcode)
        library._finalize_final_module()
        return CompileResult(
            target_context=target_context, typing_context=target_context.typing_context, library=library,
            environment=env, entry_point=None, fndesc=fndesc, type_annotation=typeann, signature=signature,
            objectmode=objectmode, lifted=lifted, typing_error=None, call_helper=None, metadata=None,
            reload_init=reload_init, referenced_envs=environments,
        )  # fmt: skip


class _LinkedOnDisk(_OnDisk):
    _impl_class = _LinkedFile


class _Inner(CPUDispatcher):  # type: ignore[misc]
    """A kernel as other kernels call it."""

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """Find or compile code for the types of the arguments alone: constants get no copy of their own."""
        plain = {name: unliteral(one) for name, one in kws.items()}
        return super().get_call_template(tuple(map(unliteral, args)), plain)

    def compile(self, sig: Any) -> object:
        """Return the token by which callers find the code for arguments of these types."""
        with global_compiler_lock, self._compiling_counter:
            arguments, returned = sigutils.normalize_signature(sig)
            known = self.overloads.get(tuple(arguments))
            if known is None:
                kept = self._cache.load_overload(sig, self.targetctx)
                known = (kept or self._compiler.compile(arguments, returned))._replace(entry_point=object())
                self.targetctx.insert_user_function(known.entry_point, known.fndesc, [known.library])
                self.overloads[tuple(arguments)] = known
                if kept is None:
                    self._cache.save_overload(sig, known)
            return known.entry_point
