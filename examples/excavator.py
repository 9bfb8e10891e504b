"""Two models of an excavator's cylinders, fitted to some trials and scored on the ones left out.

    .venv/bin/python examples/excavator.py DATA [--figure excavator.png]

DATA is a folder with the trials of github.com/mitchallain/BeagleBone-excavator, tests/data, driven
by three people. The command is a duty cycle in %, the output the position of a cylinder. For each
of the three cylinders and each trial, a model is fitted to the other trials and predicts this one,
set to the measured position every five seconds:

- the packaged drive "neutral": a dead zone and a gain each way, a lag and a delay;
- a valve of one's own equations, `Valve` below.

docs/own-models.md tells the story and keeps the table that this prints.
"""

import argparse
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure
from numba import njit

from swashplate import Campaign, Drive
from swashplate.campaign.experiment import Channel, Experiment, InputSignal
from swashplate.identification.drive_model import DriveModel
from swashplate.identification.measures import measures
from swashplate.identification.model import Differentiable, Linearised, Model, linearised, simulated
from swashplate.identification.problem import Problem
from swashplate.identification.solving import solve
from swashplate.identification.starts import sobol_starts
from swashplate.identification.unknowns import Prior, Unknown, Unknowns

# %% What is given
CAMPAIGN = Path(__file__).with_name("excavator.toml")
ANCHOR = 5.0  # what is predicted is set to the measured position this often [s]
NOISE = 0.003  # what one unit of residual is [m]
STEP = 0.02  # of the march [s]
STROKE = 0.04  # half the stroke that a cylinder uses, roughly [m]
MIDDLE = {"boom": 0.088, "stick": 0.080, "bucket": 0.060}  # of that stroke [m]

STRAIGHT_LINE = Unknowns(
    (
        Unknown("V_dz_plus", 1.0, 0.0, 2.0, "%"),
        Unknown("V_dz_minus", 1.0, 0.0, 2.0, "%"),
        Unknown("G1_plus", 0.02, 0.002, 0.5, "m/s/%", log=True),
        Unknown("G1_minus", 0.02, 0.002, 0.5, "m/s/%", log=True),
        Unknown("Z8", 15.0, 2.0, 200.0, "1/s", log=True),
        Unknown("tau", 0.08, 0.0, 0.3, "s"),
    )
)


def known(mean: float, deviation: float) -> Prior:
    """What was known beforehand; a window of 95 samples tells no more than one of them."""
    return Prior(mean, deviation / np.sqrt(95.0))


# Dead zones of 0.6 to 1.5 % duty and delays near 0.1 s stand in the description of the data; the
# rest is known by its order.
VALVE = Unknowns(
    (
        Unknown("delay", 0.1, 0.0, 0.3, "s", prior=known(0.1, 0.03)),
        Unknown("lag", 0.06, 0.005, 0.5, "s", log=True, prior=known(0.06, 0.5)),
        Unknown("overlap +", 1.05, 0.1, 1.9, "%", prior=known(1.05, 0.25)),
        Unknown("overlap -", 1.05, 0.1, 1.9, "%", prior=known(1.05, 0.25)),
        Unknown("width", 0.3, 0.02, 1.5, "%", log=True, prior=known(0.3, 0.5)),
        Unknown("speed +", 0.022, 0.005, 0.12, "m/s", log=True, prior=known(0.022, 0.4)),
        Unknown("speed -", 0.022, 0.005, 0.12, "m/s", log=True, prior=known(0.022, 0.4)),
        Unknown("slope", 0.0, -0.6, 0.6, "1", prior=known(0.0, 0.1)),
    )
)


# %% The valve
@njit(cache=True)
def flow(opening: float, overlap: float, width: float) -> float:
    """Share of the full flow [1]: none within the overlap, then more, up to what the pump has."""
    return 1.0 - np.exp(-max(opening - overlap, 0.0) / width)


@njit(cache=True)
def rod_position(command, lag, overlaps, width, speeds, slope, start, middle):
    """Position of the rod [m] at the edges of the steps."""
    position = np.full(command.size + 1, start)
    opening, share = 0.0, 1.0 - np.exp(-STEP / lag)
    for k in range(command.size):
        opening += share * (command[k] - opening)
        load = slope * (position[k] - middle) / STROKE
        out = speeds[0] * flow(opening, overlaps[0], width) * (1.0 - load)
        back = speeds[1] * flow(-opening, overlaps[1], width) * (1.0 + load)
        position[k + 1] = position[k] + STEP * (out - back)
    return position


class Valve(NamedTuple):
    """A servo that turns a rotary valve: delay, lag, overlap, flow that saturates, a load."""

    middle: float
    """Of the stroke: the load is counted from there. [m]"""
    starts: Mapping[str, float]
    """Where the rod is at the first sample, by experiment. [m]"""

    def simulate(
        self, values: Mapping[str, float], experiment: Experiment
    ) -> Mapping[str, np.ndarray]:
        """Position of the rod [m]."""
        channel, first = experiment["position"], experiment.input.time[0]
        steps = int(np.ceil((channel.time[-1] - first) / STEP))
        edges = first + STEP * np.arange(steps + 1)
        position = rod_position(
            mean_command(experiment.input, edges - values["delay"]),
            values["lag"],
            (values["overlap +"], values["overlap -"]),
            values["width"],
            (values["speed +"], values["speed -"]),
            values["slope"],
            self.starts[experiment.name],
            self.middle,
        )
        return {"position": np.interp(channel.time, edges, position)}


def mean_command(command: InputSignal, edges: np.ndarray) -> np.ndarray:
    """Mean of a held command between the edges: smooth in a delay, which samples are not."""
    held = command.values[:-1] * np.diff(command.time)
    integral = np.interp(edges, command.time, np.concatenate([[0.0], np.cumsum(held)]))
    integral += command.values[-1] * np.maximum(edges - command.time[-1], 0.0)
    return np.diff(integral) / np.diff(edges)


# %% Re-anchored to the measurement
# A position is the integral of a speed, so a small error of the speed grows without end, and the
# RMSE of a long run says more about its length than about the model. Counted from the measured
# position at the beginning of each window, runs of any length are comparable.
def since_anchor(channel: Channel, rows: np.ndarray) -> np.ndarray:
    """Rows of a time series less the row at the first sample of each window that counts."""
    windows = (channel.time - channel.time[0]) // ANCHOR
    counting = np.flatnonzero(channel.used)
    first = np.searchsorted(windows, windows)
    if not counting.size:
        return rows - rows[first]
    held = np.minimum(np.searchsorted(windows[counting], windows), counting.size - 1)
    candidate = counting[held]
    return rows - rows[np.where(windows[candidate] == windows, candidate, first)]


def anchored(experiment: Experiment) -> Experiment:
    """An experiment whose position says how far it moved since the last anchor."""
    channel = experiment["position"]
    moved = replace(channel, values=since_anchor(channel, channel.values))
    return replace(experiment, channels={**experiment.channels, "position": moved})


def anchored_model(model: Model) -> Model:
    """A model that runs freely, of which only what it moves since the anchor is compared."""
    return (DifferentiableAnchored if isinstance(model, Differentiable) else Anchored)(model)


@dataclass(frozen=True)
class Anchored:
    """See `anchored_model`."""

    model: Model

    def simulate(
        self, values: Mapping[str, float], experiment: Experiment
    ) -> Mapping[str, np.ndarray]:
        """Motion since the last anchor [m]."""
        position = simulated(self.model, values, experiment)["position"]
        return {"position": since_anchor(experiment["position"], position)}


@dataclass(frozen=True)
class DifferentiableAnchored(Anchored):
    """The same with derivatives."""

    def linearise(
        self, values: Mapping[str, float], experiment: Experiment, names: Sequence[str]
    ) -> Mapping[str, Linearised]:
        """Motion since the last anchor with its derivatives."""
        channel = experiment["position"]
        output = linearised(self.model, values, experiment, names)["position"]
        return {"position": Linearised(*(since_anchor(channel, rows) for rows in output))}


# %% Fitted to some trials, scored on another
class Score(NamedTuple):
    """What two models make of a trial that neither was fitted to."""

    actuator: str
    trial: str
    moved: float
    """RMS of the motion since the last anchor. [m]"""
    line: float
    """RMSE of the straight-line drive. [m]"""
    valve: float
    """RMSE of the valve. [m]"""


def fitted(
    model: Model, experiments: Sequence[Experiment], unknowns: Unknowns, starts: int
) -> dict[str, float]:
    """Values of the unknowns, the best of several starts."""
    problem = Problem(
        anchored_model(model),
        tuple(anchored(each) for each in experiments),
        unknowns,
        ("position",),
        {"position": NOISE},
    )
    begin = [problem.start, *sobol_starts(problem, starts - 1, seed=1)]
    found = [solve(problem, each, loss="soft_l1", tolerance=1e-4) for each in begin]
    return unknowns.values(min(found, key=lambda each: each.cost).vector)


def error(model: Model, values: Mapping[str, float], experiment: Experiment) -> float:
    """RMSE of the re-anchored position [m]."""
    measured = anchored(experiment)["position"]
    simulated = anchored_model(model).simulate(values, experiment)
    return measures(measured.values, simulated["position"], measured.weight).rmse


def models_for(axis: str, tests: Campaign) -> tuple[tuple[Model, Unknowns, int], ...]:
    """The two models, their unknowns and how many starts their fit takes."""
    line = DriveModel(Drive.preset("neutral").parameters)
    starts = {each.name: float(each["position"].values[0]) for each in tests}
    return (line, STRAIGHT_LINE, 2), (Valve(MIDDLE[axis], starts), VALVE, 1)


def scores(tests: Campaign) -> Iterator[Score]:
    """Each actuator and trial, predicted by fits to the other trials."""
    for axis in tests.axes:
        experiments = tests.select(axis=axis)
        for left_out in experiments:
            others = [each for each in experiments if each is not left_out]
            rmse = [
                error(model, fitted(model, others, unknowns, starts), left_out)
                for model, unknowns, starts in models_for(axis, tests)
            ]
            moved = anchored(left_out)["position"].values
            yield Score(axis, left_out.run, float(np.sqrt(np.mean(moved**2))), *rmse)


# %% The figure
def draw(tests: Campaign, trial: str, path: Path) -> None:
    """Draw what the valve, fitted to the other trials, makes of one."""
    figure = Figure(figsize=(11, 8), layout="constrained")
    for axis, plot in zip(tests.axes, figure.subplots(3, 1, sharex=True), strict=True):
        *others, left_out = sorted(tests.select(axis=axis), key=lambda each: each.run == trial)
        _, (valve, unknowns, starts) = models_for(axis, tests)
        values = fitted(valve, others, unknowns, starts)
        measured = left_out["position"]
        moved = anchored(left_out)["position"].values
        predicted = anchored_model(valve).simulate(values, left_out)
        anchor = measured.values - moved
        plot.plot(measured.time, 1e3 * measured.values, color="0.3", label="measured")
        plot.plot(measured.time, 1e3 * (anchor + predicted["position"]), "C1", label="predicted")
        plot.set(ylabel=f"{axis} [mm]")
    plot.set(xlabel="time [s]")
    figure.axes[0].set_title(f"{trial}, not in the fit, re-anchored every {ANCHOR:g} s")
    figure.axes[0].legend()
    figure.savefig(path, dpi=150)


# %% The data, and the run
def load(folder: Path) -> Campaign:
    """The trials of a folder, which need not be writable: the campaign file stays here."""
    text = CAMPAIGN.read_text("utf-8")
    with TemporaryDirectory() as place:
        path = Path(place) / CAMPAIGN.name
        beside = f'file = "{folder.resolve().as_posix()}/'
        path.write_text(text.replace('file = "', beside), "utf-8")
        return Campaign.from_toml(path)


def main() -> None:
    """Print the table; draw one trial if asked to."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("data", type=Path, help="folder with the trials")
    parser.add_argument("--figure", type=Path, help="draw the last trial here")
    options = parser.parse_args()
    tests = load(options.data)
    print("| cylinder | trial left out | moves [mm] | straight line [mm] | valve [mm] | |")
    print("|---|---|---|---|---|---|")
    wins = 0
    for score in scores(tests):
        won = score.valve < score.line
        wins += won
        numbers = " | ".join(f"{1e3 * each:.2f}" for each in score[2:])
        print(f"| {score.actuator} | {score.trial} | {numbers} | {'' if won else 'lost'} |")
    print(f"\nThe valve is the better one in {wins} of {len(tests)}.")
    if options.figure:
        draw(tests, tests.experiments[-1].run, options.figure)


if __name__ == "__main__":
    main()
