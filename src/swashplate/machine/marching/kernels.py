"""What compiled marches are given: numbers, arrays, and structs of them."""

from functools import cache, cached_property
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from swashplate.machine.code_generation.machine_code import address_of
from swashplate.machine.declaration import JIT_OFF

KERNEL_ARGUMENTS = (
    "count, first, h, records, before, delay_samples, delay_fraction, params, given, states, "
    "worst_margin, flat"
)
"""Arguments of a march.

``count, first`` samples of the block, and the first of them; ``h`` step; ``records`` a record for
each signal, then room for each signal between parts that taps read, and ``before`` what these were
before; ``delay_samples, delay_fraction`` delays of the taps; ``params, given`` numbers; ``states``
at the first sample, replaced by those after the last; ``worst_margin`` the worst margin of the
domain so far, and whether everything is kept; ``flat`` what is kept.
"""


class MarchArrays(NamedTuple):
    """Arrays that a march takes after its step, see `KERNEL_ARGUMENTS`."""

    records: Any
    """Addresses of the records; where nothing is compiled, the records."""
    before: Any
    delay_samples: Any
    delay_fraction: Any
    params: Any
    given: Any
    states: Any
    worst_margin: Any
    flat: Any


FLOATS, INTS = "*float", "*int"
KERNEL_KINDS = ("int", "int", "float", f"*{FLOATS}", FLOATS, INTS, *(FLOATS,) * 6)
"""Kinds of these arguments, see `machine_code.code_of_text`."""

_KINDS: dict[Any, str] = {NDArray[np.float64]: FLOATS, NDArray[np.int64]: INTS}
"""Kinds by annotation.

Compared, not taken apart: what ``NDArray[...]`` is made of differs between versions of NumPy.
"""

Fields = TypeVar("Fields", bound=tuple[Any, ...])

Kernel = Any
"""What is called: machine code, or a plain function if nothing is compiled."""


def pointers(arrays: tuple[NDArray[Any], ...]) -> Any:
    """What compiled code is given of several arrays, which must be kept as well."""
    if JIT_OFF:
        return arrays
    return np.array([*map(address_of, arrays)], dtype=np.int64)


class Struct(Generic[Fields]):
    """A named tuple as machine code reads it: whole numbers, and addresses of what else it holds.

    That is arrays, machine code and structs. Whoever holds the struct holds them, and a copy of it,
    in another process too, has addresses of its own.
    """

    def __init__(self, fields: Fields) -> None:
        self.fields = fields
        kinds = _array_types(type(fields))
        self.words = np.array([*map(_word, fields, kinds)], dtype=np.int64)

    @cached_property
    def address(self) -> int:
        """Where they begin."""
        return address_of(self.words)

    def __reduce__(self) -> tuple[Any, ...]:
        return Struct, (self.fields,)


@cache
def _array_types(kind: Any) -> tuple[str, ...]:
    """Of each field of a named tuple the type of an array's numbers, in NumPy's words."""
    types = {INTS: np.dtype(np.int64).str, FLOATS: np.dtype(np.float64).str}
    return tuple(types.get(_KINDS.get(hint, ""), "") for hint in kind.__annotations__.values())


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
