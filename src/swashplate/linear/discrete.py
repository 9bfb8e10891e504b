"""The discrete step of any model, linearised: matrices from the derivatives of its equations."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.equations.adjoints import Derived
from swashplate.equations.derivatives import derive
from swashplate.equations.fields import floats_of, value_at
from swashplate.equations.marching.part import HOLDS, taps_of
from swashplate.equations.marching.run import Instance, Started, called, outside
from swashplate.equations.model import Link, Model, Window, arguments_of
from swashplate.errors import DomainError, InputError
from swashplate.linear.model import LinearModel

Array = NDArray[np.float64]
Rows = dict[str, Array]

MOVING = ("state", "signals", "inputs")
"""Arguments of equations that move; the others are constants of a march."""


class Recurrence(NamedTuple):
    """x[n+1] = A x[n] + Σ B_j u_j, y[n] = C x[n] + Σ D_j u_j, u_j an input some samples ago."""

    A: Array
    B: Array
    C: Array
    D: Array
    states: tuple[str, ...]
    """Paths of the model's own states, with the part's name before them if there are several."""
    columns: tuple[tuple[str, int], ...]
    """Input and whole samples by which it is late, of each column of B and D."""


def linearize(
    instance: Instance,
    at: Mapping[str, float],
    h: float,
    *,
    states: Sequence[Any] | None = None,
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
) -> LinearModel:
    """Linear model of the discrete step of any model with numbers.

    Parameters
    ----------
    instance, h : Instance, float
        The model with its numbers, and its step. [s]
    at : mapping of str to float
        Constant external signals of the operating point.
    states : sequence, optional
        State of each part; by default the one that the model settles at, one sample after the
        start.
    inputs : sequence of str, optional
        External signals that move, of `at`; by default all of them.
    outputs : sequence of str, optional
        Signals of parts, their states, or links; by default the model's own choice.

    Returns
    -------
    LinearModel
        Sampled. Past samples that the model's taps read are states, `memory`.

    Raises
    ------
    InputError
        If a signal is unknown, or the model cannot settle by itself.
    DomainError
        If the point lies outside the model's domain.
    """
    moving = tuple(at if inputs is None else inputs)
    for name in moving:
        if name not in at or name not in instance.model.external:
            raise InputError(
                f"{instance.name}: '{name}' is no input at the operating point; there are "
                f"{', '.join(each for each in instance.model.external if each in at)}."
            )
    if states is None:
        # what belongs to the first sample alone has passed
        known = instance.start(at, h, "steady").arguments
        steps = (part.step for part in instance.model.parts)
        states = [called(step, each) for step, each in zip(steps, known, strict=True)]
    started = instance.start(at, h, "steady", states)
    wanted = all_outputs(instance.model) if outputs is None else tuple(outputs)
    found = recurrence(instance, started, h, moving, wanted)
    return _with_memory(found, moving, wanted, h, instance.name)


def all_outputs(model: Model) -> tuple[str, ...]:
    """Outputs that a model names, or all signals of its last part."""
    named = tuple(model.outputs) or tuple(model.parts[-1].outputs)
    return tuple(each for each in named if each not in model.integrals) or (
        model.parts[-1].signal_names
    )


def recurrence(
    instance: Instance, started: Started, h: float, inputs: Sequence[str], outputs: Sequence[str]
) -> Recurrence:
    """Matrices of a model's step at a point, with every sample that its taps read as a column.

    The point is given by the states and constant inputs that a march would start with.
    """
    chain = _Chain(instance, started, h, tuple(inputs))
    n = len(chain.states)
    following = np.array(chain.following).reshape(n, chain.size)
    wanted = np.array([chain.output(name) for name in outputs])
    A, B, C, D = following[:, :n], following[:, n:], wanted[:, :n], wanted[:, n:]
    return Recurrence(A, B, C, D, tuple(chain.states), tuple(chain.columns))


_taps = lru_cache(maxsize=256)(taps_of)


@lru_cache(maxsize=512)
def _derived(
    equation: Any, by: tuple[str, ...], options: Any, lengths: tuple[tuple[str, int], ...]
) -> Derived:
    decided = {"options": options} if "options" in arguments_of(equation) else {}
    return derive(equation, by=by, options=decided, lengths=dict(lengths))


class _Chain:
    """Derivatives of all that is known at a sample, by states and samples of the inputs."""

    def __init__(
        self, instance: Instance, started: Started, h: float, inputs: tuple[str, ...]
    ) -> None:
        self.instance, self.model, self.started = instance, instance.model, started
        parts = self.model.parts
        several = len(parts) > 1
        self.states = [
            f"{part.name}.{path}" if several else path
            for part in parts
            for path in floats_of(part.state)
        ]
        places = instance.places(inputs, h)
        self.taps = {(each.part, each.input): each for each in _taps(self.model, inputs)}
        self.whole, self.fraction = places.whole.tolist(), places.fraction.tolist()
        late = {(name, 0): None for name in inputs}
        for tap in self.taps.values():
            whole = self.whole[tap.number]
            late |= {(tap.tap.signal, whole + j): None for j in range(tap.tap.samples)}
        self.columns = sorted(late, key=lambda each: (inputs.index(each[0]), each[1]))
        self.size = len(self.states) + len(self.columns)
        self.none = np.zeros(self.size)
        self.rows: list[Rows] = []
        self.following: list[Array] = []
        for i, part in enumerate(parts):
            self._part(i, part)

    def unit(self, index: int) -> Array:
        """Row of a state or of a sample of an input."""
        row = np.zeros(self.size)
        row[index] = 1.0
        return row

    def sample(self, name: str, late: int) -> Array:
        """Row of an input some samples ago, zero if that does not move."""
        if (name, late) not in self.columns:
            return self.none
        return self.unit(len(self.states) + self.columns.index((name, late)))

    def _part(self, i: int, part: Model) -> None:
        first = sum(len(floats_of(each.state)) for each in self.model.parts[:i])
        paths = floats_of(part.state)
        rows = {f"state.{path}": self.unit(first + k) for k, path in enumerate(paths)}
        for name, kind in part.input_types.items():
            for path, row in self._input(i, name, kind):
                rows[path] = rows[f"inputs.{path}"] = row
        known = self._at(i, part)
        if part.sample is not None:
            for path, row in self._through(part, part.sample, known, rows).items():
                rows[f"signals.{path}"] = row
        if part.domain is not None:
            margin = called(part.domain, known)
            if not margin > 0.0:
                said = outside(self.model, margin, "operating point")
                raise DomainError(f"{self.instance.name}: {said}")
        self.rows.append(rows)
        found = self._through(part, part.step, known, rows)
        self.following += [found.get(path, self.none) for path in paths]

    def _at(self, i: int, part: Model) -> dict[str, Any]:
        """What a part's equations take, its windows read where the taps are."""
        known = dict(self.started.arguments[i])
        for name, kind in part.input_types.items():
            tap = self.taps.get((i, name))
            if tap is not None and kind is Window:
                known[name] = known[name]._replace(f=self.fraction[tap.number])
        if part.inputs is not None:
            known["inputs"] = part.inputs(*(known[name] for name in part.input_types))
        return known

    def _input(self, i: int, name: str, kind: Any) -> Iterator[tuple[str, Array]]:
        link = self.model.link_of(i, name)
        if link is not None:
            yield name, self.link(link)
            return
        tap = self.taps.get((i, name))
        signal = self.model.parts[i].tap(name).signal
        if tap is None:
            if kind is not Window:
                yield name, self.sample(signal, 0)
            return
        whole, samples = self.whole[tap.number], range(tap.tap.samples)
        read = [self.sample(signal, whole + j) for j in samples]
        if kind is Window:
            for j in samples:
                yield f"{name}.s.{j}", read[j]
            return
        fraction = self.fraction[tap.number]
        value = self.started.before[signal]
        hold = HOLDS[tap.tap.hold]
        # the window of a hold has as many samples as it reads
        derived = _derived(hold, ("window.s",), None, (("window.s", len(read)),))
        values = derived.python(Window((value,) * len(read), fraction))
        rows = {f"window.s.{j}": each for j, each in enumerate(read)}
        (row,) = self._chained(derived, values, rows).values()
        yield name, row

    def _through(self, part: Model, equation: Any, known: Mapping[str, Any], rows: Rows) -> Rows:
        """Rows of an equation's results."""
        taken = arguments_of(equation)
        by = tuple(
            name
            for name in taken
            if (name in MOVING or name in part.input_types)
            and any(path == name or path.startswith(f"{name}.") for path in rows)
        )
        if not by:
            return {}
        lengths = tuple(
            (f"{start}.s", part.tap(each).width)
            for each in part.input_types
            if part.tap(each).width
            for start in (each, f"inputs.{each}")
        )
        derived = _derived(equation, by, known["options"], lengths)
        values = derived.python(*(known[name] for name in taken))
        return self._chained(derived, values, rows)

    def _chained(self, derived: Derived, values: Sequence[float], rows: Rows) -> Rows:
        slopes = np.zeros((len(derived.outputs), len(derived.inputs)))
        if derived.entries:
            slopes[tuple(np.transpose(derived.entries))] = values[len(derived.outputs) :]
        # the place of a window does not move
        moving = [k for k, path in enumerate(derived.inputs) if path in rows]
        into = np.array([rows[derived.inputs[k]] for k in moving]).reshape(-1, self.size)
        return dict(zip(derived.outputs, slopes[:, moving] @ into, strict=True))

    def link(self, link: Link) -> Array:
        """Row of a signal between parts."""
        values, rows = [], []
        for part, signal in link.sources:
            inside = f"signals.{signal}" in self.rows[part]
            kind = "signals" if inside else "state"
            rows.append(self.rows[part].get(f"{kind}.{signal}", self.none))
            values.append(value_at(self.started.arguments[part][kind], signal))
        if link.equation is None:
            return rows[0]
        names = arguments_of(link.equation)
        derived = _derived(link.equation, names, None, ())
        found = self._chained(derived, derived.python(*values), dict(zip(names, rows, strict=True)))
        return found["value"]

    def output(self, name: str) -> Array:
        """Row of a signal of any part, of a state, or of a link."""
        for part, rows in zip(reversed(self.model.parts), reversed(self.rows), strict=True):
            if name in part.signal_names:
                return rows.get(f"signals.{name}", rows.get(f"state.{name}", self.none))
        if name in self.model.links:
            return self.link(self.model.links[name])
        if name in self.model.integrals:
            raise InputError(
                f"{self.instance.name}: '{name}' is an integral of a signal, which a linear model "
                f"does not have; ask for '{self.model.integrals[name]}'."
            )
        known = dict.fromkeys(each for part in self.model.parts for each in part.signal_names)
        raise InputError(
            f"{self.instance.name}: there is no signal '{name}'; there are "
            f"{', '.join((*known, *self.model.links))}."
        )


def _with_memory(
    found: Recurrence, inputs: tuple[str, ...], outputs: tuple[str, ...], h: float, name: str
) -> LinearModel:
    """The recurrence with past samples of its inputs as states."""
    n = found.A.shape[0]
    longest = {each: max(late for of, late in found.columns if of == each) for each in inputs}
    places = [(each, late) for each in inputs for late in range(1, longest[each] + 1)]
    size = n + len(places)
    A, B = np.zeros((size, size)), np.zeros((size, len(inputs)))
    C, D = np.zeros((len(outputs), size)), np.zeros((len(outputs), len(inputs)))
    A[:n, :n], C[:, :n] = found.A, found.C
    for k, (of, late) in enumerate(found.columns):
        if late == 0:
            B[:n, inputs.index(of)], D[:, inputs.index(of)] = found.B[:, k], found.D[:, k]
        else:
            at = n + places.index((of, late))
            A[:n, at], C[:, at] = found.B[:, k], found.D[:, k]
    for k, (of, late) in enumerate(places):
        if late == 1:
            B[n + k, inputs.index(of)] = 1.0
        else:
            A[n + k, n + k - 1] = 1.0
    memory = tuple(f"{of}_{late}" for of, late in places)
    return LinearModel(A, B, C, D, (*found.states, *memory), inputs, outputs, 0.0, h, name, memory)
