"""Kernels of a march, compiled one by one and called by address.

A Jacobian runs some generated functions over every block of samples. What called them by name would
be compiled together with them, for every model and every choice of its options. So all kernels have
one signature, ``kernel(count, first, h, records, before, delay_samples, delay_fraction, params,
given, states, worst_margin, flat) -> None``, and the routine that calls them, by address, is the
same for all: compiled once, kept on disk, as is each kernel for all models that share it.
"""

from collections.abc import Callable, Container, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from swashplate.equations.code_generation.lowering import (
    Lowering,
    Operand,
    function_definition_of,
    llvm_type,
    lowers,
    number,
)
from swashplate.equations.code_generation.machine_code import address_of, code_of_function
from swashplate.equations.declaration import JIT_OFF

KERNEL_ARGUMENTS = (
    "count, first, h, records, before, delay_samples, delay_fraction, params, given, states, "
    "worst_margin, flat"
)
"""Arguments of a kernel.

``count, first`` samples of the block, and the first of them; ``h`` step; ``records`` a record for
each signal, ``before`` what it was before; ``delay_samples, delay_fraction`` delays of the taps;
``params, given`` numbers; ``states`` at the first sample, replaced by those after the last;
``worst_margin`` the worst margin of the domain so far, an array of one number; ``flat`` the block,
a row for each number.
"""

FLOATS, INTS = "*float", "*int"
KERNEL_KINDS = ("int", "int", "float", f"*{FLOATS}", FLOATS, INTS, *(FLOATS,) * 6)
"""Kinds of these arguments, see `lowering`."""

_KINDS = {int: "int", float: "float", NDArray[np.float64]: FLOATS, NDArray[np.int64]: INTS}
"""Kinds by annotation.

Compared, not taken apart: what ``NDArray[...]`` is made of differs between versions of NumPy.
"""

Fields = TypeVar("Fields", bound=tuple[Any, ...])

Kernel = Any
"""What is called: machine code (`Code`), or a plain function if nothing is compiled."""
PlannedCode = Callable[[], Kernel]
"""Compiles a kernel when it is first needed (`generating`): residuals need no derivatives."""


def routine(function: Callable[..., None]) -> Kernel:
    """Compile a function of numbers and arrays that is part of the engine, by its annotations.

    Arrays become pointers, which do not know their shapes. Other routines run it by its address:
    see `run_routine`.
    """
    if JIT_OFF:
        return function
    annotations = function.__annotations__
    kinds = tuple(_KINDS[annotations[name]] for name in annotations if name != "return")
    name = function.__name__
    return code_of_function(name, name, kinds, lambda: function_definition_of(function))


def addresses(kernels: Sequence[PlannedCode], needed: Container[int]) -> Any:
    """What `call_kernel` is given of each kernel; the kernels themselves must be kept as well."""
    compiled = [kernel() if index in needed else None for index, kernel in enumerate(kernels)]
    if JIT_OFF:
        return compiled
    words = [0 if kernel is None else kernel.address for kernel in compiled]
    return np.array(words, dtype=np.int64)


def pointers(arrays: tuple[NDArray[Any], ...]) -> Any:
    """What compiled code is given of several arrays, which must be kept as well."""
    if JIT_OFF:
        return arrays
    return np.array([*map(address_of, arrays)], dtype=np.int64)


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
        return self if self._words is None else address_of(self._words)

    def __reduce__(self) -> tuple[Any, ...]:
        return Struct, (self.fields,)


@cache
def _array_types(kind: Any) -> tuple[str, ...]:
    """Of each field of a named tuple the type of an array's numbers, in NumPy's words."""
    types = {INTS: np.dtype(np.int64).str, FLOATS: np.dtype(np.float64).str}
    return tuple(types.get(_KINDS[hint], "") for hint in kind.__annotations__.values())


def _word(field: Any, kind: str) -> int:
    if isinstance(field, int):
        return field
    if not isinstance(field, np.ndarray):
        return int(field.address)
    # compiled code cannot tell what it finds at an address
    interface = field.__array_interface__
    if interface["typestr"] != kind or interface["strides"] is not None:
        raise ValueError(f"An array of a struct must be C-contiguous and of type {kind}.")
    address, _ = interface["data"]
    return int(address)


# --- what routines call ---------------------------------------------------------------------------


def row_from(array: Any, start: int) -> Any:
    """Numbers of an array from an index on, as one row."""
    return array.reshape(-1)[start:]


@lowers(row_from)
def _row_from(code: Lowering, array: Operand, start: Operand) -> Operand:
    return code.offset(array, start)


def fields_of(struct: Any, kind: Any) -> Any:
    """Fields of a struct."""
    return struct.fields


@dataclass(frozen=True)
class _Fields:
    """Fields of the struct at an address, read when they are asked for."""

    words: Operand
    kind: Any

    def field(self, code: Lowering, name: str) -> Operand:
        """A whole number, or a pointer in the place of an array."""
        kind = _KINDS[self.kind.__annotations__[name]]
        word = code.load(self.words, number(self.kind._fields.index(name)))
        return word if kind == "int" else _pointer(code, kind, word)


@lowers(fields_of)
def _fields_of(code: Lowering, address: Operand, kind: Any) -> _Fields:
    return _Fields(_pointer(code, INTS, address), kind)


def _pointer(code: Lowering, kind: str, address: Operand) -> Operand:
    return code.operand(kind, f"inttoptr i64 {address.text} to ptr")


def run_routine(routine: Kernel, arguments: tuple[Any, ...]) -> None:
    """Run a routine."""
    routine(*arguments)


@lowers(run_routine)
def _run(code: Lowering, address: Operand, arguments: tuple[Operand, ...]) -> None:
    texts = ", ".join(f"{llvm_type(operand.kind)} {operand.text}" for operand in arguments)
    code.emit(f"call void {_pointer(code, INTS, address).text}({texts})")


def call_kernel(kernel: Kernel, count: int, first: int, h: float, arrays: Any) -> None:
    """Call a kernel with arrays, see `pointers`."""
    kernel(count, first, h, *arrays)


@lowers(call_kernel)
def _call(code: Lowering, address: Operand, *arguments: Operand) -> None:
    count, first, h, arrays = arguments
    _run(code, address, (count, first, h, *_array_pointers(code, arrays)))


def _array_pointers(code: Lowering, arrays: Operand) -> list[Operand]:
    """Pointers to the arrays that a kernel takes."""
    words = [code.load(arrays, number(index)) for index in range(len(KERNEL_KINDS) - 3)]
    return [_pointer(code, INTS, word) for word in words]


def call_recurrence(
    kernel: Kernel, count: int, lanes: Any, size: int, tangent: Any, arrays: Any
) -> None:
    """Call a recurrence, which takes lanes, how many they are, and tangents."""
    kernel(count, size, 0.0, *arrays[:2], lanes, arrays[3], tangent, *arrays[5:])


@lowers(call_recurrence)
def _call_recurrence(code: Lowering, address: Operand, *arguments: Operand) -> None:
    count, lanes, size, tangent, arrays = arguments
    array_pointers = _array_pointers(code, arrays)
    array_pointers[2], array_pointers[4] = lanes, tangent
    _run(code, address, (count, size, number(0.0), *array_pointers))
