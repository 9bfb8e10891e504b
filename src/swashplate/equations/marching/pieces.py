"""Pieces of a march, compiled one by one and called by address.

A Jacobian runs some generated kernels over every block of samples. A kernel that called them by
name would be compiled together with them, for every model and every choice of its options. So all
pieces have one signature, ``piece(count, first, h, records, before, whole, fraction, params, given,
states, met, flat) -> None``, and the kernel that calls them, by address, is the same for all:
compiled once, kept on disk, as is each piece for all models that share it.
"""

from collections.abc import Callable, Container, Sequence
from typing import Any, get_args

import numpy as np
from llvmlite import ir
from numba import types
from numba.core.ccallback import CFunc
from numba.core.typing.templates import signature
from numba.extending import intrinsic
from numba.np.numpy_support import from_dtype
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


def table_of(fields: Any) -> Any:
    """What `fields_of` reads: a named tuple's whole numbers, and addresses of its arrays.

    The arrays must be kept, and be C-contiguous.
    """
    if JIT_OFF:
        return fields
    numbers = [each if isinstance(each, int) else each.ctypes.data for each in fields]
    return np.array(numbers, dtype=np.int64)


if JIT_OFF:

    def behind(array: Any, start: int) -> Any:
        """Numbers of an array from a place on, as one row."""
        return array.reshape(-1)[start:]

    def fields_of(table: Any, kind: Any) -> Any:
        """The named tuple that `table_of` was given."""
        return table

    def call(piece: Piece, count: int, first: int, h: float, arrays: tuple[Any, ...]) -> None:
        """Call a piece."""
        piece(count, first, h, *arrays)

    def call_recurrence(
        piece: Piece, count: int, lanes: Any, size: int, tangent: Any, arrays: tuple[Any, ...]
    ) -> None:
        """Call a recurrence, which takes lanes, how many they are, and tangents."""
        piece(count, size, 0.0, *arrays[:2], lanes, arrays[3], tangent, *arrays[5:])

else:

    def _call(
        context: Any, builder: Any, address: Any, numbers: list[Any], arrays: Any, kinds: Any
    ) -> None:
        """Emit the call of a piece: first arguments, then data of arrays, or pointers."""
        wanted = [context.get_value_type(each) for each in _TYPES]
        taken = [*numbers]
        for each, kind in zip(arrays, kinds, strict=True):
            data = each
            if not isinstance(kind, types.CPointer):
                data = context.make_array(kind)(context, builder, each).data
            taken.append(builder.bitcast(data, wanted[len(taken)]))
        function = ir.FunctionType(ir.VoidType(), wanted).as_pointer()
        builder.call(builder.inttoptr(address, function), taken)

    def _unpacked(builder: Any, arrays: Any, kind: Any) -> list[Any]:
        """Items of a tuple."""
        return [builder.extract_value(arrays, k) for k in range(len(kind.types))]

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

    def _field_type(hint: Any) -> Any:
        """Type of a field in compiled code, from its annotation: ``int``, or an array of numbers."""
        if hint is int:
            return types.int64
        _, dtype = get_args(hint)
        return _pointer(from_dtype(np.dtype(*get_args(dtype))))

    @intrinsic
    def fields_of(typingctx: Any, table: Any, kind: Any) -> Any:
        """The named tuple that `table_of` was given, with pointers for arrays.

        Arrays themselves, of five numbers and two pointers each, take a compiler a multiple of the
        time: of 40 of them some seconds.
        """
        fields = kind.instance_class
        members = [_field_type(hint) for hint in fields.__annotations__.values()]
        unpacked = types.NamedTuple(members, fields)

        def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            data = context.make_array(table)(context, builder, arguments[0]).data
            values = []
            for k, member in enumerate(members):
                value = builder.load(builder.gep(data, [context.get_constant(types.intp, k)]))
                if isinstance(member, types.CPointer):
                    value = builder.inttoptr(value, context.get_value_type(member))
                values.append(value)
            return context.make_tuple(builder, unpacked, values)

        taken: Any = signature
        return taken(unpacked, table, kind), codegen

    @intrinsic
    def call(typingctx: Any, address: Any, count: Any, first: Any, h: Any, arrays: Any) -> Any:
        """Call the piece at an address with the data of a tuple of arrays."""

        def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            data = _unpacked(builder, arguments[4], arrays)
            _call(context, builder, arguments[0], arguments[1:4], data, arrays.types)
            return context.get_dummy_value()

        taken: Any = signature
        return taken(types.void, address, count, first, h, arrays), codegen

    @intrinsic
    def call_recurrence(
        typingctx: Any, address: Any, count: Any, lanes: Any, size: Any, tangent: Any, arrays: Any
    ) -> Any:
        """Call a recurrence, which takes lanes, how many they are, and tangents."""

        def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            data = _unpacked(builder, arguments[5], arrays)
            kinds = [*arrays.types]
            for position, argument in ((2, 2), (4, 4)):
                data[position] = arguments[argument]
                kinds[position] = signature.args[argument]
            numbers = [arguments[1], arguments[3], context.get_constant(types.float64, 0.0)]
            _call(context, builder, arguments[0], numbers, data, kinds)
            return context.get_dummy_value()

        taken: Any = signature
        return taken(types.void, address, count, lanes, size, tangent, arrays), codegen


@kernel
def run_once(pieces: Any, arrays: tuple[Any, ...], count: int, h: float) -> None:
    """Call one piece over all samples."""
    call(pieces[0], count, 0, h, arrays)
