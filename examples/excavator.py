"""What a model of an excavator's cylinders lacks, by residual analysis, and what adding it gains.

    .venv/bin/python examples/excavator.py DATA [--figure excavator.png]

DATA is a folder with the trials of github.com/mitchallain/BeagleBone-excavator, tests/data. Each
trial is left out in turn. The equations and the scores are in docs/user-defined-models.md.
"""

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import exp
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure
from scipy.stats import t as student

from swashplate import Campaign, Channel, Drive, Experiment, Model, Tap, equation
from swashplate.identification import (
    DriveModel,
    ModelSetup,
    Prior,
    Problem,
    Unknown,
    Unknowns,
    solve,
)

# %% What is given
CAMPAIGN = Path(__file__).with_name("excavator.toml")
CYLINDERS = ("boom", "stick", "bucket")
ANCHOR = 5.0  # the motion since a measured position is compared, and so often begins again [s]
NOISE = 0.003  # of a window, roughly [m]
SAMPLES = 95  # of a window, which has one error: each counts for a 95th
MIDDLE = 0.09  # of the boom's stroke [m]
SPREAD = 0.15  # of the logarithm of a cylinder's full speed from trial to trial, roughly
RATE = 150.0  # steps a second, some eight a sample [Hz]
QUICK = 1e6 / 4.8  # Z8 of the drive "neutral" for a lag of 1 s
# Dead zones of 0.6 to 1.5 % duty and delays near 0.1 s stand in the description of the data; the
# rest is known by its order. Mean, deviation and bounds:
KNOWN = {
    "delay": (0.1, 0.03, 0.0, 0.3),
    "lag": (0.06, 0.5, 0.005, 0.5),
    "overlap_out": (1.05, 0.25, 0.1, 1.9),
    "overlap_back": (1.05, 0.25, 0.1, 1.9),
    "width": (0.3, 0.5, 0.02, 1.5),
    "loss_out": (0.2, 0.5, 0.0, 1.0),
    "loss_back": (0.2, 0.5, 0.0, 1.0),
    "rise_out": (0.0, 0.2, -0.5, 0.5),
    "rise_back": (0.0, 0.2, -0.5, 0.5),
    "speed_out": (0.022, 0.4, 0.005, 0.12),
    "speed_back": (0.022, 0.4, 0.005, 0.12),
}
LOGARITHMS = ("lag", "width", "speed_out", "speed_back")
Values = Mapping[str, float]


# %% The valve: a servo that turns a rotary valve with overlap, on a pump that others draw from
class Valve(NamedTuple):
    """Numbers of a cylinder and its valve."""

    delay: float  # [s]
    lag: float  # [s]
    overlap_out: float  # [%]
    overlap_back: float
    width: float  # beyond the overlap, for 63 % of the full flow [%]
    loss_out: float  # of the speed, for each other valve that is fully open [1]
    loss_back: float
    rise_out: float  # of the speed, with the boom's cylinder 20 mm further out [1]
    rise_back: float
    speed_out: float  # of the rod at full flow [m/s]
    speed_back: float


class Rod(NamedTuple):
    """Opening of the valve [%], flow of the others [full flows] and position of the rod [m]."""

    opening: float
    others: float
    position: float


@equation
def flow(opening: float, overlap: float, width: float) -> float:
    """Share of the full flow [1]: none within the overlap, then more, up to what the pump has."""
    return 1.0 - exp(-max(opening - overlap, 0.0) / width)


@equation
def step(state: Rod, command: float, demand: float, boom: float, p: Valve, h: float) -> Rod:
    """Opening, others' flow and position one step on."""
    follow = 1.0 - exp(-h / p.lag)
    opening = state.opening + follow * (command - state.opening)
    others = state.others + follow * (demand - state.others)
    out = p.speed_out * flow(opening, p.overlap_out, p.width)
    back = p.speed_back * flow(-opening, p.overlap_back, p.width)
    out *= max(1.0 - p.loss_out * others, 0.0)
    back *= max(1.0 - p.loss_back * others, 0.0)
    out *= 1.0 + p.rise_out * boom
    back *= 1.0 + p.rise_back * boom
    return Rod(opening, others, state.position + h * (out - back))


TAPS = {name: Tap(name, delay="delay", hold="mean") for name in ("command", "demand")}
valve = Model("valve", Valve, Rod, step, taps=TAPS)


def with_others(tests: Campaign, run: Experiment) -> Experiment:
    """A run with channels for the flow of the other valves, in full flows, and the boom's height.

    The height is in 20 mm of the boom's cylinder, from its middle. The residuals show an effect of
    it on the bucket alone, so that it is 0 for the others.
    """
    position = run["position"]
    overlap, width = KNOWN["overlap_out"][0], KNOWN["width"][0]
    flows = np.zeros(position.time.size)
    for other in tests:
        if other.run == run.run and other.axis != run.axis:
            beyond = np.maximum(np.abs(other.input.values) - overlap, 0.0)
            flows += 1.0 - np.exp(-beyond / width)
    heights = np.zeros(position.time.size)
    if run.axis == "bucket":
        heights = (tests[f"{run.run} boom"]["position"].values - MIDDLE) / 0.02
    demand = replace(position, name="demand", kind="other", unit="1", values=flows)
    boom = replace(position, name="boom", kind="other", unit="1", values=heights)
    channels = {
        "position": position,
        "demand": replace(demand, interpolation="previous"),
        "boom": boom,
    }
    return replace(run, channels=channels)


# %% Two models to fit: a valve, and a drive with dead zones, gains, a lag and a delay
class Candidate(NamedTuple):
    """A model with its unknowns; to its full speeds in both directions it is proportional."""

    model: Any  # what a problem simulates: `DriveModel`, or a setup's `measured`
    unknowns: Sequence[Unknown]
    speeds: tuple[str, str]


# of the drive "neutral" an ampere is 2/3 Z10, here 1 m/s: its gains are speeds for a per cent
LAG = Candidate(
    DriveModel(Drive.preset("neutral").replace(Z10=1.5).parameters),
    (
        Unknown("V_dz_plus", 1.05, 0.0, 2.0, "%", prior=Prior(1.05, 0.25)),
        Unknown("V_dz_minus", 1.05, 0.0, 2.0, "%", prior=Prior(1.05, 0.25)),
        Unknown("Z8", 15.0 * QUICK, 2.0 * QUICK, 200.0 * QUICK, "sqrt(Pa)/(m s)", log=True),
        Unknown("tau", 0.1, 0.0, 0.3, "s", prior=Prior(0.1, 0.03)),
        Unknown("G1_plus", 0.02, 0.002, 0.5, "m/s/%", log=True),
        Unknown("G1_minus", 0.02, 0.002, 0.5, "m/s/%", log=True),
    ),
    ("G1_plus", "G1_minus"),
)
VALVE_UNKNOWNS = [
    Unknown(name, mean, *bounds, log=name in LOGARITHMS, prior=Prior(mean, deviation))
    for name, (mean, deviation, *bounds) in KNOWN.items()
]
VALVE = Candidate(
    ModelSetup(
        valve,
        {unknown.name: unknown for unknown in VALVE_UNKNOWNS},
        rate=RATE,
        begin={"position": "position"},
    ).measured,
    VALVE_UNKNOWNS,
    ("speed_out", "speed_back"),
)


# %% Compared is the motion since the last anchor
# A position is the integral of a speed, so a small error of the speed grows without end. So each
# five seconds are a window of their own, from the measured position at its beginning.
def windows(time: np.ndarray) -> np.ndarray:
    """(m,) number of the window that each sample is in."""
    return np.floor((time - time[0]) / ANCHOR).astype(int)


def since_anchor(channel: Channel, rows: np.ndarray) -> np.ndarray:
    """Rows (m,) or (m, k) of a time series less the row at the beginning of their window."""
    numbers = windows(channel.time)
    _, first, window = np.unique(numbers, return_index=True, return_inverse=True)
    return rows - rows[first][window]


def motion(run: Experiment) -> np.ndarray:
    """(m,) measured motion. [m]"""
    return since_anchor(run["position"], run["position"].values)


# %% Fit to some trials
def fit(candidate: Candidate, runs: Sequence[Experiment], fixed: Values) -> Values:
    """Numbers of a model fitted to some trials, of which each has full speeds of its own.

    The speeds that it returns are the geometric means of the trials'.
    """
    unknowns = []
    for unknown in candidate.unknowns:
        if unknown.name in candidate.speeds:
            unknowns += [replace(unknown, run=run.name) for run in runs]
        elif unknown.name not in fixed:
            unknowns.append(unknown)
    problem = Problem(
        candidate.model,
        tuple(runs),
        Unknowns(tuple(unknowns)),
        channels=("position",),
        scales={"position": NOISE * SAMPLES**0.5},
        fixed=fixed,
        compare=since_anchor,
    )
    solution = solve(problem, tolerance=1e-6)
    values = {**fixed, **problem.unknowns.values(solution.vector)}
    for name in candidate.speeds:
        speeds = [values.pop(f"{name} ({run.name})") for run in runs]
        values[name] = float(np.exp(np.mean(np.log(speeds))))
    return values


# %% Motion in a trial: from the others' full speeds, or from its own
def directions(candidate: Candidate, values: Values, run: Experiment) -> np.ndarray:
    """(m, 2) motion in each direction at the speeds in `values`; their sum is simulated. [m]"""
    by_speed = candidate.model.linearise(values, run, candidate.speeds)["position"].by
    speeds = [values[name] for name in candidate.speeds]
    return since_anchor(run["position"], by_speed * speeds)


def speed_factors(columns: np.ndarray, measured: np.ndarray) -> np.ndarray:
    """(2,) full speeds of a trial by those of the others: 1 before anything is measured of it."""
    weight = 1.0 / (NOISE**2 * SAMPLES)
    prior = 1.0 / SPREAD**2
    information = weight * columns.T @ columns + prior * np.eye(2)
    return np.linalg.solve(information, weight * columns.T @ measured + prior)


def hindsight(columns: np.ndarray, run: Experiment) -> np.ndarray:
    """(m,) motion with the speeds that the whole trial shows: no prediction, but a bound. [m]"""
    return columns @ speed_factors(columns, motion(run))


def learned(columns: np.ndarray, run: Experiment) -> np.ndarray:
    """(m,) motion with the speeds that the windows before have shown. [m]"""
    window, measured = windows(run["position"].time), motion(run)
    predicted = np.empty(measured.size)
    for number in np.unique(window):
        before, now = window < number, window == number
        predicted[now] = columns[now] @ speed_factors(columns[before], measured[before])
    return predicted


def line(runs: Sequence[Experiment], run: Experiment) -> np.ndarray:
    """(m,) motion of a rod whose speed is a straight line over the command. [m]"""

    def columns(run: Experiment) -> np.ndarray:
        position, command = run["position"], run.input
        integral = np.concatenate([[0.0], np.cumsum(command.values[:-1] * np.diff(command.time))])
        return since_anchor(position, np.stack([integral, position.time], axis=1))

    rows = np.concatenate([columns(other) for other in runs])
    measured = np.concatenate([motion(other) for other in runs])
    numbers, *_ = np.linalg.lstsq(rows, measured, rcond=None)
    return columns(run) @ numbers


# %% A trial predicted by fits to the others
WITHOUT_BOOM = {"rise_out": 0.0, "rise_back": 0.0}
WITHOUT_OTHERS = {"loss_out": 0.0, "loss_back": 0.0, **WITHOUT_BOOM}
BEST = "pump and boom, learning"


def predictions(others: Sequence[Experiment], run: Experiment) -> dict[str, np.ndarray]:
    """(m,) motion in a trial by model, each fitted to the others. [m]"""
    by_model = {"straight line": line(others, run)}
    for name, candidate, fixed in (
        ("lag", LAG, {}),
        ("valve", VALVE, WITHOUT_OTHERS),
        ("pump", VALVE, WITHOUT_BOOM),
        ("pump and boom", VALVE, {}),
    ):
        columns = directions(candidate, fit(candidate, others, fixed), run)
        if name in ("lag", "valve"):
            by_model[name] = columns.sum(axis=1)
        by_model[f"{name}, learning"] = learned(columns, run)
    by_model["in hindsight"] = hindsight(columns, run)
    return by_model


def rms(rows: np.ndarray) -> float:
    """Root mean square, of metres in millimetres."""
    return 1e3 * float(np.sqrt(np.mean(rows**2)))


def mean_ratio(ratios: np.ndarray) -> str:
    """Geometric mean of the ratios of independent trials, with Student's 95 % interval."""
    logarithms = np.log(ratios)
    error = student.ppf(0.975, ratios.size - 1) * np.std(logarithms, ddof=1) / ratios.size**0.5
    low, middle, high = np.exp(np.mean(logarithms) + error * np.array([-1.0, 0.0, 1.0]))
    return f"{middle:.2f} ({low:.2f} to {high:.2f})"


# %% What the residuals of the valve alone show
PIECE = 0.5  # residual motion is explained in pieces of this length [s]
DRAWS = 200  # resampled sets of windows for an interval
ACTING = 1e-4  # motion by its cause in a piece that counts [m]
FEWEST = 10  # pieces from which an effect is told


class Pieces(NamedTuple):
    """Half seconds of all trials of a cylinder."""

    residual: np.ndarray  # (n,) measured less simulated motion [m]
    simulated: np.ndarray  # (n, 2) motion in each direction [m]
    trial: np.ndarray  # (n,) number of the trial
    window: np.ndarray  # (n,) number of the window, of all trials
    causes: Mapping[str, np.ndarray]  # (n,) each


def causes_of(tests: Campaign, run: Experiment, time: np.ndarray) -> dict[str, np.ndarray]:
    """(n,) what may speed up or slow down a cylinder, by name, at some instants."""
    causes = {"a minute later": (time - run.input.time[0]) / 60.0}
    for other in tests:
        if other.run != run.run:
            continue
        if other.axis != run.axis:
            is_open = np.abs(other.input.at(time)) > KNOWN["overlap_out"][0]
            causes[f"{other.axis} valve open"] = is_open.astype(float)
        if other.axis in CYLINDERS:
            position = other["position"]
            offset = position.at(time) - np.mean(position.values)
            causes[f"{other.axis} 20 mm further out"] = offset / 0.02
    return causes


def pieces_of(tests: Campaign, runs: Sequence[Experiment], values: Values) -> Pieces:
    """Half seconds of some trials, with what the valve makes of them."""
    residuals, simulations, trials, window_numbers, causes = [], [], [], [], []
    for trial, run in enumerate(runs):
        position = run["position"]
        edges = np.arange(position.time[0], position.time[-1], PIECE)
        middle = 0.5 * (edges[:-1] + edges[1:])
        by_speed = VALVE.model.linearise(values, run, VALVE.speeds)["position"].by
        columns = by_speed * [values[name] for name in VALVE.speeds]
        at_edges = [np.interp(edges, position.time, column) for column in columns.T]
        simulated = np.diff(at_edges, axis=1).T
        measured = np.diff(np.interp(edges, position.time, position.values))
        residuals.append(measured - simulated.sum(axis=1))
        simulations.append(simulated)
        trials.append(np.full(middle.size, trial))
        window_numbers.append(1000 * trial + windows(middle))
        causes.append(causes_of(tests, run, middle))
    return Pieces(
        np.concatenate(residuals),
        np.concatenate(simulations),
        np.concatenate(trials),
        np.concatenate(window_numbers),
        {name: np.concatenate([of_run[name] for of_run in causes]) for name in causes[0]},
    )


def regression(columns: np.ndarray, residual: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Coefficients of some columns by least squares, and what they leave."""
    coefficients, *_ = np.linalg.lstsq(columns, residual, rcond=None)
    return coefficients, residual - columns @ coefficients


def trial_speeds(pieces: Pieces) -> np.ndarray:
    """(n, 2 trials) columns of a regression that lets each trial have full speeds of its own."""
    numbers = np.unique(pieces.trial)
    by_trial = [pieces.simulated * (pieces.trial == trial)[:, None] for trial in numbers]
    return np.concatenate(by_trial, axis=1)


class Effect(NamedTuple):
    """What a cause does to the speed, beside each trial's own speeds."""

    explained: float  # share of the squared residuals [1]
    acting: np.ndarray  # (2,) half seconds outward and back
    change: np.ndarray  # (2,) of the speeds outward and back [1]
    low: np.ndarray  # (2,) 95 % limits of both, which resample windows
    high: np.ndarray


def effect_of(cause: np.ndarray, pieces: Pieces) -> Effect:
    """Effect of a cause (n,) on the speed in both directions."""
    acting, residual = pieces.simulated * cause[:, None], pieces.residual
    speeds = trial_speeds(pieces)
    columns = np.concatenate([acting, speeds], axis=1)
    coefficients, left = regression(columns, residual)
    _, left_without = regression(speeds, residual)
    members = [np.flatnonzero(pieces.window == window) for window in np.unique(pieces.window)]
    random = np.random.default_rng(1)
    resampled = []
    for _ in range(DRAWS):
        drawn = random.integers(len(members), size=len(members))
        rows = np.concatenate([members[number] for number in drawn])
        resampled.append(regression(columns[rows], residual[rows])[0][:2])
    low, high = np.quantile(resampled, [0.025, 0.975], axis=0)
    explained = (left_without @ left_without - left @ left) / (residual @ residual)
    counts = np.count_nonzero(np.abs(acting) > ACTING, axis=0)
    return Effect(float(explained), counts, coefficients[:2], low, high)


# %% The run
def print_effects(tests: Campaign, axis: str, runs: Sequence[Experiment]) -> None:
    """Print what the residuals of a cylinder show."""
    pieces = pieces_of(tests, runs, fit(VALVE, runs, WITHOUT_OTHERS))
    squares = pieces.residual @ pieces.residual
    _, left = regression(trial_speeds(pieces), pieces.residual)
    explained = 1.0 - left @ left / squares
    largest = np.cumsum(np.sort(left**2)[::-1])
    few = 1 + int(np.searchsorted(largest, 0.5 * largest[-1]))
    at_rest = np.abs(pieces.simulated).sum(axis=1) < ACTING
    print(f"\n{axis}: of the squared residuals {100.0 * explained:.0f} % are speeds of the trial;")
    print(f"of the rest {few} of {left.size} half seconds hold a half.")
    print(f"At rest a half second has {rms(left[at_rest]):.2f} mm.\n")
    print("| cause | explains | speed outward | speed back |")
    print("|---|---|---|---|")
    effects = {name: effect_of(cause, pieces) for name, cause in pieces.causes.items()}
    for name, effect in sorted(effects.items(), key=lambda item: -item[1].explained):
        changes = []
        for acting, change, low, high in zip(*effect[1:], strict=True):
            limits = f"{100.0 * low:+.0f} to {100.0 * high:+.0f}"
            text = f"{100.0 * change:+.0f} % ({limits}; {acting})"
            changes.append(text if acting >= FEWEST else f"({acting})")
        explains = f"{100.0 * effect.explained:.1f} %"
        print(f"| {name} | {explains} | {changes[0]} | {changes[1]} |", flush=True)


def print_scores(axis: str, runs: Sequence[Experiment]) -> dict[str, list[float]]:
    """Print the errors in each trial left out [mm]; return them by model."""
    scores: dict[str, list[float]] = {}
    for run in runs:
        by_model = predictions([other for other in runs if other is not run], run)
        if not scores:
            print(f"\n| {axis}, left out | moves | {' | '.join(by_model)} |")
            print("|---" * (len(by_model) + 2) + "|")
        errors = {name: rms(predicted - motion(run)) for name, predicted in by_model.items()}
        for name, error in errors.items():
            scores.setdefault(name, []).append(error)
        shown = " | ".join(f"{error:.2f}" for error in (rms(motion(run)), *errors.values()))
        print(f"| {run.run} | {shown} |", flush=True)
    return scores


def print_ratios(scores: Mapping[str, Mapping[str, Sequence[float]]]) -> None:
    """Print the ratio of the best model's errors to each other model's; `scores` by cylinder."""
    print(f"\n| {BEST}, error to that of | {' | '.join(scores)} | all |")
    print("|---" * (len(scores) + 2) + "|")
    for name in next(iter(scores.values())):
        if name == BEST:
            continue
        ratios = [np.divide(axis[BEST], axis[name]) for axis in scores.values()]
        # the cylinders of a trial share its pump and its operator: together they are one ratio
        ratios.append(np.exp(np.mean(np.log(ratios), axis=0)))
        print(f"| {name} | {' | '.join(mean_ratio(row) for row in ratios)} |")


def draw(figure: Figure, number: int, others: Sequence[Experiment], run: Experiment) -> None:
    """Draw the errors in a trial left out."""
    plot = figure.add_subplot(3, 1, number, title=run.name, ylabel="error [mm]")
    by_model = predictions(others, run)
    for name in ("lag", BEST):
        plot.plot(run["position"].time, 1e3 * (by_model[name] - motion(run)), label=name)
    plot.legend()


def main() -> None:
    """Print what residuals show and each trial's errors; draw those of the last if asked to."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("data", type=Path, help="folder with the trials")
    parser.add_argument("--figure", type=Path, help="draw the errors in the last trial here")
    parser.add_argument("--cylinder", choices=CYLINDERS, help="only this one")
    options = parser.parse_args()
    tests = Campaign.from_toml(CAMPAIGN, logs=options.data)
    axes = (options.cylinder,) if options.cylinder else CYLINDERS
    figure, scores = Figure(figsize=(11, 8), layout="constrained"), {}
    for number, axis in enumerate(axes, start=1):
        runs = [with_others(tests, run) for run in tests.select(axis=axis)]
        print_effects(tests, axis, runs)
        scores[axis] = print_scores(axis, runs)
        if options.figure:
            draw(figure, number, runs[:-1], runs[-1])
    print_ratios(scores)
    if options.figure:
        figure.savefig(options.figure, dpi=150)


if __name__ == "__main__":
    main()
