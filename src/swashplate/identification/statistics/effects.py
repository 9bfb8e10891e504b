"""What estimates depend on besides noise: fixed numbers, instruments, runs that differ.

Estimates absorb such an effect, so that residuals do not show it. How far they move is linear in
it: a standard uncertainty of each effect, times this slope, goes into the intervals (JCGM 100:2008,
section 5).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import hypot, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign import Channel, Experiment, resolution_of_inputs
from swashplate.identification.estimation.drive_model import (
    CURRENTS,
    DriveModel,
    measured_current,
    simulated_current,
)
from swashplate.identification.estimation.model import MachineModel, simulated
from swashplate.identification.estimation.model import linearised as linearised_model
from swashplate.identification.estimation.problem import LinearisedFit, LinearisedRun
from swashplate.identification.optimum import Optimum
from swashplate.results import Result

Array = NDArray[np.float64]
Changes = Mapping[str, Array]
"""Changes of the residuals of one run, (m,) by channel. [unit]"""

IN_RUN = " in "
"""What stands between an effect and the only run that it belongs to."""
HYSTERESIS = ("solenoid_hysteresis", "spool_friction")
"""Parameters by which a drive has a hysteresis of its own."""
ROUNDING = 1e-9
"""Noise of a command, over its largest value, that is rounding. [1]"""
WINDOW, AT_REST, CALMEST = 50, 0.02, 0.1
"""Samples over which a command is looked at, part of its range by which it moves at most at rest,
and the share of such windows that say how large its noise is. [1]"""
FEWEST_RUNS = 5
"""Runs from which it is estimated by how much they differ."""


# --- models and fixed numbers ---------------------------------------------------------------------


def source_of(fit: Optimum) -> Callable[[Experiment], MachineModel]:
    """The model of a run: the whole chain if the drive's own card drives the pump."""
    model = fit.problem.model
    if not isinstance(model, DriveModel):
        return lambda experiment: model
    part_model, chain = (
        replace(model, parameters=fit.drive.parameters, part=part) for part in (model.part, "chain")
    )
    by_card = model.part == "pump" and fit.setup.current == "simulated"
    return lambda run: chain if by_card and run.input.kind == "voltage" else part_model


def slopes_by(fit: Optimum, uncertain: Sequence[Mapping[str, float]]) -> Array:
    """(K, F) changes of the estimates if fixed numbers, by column, change together by these."""
    names = [name for together in uncertain for name in together]
    if not names:
        return np.zeros((len(fit.linearised.variables), 0))
    deviations = np.array([[change.get(name, 0.0) for change in uncertain] for name in names])
    return _slopes_by_names(fit, names, deviations)


def _slopes_by_names(fit: Optimum, names: Sequence[str], by: Array) -> Array:
    """(K, F) derivatives of the estimates, from those (names, F) of the model's numbers."""
    problem, vector, linearised = fit.problem, fit.solution.vector, fit.linearised
    products, source = np.zeros((linearised.rank, by.shape[1])), source_of(fit)
    jacobians = linearised.jacobians()
    for number, experiment in enumerate(problem.experiments):
        values = problem.model_values(vector, number)
        response = linearised_model(source(experiment), values, experiment, names)
        directions, whitening = linearised.inverse.of_run(experiment.name)
        for name, weight in problem.weights[number].items():
            used = weight > 0.0
            if used.any():
                changes = weight[used, None] * (response[name].by[used] @ by)
                _, jacobian = next(jacobians)
                products[directions] += whitening.T @ (jacobian.T @ changes)
    slopes: Array = -linearised.whitening @ products
    return slopes


def effect_of_fixed(together: Mapping[str, float]) -> str:
    """Name of the effect of fixed numbers that are off together."""
    return f"uncertainty of {', '.join(together)}"


# --- instruments, and what the model leaves out ---------------------------------------------------


class Change(NamedTuple):
    """A run as it would be if one effect were larger by a standard uncertainty."""

    effect: str
    """In words; effects of one name in several runs are one."""
    experiment: Experiment
    """The run, its command or what was measured changed."""


def changes_of(experiment: Experiment, resolution: float) -> Iterator[Change]:
    """A run with each effect of its instruments in turn.

    Parameters
    ----------
    experiment : Experiment
    resolution : float
        Step of the command's converter, in the input's unit; 0 if there is none.

    Notes
    -----
    Limits of an instrument's error are taken for ends of a rectangular distribution, whose standard
    deviation is 1/√3 of them (JCGM 100:2008, 4.3.7). The zero of a command is another one in each
    run, because the converter rounds each of its levels again. What a command does between samples
    is known to half of the time between them: the instant of a jump, or when a staircase that looks
    like a ramp passes a threshold. A reading with noise passes a threshold before the command does,
    by about the standard deviation of the noise, in all runs and both ways.
    """
    command, run = experiment.input, experiment.name
    accuracy = command.instrument
    interval = float(np.median(np.diff(command.time)))
    late = 0.5 * interval if accuracy.time is None else accuracy.time
    if late > 0.0:
        later = replace(command, time=command.time + late / sqrt(3.0))
        yield Change(f"instant of the command{IN_RUN}{run}", replace(experiment, input=later))
    steps = resolution / sqrt(12.0) if accuracy.rounded else 0.0
    zero = hypot(accuracy.zero / sqrt(3.0), steps)
    # a card takes no more than its full voltage, which a command may have reached
    largest = float(np.abs(command.values).max())
    if zero > 0.0:
        # all of it: a part may just pass a sample over the jump of the current, which is no slope
        shifted = np.clip(command.values + zero, -largest, largest)
        shifted_command = replace(command, values=shifted)
        yield Change(
            f"zero of the command{IN_RUN}{run}", replace(experiment, input=shifted_command)
        )
    # what rounding makes counts as the zero
    noise = sqrt(max(_noise(command.values) ** 2 - resolution**2 / 12.0, 0.0))
    if noise > ROUNDING * largest:
        noisier = np.clip(command.values + noise * np.sign(command.values), -largest, largest)
        noisy_command = replace(command, values=noisier)
        yield Change("noise of the command", replace(experiment, input=noisy_command))
    if accuracy.gain > 0.0:
        weaker = replace(command, values=command.values * (1.0 - accuracy.gain / sqrt(3.0)))
        yield Change("gain of the command", replace(experiment, input=weaker))
    for name, channel in experiment.channels.items():
        accuracy = channel.instrument
        readings = dict[str, Channel]()
        if accuracy.gain > 0.0:
            larger = channel.values * (1.0 + accuracy.gain / sqrt(3.0))
            readings["gain"] = replace(channel, values=larger)
        if accuracy.zero > 0.0 and not channel.is_position:
            readings["zero"] = replace(channel, values=channel.values + accuracy.zero / sqrt(3.0))
        if accuracy.time:
            readings["stamps"] = replace(channel, time=channel.time + accuracy.time / sqrt(3.0))
        for what, reading in readings.items():
            channels = {**experiment.channels, name: reading}
            yield Change(f"{what} of {name}", replace(experiment, channels=channels))


def _noise(values: Array) -> float:
    """Standard deviation of white noise in (n,) readings of a command, where that rests; 0 if not.

    A controller's steps on a ramp are no noise, nor is a motion of the stick.
    """
    windows = values[: values.size // WINDOW * WINDOW].reshape(-1, WINDOW)
    resting = windows[np.ptp(windows, axis=1) < AT_REST * np.ptp(values)]
    if not resting.size:
        return 0.0
    # 20 = 1 + 9 + 9 + 1, of the squares of a third difference
    squares = np.mean(np.diff(resting, 3, axis=1) ** 2, axis=1) / 20.0
    return sqrt(float(np.quantile(squares, CALMEST)))


def after_play(values: Array, width: float) -> Array:
    """A signal downstream of a play of a full width, in the middle of which it begins."""
    output, half = np.empty_like(values), 0.5 * width
    follower = values[0]
    for n, value in enumerate(values.tolist()):
        follower = min(max(follower, value - half), value + half)
        output[n] = follower
    return output


def responses(fit: Optimum, number: int, resolution: float) -> Iterator[tuple[str, Changes]]:
    """By what the residuals of one run would change, effect by effect.

    Each is the change of (simulated less measured), by channel, for a standard uncertainty of the
    effect. `resolution` as of `changes_of`.
    """
    experiment = fit.problem.experiments[number]
    simulation = SimulatedRun(fit, number)
    middle = simulation.of(experiment)
    for effect, changed in changes_of(experiment, resolution):
        changed_signals = simulation.of(changed) if _acts(fit, experiment, changed) else middle
        yield (
            effect,
            {
                name: changed_signals[name] - middle[name] - changed[name].values + channel.values
                for name, channel in experiment.channels.items()
                if name in middle
            },
        )
    if late := simulation.behind_hysteresis(experiment):
        yield "hysteresis of the current", late


def _acts(fit: Optimum, experiment: Experiment, changed: Experiment) -> bool:
    """Whether a change acts on what is simulated, and not only on what was measured."""
    model = fit.problem.model
    if changed.input is not experiment.input or not isinstance(model, DriveModel):
        return True  # a user-defined model may take any channel as an input
    if model.part == "pump" and fit.setup.current == "measured":
        return True
    return any(
        changed[name].time is not channel.time for name, channel in experiment.channels.items()
    )


class SimulatedRun:
    """One run of a fit with the numbers that were found, changed or not."""

    def __init__(self, fit: Optimum, number: int) -> None:
        self.fit, self.source = fit, source_of(fit)
        self.values = fit.problem.model_values(fit.solution.vector, number)

    def of(self, experiment: Experiment) -> Mapping[str, Array]:
        """The samples of each channel that the model has. [unit]"""
        model = self.source(experiment)
        if isinstance(model, DriveModel) and model.part == "pump":
            current = measured_current(experiment, self.fit.setup.current_scale)
            model = replace(model, currents={experiment.name: current})
        return simulated(model, self.values, experiment)

    def behind_hysteresis(self, experiment: Experiment) -> dict[str, Array]:
        """By how much these change if the current that drives the pump has a hysteresis.

        Of a drive only; empty if no pump is fitted, the hysteresis is 0, or the drive has one
        of its own.
        """
        model, width = self.fit.problem.model, self.fit.setup.current_hysteresis
        if not isinstance(model, DriveModel) or model.part == "card" or width == 0.0:
            return {}
        parameters = self.fit.drive.parameters
        if any(parameters.numbers.get(name) for name in HYSTERESIS):
            return {}
        if self.fit.setup.current == "measured" or experiment.input.kind == "current":
            current = measured_current(experiment, self.fit.setup.current_scale)
        else:
            current = simulated_current(experiment, parameters)
        late = replace(current, values=after_play(current.values, width))
        pump = replace(model, parameters=parameters, part="pump")
        without_hysteresis, with_hysteresis = (
            simulated(replace(pump, currents={experiment.name: record}), self.values, experiment)
            for record in (current, late)
        )
        return {
            name: with_hysteresis[name] - without_hysteresis[name] for name in without_hysteresis
        }


# --- all effects ----------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class RunToRun(Result):
    """By how much the motion's scale differs from run to run, and how the estimates follow it."""

    deviation: float
    """Standard deviation of the scale. [1]"""
    slopes: Array
    """(K, R) changes of the solver's vector if the scale of one run is a deviation larger."""
    degrees_of_freedom: float


@dataclass(frozen=True, eq=False)
class Effects(Result):
    """What estimates depend on besides noise."""

    systematic: Mapping[str, Array]
    """(K,) changes of the solver's vector for a standard uncertainty of each effect, by name."""
    runs: RunToRun | None = None
    """None for fewer than `FEWEST_RUNS` runs with a motion, or runs that do not differ."""


def effects_of(fit: Optimum) -> Effects:
    """Effects of the instruments, of what the model leaves out, and of runs that differ."""
    linearised, problem = fit.linearised, fit.problem
    products, motions = dict[str, Array](), list[_Motion]()
    resolution = resolution_of_inputs([run.input for run in problem.experiments])
    jacobians = linearised.jacobians()
    for number in range(len(problem.experiments)):
        run = RunParts(fit, number, jacobians)
        for effect, changes in responses(fit, number, resolution):
            products[effect] = products.get(effect, 0.0) + run.along(changes)
        if motion := motion_of(fit, number):
            motions.append(run.motion(motion))
    systematic = {effect: -linearised.whitening @ product for effect, product in products.items()}
    return Effects(systematic, _run_to_run(linearised, motions))


class _Motion(NamedTuple):
    """A run's own motion z, as a change of its residuals by a scale of 1."""

    square: float
    """zᵀ z"""
    product: float
    """zᵀ r, with the run's residuals."""
    along: Array
    """(rank,) Wᵀ Jᵀ z"""


class RunParts:
    """The channels of one run at the optimum that have a sample which counts."""

    def __init__(
        self, fit: Optimum, number: int, jacobians: Iterator[tuple[LinearisedRun, Array]]
    ) -> None:
        self.rank, inverse = fit.linearised.rank, fit.linearised.inverse
        self.directions, self.whitening = inverse.of_run(fit.problem.experiments[number].name)
        self.weights = {
            name: weight
            for name, weight in fit.problem.weights[number].items()
            if (weight > 0.0).any()
        }
        self.parts = {name: next(jacobians) for name in self.weights}

    def weighted(self, changes: Changes) -> Iterator[tuple[LinearisedRun, Array, Array]]:
        """Each channel that changes, its derivatives, and its weighted changes."""
        for name, weight in self.weights.items():
            if name in changes:
                used = weight > 0.0
                run, jacobian = self.parts[name]
                yield run, jacobian, weight[used] * changes[name][used]

    def along(self, changes: Changes) -> Array:
        """(rank,) Wᵀ Jᵀ times changes of the residuals."""
        product = np.zeros(self.rank)
        for _, jacobian, change in self.weighted(changes):
            product[self.directions] += self.whitening.T @ (jacobian.T @ change)
        return product

    def motion(self, changes: Changes) -> _Motion:
        """The run's motion with what belongs to it."""
        square = product = 0.0
        for run, _, change in self.weighted(changes):
            square += float(change @ change)
            product += float(change @ run.residual)
        return _Motion(square, product, self.along(changes))


def motion_of(fit: Optimum, number: int) -> Changes:
    """What a run moves by, by channel: positions from their first sample on; no currents. [unit]"""
    experiment = fit.problem.experiments[number]
    samples = SimulatedRun(fit, number).of(experiment)
    motion = dict[str, Array]()
    for name, values in samples.items():
        channel = experiment[name]
        if channel.kind not in CURRENTS:
            motion[name] = values - values[0] if channel.is_position else values
    return motion


def _run_to_run(fit: LinearisedFit, motions: Sequence[_Motion]) -> RunToRun | None:
    """By how much runs differ in the scale of their motion.

    Notes
    -----
    A machine differs from run to run: its oil is warmer, a pressure is set again. What of that is a
    scale of the motion, by b_i in run i, shows in the products q_i = z_iᵀ r. At the optimum
    q = A b + noise with A = ZᵀZ - ZᵀJ (JᵀJ)⁻¹ JᵀZ. The variance of b is that of the method of
    moments (Henderson 1953): the sum of the q², each in units of |z_i|, less what the noise adds
    to it, over the trace of A², in these units. Degrees of freedom are Satterthwaite's.
    """
    motions = [motion for motion in motions if motion.square > 0.0]
    if len(motions) < FEWEST_RUNS:
        return None
    sizes = np.sqrt([motion.square for motion in motions])
    along = np.array([motion.along for motion in motions])
    products = np.array([motion.product for motion in motions]) / sizes
    matrix = (np.diag(sizes**2) - along @ along.T) / sizes[:, None]
    squares = np.linalg.eigvalsh(matrix @ matrix.T)
    noise = fit.squares / fit.spare_samples * float(np.trace(matrix / sizes))
    variance = (float(products @ products) - noise) / float(squares.sum())
    if not variance > 0.0:
        return None
    deviation = sqrt(variance)
    freedom = float(squares.sum() ** 2 / np.sum(squares**2))
    return RunToRun(deviation, -deviation * fit.whitening @ along.T, freedom)
