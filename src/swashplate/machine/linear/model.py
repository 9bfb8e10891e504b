"""Linear models: state space with a delay before its input, its margins in a loop, other forms."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from math import copysign, inf, pi
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.errors import DomainError, InputError
from swashplate.tables import Form, ending, write_text

if TYPE_CHECKING:
    from scipy.signal import StateSpace

Array = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
ComplexArray = NDArray[np.complex128]
Matrices = tuple[Array, Array, Array, Array]
Response = Callable[[Array], ComplexArray]

INTEGRATOR_DISTANCE = 3e-8
"""Largest distance of an integrator's pole from s = 0, or z = 1, over the size of the poles. [1]

Numerically, the poles of two integrators in series lie some 1e-8 apart."""

LINEAR_MODEL = Form("a linear model", (".toml", ".json"))


@dataclass(frozen=True, eq=False, kw_only=True)
class LinearModel:
    """Small motions about an operating point.

    Continuous (`rate` None): x' = A x + B u, y = C x + D u. Sampled: x[n+1] = A x[n] + B u[n],
    y[n] = C x[n] + D u[n]. All are deviations from the operating point, in SI. The first of the
    inputs u comes late by `delay`.
    """

    name: str
    """Name of the machine."""
    A: Array
    """(n, n)"""
    B: Array
    """(n, k)"""
    C: Array
    """(m, n)"""
    D: Array
    """(m, k)"""
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    """The first is the one that loops, gains and responses are about unless stated otherwise."""
    outputs: tuple[str, ...]
    delay: float = 0.0
    """What stands exactly before the first input; of a sampled model whole samples. [s]"""
    rate: float | None = None
    """Samples a second of a sampled model, None of a continuous one. [Hz]"""
    memory: tuple[str, ...] = ()
    """States that are earlier samples of inputs, or of signals between parts."""
    units: Mapping[str, str] = field(default_factory=dict)
    """SI units of inputs and outputs by name, as far as they are known."""
    at: Mapping[str, float] = field(default_factory=dict)
    """Constant inputs of the operating point, by name; a drive's voltage, or its current. [SI]"""

    def __repr__(self) -> str:
        time = "continuous" if self.rate is None else f"sampled at {self.rate:g} Hz"
        kind = type(self).__name__
        inputs = ", ".join(self.inputs)
        return f"{kind}({self.name!r}, {inputs} to {', '.join(self.outputs)}, {time})"

    @property
    def input(self) -> str:
        """The first input."""
        return self.inputs[0]

    def poles_of(self, *states: str) -> ComplexArray:
        """Poles of some of the states by themselves, the slowest first."""
        rows = [k for k, name in enumerate(self.states) if name in states]
        poles = np.linalg.eigvals(self.A[np.ix_(rows, rows)])
        slowness = poles.real if self.rate is None else np.abs(poles)
        return np.asarray(poles[np.lexsort((poles.imag, -slowness))], dtype=np.complex128)

    @cached_property
    def poles(self) -> ComplexArray:
        """Poles of the machine, the slowest first.

        Those of delays that stand in no loop, all at z = 0, are left out. Of a continuous model in
        the s-plane [rad/s], of a sampled one in the z-plane [1].
        """
        if not self.memory:
            return self.poles_of(*self.states)
        looped = self._mutual.diagonal()
        states = zip(self.states, looped, strict=True)
        return self.poles_of(*[name for name, loops in states if loops or name not in self.memory])

    @cached_property
    def _mutual(self) -> BoolArray:
        """(n, n) whether two states act on each other, or a state on itself, at last."""
        reached = np.not_equal(self.A, 0.0)
        while True:
            paths = reached.astype(np.float32)
            further = np.logical_or(reached, paths @ paths > 0.0)
            if (further == reached).all():
                return np.asarray(reached & reached.T)
            reached = further

    def groups_of(self, members: Sequence[str]) -> list[tuple[str, ...]]:
        """Members of a joined machine, those that act on each other together.

        The poles of the states of a group are poles of the machine.

        Parameters
        ----------
        members : sequence of str
            Their names, with which the names of their states begin.
        """
        rows = {
            member: [name.startswith(f"{member}.") for name in self.states] for member in members
        }
        groups = list[tuple[str, ...]]()
        left = list(members)
        while left:
            group = [left[0]]
            for member in group:  # which grows
                others: BoolArray = np.any(self._mutual[rows[member]], axis=0)
                group += [each for each in left if each not in group and others[rows[each]].any()]
            groups.append(tuple(member for member in left if member in group))
            left = [member for member in left if member not in group]
        return groups

    @property
    def is_stable(self) -> bool:
        """Whether every motion dies out."""
        if self.rate is None:
            return bool((self.poles.real < 0.0).all())
        return bool((np.abs(self.poles) < 1.0).all())

    @cached_property
    def _steady_frequency(self) -> float:
        """Frequency at which to find steady gains if some state integrates. [Hz]

        A million times below the slowest decaying pole; 0 if no state integrates.
        """
        integrator_pole = 0.0 if self.rate is None else 1.0
        distances = np.abs(self.poles - integrator_pole)
        decaying = distances[distances > INTEGRATOR_DISTANCE * self._pole_size]
        if decaying.size == distances.size:
            return 0.0
        slowest = decaying.min(initial=self._pole_size)
        steps_per_second = self.rate or 1.0  # of a continuous model poles are rates already
        return float(1e-6 * slowest * steps_per_second / (2.0 * pi))

    @property
    def _pole_size(self) -> float:
        """Size to compare poles with: 1 in the z-plane, that of the fastest in the s-plane."""
        if self.rate is not None:
            return 1.0
        return float(np.abs(self.poles).max(initial=0.0)) or 1.0

    @cached_property
    def gains(self) -> Array:
        """Steady gain of the first input to each output, in the output's unit by the input's, (m,).

        Infinite, with the sign of its growth, of an output that integrates, as a position does.
        Those of the other inputs are the `response` to them at 0 Hz.
        """
        return np.asarray(self.response([0.0])[:, 0].real)

    @property
    def gain(self) -> float:
        """Steady gain to the first output."""
        return float(self.gains[0])

    def response(self, frequency: ArrayLike, input: str | None = None) -> ComplexArray:
        """Frequency response of the outputs to an input, the first by default, with its delay.

        Parameters
        ----------
        frequency : float or (f,) array_like
            From 0 on, of a sampled model up to half its rate. [Hz]
        input : str, optional
            Of `inputs`.

        Returns
        -------
        (m,) or (m, f) complex array
            G e^(-jω delay) with G = C (p - A)⁻¹ B + D, p being jω or, sampled, e^(jωh). At 0 Hz it
            is infinite of an output that integrates, with the sign of its growth.

        Raises
        ------
        InputError
            For other frequencies, and an input that the model does not have.
        """
        f = np.atleast_1d(np.asarray(frequency))
        h = None if self.rate is None else 1.0 / self.rate
        highest = inf if self.rate is None else 0.5 * self.rate
        # half the rate may have been computed in another way
        numbers = f.dtype.kind in "fiub" and f.ndim == 1
        if not numbers or not (np.isfinite(f) & (f >= 0.0) & (f <= highest * (1.0 + 1e-12))).all():
            raise InputError(
                "Frequencies must be one row of finite numbers from 0 on"
                + ("." if h is None else f" to half the rate, {highest:g} Hz.")
            )
        if input is not None and input not in self.inputs:
            raise InputError(
                f"The model of {self.name} has no input '{input}'; it has {', '.join(self.inputs)}."
            )
        column = 0 if input is None else self.inputs.index(input)
        steady = (f == 0.0) & (self._steady_frequency > 0.0)
        s = 2j * np.pi * np.where(steady, self._steady_frequency, f)
        point = s if h is None else np.exp(s * h)
        n = self.A.shape[0]
        system = point[:, np.newaxis, np.newaxis] * np.eye(n) - self.A
        into = np.broadcast_to(self.B[:, column : column + 1], (f.size, n, 1))
        states = np.linalg.solve(system, into)
        response = (self.C @ states)[:, :, 0].T + self.D[:, column : column + 1]
        if column == 0:
            response = response * np.exp(-s * self.delay)
        if steady.any():
            # if twice the frequency halves the gain, the output integrates once; if it leaves a
            # quarter, twice
            near = response[:, steady]
            twice = self.response([2.0 * self._steady_frequency], input)
            ratio = np.maximum(np.abs(near), 1e-300) / np.maximum(np.abs(twice), 1e-300)
            order = np.maximum(np.rint(np.log2(ratio)), 0.0)
            growth = (near * s[steady] ** order).real
            response[:, steady] = np.where(order > 0.0, np.copysign(inf, growth), near.real)
        if np.ndim(frequency) == 0:
            response = response[:, 0]
        return np.asarray(response, dtype=np.complex128)

    # --- loops ------------------------------------------------------------------------------------

    def _refuse_unstable(self) -> None:
        """Refuse a model with a pole that grows; one that integrates is fine."""
        is_sampled = self.rate is not None
        integrator_pole = 1.0 if is_sampled else 0.0
        growth = np.abs(self.poles) - 1.0 if is_sampled else self.poles.real
        integrates = np.abs(self.poles - integrator_pole) <= INTEGRATOR_DISTANCE * self._pole_size
        if (growth[~integrates] >= 0.0).any():
            raise DomainError(
                f"{self.name}: the linear model is unstable (poles {self.poles}), so bandwidth and "
                "margins are meaningless."
            )

    def _search_end(self) -> float:
        """Frequency far beyond all poles, or half the rate of a sampled model. [Hz]"""
        return 1e3 * self._pole_size if self.rate is None else 0.5 * self.rate

    def _largest(self, grid: Array) -> float:
        """Largest magnitude of the first output's response."""
        return float(np.abs(self.response(grid)[0]).max())

    def _refuse_without_gain(self, largest: float) -> None:
        """Refuse a first output that does not follow a steady input."""
        if abs(self.gain) <= 1e-9 * largest:
            raise DomainError(
                "The output does not follow a steady input (its gain is 0), so it has neither a "
                "bandwidth nor a largest gain; choose another output."
            )

    @property
    def bandwidth(self) -> float:
        """Frequency at which the first output falls 3 dB (to 1/√2) below its steady gain. [Hz]

        Infinite if it never does below half the rate of a sampled model.

        Raises
        ------
        DomainError
            If the model is unstable, or the output does not follow a steady input or integrates.
        """
        self._refuse_unstable()
        grid = _grid(self._search_end())
        self._refuse_without_gain(self._largest(grid))
        level = abs(self.gain) / np.sqrt(2.0)
        if level == inf:
            raise DomainError(
                f"{self.name}: {self.outputs[0]} integrates {self.input}, with an infinite gain, "
                "so it has no bandwidth; use the margins of a loop around it."
            )
        falls = _roots(lambda f: np.abs(self.response(f)[0]) - level, grid)
        return falls[0] if falls else inf

    @property
    def largest_gain(self) -> float:
        """Proportional gain at which the loop u = K (r - y) of the first output begins to swing.

        In the input's unit by the output's, positive; infinite if none does.

        Raises
        ------
        DomainError
            If the model is unstable, or the output does not follow a steady input.
        """
        self._refuse_unstable()
        largest = self._largest(_grid(self._search_end()))
        self._refuse_without_gain(largest)
        small = 0.5 / largest
        return small * self.margins(copysign(small, self.gain)).gain_margin

    def margins(self, controller: float | Response) -> LoopMargins:
        """Margins of the loop u = K (r - y) closed over the first output.

        Parameters
        ----------
        controller : float or callable
            A proportional gain K, in the input's unit by the output's, e.g. V/(rad/s), or its
            frequency response: a function of frequencies [Hz] that returns complex numbers. It must
            not be unstable by itself; one that integrates is fine.

        Returns
        -------
        LoopMargins
            Crossover, and margins of phase, delay and gain.

        Raises
        ------
        InputError
            If the controller is not a gain, nor a function that gives as many numbers.
        DomainError
            If the closed loop is unstable, as it then has no margin, or the model is.

        Examples
        --------
        >>> from swashplate import Drive
        >>> round(Drive.preset("hoist").linearize(5.0).margins(2.0).gain_margin, 1)
        6.8
        """

        def open_loop(frequency: Array) -> ComplexArray:
            gain = np.asarray(controller(frequency) if callable(controller) else controller)
            if gain.dtype.kind not in "iufc" or gain.shape not in ((), frequency.shape):
                raise InputError(
                    f"{self.name}: the controller must be a gain, or a function of frequencies "
                    "[Hz] that gives as many numbers."
                )
            return np.asarray(gain * self.response(frequency)[0])

        self._refuse_unstable()
        return loop_margins(open_loop, self.delay, self._search_end(), self.name)

    # --- other forms ------------------------------------------------------------------------------

    def to_scipy(self, *, without_delay: bool = False) -> StateSpace:
        """The model as `scipy.signal.StateSpace`, continuous or sampled.

        A sampled model's delay is exact, as states. A continuous one's must be left out by
        `without_delay`; it is refused in an `InputError` otherwise. Its matrices are those that
        SciPy's ``ss2tf`` and python-control's ``ss`` take.
        """
        from scipy.signal import StateSpace

        matrices = self.A, self.B, self.C, self.D
        if self.rate is not None:
            delay_samples = round(self.delay * self.rate)
            A, B, C, D = with_delay_line(matrices, delay_samples)
            return StateSpace(A, B, C, D, dt=1.0 / self.rate)
        if self.delay != 0.0 and not without_delay:
            raise InputError(
                f"The model has a delay of {self.delay:g} s, which no state space represents "
                "exactly; pass without_delay=True and put an approximant before it, "
                "python-control's pade for example, or use a sampled model (discrete), which has "
                "it as states."
            )
        return StateSpace(self.A, self.B, self.C, self.D)

    def content(self) -> dict[str, Any]:
        """Content of a model's file, as plain numbers, strings and lists; SI."""
        time = {} if self.rate is None else {"rate": self.rate}
        return {
            "format": 1,
            "drive": self.name,
            "kind": "continuous" if self.rate is None else "sampled",
            "delay": self.delay,
            **time,
            "input": self.input,
            "inputs": list(self.inputs),
            "outputs": list(self.outputs),
            "states": list(self.states),
            "input_unit": self.units.get(self.input, ""),
            "input_units": [self.units.get(name, "") for name in self.inputs],
            "output_units": [self.units.get(name, "") for name in self.outputs],
            **{name: getattr(self, name).tolist() for name in ("A", "B", "C", "D")},
        }

    def write(self, path: str | Path) -> None:
        """Write matrices, names, units, delay and operating point as .toml or .json, in SI."""
        if ending(path, LINEAR_MODEL) == ".json":
            from json import dumps as dump_json

            write_text(dump_json(self.content(), indent=1) + "\n", path)
        else:
            from tomlkit import dumps as dump_toml

            write_text(dump_toml(self.content()), path)


def with_delay_line(matrices: Matrices, samples: int) -> Matrices:
    """Matrices with samples of delay before the first input as states, the newest first."""
    if samples == 0:
        return matrices
    A, B, C, D = matrices
    n = A.shape[0]
    others = np.zeros((samples, B.shape[1] - 1))
    line = np.eye(samples, k=-1)
    last = np.eye(1, samples, samples - 1)
    first = np.eye(samples, 1)
    longer = np.block([[line, np.zeros((samples, n))], [B[:, :1] @ last, A]])
    into = np.block([[first, others], [np.zeros((n, 1)), B[:, 1:]]])
    out = np.hstack((D[:, :1] @ last, C)), np.hstack((np.zeros_like(D[:, :1]), D[:, 1:]))
    return longer, into, *out


# --- margins --------------------------------------------------------------------------------------

POINTS, DECADES = 4000, 9  # Of the search, which ends at the fastest frequency.
MOST_TURN = 100.0
"""Phase of the delay beyond which a loop of size 1 or more cannot be stable. [rad]

Up to there it turns by half a radian at most from one point of the search to the next.
"""


class LoopMargins(NamedTuple):
    """Margins of a stable loop."""

    crossover: float
    """Frequency at which |L| = 1 that leaves the smallest delay margin, 0 if there is none. [Hz]"""
    phase_margin: float
    """Phase of L above -180° there, infinite without a crossover. [rad]"""
    delay_margin: float
    """Further delay that makes the loop swing. [s]"""
    gain_margin: float
    """Factor on L that makes the loop swing. [1]"""


def loop_margins(loop: Response, delay: float, fastest: float, name: str) -> LoopMargins:
    """Margins of the loop 1 + L = 0.

    Parameters
    ----------
    loop : callable
        L of frequencies [Hz], of parts that are stable or integrate.
    delay, fastest : float
        The delay within L [s], and the highest frequency to look at [Hz].
    name : str
        Whose loop, for the sentence.

    Raises
    ------
    DomainError
        If the closed loop is unstable: by Nyquist's criterion, the argument of 1 + L does not come
        from where it must to zero.
    """
    grid = _grid(fastest)
    values = loop(grid)
    # a loop that integrates begins at -90° or, twice, at -180°; another one on the positive axis
    integrates = abs(values[0]) > 2.0 * abs(loop(10.0 * grid[:1])[0])
    if integrates and abs(values[0]) < 10.0:  # begin where it is large
        grid = np.geomspace(0.1 * grid[0] * abs(values[0]), fastest, POINTS)
        values = loop(grid)
    if not np.isfinite(values).all():
        raise InputError(f"{name}: the controller's frequency response is not finite.")
    argument = np.unwrap(np.angle(1.0 + values))
    begins_well = (-pi if integrates else -0.5 * pi) <= argument[0] <= 0.25 * pi
    turned = 2.0 * pi * delay * grid > MOST_TURN
    if abs(argument[-1]) > 0.5 * pi or not begins_well or (np.abs(values[turned]) >= 1.0).any():
        raise DomainError(
            f"{name}: the closed loop is unstable, so it has no margins; lower the controller's "
            "gain."
        )
    margins = [(inf, 0.0, inf)]
    for frequency in _roots(lambda f: np.log(np.maximum(np.abs(loop(f)), 1e-300)), grid):
        phase = (float(np.angle(loop(np.array([frequency]))[0])) + pi) % (2.0 * pi)
        margins.append((phase / (2.0 * pi * frequency), frequency, phase))
    delay_margin, crossover, phase = min(margins)
    # where L crosses the negative real axis farthest out
    turns = _roots(lambda f: loop(f).imag, grid, values.real < 0.0)
    sizes = [abs(loop(np.array([frequency]))[0]) for frequency in turns]
    if values[-1].real < 0.0 and abs(values[-1].imag) <= 1e-9 * abs(values[-1]):
        sizes.append(abs(values[-1]))  # half the rate of a sampled model
    if values[0].real < 0.0 and not integrates:
        sizes.append(abs(values[0]))  # a gain of the wrong sign
    gain_margin = float(1.0 / max(sizes)) if sizes else inf
    return LoopMargins(crossover, phase, delay_margin, gain_margin)


def _grid(fastest: float) -> Array:
    return np.asarray(np.geomspace(fastest * 10.0**-DECADES, fastest, POINTS))


def _roots(
    function: Callable[[Array], Array], grid: Array, within: NDArray[np.bool_] | None = None
) -> list[float]:
    """Frequencies at which a function changes its sign, between points of the grid within."""
    from scipy.optimize import brentq

    turns = np.diff(np.signbit(function(grid)))
    if within is not None:
        turns &= within[:-1] & within[1:]
    return [
        float(brentq(lambda f: float(function(np.array([f]))[0]), grid[k], grid[k + 1]))
        for k in np.flatnonzero(turns)
    ]
