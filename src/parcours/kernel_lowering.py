"""How a kernel becomes LLVM's language, in three quarters of the lines that Numba's own lowering writes.

A kernel that makes no arrays holds nothing that must be given back, so its variables need not be cleared. Kernels have
no `try`: an exception goes to where the caller's own would go, and nobody asks which kind it is on the way.
"""

from __future__ import annotations

from typing import Any, ClassVar

from llvmlite import ir
from numba.core import cgutils, types
from numba.core.callconv import CPUCallConv, Status, excinfo_ptr_t
from numba.core.compiler_machinery import register_pass
from numba.core.cpu import CPUContext
from numba.core.errors import UnsupportedError
from numba.core.lowering import Lower
from numba.core.typed_passes import BaseNativeLowering
from numba.core.types.containers import BaseTuple
from numba.core.types.misc import Optional, unliteral

_ENTRIES = (types.Integer, types.Float, types.Boolean, types.Record)
_EXCEPTION = ir.PointerType(excinfo_ptr_t)


class _CallConvention(CPUCallConv):  # type: ignore[misc]
    """Calls between kernels: functions of the same types as Numba's."""

    def call_function(
        self, builder: Any, callee: Any, resty: Any, argtys: Any, args: Any, attrs: Any = None
    ) -> tuple[Any, Any]:
        """Call a compiled function with the caller's place for an exception."""
        caller = builder.function.args
        within = len(caller) > 1 and caller[1].type == _EXCEPTION  # as opposed to a wrapper for Python
        if not within or attrs or isinstance(resty, Optional):
            called: tuple[Any, Any] = super().call_function(builder, callee, resty, argtys, args, attrs)
            return called
        with builder.goto_entry_block():
            place = builder.alloca(self._get_return_argument(callee.function_type).pointee)
        given = self._get_arg_packer(argtys).as_arguments(builder, args)
        code = builder.call(callee, [place, caller[1], *given])
        failed = builder.icmp_signed("!=", code, ir.Constant(code.type, 0))
        status = Status(code, None, None, failed, None, None, None, None)
        return status, self.context.get_returned_value(builder, resty, builder.load(place))

    def set_try_status(self, builder: Any) -> None:
        """Refuse a `try`. Raises UnsupportedError."""
        raise UnsupportedError("a kernel cannot catch an exception: it leaves all kernels at once")

    def return_status_propagate(self, builder: Any, status: Any) -> None:
        """Return as the function that was called did."""
        if status.excinfoptr is not None:
            builder.store(status.excinfoptr, self._get_excinfo_argument(builder.function))
        builder.ret(status.code)


class KernelContext(CPUContext):  # type: ignore[misc]
    """What a kernel is compiled for: Numba's own target, but for the calls."""

    allow_dynamic_globals = False  # Addresses of this process: such code could not be kept
    __slotnames__: ClassVar[list[str]] = []  # Copying one would add it, and be taken for a planner's doing

    @property
    def call_conv(self) -> CPUCallConv:
        """Return how functions are called."""
        return _CallConvention(self)

    def get_constant_generic(self, builder: Any, ty: Any, val: Any) -> Any:
        """Return a constant; of a function nothing but its type is needed."""
        if isinstance(ty, types.Dispatcher):
            return self.get_dummy_value()
        return super().get_constant_generic(builder, ty, val)


class _Lower(Lower):  # type: ignore[misc]
    def lower_expr(self, resty: Any, expr: Any) -> Any:
        """Read an entry of an array at a constant place as at any other."""
        signature = self.fndesc.calltypes[expr] if expr.op == "static_getitem" else None
        if signature and expr.index_var:
            return self.lower_getitem(resty, expr, expr.value, expr.index_var, signature)
        return super().lower_expr(resty, expr)

    def lower_getitem(self, resty: Any, expr: Any, value: Any, index: Any, signature: Any) -> Any:
        """Read an entry of an array."""
        place = self._place(value, index)
        if place is None:
            return super().lower_getitem(resty, expr, value, index, signature)
        array = self.typeof(value.name)
        read = self.context.unpack_value(self.builder, array.dtype, place, None if array.aligned else 1)
        return self.context.cast(self.builder, read, array.dtype, resty)

    def lower_setitem(self, target_var: Any, index_var: Any, value_var: Any, signature: Any) -> Any:
        """Write an entry of an array."""
        array = self.typeof(target_var.name)
        place = None if isinstance(getattr(array, "dtype", None), types.Record) else self._place(target_var, index_var)
        if place is None:
            return super().lower_setitem(target_var, index_var, value_var, signature)
        value = self.context.cast(self.builder, self.loadvar(value_var.name), self.typeof(value_var.name), array.dtype)
        self.context.pack_value(self.builder, array.dtype, value, place, None if array.aligned else 1)
        return None

    def _place(self, target: Any, index: Any) -> Any:
        """Return where an entry of an array lies; None if it is no array, or the indices do not name one entry."""
        array, at = self.typeof(target.name), unliteral(self.typeof(index.name))
        kinds = tuple(map(unliteral, at)) if isinstance(at, BaseTuple) else (at,)
        whole = type(array) is types.Array and array.ndim == len(kinds) and isinstance(array.dtype, _ENTRIES)
        if not whole or not all(isinstance(kind, types.Integer) for kind in kinds):
            return None
        builder, context = self.builder, self.context
        value, given = self.loadvar(target.name), self.loadvar(index.name)
        fields = context.data_model_manager[array]
        shape = cgutils.unpack_tuple(builder, fields.get(builder, value, "shape"), array.ndim)
        strides = () if array.layout in "CF" else fields.get(builder, value, "strides")
        indices = []
        for k, (kind, length) in enumerate(zip(kinds, shape, strict=True)):
            one = builder.extract_value(given, k) if isinstance(at, BaseTuple) else given
            one = context.cast(builder, one, kind, types.intp)
            if kind.signed and not (isinstance(one, ir.Constant) and one.constant >= 0):
                from_end = builder.icmp_signed("<", one, one.type(0))
                one = builder.select(from_end, builder.add(one, length), one)
            indices.append(one)
        return cgutils.get_item_pointer2(
            context, builder, fields.get(builder, value, "data"), shape,
            strides and cgutils.unpack_tuple(builder, strides, array.ndim), array.layout, indices,
        )  # fmt: skip

    def emit_environment_object(self) -> None:
        """Name no environment: what needs one names it."""

    def alloca_lltype(self, name: str, lltype: Any, datamodel: Any = None) -> Any:
        """Make room for a variable, without a note for debuggers."""
        return cgutils.alloca_once(self.builder, lltype, name=name)

    def delvar(self, name: str) -> None:
        """Let go of a variable that may hold an array."""
        if self.context.enable_nrt:
            super().delvar(name)

    def storevar(self, value: Any, name: str, argidx: int | None = None) -> None:
        """Store a value, without a look at what was there."""
        if self.context.enable_nrt or argidx is not None or name in self._singly_assigned_vars:
            super().storevar(value, name, argidx)
        else:
            self._alloca_var(name, self.typeof(name))
            self.builder.store(value, self.getvar(name))


@register_pass(mutates_CFG=True, analysis_only=False)
class KernelLowering(BaseNativeLowering):  # type: ignore[misc]
    """Takes the place of Numba's pass of that name."""

    _name = "native_lowering"
    lowering_class = _Lower
