"""From derivatives on the grid to weighted rows of a least-squares problem, and their triangle.

What is here knows no model: it calls a march by its address, block by block, and works on what that
leaves. With [J r] = Q R, the small triangle R holds all that a Gauss-Newton or trust-region step
needs: RᵀR is [J r]ᵀ[J r], and J has the singular values of R's columns. R is made by Householder
reflections, never from the normal equations, whose condition number is squared and which a zero
column breaks (G. H. Golub, C. F. Van Loan: Matrix Computations, 4th ed., 5.2).

The routines are printed in LLVM's language, as marches are, and do the same in the same order on
every processor.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.machine.code_generation.elimination import SIDE_BY_SIDE
from swashplate.machine.code_generation.functions import generating
from swashplate.machine.code_generation.llvm import Code
from swashplate.machine.code_generation.machine_code import code_of_text
from swashplate.machine.marching.kernels import INTS, Struct
from swashplate.machine.marching.march import ZERO
from swashplate.machine.marching.tangents import TANGENT_ARGUMENTS, VECTOR, summed

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

ROWS = 512
"""Rows that are rotated at once: few enough for a fast cache."""
TOGETHER = 4
"""Vectors whose products are summed side by side."""
NOTHING = 1e-290
"""Square of a column's norm that counts as none: the reflection divides by numbers of its size."""
CACHE_LINE = 64
"""Bytes. Vectors that lie across two lines take twice as long to load."""


# Routines read these named tuples as structs (see `kernels.Struct`), whose arrays do not know their
# shapes.


class Plan(NamedTuple):
    """Where all observations look, one after the other; m samples in all, r observations."""

    observations: int
    """How many: r."""
    first: Indices
    """(r + 1,) first sample of each, and m."""
    cell: Indices
    """(m,) point of the grid at or before the stamp, never falling within an observation."""
    fraction: Array
    """(m,) how far after it the stamp lies, in steps, 0 to 1."""
    measured: Array
    """(m,) measured values."""
    weight: Array
    """(m,)"""
    regular: Indices
    """(r,) whether an observation's stamps are successive points of the grid."""
    all_weigh: Indices
    """(r,) whether all its stamps have weight."""


class Sink(NamedTuple):
    """Where weighted rows go: all residuals or derivatives of a column each, residuals last."""

    columns: int
    """k + 1, residuals counted."""
    length: int
    """From one row to the next: m, or ROWS for a triangle."""
    rows: Array
    """(k + 1, length) all rows, or as many as are rotated at once."""
    target: Indices
    """(w,) rows where the derivatives of a march go; of idle columns the residuals', which are
    written last."""
    first_offset_row: int
    """First row of those by the observations' own offsets; residuals come after them."""
    folded: int
    """Whether a triangle is wanted."""
    factor: Array
    """(k + 1, k + 1) triangle, (0, 0) if all rows are wanted."""
    offset: Array
    """(r,) offset that is assumed in the measured values of each observation."""
    offset_row: Indices
    """(r,) row of the derivative by the offset, -1 if not wanted."""


class Room(NamedTuple):
    """What a march leaves in a block, see `tangents.Tangents`."""

    block: int
    """Most samples of it."""
    row: int
    """From one sample to the next."""
    width: int
    """Columns of an output, idle ones counted."""
    flat: Array
    """(block + 2, row) the last sample of the block before, then the block's, and one after."""
    value: Indices
    """(r,) place of each observation's value in a row."""
    column: Indices
    """(r,) place of its first column."""
    next_stamp: Indices
    """(r,) number of the next stamp of each observation."""


class BlockRun(NamedTuple):
    """All that a run is given."""

    steps: int
    """How many functions there are for each block."""
    codes: Indices
    """Their addresses."""
    arrays: Indices
    """Addresses of what they take after the step, see `tangents.TANGENT_ARGUMENTS`."""
    plan: Struct[Plan]
    sink: Struct[Sink]
    room: Struct[Room]
    write_rows: Any
    absorb: Any


class Fields:
    """Fields of the struct at an address, each loaded where it is read."""

    def __init__(self, code: Code, address: str, kind: Any) -> None:
        self._code, self._address, self._kind = code, address, kind

    def __getattr__(self, name: str) -> str:
        """A whole number, or a pointer to an array."""
        place = self._kind._fields.index(name)
        word = self._code.load(self._address, place, "i64")
        whole = self._kind.__annotations__[name] is int
        return word if whole else self._code.pointer(word)


def aligned(*shape: int) -> Array:
    """Zeros that begin with a cache line."""
    size = int(np.prod(shape))
    room = np.zeros(size + CACHE_LINE // 8)
    skipped = -room.ctypes.data % CACHE_LINE // 8
    return room[skipped : skipped + size].reshape(shape)


def upright(factor: Array) -> Array:
    """The triangle with rows turned so that no diagonal element is negative."""
    turned = np.where(np.diag(factor) < 0.0, -1.0, 1.0)
    return np.asarray(turned[:, None] * factor)


# --- the triangle ---------------------------------------------------------------------------------


def absorb_text() -> str:
    """Text of what rotates ROWS rows into the triangular factor of all rows before them.

    Of a sink; the rows are used up, and are to be zeros if there are fewer than ROWS.
    """
    code = Code([("ptr", "sink")])
    sink = Fields(code, "%sink", Sink)
    columns, rows, factor = sink.columns, sink.rows, sink.factor
    with code.loop("0", columns) as j:
        pivot = code.address(rows, code.put(f"mul i64 {j}, {ROWS}"))
        line = code.address(factor, code.put(f"mul i64 {j}, {columns}"))
        square = _dot(code, pivot, pivot)
        # nothing to rotate, as with a parameter that the rows do not depend on
        with code.only_if(code.put(f"fcmp uge double {square}, {code.constant(NOTHING)}")):
            corner = code.load(line, j)
            corner_square = code.put(f"fmul double {corner}, {corner}")
            norm = code.function("sqrt", code.put(f"fadd double {corner_square}, {square}"))
            positive = code.put(f"fcmp ogt double {corner}, {ZERO}")
            diagonal = code.select(positive, code.put(f"fneg double {norm}"), norm)
            lead = code.put(f"fsub double {corner}, {diagonal}")
            # the reflection 1 - v vᵀ · scale with v = [lead, pivot]: no difference of like numbers
            size = code.put(f"fadd double {norm}, {code.function('fabs', corner)}")
            size = code.put(f"fmul double {norm}, {size}")
            scale = code.put(f"fdiv double {code.constant(1.0)}, {size}")
            code.store(diagonal, line, j)
            with code.loop(code.put(f"add i64 {j}, 1"), columns) as k:
                _reflect(code, rows, pivot, line, k, lead, scale)
    return code.text


def _reflect(code: Code, rows: str, pivot: str, line: str, k: str, lead: str, scale: str) -> None:
    """Reflect column k."""
    column = code.address(rows, code.put(f"mul i64 {k}, {ROWS}"))
    of_line = code.load(line, k)
    along = code.put(f"fmul double {lead}, {of_line}")
    along = code.put(f"fadd double {along}, {_dot(code, pivot, column)}")
    along = code.put(f"fmul double {scale}, {along}")
    moved = code.put(f"fmul double {along}, {lead}")
    code.store(code.put(f"fsub double {of_line}, {moved}"), line, k)
    in_all = code.vector(along, SIDE_BY_SIDE)
    with code.loop("0", str(ROWS), SIDE_BY_SIDE) as i:
        moved = code.put(f"fmul {VECTOR} {in_all}, {code.load(pivot, i, VECTOR)}")
        reflected = code.put(f"fsub {VECTOR} {code.load(column, i, VECTOR)}, {moved}")
        code.store(reflected, column, i, VECTOR)


def _dot(code: Code, first: str, second: str) -> str:
    """Scalar product of two columns of ROWS numbers, in sums that do not wait for each other."""
    sums = [code.variable("zeroinitializer", VECTOR) for _ in range(TOGETHER)]
    with code.loop("0", str(ROWS), TOGETHER * SIDE_BY_SIDE) as i:
        for number, variable in enumerate(sums):
            at = code.put(f"add i64 {i}, {number * SIDE_BY_SIDE}") if number else i
            one, other = (code.load(column, at, VECTOR) for column in (first, second))
            product = code.put(f"fmul {VECTOR} {one}, {other}")
            total = code.put(f"fadd {VECTOR} {code.load(variable, 0, VECTOR)}, {product}")
            code.store(total, variable, 0, VECTOR)
    total = summed(code, [code.load(variable, 0, VECTOR) for variable in sums], VECTOR)
    numbers = [
        code.put(f"extractelement {VECTOR} {total}, i32 {lane}") for lane in range(SIDE_BY_SIDE)
    ]
    return summed(code, numbers, "double")


# --- rows -----------------------------------------------------------------------------------------

STAMPS = (
    *(("ptr", name) for name in ("plan", "sink", "room")),
    *(("i64", name) for name in ("observation", "first", "stamp", "count", "to")),
)
"""Of what writes rows: structs, an observation, the block's first sample, the first stamp and how
many they are, and the place in the sink that they go to."""


STAMP_KINDS = tuple(INTS if kind == "ptr" else "int" for kind, _ in STAMPS)


def rows_text() -> str:
    """Text of what writes weighted rows of the problem at some stamps of an observation."""
    code = Code(STAMPS)
    plan, sink, room = (
        Fields(code, f"%{name}", kind)
        for name, kind in (("plan", Plan), ("sink", Sink), ("room", Room))
    )
    stamps = _Stamps(code, plan, room)
    rows, length, target = sink.rows, sink.length, sink.target
    column = code.load(room.column, "%observation", "i64")
    whole = code.put(f"and i64 %count, {-SIDE_BY_SIDE}")
    regular = code.put(f"icmp ne i64 {code.load(plan.regular, '%observation', 'i64')}, 0")
    cases = ((True, regular), (False, code.put(f"xor i1 {regular}, true")))

    def goes_to(row: str) -> str:
        place = code.put(f"mul i64 {row}, {length}")
        return code.address(rows, code.put(f"add i64 {place}, %to"))

    with code.loop("0", room.width, SIDE_BY_SIDE) as group:
        place = code.put(f"add i64 {column}, {group}")
        targets = [
            goes_to(code.load(target, code.put(f"add i64 {group}, {lane}"), "i64"))
            for lane in range(SIDE_BY_SIDE)
        ]
        for on_grid, test in cases:
            with code.only_if(test):
                with code.loop("0", whole, SIDE_BY_SIDE) as i:
                    vectors = [
                        stamps.weighted(code.put(f"add i64 {i}, {k}"), place, on_grid=on_grid)
                        for k in range(SIDE_BY_SIDE)
                    ]
                    for row, vector in zip(targets, code.transposed(vectors), strict=True):
                        code.store(vector, row, i, VECTOR)
                with code.loop(whole, "%count") as i:
                    vector = stamps.weighted(i, place, on_grid=on_grid)
                    for lane, row in enumerate(targets):
                        number = code.put(f"extractelement {VECTOR} {vector}, i32 {lane}")
                        code.store(number, row, i)
    residuals = code.put(f"sub i64 {sink.columns}, 1")
    own = code.load(sink.offset_row, "%observation", "i64")
    with code.loop(sink.first_offset_row, residuals) as row:
        is_own = code.put(f"icmp eq i64 {row}, {own}")
        to = goes_to(row)
        with code.loop("0", "%count") as i:
            weight = stamps.weight(i)
            code.store(code.put(f"select i1 {is_own}, double {weight}, double {ZERO}"), to, i)
    value = code.load(room.value, "%observation", "i64")
    offset = code.load(sink.offset, "%observation")
    to = goes_to(residuals)
    for on_grid, test in cases:
        with code.only_if(test), code.loop("0", "%count") as i:
            simulated = stamps.between(i, value, "double", on_grid=on_grid)
            expected = code.put(f"fsub double {stamps.measured(i)}, {offset}")
            error = code.put(f"fsub double {simulated}, {expected}")
            code.store(code.put(f"fmul double {stamps.weight(i)}, {error}"), to, i)
    return code.text


class _Stamps:
    """What is known at some stamps of an observation."""

    def __init__(self, code: Code, plan: Fields, room: Fields) -> None:
        self._code = code
        self._cell = code.address(plan.cell, "%stamp", "i64")
        self._first_cell = code.load(self._cell, 0, "i64")
        self._fraction, self._weight, self._measured = (
            code.address(pointer, "%stamp")
            for pointer in (plan.fraction, plan.weight, plan.measured)
        )
        self._row = room.row
        self._flat = room.flat

    def weight(self, i: str) -> str:
        """Weight of a stamp."""
        return self._code.load(self._weight, i)

    def measured(self, i: str) -> str:
        """Measured value at a stamp."""
        return self._code.load(self._measured, i)

    def between(self, i: str, place: str, kind: str, *, on_grid: bool = False) -> str:
        """A number, or a vector, of the rows of samples at a stamp: between two of them."""
        code = self._code
        cell = self._first_cell if on_grid else code.load(self._cell, i, "i64")
        cell = code.put(f"add i64 {cell}, {i}") if on_grid else cell
        # the row before the block's first is that of the sample before
        row = code.put(f"sub i64 {cell}, %first")
        row = code.put(f"mul i64 {code.put(f'add i64 {row}, 1')}, {self._row}")
        at = code.address(self._flat, code.put(f"add i64 {row}, {place}"))
        before = code.load(at, 0, kind)
        if on_grid:
            return before
        fraction = code.load(self._fraction, i)
        rest = code.put(f"fsub double {code.constant(1.0)}, {fraction}")
        if kind == VECTOR:
            rest, fraction = (code.vector(each, SIDE_BY_SIDE) for each in (rest, fraction))
        before = code.put(f"fmul {kind} {rest}, {before}")
        after = code.put(f"fmul {kind} {fraction}, {code.load(at, self._row, kind)}")
        return code.put(f"fadd {kind} {before}, {after}")

    def weighted(self, i: str, place: str, *, on_grid: bool) -> str:
        """A vector at a stamp, weighted."""
        weight = self._code.vector(self.weight(i), SIDE_BY_SIDE)
        vector = self.between(i, place, VECTOR, on_grid=on_grid)
        return self._code.put(f"fmul {VECTOR} {weight}, {vector}")


# --- block by block -------------------------------------------------------------------------------


def run_text() -> str:
    """Text of what marches block by block, and compares what comes with what was observed."""
    return _RunText().finished()


class _RunText:
    """That text, under way."""

    def __init__(self) -> None:
        code = self._code = Code([("i64", "size"), ("double", "h"), ("ptr", "run")])
        run = self._run = Fields(code, "%run", BlockRun)
        self._structs = run.plan, run.sink, run.room
        self._plan, self._sink, self._room = (
            Fields(code, struct, kind)
            for struct, kind in zip(self._structs, (Plan, Sink, Room), strict=True)
        )
        self._write_rows, self._absorb = run.write_rows, run.absorb
        self._row, self._flat = self._room.row, self._room.flat
        self._folds = code.put(f"icmp ne i64 {self._sink.folded}, 0")
        self._waiting = code.variable("0", "i64")
        """Rows that wait in the sink to be rotated."""

    def finished(self) -> str:
        """All blocks, then what waits."""
        code, block = self._code, self._room.block
        with code.loop("0", "%size", block) as first:
            with code.only_if(code.put(f"icmp sgt i64 {first}, 0")):
                self._copy(block, "0")  # what interpolation looks back at
            left = code.put(f"sub i64 %size, {first}")
            ends = code.put(f"icmp sle i64 {left}, {block}")
            count = code.put(f"select i1 {ends}, i64 {left}, i64 {block}")
            self._march(first, count)
            self._copy(count, code.put(f"add i64 {count}, 1"))  # nothing comes after the end
            known = code.put(f"add i64 {first}, {count}")
            # the point after a stamp must be known as well
            before = code.put(f"sub i64 {known}, 1")
            known = code.put(f"select i1 {ends}, i64 {known}, i64 {before}")
            with code.loop("0", self._plan.observations) as r:
                self._observe(r, first, known)
        held = code.load(self._waiting, 0, "i64")
        with code.only_if(code.put(f"icmp sgt i64 {held}, 0")):
            with code.loop("0", self._sink.columns) as column:
                to = code.address(self._sink.rows, code.put(f"mul i64 {column}, {ROWS}"))
                with code.loop(held, str(ROWS)) as i:
                    code.store(ZERO, to, i)
            self._rotate()
        return code.text

    def _copy(self, source: str, target: str) -> None:
        """Copy a sample's row."""
        code = self._code
        source, target = (
            code.address(self._flat, code.put(f"mul i64 {each}, {self._row}"))
            for each in (source, target)
        )
        with code.loop("0", self._row) as i:
            code.store(code.load(source, i), target, i)

    def _march(self, first: str, count: str) -> None:
        """Do with a block what a march has functions for."""
        code, run = self._code, self._run
        _, _, _, *pointers = TANGENT_ARGUMENTS
        arrays = [
            code.pointer(code.load(run.arrays, place, "i64")) for place, _ in enumerate(pointers)
        ]
        given = ", ".join(f"ptr {array}" for array in arrays)
        with code.loop("0", run.steps) as number:
            function = code.pointer(code.load(run.codes, number, "i64"))
            code.do(f"call void {function}(i64 {count}, i64 {first}, double %h, {given})")

    def _rotate(self) -> None:
        code = self._code
        code.do(f"call void {self._absorb}(ptr {self._structs[1]})")
        code.store("0", self._waiting, 0, "i64")

    def _observe(self, r: str, first: str, known: str) -> None:
        """Write the rows of an observation whose stamps are known."""
        code, plan, room = self._code, self._plan, self._room
        stop = code.load(plan.first, code.put(f"add i64 {r}, 1"), "i64")
        stamp = code.variable(code.load(room.next_stamp, r, "i64"), "i64")
        end = _first_beyond(code, plan.cell, code.load(stamp, 0, "i64"), stop, known)
        code.store(end, room.next_stamp, r, "i64")
        # a stamp without weight changes no triangle
        all_weigh = code.load(plan.all_weigh, r, "i64")
        skips = code.put(f"icmp eq i64 {all_weigh}, 0")
        skips = code.put(f"and i1 {self._folds}, {skips}")

        def goes_on() -> str:
            return code.put(f"icmp slt i64 {code.load(stamp, 0, 'i64')}, {end}")

        with code.as_long_as(goes_on):
            at = code.load(stamp, 0, "i64")
            until = code.variable(self._most(at, end), "i64")
            with code.only_if(skips):
                limit = code.load(until, 0, "i64")
                code.store(_first_without_weight(code, plan.weight, at, limit), until, 0, "i64")
            until = code.load(until, 0, "i64")
            count = code.put(f"sub i64 {until}, {at}")
            some = code.put(f"icmp sgt i64 {count}, 0")
            with code.only_if(some):
                self._write(f"i64 {r}, i64 {first}, i64 {at}, i64 {count}", at, count)
            after = code.put(f"add i64 {at}, 1")
            code.store(code.put(f"select i1 {some}, i64 {until}, i64 {after}"), stamp, 0, "i64")

    def _most(self, at: str, end: str) -> str:
        """The first stamp that no longer fits, at most `end`."""
        code = self._code
        room = code.put(f"sub i64 {ROWS}, {code.load(self._waiting, 0, 'i64')}")
        most = code.put(f"add i64 {at}, {room}")
        fits = code.put(f"icmp sle i64 {end}, {most}")
        most = code.put(f"select i1 {fits}, i64 {end}, i64 {most}")
        return code.put(f"select i1 {self._folds}, i64 {most}, i64 {end}")

    def _write(self, numbers: str, at: str, count: str) -> None:
        """Write rows, and rotate the sink once it is full."""
        code = self._code
        held = code.load(self._waiting, 0, "i64")
        to = code.put(f"select i1 {self._folds}, i64 {held}, i64 {at}")
        structs = ", ".join(f"ptr {struct}" for struct in self._structs)
        code.do(f"call void {self._write_rows}({structs}, {numbers}, i64 {to})")
        more = code.put(f"select i1 {self._folds}, i64 {count}, i64 0")
        held = code.put(f"add i64 {held}, {more}")
        code.store(held, self._waiting, 0, "i64")
        with code.only_if(code.put(f"icmp eq i64 {held}, {ROWS}")):
            self._rotate()


def _first_beyond(code: Code, cells: str, start: str, stop: str, limit: str) -> str:
    """The first place between two whose cell is not below a limit; cells never fall."""
    low, high = code.variable(start, "i64"), code.variable(stop, "i64")

    def goes_on() -> str:
        return code.put(f"icmp slt i64 {code.load(low, 0, 'i64')}, {code.load(high, 0, 'i64')}")

    with code.as_long_as(goes_on):
        first, last = code.load(low, 0, "i64"), code.load(high, 0, "i64")
        middle = code.put(f"ashr i64 {code.put(f'add i64 {first}, {last}')}, 1")
        below = code.put(f"icmp slt i64 {code.load(cells, middle, 'i64')}, {limit}")
        after = code.put(f"add i64 {middle}, 1")
        code.store(code.put(f"select i1 {below}, i64 {after}, i64 {first}"), low, 0, "i64")
        code.store(code.put(f"select i1 {below}, i64 {last}, i64 {middle}"), high, 0, "i64")
    return code.load(low, 0, "i64")


def _first_without_weight(code: Code, weights: str, start: str, stop: str) -> str:
    """The first place from `start` on whose weight is zero, at most `stop`."""
    place, weighs = code.variable(start, "i64"), code.variable("true", "i1")

    def goes_on() -> str:
        inside = code.put(f"icmp slt i64 {code.load(place, 0, 'i64')}, {stop}")
        return code.put(f"and i1 {inside}, {code.load(weighs, 0, 'i1')}")

    with code.as_long_as(goes_on):
        at = code.load(place, 0, "i64")
        test = code.put(f"fcmp une double {code.load(weights, at)}, 0.0")
        code.store(test, weighs, 0, "i1")
        after = code.put(f"select i1 {test}, i64 {code.put(f'add i64 {at}, 1')}, i64 {at}")
        code.store(after, place, 0, "i64")
    return code.load(place, 0, "i64")


@generating
def routines() -> tuple[Any, Any, Any]:
    """What runs a march, writes rows, and rotates them."""
    return (
        code_of_text("run", run_text(), ("int", "float", INTS)),
        code_of_text("rows", rows_text(), STAMP_KINDS),
        code_of_text("absorb", absorb_text(), (INTS,)),
    )
