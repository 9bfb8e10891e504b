"""Pieces of a march, compiled one by one and called by address.

A Jacobian runs some generated kernels over every block of samples. A kernel that called them by
name would be compiled together with them, for every model and every choice of its options. So all
pieces have one signature, ``piece(count, first, h, records, before, whole, fraction, params, given,
states, met, flat) -> None``, and the kernel that calls them, by address, is the same for all:
compiled once, kept on disk, as is each piece for all models that share it.
"""

from collections.abc import Callable, Container, Sequence
from functools import cache, cached_property
from typing import Any, Generic, TypeVar, get_args

import numpy as np
from llvmlite import ir
from numba import types
from numba.core.ccallback import CFunc
from numba.core.typing.templates import signature
from numba.extending import intrinsic
from numba.np.numpy_support import as_dtype, from_dtype
from numpy.typing import NDArray

from swashplate.equations.cache import borrowing_kernel, on_disk
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

Fields = TypeVar("Fields", bound=tuple[Any, ...])

Piece = Any
"""What `piece` returns."""
Planned = Callable[[], Piece]
"""Compiles a piece when it is first needed (`generating`): residuals alone need no derivatives."""


def piece(function: Callable[..., None]) -> Piece:
    """Compile a function with the arguments of `PIECE`: strict arithmetic, cached on disk."""
    return _by_address(function, _TYPES)


def routine(function: Callable[..., None]) -> Piece:
    """Compile a function of whole numbers and arrays, by its annotations, as a piece.

    Kernels `run` it by its address. Called by name, it would be compiled on its own, and again with
    each that calls it.
    """
    hints = {k: v for k, v in function.__annotations__.items() if k != "return"}
    return _by_address(function, tuple(_type_of(hint) for hint in hints.values()))


def _by_address(function: Callable[..., None], arguments: tuple[Any, ...]) -> Piece:
    known[plain(function)] = None
    if JIT_OFF:
        return function
    options = {"nopython": True, "nogil": True, "error_model": "numpy"}
    made = CFunc(function, (arguments, types.void), {}, options)
    on_disk(made, function)
    made.compile()
    return made


def _type_of(hint: Any) -> Any:
    """Type in compiled code of what has an annotation: of a whole number, or an array of numbers.

    An array becomes a pointer: an array of Numba's has seven fields, and some 40 of them would take
    two seconds to compile.
    """
    if hint is int:
        return types.int64
    _, dtype = get_args(hint)
    return _pointer(from_dtype(np.dtype(*get_args(dtype))))


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


class Struct(Generic[Fields]):
    """A named tuple as kernels read it: its whole numbers, and addresses of what else it holds.

    That is arrays, routines and structs. Whoever holds the struct holds them, and a copy of it, in
    another process too, has addresses of its own.
    """

    def __init__(self, fields: Fields) -> None:
        self.fields = fields
        kinds = _array_types(type(fields))
        self._words = None if JIT_OFF else np.array([*map(_word, fields, kinds)], dtype=np.int64)

    @cached_property
    def address(self) -> Any:
        """What `fields_of` is given."""
        return self if self._words is None else self._words.ctypes.data

    def __reduce__(self) -> tuple[Any, ...]:
        return Struct, (self.fields,)


@cache
def _array_types(kind: Any) -> tuple[str, ...]:
    """Of each field of a named tuple the type of an array's numbers, in NumPy's words."""
    members = map(_type_of, kind.__annotations__.values())
    return tuple(as_dtype(getattr(member, "dtype", member)).str for member in members)


def _word(field: Any, kind: str) -> int:
    if isinstance(field, int):
        return field
    if not isinstance(field, np.ndarray):
        return int(field.address)
    # compiled code cannot tell what it finds at an address
    found = field.__array_interface__
    if found["typestr"] != kind or found["strides"] is not None:
        raise ValueError(f"An array of a struct must be C-contiguous and of type {kind}.")
    return int(found["data"][0])


if JIT_OFF:

    def behind(array: Any, start: int) -> Any:
        """Numbers of an array from a place on, as one row."""
        return array.reshape(-1)[start:]

    def fields_of(struct: Any, kind: Any) -> Any:
        """Fields of a struct."""
        return struct.fields

    def run(routine: Piece, arguments: tuple[Any, ...]) -> None:
        """Run a routine."""
        routine(*arguments)

    def call(piece: Piece, count: int, first: int, h: float, arrays: tuple[Any, ...]) -> None:
        """Call a piece."""
        piece(count, first, h, *arrays)

    def call_recurrence(
        piece: Piece, count: int, lanes: Any, size: int, tangent: Any, arrays: tuple[Any, ...]
    ) -> None:
        """Call a recurrence, which takes lanes, how many they are, and tangents."""
        piece(count, size, 0.0, *arrays[:2], lanes, arrays[3], tangent, *arrays[5:])

else:

    def _unpacked(context: Any, builder: Any, values: Any, kind: Any) -> list[Any]:
        """Numbers, pointers, and the data of arrays that a tuple holds."""
        unpacked = []
        for k, each in enumerate(kind.types):
            value = builder.extract_value(values, k)
            if isinstance(each, types.Array):
                value = context.make_array(each)(context, builder, value).data
            unpacked.append(value)
        return unpacked

    def _call(context: Any, builder: Any, address: Any, arguments: list[Any]) -> None:
        """Call the piece at an address."""
        wanted = [context.get_value_type(each) for each in _TYPES]
        function = ir.FunctionType(ir.VoidType(), wanted).as_pointer()
        taken = [builder.bitcast(a, kind) for a, kind in zip(arguments, wanted, strict=True)]
        builder.call(builder.inttoptr(address, function), taken)

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
    def fields_of(typingctx: Any, address: Any, kind: Any) -> Any:
        """Fields of the struct at an address: its named tuple with pointers in place of arrays."""
        hints = kind.instance_class.__annotations__
        members = [_type_of(hint) for hint in hints.values()]
        named_tuple: Any = types.NamedTuple
        fields = named_tuple(members, kind.instance_class)

        def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            struct = builder.inttoptr(arguments[0], ir.IntType(64).as_pointer())
            values = []
            for k, member in enumerate(members):
                value = builder.load(builder.gep(struct, [context.get_constant(types.intp, k)]))
                if isinstance(member, types.CPointer):
                    value = builder.inttoptr(value, context.get_value_type(member))
                values.append(value)
            return context.make_tuple(builder, fields, values)

        taken: Any = signature
        return taken(fields, address, kind), codegen

    @intrinsic
    def run(typingctx: Any, address: Any, arguments: Any) -> Any:
        """Run the routine at an address with whole numbers and pointers."""

        def codegen(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            data = _unpacked(context, builder, values[1], arguments)
            function = ir.FunctionType(ir.VoidType(), [each.type for each in data])
            builder.call(builder.inttoptr(values[0], function.as_pointer()), data)
            return context.get_dummy_value()

        taken: Any = signature
        return taken(types.void, address, arguments), codegen

    @intrinsic
    def call(typingctx: Any, address: Any, count: Any, first: Any, h: Any, arrays: Any) -> Any:
        """Call the piece at an address with the data of a tuple of arrays."""

        def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            data = _unpacked(context, builder, arguments[4], arrays)
            _call(context, builder, arguments[0], [*arguments[1:4], *data])
            return context.get_dummy_value()

        taken: Any = signature
        return taken(types.void, address, count, first, h, arrays), codegen

    @intrinsic
    def call_recurrence(
        typingctx: Any, address: Any, count: Any, lanes: Any, size: Any, tangent: Any, arrays: Any
    ) -> Any:
        """Call a recurrence, which takes lanes, how many they are, and tangents."""

        def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            address, count, lanes, size, tangent, values = arguments
            data = _unpacked(context, builder, values, arrays)
            data[2], data[4] = lanes, tangent
            h = context.get_constant(types.float64, 0.0)  # None of them has a step.
            _call(context, builder, address, [count, size, h, *data])
            return context.get_dummy_value()

        taken: Any = signature
        return taken(types.void, address, count, lanes, size, tangent, arrays), codegen


@borrowing_kernel
def run_once(pieces: Any, arrays: tuple[Any, ...], count: int, h: float) -> None:
    """Call one piece over all samples."""
    call(pieces[0], count, 0, h, arrays)
