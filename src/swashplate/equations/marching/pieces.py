"""Pieces of a march, compiled one by one and called by address.

A Jacobian runs some generated kernels over every block of samples. A kernel that called them by
name would be compiled together with them, for every model and every choice of its options. So all
pieces have one signature, ``piece(count, first, h, records, before, whole, fraction, params, given,
states, met, flat) -> None``, and the kernel that calls them, by address, is the same for all:
compiled once, kept on disk, as is each piece for all models that share it.
"""

from collections.abc import Callable, Container, Sequence
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core.ccallback import CFunc
from numba.core.typing.templates import signature
from numba.extending import intrinsic
from numpy.typing import NDArray

from swashplate.equations.cache import kernel, on_disk
from swashplate.equations.declaration import JIT_OFF, known
from swashplate.equations.language import plain

PIECE = "count, first, h, records, before, whole, fraction, params, given, states, met, flat"
"""Arguments of a piece.

``count, first`` samples of the block, and the first of them; ``h`` step; ``records`` a record for
each signal, ``before`` what it was before; ``whole, fraction`` delays of the taps; ``params,
given`` numbers; ``states`` at the first sample, replaced by those behind the last; ``met`` the
worst margin, in one place; ``flat`` the block, a row for each number.
"""

_pointer: Any = types.CPointer
_FLOATS = _pointer(types.float64)
_TYPES = (
    types.int64,
    types.int64,
    types.float64,
    _pointer(_FLOATS),
    _FLOATS,
    _pointer(types.int64),
    *(_FLOATS,) * 6,
)

Piece = Any
"""What `piece` returns."""
Planned = Callable[[], Piece]
"""Compiles a piece when it is first needed (`generating`): residuals alone need no derivatives."""


def piece(function: Callable[..., None]) -> Piece:
    """Compile a function with the arguments of `PIECE`: strict arithmetic, cached on disk."""
    known[plain(function)] = None
    if JIT_OFF:
        return function
    options = {"nopython": True, "nogil": True, "error_model": "numpy"}
    made = CFunc(function, (_TYPES, types.void), {}, options)
    on_disk(made, function)
    made.compile()
    return made


def addresses(pieces: Sequence[Planned], needed: Container[int]) -> Any:
    """What `call` is given of each piece; the pieces themselves must be kept as well."""
    made = [each() if k in needed else None for k, each in enumerate(pieces)]
    if JIT_OFF:
        return made
    return np.array([0 if each is None else each.address for each in made], dtype=np.int64)


def pointers(records: tuple[NDArray[np.float64], ...]) -> Any:
    """What `call` is given of the records, which must be kept as well."""
    if JIT_OFF:
        return records
    return np.array([each.ctypes.data for each in records], dtype=np.int64)


if JIT_OFF:

    def behind(array: Any, start: int) -> Any:
        """Numbers of an array from a place on, as one row."""
        return array.reshape(-1)[start:]

    def call(piece: Piece, count: int, first: int, h: float, arrays: tuple[Any, ...]) -> None:
        """Call a piece."""
        piece(count, first, h, *arrays)

else:

    @intrinsic
    def behind(typingctx: Any, array: Any, start: Any) -> Any:
        """Numbers of an array from a place on: a pointer, which compiles faster than a slice."""

        def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            data = arguments[0]
            if not isinstance(array, types.CPointer):
                data = context.make_array(array)(context, builder, data).data
            return builder.gep(data, [arguments[1]])

        taken: Any = signature
        kind = array if isinstance(array, types.CPointer) else _pointer(array.dtype)
        return taken(kind, array, start), codegen

    @intrinsic
    def call(typingctx: Any, address: Any, count: Any, first: Any, h: Any, arrays: Any) -> Any:
        """Call the piece at an address with the data of a tuple of arrays."""

        def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            wanted = [context.get_value_type(each) for each in _TYPES]
            taken = list(arguments[1:4])
            for k, kind in enumerate(signature.args[4].types):
                data = builder.extract_value(arguments[4], k)
                if not isinstance(kind, types.CPointer):
                    data = context.make_array(kind)(context, builder, data).data
                taken.append(builder.bitcast(data, wanted[3 + k]))
            kind = ir.FunctionType(ir.VoidType(), wanted).as_pointer()
            builder.call(builder.inttoptr(arguments[0], kind), taken)
            return context.get_dummy_value()

        taken: Any = signature
        return taken(types.void, address, count, first, h, arrays), codegen


@kernel
def run_once(pieces: Any, arrays: tuple[Any, ...], count: int, h: float) -> None:
    """Call one piece over all samples."""
    call(pieces[0], count, 0, h, arrays)
