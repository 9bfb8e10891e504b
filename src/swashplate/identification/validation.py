"""Validation: measures and tests of residuals, and runs predicted from the command alone."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len, rfft

from swashplate.campaign import (
    DIFFERENTIATOR,
    SIGNALS,
    Channel,
    Experiment,
    speed_from_angle,
    speed_of,
)
from swashplate.errors import InputError
from swashplate.identification.estimation.drive_model import (
    DriveModel,
    edges_problem,
    with_edges,
)
from swashplate.identification.estimation.fit_problem import Parameters
from swashplate.identification.estimation.model_setup import ModelSetup
from swashplate.identification.estimation.problem import Problem
from swashplate.identification.estimation.solving import solve
from swashplate.identification.noise import LONGEST, Grid, correlation_length, grid_of, pair_sums
from swashplate.parameters import HasParameters, ParameterSet, set_of
from swashplate.results import Result, figures

if TYPE_CHECKING:
    from swashplate.identification.estimation.posterior import Posterior
    from swashplate.results import Figure
Array = NDArray[np.float64]


LONGEST_SHOWN = 2.0
"""Largest lag of the correlation with the input. [s]"""
FEWEST = 8
"""Samples that a test of residuals needs."""

DEVIATIONS = 1.96
"""Half width of the bands, in standard deviations: 95 %."""

FOLLOWS = 0.5
"""Correlation of residuals with the input that counts as model error: a quarter of their square."""
BANDS = 1.35
"""And how many of its 95 % bands it must reach: if a band is wide, about six independent looks
fit into the lags, and the largest of them stays below that."""
STILL = 1e-9
"""Range of a simulated signal over its size, or over the measured range, that is rounding. [1]"""
WHITE = 1.5
"""Standard deviation of a signal over that which its steps from sample to sample show, up to which
it is white noise. [1]"""
SURE = 0.9
"""A correlation from which no band is asked: in short runs of one slow movement it reaches 1."""


@dataclass(frozen=True, eq=False)
class ResidualTest(Result):
    """Correlation of the residuals of one channel of one run, with the input above all."""

    lags: Array
    """(2 m - 1,) positive if the residual comes after the input. [s]"""
    correlation: Array
    """(2 m - 1,) of the residuals with the input."""
    band: float
    """Half width of the 95 % band of residuals, coloured as these are, without relation to the
    input."""
    duration: float
    """Time over which the residuals stay correlated with themselves; 0 if they are white. [s]"""

    @property
    def peak(self) -> tuple[float, float]:
        """Lag of the largest correlation [s], and its value."""
        index = int(np.argmax(np.abs(self.correlation)))
        return float(self.lags[index]), float(self.correlation[index])

    @property
    def follows(self) -> bool:
        """Whether the residuals follow the input by as much as counts as model error."""
        return abs(self.peak[1]) >= min(max(FOLLOWS, BANDS * self.band), SURE)

    @property
    def verdict(self) -> str:
        """Correlation of the residuals with themselves and with the input, in a sentence."""
        lag, value = self.peak
        colour = f"stay correlated over {self.duration:.2g} s" if self.duration else "are white"
        if not self.follows:
            return f"The residuals {colour} and do not follow the input."
        return (
            f"The residuals {colour} and follow the input (correlation {value:+.2f}, {lag:+.2g} s "
            "after it): the model leaves out something that the input causes."
        )


def residual_test(
    time: Array, residual: Array, command: Array, *, longest: float = LONGEST_SHOWN
) -> ResidualTest:
    """Test of the residuals of one channel of one run.

    Parameters
    ----------
    time : (n,) array
        Stamps of the samples that count, at least 8; gaps are respected. [s]
    residual, command : (n,) arrays
        Simulated less measured, weights left out, and the input at the same stamps.
    longest : float
        Largest lag; at most a quarter of the run is looked at. [s]

    Notes
    -----
    The band is 1.96 √(Σ ρ_r ρ_u/n), Bartlett's: two coloured signals without any relation show
    large correlations by chance.
    """
    if time.size < FEWEST:
        raise InputError(f"{time.size} samples show no correlation; at least {FEWEST} are needed.")
    grid = grid_of(time)
    most = max(int(LONGEST * grid.size), 1)
    lags_kept = min(most, max(int(longest / grid.step), 1))
    residual, command = residual - residual.mean(), command - command.mean()
    of_residual, counts = _autocorrelation(residual, grid, most)
    of_command, _ = _autocorrelation(command, grid, most)
    length = correlation_length(of_residual, counts)
    # beyond the residuals' own length their estimated correlation is chance
    lags_within = slice(1, max(length, 1) + 1)
    products_of_both = float(of_residual[lags_within] @ of_command[lags_within])
    inflation = max(1.0, 1.0 + 2.0 * products_of_both)
    band = min(DEVIATIONS * float(np.sqrt(inflation / time.size)), 1.0)
    lags, correlation = (
        np.arange(-lags_kept, lags_kept + 1.0) * grid.step,
        np.zeros(2 * lags_kept + 1),
    )
    scale = float(np.linalg.norm(residual) * np.linalg.norm(command))
    if scale > 0.0:
        size = next_fast_len(grid.size + lags_kept, real=True)
        spectra = rfft(grid.spread(command), size).conj() * rfft(grid.spread(residual), size)
        products = irfft(spectra, size)
        correlation = (
            np.concatenate([products[size - lags_kept :], products[: lags_kept + 1]]) / scale
        )
    return ResidualTest(lags, correlation, band, length * grid.step)


def _autocorrelation(samples: Array, grid: Grid, lags: int) -> tuple[Array, Array]:
    sums, counts = pair_sums(samples, grid, lags)
    means = sums / np.maximum(counts, 1.0)
    if not means[0] > 0.0:
        return np.where(np.arange(lags + 1) == 0, 1.0, 0.0), counts
    return np.clip(means / means[0], -1.0, 1.0), counts


class Measures(NamedTuple):
    """Measures of one channel of one run, or of several together."""

    samples: int
    """Samples that count."""
    rmse: float
    """Root of the mean squared difference, in the channel's unit."""
    spread: float
    """Standard deviation of what was measured, in the channel's unit; 0 of a run in which nothing
    but noise was, and nothing should."""

    @property
    def nrmse(self) -> float | None:
        """RMSE over the measured standard deviation; None if nothing moved."""
        return self.rmse / self.spread if self.spread > 0.0 else None

    @property
    def fit_percent(self) -> float | None:
        """100 (1 - NRMSE); 100 is perfect, 0 no better than the measured mean. [%]"""
        return None if self.nrmse is None else 100.0 * (1.0 - self.nrmse)


def measures(*runs: tuple[Array, Array, Array | None]) -> Measures:
    """Measures of one channel over one run, or over several, about the mean of all.

    Of each run (n,) samples measured and simulated, in the channel's unit, and factors on the
    squared errors, None for none. Those that are 0 say which samples do not count. The others weigh
    nothing here: a window of weight ten would otherwise pass for the whole run. An `InputError`
    says that no sample counts, or one that does is not finite.
    """
    parts = []
    for values, simulated, weight in runs:
        used = np.ones(values.shape, np.bool_) if weight is None else weight > 0.0
        for origin, samples in (("measured", values), ("simulated", simulated)):
            bad = used & ~np.isfinite(samples)
            if bad.any():
                row = int(np.argmax(bad)) + 1
                raise InputError(f"Sample {row} of what was {origin} is not finite; ignore it.")
        parts.append(np.stack([values[used], simulated[used]]))
    measured, errors = np.hstack(parts)
    if not measured.size:
        raise InputError("No sample is used: all are ignored or have weight 0.")
    errors = errors - measured
    mean = float(measured.mean())
    # a constant channel's own mean is off by rounding
    about = measured - mean
    about[np.abs(about) <= 4.0 * np.finfo(np.float64).eps * abs(mean)] = 0.0
    return Measures(
        samples=measured.size,
        rmse=float(np.sqrt(np.mean(errors**2))),
        spread=float(np.sqrt(np.mean(about**2))),
    )


@dataclass(frozen=True, eq=False)
class RunQuality(Result):
    """Errors of the simulation of one channel of one run."""

    experiment: Experiment
    """The run."""
    channel: str
    """Name of its channel."""
    simulated: Array
    """(m,) at the channel's stamps, its free zero included. [unit of the channel]"""
    measures: Measures
    test: ResidualTest | None
    """None if there are too few samples."""
    noise: float = 0.0
    """Standard deviation of a position's noise in a speed made from it.
    [unit of the channel]"""
    left_open: Array | None = field(default=None, repr=False)
    """(m, s) changes of what is simulated for a standard deviation of each independent error that
    the numbers of the machine may have, as of `Posterior.errors_of`; None if nothing is known of
    these. [unit of the channel]"""

    @property
    def residual(self) -> Array:
        """(m,) simulated less measured."""
        return self.simulated - self.experiment[self.channel].values

    def plot(
        self, *, window: tuple[float, float] | None = None, title: str | None = None
    ) -> Figure:
        """Figure of what was measured and what is simulated, and of the residual that is judged.

        As of `swashplate.report.figures.plot_prediction`: of a position also the speed, by which
        the verdict judges it.
        """
        draw = figures().plot_prediction
        return cast("Figure", draw(self, window=window, title=title))


def run_qualities(problem: Problem, vector: Array) -> tuple[RunQuality, ...]:
    """Quality of each channel of each run of a problem at a point."""
    return tuple(
        compared(experiment, name, simulated)
        for number, experiment in enumerate(problem.experiments)
        for name, simulated in problem.outputs(vector, number).items()
        if experiment[name].used.any()
    )


def compared(experiment: Experiment, name: str, simulated: Array) -> RunQuality:
    """Quality of one channel of one run, simulated at its stamps."""
    channel = experiment[name]
    used = channel.used
    test = None
    if np.count_nonzero(used) >= FEWEST:
        time = channel.time[used]
        residual = (simulated - channel.values)[used]
        test = residual_test(time, residual, experiment.input.at(time))
    of_run = measures((channel.values, simulated, channel.weight))
    if _rests(channel.values[used], simulated[used]):
        of_run = of_run._replace(spread=0.0)
    return RunQuality(experiment, name, simulated, of_run, test)


def _rests(measured: Array, simulated: Array) -> bool:
    """Whether a signal stands still, simulated and, but for white noise, measured."""
    if np.ptp(simulated) > STILL * max(float(np.abs(simulated).max()), float(np.ptp(measured))):
        return False
    noise = float(np.diff(measured).std()) / 2.0**0.5 if measured.size > FEWEST else 0.0
    return bool(measured.std() <= WHITE * noise)


def predict(
    model: Parameters | HasParameters,
    experiments: Sequence[Experiment],
    posterior: Posterior | None = None,
) -> tuple[RunQuality, ...]:
    """Predict runs from their input alone and compare every channel that the drive has.

    Parameters
    ----------
    model : Drive, ParameterSet or ModelSetup
        The drive, or a user-defined model with its numbers.
    experiments : sequence of Experiment
        Runs that it was not fitted to. A voltage goes through the whole chain, a current through
        pump and motor.
    posterior : Posterior, optional
        What the fit of a drive leaves open of its numbers, and so of what is predicted.

    Returns
    -------
    tuple of RunQuality
        One for each run and channel. The free zero of a position is the one that fits best; so are,
        within their sample, the instants of a voltage's edges (`InputSignal.edges`).

    Raises
    ------
    InputError
        If a run is driven by neither, or has no channel that a drive has.
    DomainError
        If the model does not hold under a run's input.

    Examples
    --------
    >>> from swashplate import Campaign, Drive, maneuvers, rig
    >>> from swashplate.identification import predict
    >>> file = rig.write(rig.run("hoist", {"step": maneuvers.step(9.0)}), "tests")
    >>> [quality.channel for quality in predict(Drive.preset("hoist"), Campaign.from_toml(file))]
    ['current', 'counts']
    """
    parameters = model if isinstance(model, ModelSetup) else set_of(model)
    if isinstance(parameters, ModelSetup):
        return tuple(
            compared(experiment, name, simulated)
            for experiment in experiments
            for name, simulated in parameters.predicted(experiment).items()
            if experiment[name].used.any()
        )
    qualities = []
    for run in experiments:
        if not any(channel.kind in SIGNALS for channel in run.channels.values()):
            raise InputError(f"{run.name} has no channel that a drive has.")
        drive = DriveModel(parameters)
        left_open = {} if posterior is None else posterior.errors_of(drive, {}, run)
        for name, simulated in drive.simulate({}, at_instants(parameters, run)).items():
            channel = run[name]
            if not channel.used.any():
                continue
            zero = 0.0
            if channel.is_position:
                zero = np.average(channel.values - simulated, weights=channel.weight)
            quality = compared(run, name, simulated + zero)
            qualities.append(replace(quality, left_open=left_open.get(name)))
    return tuple(qualities)


def at_instants(parameters: ParameterSet, experiment: Experiment) -> Experiment:
    """An experiment with the edges of its command where they fit a drive best."""
    edges = edges_problem(parameters, experiment)
    if edges is None:
        return experiment
    return with_edges(experiment, edges.model_values(solve(edges).vector, 0))


def with_speeds(qualities: Iterable[RunQuality]) -> tuple[RunQuality, ...]:
    """The qualities, each of a position followed by that of its speed.

    Measured and simulated positions go through the same filters (`speed_of`, ``"exact"``), so that
    both carry the same phase. What the position's noise is after them is stated as the speed's,
    next to measures that contain it. A position whose stamps no filter takes has no speed, nor has
    one in whose noise the speed drowns.

    Parameters
    ----------
    qualities : iterable of RunQuality
        Of predicted runs, such as `Identification.predicted`.

    Returns
    -------
    tuple of RunQuality
        The channel of a speed is named "speed from" that of the position. [unit of the position/s]
    """
    pairs = list[tuple[RunQuality, RunQuality | None]]()
    for quality in qualities:
        pairs.append((quality, None))
        channel = quality.experiment[quality.channel]
        if not channel.is_position:
            continue
        unread = replace(channel, noise=None, limits=None, encoder=None, counts=None)
        try:
            filtered = speed_of(channel, "exact").speed
            simulated = speed_of(replace(unread, values=quality.simulated), "exact").speed
        except InputError:
            continue
        name, unit = f"speed from {channel.name}", f"{channel.unit}/s"
        noise = _noise_of_speed(quality, simulated)
        speed = replace(unread, name=name, kind="shaft_speed", unit=unit, values=filtered)
        speed = replace(speed, noise=noise)
        run = replace(quality.experiment, channels={**quality.experiment.channels, name: speed})
        # the residuals of a filtered signal are coloured by the filter: there is no test of them
        quality_of_speed = RunQuality(
            experiment=run,
            channel=name,
            simulated=simulated,
            measures=measures((filtered, simulated, speed.weight)),
            test=None,
            noise=noise,
        )
        pairs[-1] = quality, quality_of_speed
    speeds = [of_speed for _, of_speed in pairs if of_speed is not None]
    clean, raw = pooled_measures(speeds, without_noise=True), pooled_measures(speeds)
    clear = {name for name in raw if clean[name].spread ** 2 >= 0.5 * raw[name].spread ** 2}
    return tuple(
        quality
        for pair in pairs
        for quality in pair
        if quality is not None and (quality.channel in clear or quality.channel not in raw)
    )


def _noise_of_speed(quality: RunQuality, speed: Array) -> float:
    """Standard deviation that the noise of a position has after the filters of `speed_of`.

    Of an encoder that of rounding what is simulated, whose speed is given, to whole counts. Of
    another position that of its white noise.
    """
    channel = quality.experiment[quality.channel]
    if channel.encoder is not None and (step := channel.resolution):
        counts_per_step = step / channel.encoder.angle_per_count
        counts = counts_per_step * np.round(quality.simulated / step)
        rounded = speed_of(replace(channel, counts=counts), "exact").speed - speed
        return float(np.sqrt(np.mean(rounded[channel.used] ** 2)))
    pulse = np.zeros(channel.time.size)
    # away from both ends: the filters keep nothing for longer than 0.2 s
    pulse[pulse.size // 2] = 1.0
    return float(_white_noise(quality) * np.linalg.norm(speed_from_angle(channel.time, pulse)))


def _white_noise(quality: RunQuality) -> float:
    """Standard deviation of a channel's white noise and rounding.

    Of noise from third differences of the residuals: they leave nothing of what is smooth, such as
    a model's error, and spikes count little in their median.
    """
    channel = quality.experiment[quality.channel]
    residual = quality.residual[channel.used]
    steps = np.abs(np.diff(channel.values[channel.used]))
    if residual.size < FEWEST or not steps.any():
        return 0.0
    # 20 = 1 + 9 + 9 + 1, and the median of a normal magnitude is 0.6745 standard deviations
    white = np.median(np.abs(np.diff(residual, 3))) / (0.6745 * np.sqrt(20.0))
    return float(max(white, steps[steps > 0.0].min() / np.sqrt(12.0)))


def pooled_measures(
    qualities: Iterable[RunQuality], *, without_noise: bool = False
) -> dict[str, Measures]:
    """Measures over all runs of each channel, by its name.

    Without noise, what a position's noise is in a speed made from it counts neither as error nor as
    movement; of the error at least what the noise's own scatter leaves open remains.
    """
    channels: dict[str, list[RunQuality]] = {}
    for quality in qualities:
        channels.setdefault(quality.channel, []).append(quality)
    by_channel = {}
    for name, of_channel in channels.items():
        of_runs = []
        for quality in of_channel:
            channel = quality.experiment[name]
            of_runs.append((channel.values, quality.simulated, channel.weight))
        together = measures(*of_runs)
        if without_noise and any(quality.noise for quality in of_channel):
            square, scatter = _noise_square(of_channel)
            rmse = max(together.rmse**2 - square, min(scatter, together.rmse**2))
            spread = max(together.spread**2 - square, 0.0)
            together = together._replace(rmse=rmse**0.5, spread=spread**0.5)
        by_channel[name] = together
    return by_channel


def _noise_square(qualities: Sequence[RunQuality]) -> tuple[float, float]:
    """Mean square of the noise of a channel over some runs, and that one's standard error."""
    square = samples = values = 0.0
    for quality in qualities:
        channel = quality.experiment[quality.channel]
        count = float(np.count_nonzero(channel.used))
        samples += count
        if quality.noise:
            # the filters pass noise of up to 30 Hz or so: twice as many independent values a second
            bandwidth = float(np.median(np.diff(channel.time))) * DIFFERENTIATOR / np.pi
            values += min(bandwidth, 1.0) * count
            square += count * quality.noise**2
        else:
            values += count
            square += count * _white_noise(quality) ** 2
    mean = square / samples
    return mean, mean * float(np.sqrt(2.0 / values))


def range_of(qualities: Sequence[RunQuality]) -> float:
    """Largest less smallest value that was measured of a channel in some runs."""
    channels = [quality.experiment[quality.channel] for quality in qualities]
    used = [channel.values[channel.used] for channel in channels]
    return max(float(values.max()) for values in used) - min(float(values.min()) for values in used)


def percent(part: float) -> str:
    """A part in per cent, two digits."""
    number = 100.0 * part
    return f"{number:.0f} %" if number >= 9.95 else f"{number:.2g} %"


def input_correlations(qualities: Sequence[RunQuality], name: str) -> tuple[int, list[float]]:
    """Runs of a channel that were tested, and correlations of those that follow the input."""
    tests = [
        quality.test
        for quality in qualities
        if quality.channel == name and quality.test is not None
    ]
    return len(tests), [test.peak[1] for test in tests if test.follows]


def ignored_windows(channel: Channel) -> tuple[tuple[float, float], ...]:
    """First and last instant of each stretch of a channel that does not count. [s]"""
    edges = np.flatnonzero(np.diff(~channel.used, prepend=False, append=False)).reshape(-1, 2)
    return tuple((float(channel.time[a]), float(channel.time[b - 1])) for a, b in edges)
