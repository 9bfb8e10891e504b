"""Frequency responses to sines of a size: describing functions, by simulation.

A model is marched over whole cycles of each frequency until its output repeats itself.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import ceil, inf
from types import MappingProxyType
from typing import TYPE_CHECKING, cast, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.errors import DomainError, InputError
from swashplate.machine import Machine
from swashplate.machine.fields import is_real
from swashplate.machine.linear.model import LinearModel
from swashplate.machine.linear.settling import settles_by_equation
from swashplate.machine.marching import check_rate, marched, output_of
from swashplate.results import GivenAxes, Tabular, figures
from swashplate.tables import Column, Table

if TYPE_CHECKING:
    import polars

    from swashplate.results import Axes, Figure
Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
SLOWEST_CYCLE = 1e-3  # Lowest frequency. [Hz]
FEWEST_STEPS, MOST_STEPS = 8, 1_000_000
"""Steps of a cycle, which bound the frequencies from both sides."""
SHORTEST = 1.0  # Half of a march lasts as long at least. [s]
LONGEST = 64  # Times the first march, after which an answer that still changes is given up.
SHOWN = 8
"""Frequencies of a response that its table shows; its figure shows all of them."""
STILL = 1e-12  # Answers below this part of the output's size are none.


@dataclass(frozen=True, eq=False)
class FrequencyResponse(Tabular):
    """First harmonic of the answer to bias + amplitude · sin(2π f t), once it repeats itself.

    A row for each amplitude, a column for each frequency.

    Examples
    --------
    >>> from swashplate import Drive
    >>> response = Drive.preset("hoist").frequency_response([0.1, 0.5], [3.0], bias=6.0)
    >>> response.ratio.shape  # amplitudes, frequencies
    (1, 2)
    """

    name: str
    """Name of the machine."""
    input: str
    """What moves it."""
    output: str
    """The signal that answers."""
    bias: float
    """Mean of the input, in its SI unit."""
    frequencies: Array
    """Rising, (f,). [Hz]"""
    amplitudes: Array
    """Of the input, as given, (a,), in its SI unit."""
    ratio: ComplexArray
    """First harmonic of the output by that of the input, (a, f); 0 if nothing moves."""
    distortion: Array
    """Root mean square of all but mean and first harmonic, by that of the first harmonic, (a, f);
    0 if nothing moves. [1]"""
    mean: Array
    """Mean of the output, (a, f)."""
    units: Mapping[str, str] = field(default_factory=dict)
    """SI units of input and output by name, as far as they are known."""

    def __repr__(self) -> str:
        return (
            f"FrequencyResponse({self.name!r}, {self.input} to {self.output}, "
            f"{self.amplitudes.size} amplitudes, {self.frequencies.size} frequencies)"
        )

    @overload
    def plot(
        self,
        *,
        linear: LinearModel | None = None,
        mark: float | None = 0.3,
        ax: None = None,
        title: str | None = None,
    ) -> Figure: ...

    @overload
    def plot(
        self,
        *,
        linear: LinearModel | None = None,
        mark: float | None = 0.3,
        ax: GivenAxes,
        title: str | None = None,
    ) -> GivenAxes: ...

    def plot(
        self,
        *,
        linear: LinearModel | None = None,
        mark: float | None = 0.3,
        ax: Axes | Sequence[Axes] | None = None,
        title: str | None = None,
    ) -> Figure | Axes | Sequence[Axes]:
        """Figure of gain, phase and distortion over the frequency, a line for each amplitude.

        By default a new figure; with `ax`, two for gain and phase or three, it is drawn there, and
        `ax` returned. See `swashplate.report.figures.plot_bode`.
        """
        draw = figures().plot_bode
        return cast("Figure", draw(self, linear=linear, mark=mark, ax=ax, title=title))

    @property
    def gain(self) -> Array:
        """Magnitude of the ratio, (a, f)."""
        return np.abs(self.ratio)

    @property
    def has_motion(self) -> NDArray[np.bool_]:
        """(a, f) whether the output moves at all: a small sine may stay in a dead zone."""
        return np.asarray(self.ratio != 0.0)

    @property
    def phase(self) -> Array:
        """Phase of the output, negative if it lags, followed from low to high frequencies. [rad]

        The lowest frequency's is within ±π. It is NaN if the output does not move.
        """
        phase = np.full(self.ratio.shape, np.nan)
        for row, ratio in zip(phase, self.ratio, strict=True):
            there = ratio != 0.0
            row[there] = np.unwrap(np.angle(ratio[there]))
        return phase

    def table(self) -> Table:
        """Gain, phase and distortion by amplitude, at up to `SHOWN` of the frequencies."""
        unit = self.units.get(self.input, "")
        answer_unit = self.units.get(self.output, "")
        gain_unit = f"{answer_unit or '1'}/{unit}" if unit else answer_unit
        columns = (
            Column("amplitude", "g", unit),
            Column("frequency", ".4g", "Hz"),
            Column("gain", ".4g", gain_unit, none="no motion"),
            Column("phase", "z.1f", "rad"),
            Column("distortion", ".1%"),
        )
        table = Table("", columns)
        size = self.frequencies.size
        rows = np.unique(np.linspace(0, size - 1, min(size, SHOWN)).round().astype(int))
        for k, amplitude in enumerate(self.amplitudes.tolist()):
            for index in rows.tolist():
                gain = phase = distortion = None
                if self.has_motion[k, index]:
                    gain = float(self.gain[k, index])
                    phase = float(self.phase[k, index])
                    distortion = float(self.distortion[k, index])
                table.add(
                    amplitude,
                    float(self.frequencies[index]),
                    gain,
                    phase,
                    distortion,
                    section=bool(k > 0 and index == rows[0]),
                )
        if rows.size < size:
            table.caption = f"{rows.size} of {size} frequencies shown"
        return table

    def sentences_on_no_motion(self) -> list[str]:
        """A sentence for each amplitude under which the output does not move at some frequencies.

        See `has_motion`.
        """
        unit = self.units.get(self.input, "")
        sentences = list[str]()
        for amplitude, has_motion in zip(self.amplitudes, self.has_motion, strict=True):
            without_motion = np.flatnonzero(~has_motion)
            if without_motion.size == 0:
                continue
            low, high = self.frequencies[without_motion[[0, -1]]]
            where = f"at {low:.3g} Hz" if low == high else f"from {low:.3g} to {high:.3g} Hz"
            are_adjacent = without_motion[-1] - without_motion[0] < without_motion.size
            if high > low and not are_adjacent:
                where = f"at {without_motion.size} frequencies {where}"
            size = f"{amplitude:g} {unit}".rstrip()
            sentences.append(f"No motion under {size} {where}")
        return sentences

    def to_polars(self) -> polars.DataFrame:
        """Table in SI, a row for each amplitude and frequency; no phase if nothing moves."""
        import polars as pl

        shape = self.ratio.shape
        columns = {
            "amplitude": np.repeat(self.amplitudes, shape[1]),
            "frequency": np.tile(self.frequencies, shape[0]),
        }
        for name in ("gain", "phase", "distortion", "mean"):
            columns[name] = getattr(self, name).ravel()
        return pl.DataFrame(columns).with_columns(pl.col("phase").fill_nan(None))


# --- sweep ----------------------------------------------------------------------------------------


def steps_of(frequency: float, rate: float) -> int:
    """Steps of a cycle: whole ones, none of them longer than at the rate."""
    return ceil(rate / frequency * (1.0 - 1e-12))


def checked_frequencies(frequencies: ArrayLike, rate: float) -> Array:
    """Frequencies as an array [Hz], refused unless they rise and suit a rate of steps [Hz]."""
    check_rate(rate)
    values = _checked(frequencies, "frequencies")
    lowest = max(SLOWEST_CYCLE, rate / MOST_STEPS)
    highest = rate / FEWEST_STEPS
    if (np.diff(values) <= 0.0).any() or values[0] < lowest or values[-1] > highest:
        raise InputError(
            f"The frequencies must rise from {lowest:g} Hz or above to at most {highest:g} Hz, an "
            "eighth of the rate."
        )
    return values


def checked_amplitudes(amplitudes: ArrayLike) -> Array:
    """Amplitudes as an array, refused unless they are above 0."""
    return _checked(amplitudes, "amplitudes")


def sweep(
    instance: Machine,
    frequencies: ArrayLike,
    amplitudes: ArrayLike,
    rate: float,
    *,
    input: str,
    output: str,
    bias: float = 0.0,
    at: Mapping[str, float] = MappingProxyType({}),
    tolerance: float = 1e-4,
    size: float = 0.0,
    units: Mapping[str, str] | None = None,
) -> FrequencyResponse:
    """Describing function of a model with numbers, by sine sweep.

    Parameters
    ----------
    instance : Machine
        The model with its numbers, see `swashplate.machine.Machine`. One that has no equation for
        its steady state starts at rest.
    frequencies : (f,) array_like
        Rising, from 1 mHz to an eighth of the rate. [Hz]
    amplitudes : (a,) array_like
        Of the sine about the bias, in the input's SI unit.
    rate : float
        Steps a second. At each frequency the step is shortened a little, so that a cycle has a
        whole number of them and its harmonics are exact. [Hz]
    input, output : str
        External signal that moves the model, and the signal that answers.
    bias : float
        Mean of the input.
    at : mapping of str to float
        Constant values of its other inputs.
    tolerance : float
        Relative change of the first harmonic, from the middle of a march to its end, below which
        the answer repeats itself.
    size : float
        Natural size of the output: an answer below 1e-12 of it is rounding, and counts as none.
    units : mapping of str to str, optional
        SI units of input and output by name; by default those that the model declares.

    Returns
    -------
    FrequencyResponse
        A row for each amplitude, a column for each frequency.

    Raises
    ------
    InputError
        For frequencies, amplitudes or options out of range, or signals that the model does not
        have.
    DomainError
        If nothing moves at all, the answer does not come to repeat itself, or the model leaves its
        domain.
    """
    f = checked_frequencies(frequencies, rate)
    a = checked_amplitudes(amplitudes)
    if not is_real(tolerance) or not 0.0 < tolerance < 1.0:
        raise InputError(f"The tolerance is {tolerance!r}, but must be between 0 and 1.")
    if not is_real(bias) or not np.isfinite(bias):
        raise InputError(f"The bias is {bias}, but must be a finite number.")
    _check_swing(instance, input, bias, float(a.max()))
    if units is None:
        definitions = instance.model.definitions
        units = {name: definitions[name].unit for name in (input, output) if name in definitions}

    ratio = np.zeros((a.size, f.size), dtype=np.complex128)
    distortion, mean = np.zeros((2, a.size, f.size))
    for j, frequency in enumerate(f.tolist()):
        steps = steps_of(frequency, rate)
        step = 1.0 / (frequency * steps)
        instance.check_step(step)
        wave = np.sin(2.0 * np.pi * np.arange(steps) / steps)
        for i, amplitude in enumerate(a.tolist()):
            cycle = bias + amplitude * wave
            # twice as long until the middle and the last cycle agree: what lasts is then smaller
            count = least = 2 * ceil(frequency * SHORTEST)
            while True:
                answer = _cycles(instance, {input: np.tile(cycle, count)}, at, output, step, steps)
                middle, _, _ = _harmonic(answer[count // 2 - 1], size)
                last, distortion[i, j], mean[i, j] = _harmonic(answer[-1], size)
                if abs(last - middle) <= tolerance * abs(last):
                    break
                if count >= LONGEST * least:
                    raise DomainError(
                        f"{instance.name}: at {frequency:g} Hz and an amplitude of {amplitude:g} "
                        f"the response has not settled to {tolerance:g} within {count} cycles; "
                        "allow a larger tolerance, or examine it in a simulation."
                    )
                count *= 2
            ratio[i, j] = last / amplitude
    if not ratio.any():
        middle_of = f"{bias:g} {units.get(input, '')}".rstrip()
        raise DomainError(
            f"{instance.name}: nothing moves about {middle_of} with amplitudes up to {a.max():g}: "
            "all stay in a dead zone or at a stop; use larger ones or another bias."
        )
    return FrequencyResponse(
        name=instance.name,
        input=input,
        output=output,
        bias=float(bias),
        frequencies=f,
        amplitudes=a,
        ratio=ratio,
        distortion=distortion,
        mean=mean,
        units=units,
    )


def _check_swing(instance: Machine, input: str, bias: float, largest: float) -> None:
    """Refuse a sine that swings beyond the range of its input."""
    least, most = instance.model.input_ranges.get(input, (-inf, inf))
    if least <= bias - largest and bias + largest <= most:
        return
    definition = instance.model.input_definitions[input]
    reached = bias - largest if bias - largest < least else bias + largest
    raise InputError(
        f"{instance.name}: bias and amplitude reach {reached:g} {definition.unit}, but the {input} "
        f"must be {definition.span} {definition.unit}."
    )


def _cycles(
    instance: Machine,
    moving: Mapping[str, Array],
    at: Mapping[str, float],
    output: str,
    step: float,
    steps: int,
) -> Array:
    """Answer to a moving input from its first sample on, a row for each cycle."""
    ((input, record),) = moving.items()
    records = {**moving, **{name: np.full(record.size, value) for name, value in at.items()}}
    settles = settles_by_equation(instance)
    first = {name: float(values[0]) for name, values in records.items()}
    initial = instance.start(first, step, "steady" if settles else "rest")
    stored, _ = output_of(instance.model, output)
    (signal,) = marched(instance, records, step, initial, (stored,), input)
    return np.asarray(signal.reshape(-1, steps))


def _harmonic(signal: Array, size: float) -> tuple[complex, float, float]:
    """First harmonic by that of a unit sine, distortion and mean of one whole cycle."""
    n = signal.size
    mean = float(signal.mean())
    turn = np.exp(-2j * np.pi * np.arange(n) / n)
    first = complex(2.0 / n * ((signal - mean) @ turn))
    if abs(first) <= STILL * size:
        return 0j, 0.0, mean
    rest = signal - mean - np.real(first * np.conj(turn))
    distortion = float(np.sqrt(2.0 * np.mean(rest * rest))) / abs(first)
    return 1j * first, distortion, mean


def _checked(values: ArrayLike, what: str) -> Array:
    try:
        data = np.atleast_1d(np.array(values, dtype=np.float64))
    except (TypeError, ValueError):
        raise InputError(f"The {what} must be a sequence of numbers.") from None
    if data.ndim != 1 or data.size == 0 or not (np.isfinite(data) & (data > 0.0)).all():
        raise InputError(f"The {what} must be one or more finite numbers above 0, in one row.")
    return data
