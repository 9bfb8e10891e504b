"""Design of experiments for user-defined models: which tests of a campaign tell, which comes next.

The same as `experiment_design` does for drives; what is measured and how well is that of the runs.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from swashplate.campaign import Experiment, SignalOrigin
from swashplate.errors import InputError
from swashplate.identification.estimation.arrow import triangular_factor
from swashplate.identification.estimation.model_setup import ModelSetup
from swashplate.identification.estimation.problem import linearised_fit
from swashplate.identification.estimation.unknowns import Unknowns
from swashplate.identification.statistics.experiment_design import (
    RATE,
    CandidateTest,
    RunInformation,
    Sensor,
    machine_rows,
    machine_unknowns,
    sensor_of_residuals,
)
from swashplate.machine.marching import even_rate
from swashplate.maneuvers import Maneuver, multisine, sine, stairs, step
from swashplate.results import Result

Array = NDArray[np.float64]
SHARES = (0.2, 0.5, 0.9)
"""Parts of the largest command of the usual tests. [1]"""
SLOW, FAST = 3.0, 12.0
"""Cycles of the usual sines in the length of a run. [1]"""
ONE_WAY = 0.05
"""Part of the range of the input up to which it is taken to go one way only. [1]"""


def model_run_information(setup: ModelSetup, experiments: Sequence[Experiment]) -> RunInformation:
    """What runs can tell of the unknowns of a user-defined model, at its nominal values.

    Raises as `ModelSetup.problem`, and a `DomainError` if the model does not hold there.
    """
    problem = setup.problem(experiments)
    return RunInformation(problem, linearised_fit(problem, problem.start))


@dataclass(frozen=True, eq=False)
class ModelPriorInformation(Result):
    """A user-defined model, what is to be found of it, and what is known before the next test."""

    setup: ModelSetup
    variables: Unknowns
    """The model's unknowns, those of single runs left out."""
    present: Array
    """(m, K) what the runs made so far tell, in noise's deviations."""
    sensors: Mapping[str, Sensor]
    """What is measured, by channel."""
    run: Experiment
    """A run whose instruments a further test has."""
    rate: float
    """Samples a second of a further test. [Hz]"""
    constants: Mapping[str, float]
    """Means of the channels that the model takes as inputs."""

    def candidate(self, maneuver: Maneuver) -> CandidateTest:
        """A test under a maneuver, all other inputs at their mean; free zeros are spent."""
        # what is known beforehand counts once, not once a test
        free = {name: replace(unknown, prior=None) for name, unknown in self.setup.free.items()}
        imagined = self._imagined(maneuver)
        problem = replace(self.setup, free=free, channels=tuple(self.sensors)).problem([imagined])
        rows = triangular_factor(machine_rows(problem))
        return CandidateTest(maneuver.name, rows, maneuver.length)

    def _imagined(self, maneuver: Maneuver) -> Experiment:
        """A test that has not been made: of what it measures only the stamps count."""
        time = maneuver.time(self.rate)
        channels = {}
        for name, channel in self.run.channels.items():
            if name not in (*self.sensors, *self.constants):
                continue
            sensor = self.sensors.get(name)
            channels[name] = replace(
                channel,
                time=time,
                values=np.full(time.size, self.constants.get(name, 0.0)),
                weight=np.ones(time.size),
                counts=None,
                noise=sensor.deviation(1.0 / self.rate) if sensor else channel.noise,
            )
        moved = replace(
            self.run.input,
            time=time,
            values=maneuver.sample(self.rate),
            interpolation="previous" if self.run.input.is_held else "linear",
            source=SignalOrigin(Path("none"), self.run.input.kind),
        )
        return replace(
            self.run,
            name=maneuver.name,
            run=maneuver.name,
            input=moved,
            channels=channels,
            ignored=(),
        )


def model_prior_information(
    setup: ModelSetup, experiments: Sequence[Experiment], *, fitted: bool = False
) -> ModelPriorInformation:
    """What is known of a user-defined model before the next test.

    If its nominal values are `fitted` to these runs, noise and its colour are those of the
    residuals; else noise is as stated, correlated over `MEMORY`.

    Raises
    ------
    InputError
        If there is no run, or a fitted model leaves residuals that are zero, or too large to be
        noise.
    """
    if not experiments:
        raise InputError(f"{setup.name}: there is no run whose instruments a further test has.")
    problem = setup.problem(experiments)
    fit = linearised_fit(problem, problem.start) if fitted else None
    scales, sensors = dict[str, float](), dict[str, Sensor]()
    for name in problem.channels:
        channels = [run[name] for run in problem.experiments if name in run.channels]
        interval = float(np.median(np.concatenate([np.diff(each.time) for each in channels])))
        sensor = Sensor(channels[0].kind, problem.scales[name], origin="as in the campaign")
        if fit is not None:
            sensor = sensor_of_residuals(fit, channels, sensor, interval)
        # one sample in each `memory` is independent: the others are worth nothing
        scales[name] = sensor.deviation(interval)
        sensors[name] = sensor
    run = max(problem.experiments, key=lambda each: len(each.channels))
    others = [name for name in run.channels if name not in sensors]
    return ModelPriorInformation(
        setup=setup,
        variables=machine_unknowns(problem),
        present=machine_rows(replace(problem, scales=scales)),
        sensors=sensors,
        run=run,
        rate=even_rate(run.input.time) or RATE,
        constants={name: float(np.mean(run[name].values)) for name in others},
    )


def usual_maneuvers(experiments: Sequence[Experiment]) -> tuple[Maneuver, ...]:
    """Small and large, slow and fast, within the range and the length of the runs made so far."""
    ranges = [
        run.input.limits or (float(run.input.values.min()), float(run.input.values.max()))
        for run in experiments
    ]
    rates = [even_rate(run.input.time) or RATE for run in experiments]
    durations = [float(np.ptp(run.input.time)) for run in experiments]
    # whole samples, and a tenth of it too
    length = max(round(float(np.median(durations)) * rates[0] / 10.0), 1) * 10.0 / rates[0]
    unit = "" if experiments[0].input.unit == "1" else experiments[0].input.unit
    span = max(abs(end) for ends in ranges for end in ends)
    ways = {
        1.0: max((max(high, 0.0) for _, high in ranges), default=0.0),
        -1.0: max((max(-low, 0.0) for low, _ in ranges), default=0.0),
    }
    ways = {sign: most for sign, most in ways.items() if most > ONE_WAY * span}
    window = {"start": 0.1 * length, "stop": 0.6 * length, "length": length}

    def called(maneuver: Maneuver, words: str) -> Maneuver:
        return replace(maneuver, name=words.replace("  ", " ").strip())

    def rounded(value: float) -> float:
        return float(f"{value:.3g}")

    usual = list[Maneuver]()
    for share in SHARES:
        for sign, most in ways.items():
            level = rounded(sign * share * most)
            usual.append(called(step(level, **window), f"step {level:g} {unit}"))
    for sign, most in ways.items():
        levels = [rounded(sign * share * most) for share in (0.25, 0.5, 0.75, 1.0)]
        climb = stairs([*levels, *levels[-2::-1], 0.0], 0.1 * length, start=0.1 * length)
        usual.append(called(climb, f"stairs to {levels[-1]:g} {unit} and back"))
    if len(ways) == len((1.0, -1.0)):
        smaller = min(ways.values())
        for share in SHARES:
            for cycles in (SLOW, FAST):
                size, frequency = rounded(share * smaller), rounded(cycles / length)
                wave = sine(size, frequency, start=0.0, settle=None, length=length)
                usual.append(called(wave, f"sine {size:g} {unit}, {frequency:g} Hz"))
        size = rounded(SHARES[-1] * smaller)
        band = (SLOW / length, 10.0 * FAST / length, 8)
        many = multisine(size, band, start=0.0, settle=None, length=length)
        words = f"multisine {size:g} {unit}, {band[0]:.2g} to {band[1]:.2g} Hz"
        usual.append(called(many, words))
    return tuple(usual)
