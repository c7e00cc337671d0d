"""Four numbers of a row at once, as vectors of the processor: what LLVM does not find by itself in loops over a dozen columns.

Its loops take several vectors at once, and what is left over one by one; its search for vectors among single statements is
switched off by numba. Decision 0045 has the times.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Final

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

FOUR: Final = ir.VectorType(ir.DoubleType(), 4)
FIRST: Final = ir.Constant(ir.VectorType(ir.IntType(32), 4), [0, 0, 0, 0])


def _combination(is_added: bool) -> Callable[[Any, ir.IRBuilder, Any, Sequence[ir.Value]], ir.Value]:
    """Writes the code of either function below."""

    def generate(context: Any, builder: ir.IRBuilder, signature: Any, given: Sequence[ir.Value]) -> ir.Value:
        """Instructions for arguments in the order of `_set_four`, without the first."""
        target, source = (context.make_array(signature.args[k])(context, builder, given[k]).data for k in (0, 2))
        to, at, stride = builder.bitcast(builder.gep(target, [given[1]]), FOUR.as_pointer()), given[3], given[4]
        total: Any = None
        for factor in given[5:]:
            alone = builder.insert_element(ir.Constant(FOUR, ir.Undefined), factor, ir.Constant(ir.IntType(32), 0))
            row = builder.load(builder.bitcast(builder.gep(source, [at]), FOUR.as_pointer()), align=8)
            term = builder.fmul(builder.shuffle_vector(alone, alone, FIRST), row)
            total = term if total is None else builder.fadd(total, term)
            at = builder.add(at, stride)
        if is_added:
            total = builder.fadd(builder.load(to, align=8), total)
        builder.store(total, to, align=8)
        return context.get_dummy_value()

    return generate


def _signature(out: Any, source: Any) -> Any:
    for array in (out, source):
        if not (isinstance(array, types.Array) and array.layout == "C" and array.dtype == types.float64):
            raise TypeError(f"four numbers at once are taken from C-contiguous arrays of floats, not from {array}")
    return types.none(out, types.intp, source, types.intp, types.intp, types.float64, types.float64, types.float64)


def _set_four(_, out, to, source, at, stride, x, y, z):  # type: ignore[no-untyped-def]
    """Set out[to : to + 4] to x source[at : at + 4] + y (the same `stride` further on) + z (twice as far), both as if they were flat.

    No bounds are looked at. `out` and `source` are C-contiguous arrays of floats.
    """
    return _signature(out, source), _combination(False)


def _add_four(_, out, to, source, at, stride, x, y, z):  # type: ignore[no-untyped-def]
    """The same, added to what is there."""
    return _signature(out, source), _combination(True)


set_four: Final[Any] = intrinsic(_set_four)
add_four: Final[Any] = intrinsic(_add_four)
