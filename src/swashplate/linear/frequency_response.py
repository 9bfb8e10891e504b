"""Frequency responses to sines of a size: describing functions, by simulation.

The drive is marched over whole cycles of each frequency until it repeats itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, sqrt
from typing import TYPE_CHECKING, cast, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.equations.fields import is_real
from swashplate.equations.marching.march import output_of
from swashplate.equations.marching.record import FASTEST, SOURCE_RATE, check_rate
from swashplate.equations.marching.run import Instance, marched
from swashplate.errors import DomainError, InputError
from swashplate.linear.drive import OUTPUTS
from swashplate.models.displacement_control import Pump
from swashplate.parameters.parameter_set import ParameterSet
from swashplate.parameters.rules import FULL_VOLTAGE
from swashplate.results import GivenAxes, Tabular, figures
from swashplate.simulation.instance import check_filter_stability, instance_of, without_ripple
from swashplate.simulation.result import UNITS
from swashplate.tables import Column, Table

if TYPE_CHECKING:
    import polars

    from swashplate.linear.drive import LinearDrive
    from swashplate.results import Axes, Figure

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
SWEPT_OUTPUTS = OUTPUTS[:7]  # Without the motor's.
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
    """

    name: str
    """Name of the drive."""
    input: str
    """``"voltage"`` or ``"current"``."""
    output: str
    bias: float
    """Mean of the input. [V or A]"""
    frequencies: Array
    """Rising, (f,). [Hz]"""
    amplitudes: Array
    """Of the input, as given, (a,). [V or A]"""
    ratio: ComplexArray
    """First harmonic of the output by that of the input, (a, f); 0 where nothing moves."""
    distortion: Array
    """Root mean square of all but mean and first harmonic, by that of the first harmonic, (a, f);
    0 where nothing moves. [1]"""
    mean: Array
    """Mean of the output, (a, f)."""

    def __repr__(self) -> str:
        return (
            f"FrequencyResponse({self.name!r}, {self.input} to {self.output}, "
            f"{self.amplitudes.size} amplitudes, {self.frequencies.size} frequencies)"
        )

    @overload
    def plot(
        self,
        *,
        linear: LinearDrive | None = None,
        mark: float | None = 0.3,
        ax: None = None,
        title: str | None = None,
    ) -> Figure: ...

    @overload
    def plot(
        self,
        *,
        linear: LinearDrive | None = None,
        mark: float | None = 0.3,
        ax: GivenAxes,
        title: str | None = None,
    ) -> GivenAxes: ...

    def plot(
        self,
        *,
        linear: LinearDrive | None = None,
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
    def moves(self) -> NDArray[np.bool_]:
        """Where there is an answer at all, (a, f): a small sine may stay in a dead zone."""
        return np.asarray(self.ratio != 0.0)

    @property
    def phase(self) -> Array:
        """Phase of the output, negative where it lags, followed from low to high frequencies. [rad]

        The lowest frequency's is within ±π. NaN marks what `moves` denies: nothing has no phase.
        """
        phase = np.full(self.ratio.shape, np.nan)
        for row, ratio in zip(phase, self.ratio, strict=True):
            there = ratio != 0.0
            row[there] = np.unwrap(np.angle(ratio[there]))
        return phase

    def table(self) -> Table:
        """Gain, phase and distortion by amplitude, at up to `SHOWN` of the frequencies."""
        columns = (
            Column("amplitude", "g", UNITS[self.input]),
            Column("frequency", ".4g", "Hz"),
            Column("gain", ".4g", f"{UNITS[self.output]}/{UNITS[self.input]}", none="no motion"),
            Column("phase", "z.1f", "rad"),
            Column("distortion", ".1%"),
        )
        made, size = Table("", columns), self.frequencies.size
        rows = np.unique(np.linspace(0, size - 1, min(size, SHOWN)).round().astype(int))
        for k, amplitude in enumerate(self.amplitudes.tolist()):
            for at in rows.tolist():
                answer: tuple[float | None, ...] = (None, None, None)
                if self.moves[k, at]:
                    numbers = (self.gain[k, at], self.phase[k, at], self.distortion[k, at])
                    answer = tuple(map(float, numbers))
                frequency, first = float(self.frequencies[at]), at == rows[0]
                made.add(amplitude, frequency, *answer, section=bool(first and k))
        if rows.size < size:
            made.caption = f"{rows.size} of {size} frequencies shown"
        return made

    def still(self) -> list[str]:
        """Where `moves` denies an answer, in words, for each amplitude that has such a place."""
        unit, said = UNITS[self.input], list[str]()
        for amplitude, moves in zip(self.amplitudes, self.moves, strict=True):
            places = np.flatnonzero(~moves)
            if places.size == 0:
                continue
            low, high = self.frequencies[places[[0, -1]]]
            where = f"at {low:.3g} Hz" if low == high else f"from {low:.3g} to {high:.3g} Hz"
            if high > low and places[-1] - places[0] >= places.size:
                where = f"at {places.size} frequencies {where}"
            said.append(f"No motion under {amplitude:g} {unit} {where}")
        return said

    def to_polars(self) -> polars.DataFrame:
        """Table in SI, a row for each amplitude and frequency; no phase where nothing moves."""
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


def sweep(
    parameters: ParameterSet,
    frequencies: ArrayLike,
    amplitudes: ArrayLike,
    bias: float = 0.0,
    input: str = "voltage",
    output: str = "shaft_speed",
    rate: float = SOURCE_RATE,
    tolerance: float = 1e-4,
) -> FrequencyResponse:
    """Describing function by sine sweep; see `Drive.frequency_response`."""
    f, a = _checked(frequencies, "frequencies"), _checked(amplitudes, "amplitudes")
    check_rate(rate)
    if not SOURCE_RATE <= rate <= FASTEST:
        raise InputError(
            f"The rate is {rate:g} Hz, but must be between {SOURCE_RATE:g} and {FASTEST:g} Hz."
        )
    lowest, highest = max(SLOWEST_CYCLE, rate / MOST_STEPS), rate / FEWEST_STEPS
    if (np.diff(f) <= 0.0).any() or f[0] < lowest or f[-1] > highest:
        raise InputError(
            f"The frequencies must rise from {lowest:g} Hz or above to at most {highest:g} Hz, an "
            "eighth of the rate."
        )
    if not is_real(tolerance) or not 0.0 < tolerance < 1.0:
        raise InputError(f"The tolerance is {tolerance!r}, but must be between 0 and 1.")
    if input not in ("voltage", "current"):
        raise InputError(f"The input is '{input}'; it is 'voltage' or 'current'.")
    if output not in SWEPT_OUTPUTS or output == input:
        raise InputError(
            f"'{output}' is no output of a sweep of the {input}; there are "
            f"{', '.join(name for name in SWEPT_OUTPUTS if name != input)}."
        )
    if not is_real(bias) or not np.isfinite(bias):
        raise InputError(f"The bias is {bias}, but must be a finite number.")
    if input == "voltage" and (largest := abs(bias) + float(a.max())) > FULL_VOLTAGE:
        raise InputError(f"Bias and amplitude reach {largest:g} V, but the card takes ±10 V.")

    ratio = np.zeros((a.size, f.size), dtype=np.complex128)
    distortion, mean = np.zeros((2, a.size, f.size))
    instance = without_ripple(instance_of(parameters, input == "voltage"))
    size = _size(instance.parts[1].p, output)
    for j, frequency in enumerate(f.tolist()):
        steps = ceil(rate / frequency * (1.0 - 1e-12))
        step = 1.0 / (frequency * steps)
        if input == "voltage":
            check_filter_stability(parameters, step)
        wave = np.sin(2.0 * np.pi * np.arange(steps) / steps)
        for i, amplitude in enumerate(a.tolist()):
            cycle = bias + amplitude * wave
            # twice as long until the middle and the last cycle agree: what lasts is then smaller
            count = least = 2 * ceil(frequency * SHORTEST)
            while True:
                answer = _cycles(instance, input, output, np.tile(cycle, count), step, steps)
                middle, _, _ = _harmonic(answer[count // 2 - 1], size)
                last, distortion[i, j], mean[i, j] = _harmonic(answer[-1], size)
                if abs(last - middle) <= tolerance * abs(last):
                    break
                if count >= LONGEST * least:
                    raise DomainError(
                        f"{parameters.name}: at {frequency:g} Hz and an amplitude of "
                        f"{amplitude:g} the answer has not settled to {tolerance:g} within "
                        f"{count} cycles; allow a larger tolerance, or look at it with a "
                        "simulation."
                    )
                count *= 2
            ratio[i, j] = last / amplitude
    if not ratio.any():
        raise DomainError(
            f"{parameters.name}: nothing moves about {bias:g} {'V' if input == 'voltage' else 'A'} "
            f"with amplitudes up to {a.max():g}: all stay in a dead zone or at a stop; take larger "
            "ones or another bias."
        )
    name = parameters.name
    return FrequencyResponse(name, input, output, float(bias), f, a, ratio, distortion, mean)


def _cycles(
    instance: Instance, input: str, output: str, record: Array, step: float, steps: int
) -> Array:
    """Answer from the steady state under the first sample, a row for each cycle."""
    started = instance.start({input: float(record[0])}, step, "steady")
    seen, _ = output_of(instance.model, output)
    (signal,) = marched(instance, {input: record}, step, started, (seen,), input)
    return np.asarray(signal.reshape(-1, steps))


def _size(pump: Pump, output: str) -> float:
    """Natural size of a signal, beside which rounding is told from motion."""
    sizes = {
        "shaft_speed": pump.Z10,
        "stroker_pressure": 1.0 / pump.Z1,
        "spool_position": pump.Z5,
        "orifice_opening": pump.Z5,
        "solenoid_force": sqrt(pump.Z4) / pump.Z5,
    }
    return sizes.get(output, 1.0)


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


def response_table(response: FrequencyResponse, frequency: float) -> Table:
    """Gain, phase, lag and distortion of a drive by the amplitude of the sine.

    `response` is from voltage to the shaft's speed; at one of its frequencies [Hz]: another is
    refused in an `InputError`, nothing is interpolated.
    """
    at = int(np.argmin(np.abs(response.frequencies - frequency)))
    nearest = float(response.frequencies[at])
    if not abs(nearest - frequency) <= 1e-9 * nearest:
        raise InputError(
            f"The response was not taken at {frequency:g} Hz; the nearest frequency is "
            f"{nearest:.6g} Hz."
        )
    heads = (
        ("amplitude", "g", "V"),
        ("gain", ".3f", "rad/s/V", "none"),
        ("phase", "z.1f", "deg"),
        ("lag", "z.1f", "ms"),
        ("distortion %", ".1f"),
        ("mean speed", "z.2f", "rad/s"),
    )
    made = Table("", tuple(Column(*each) for each in heads))
    # the phase within a turn of itself, as of this frequency alone
    phases = np.angle(response.ratio[:, at])
    for k, amplitude in enumerate(map(float, response.amplitudes)):
        answer: tuple[float | None, ...] = (None,) * 4
        if response.moves[k, at]:
            phase = float(phases[k])
            lag = -1e3 * phase / (2.0 * np.pi * frequency)
            distortion = 100.0 * float(response.distortion[k, at])
            answer = (float(response.gain[k, at]), np.degrees(phase), lag, distortion)
        made.add(amplitude, *answer, float(response.mean[k, at]))
    return made
