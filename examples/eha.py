"""An electro-hydrostatic actuator: from its pump's speed and its pressures to its position.

    .venv/bin/python examples/eha.py DATA [--figure eha.png]

DATA is a folder with exp_data_1_3.csv and exp_data_3_3.csv of
github.com/ivliev123/Electro-Hydraulic-Actuator, 4_ANALIZE_DATA. Each load case is predicted by fits
to the other one. The equations and the scores are in docs/user-defined-models.md.
"""

import argparse
from collections.abc import Mapping, Sequence
from math import exp, log
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure

from swashplate import Campaign, Channel, Experiment, Model, Tap, equation
from swashplate.identification import (
    ModelSetup,
    Problem,
    Unknown,
    Unknowns,
    linearised_fit,
    solve,
    uncertainty,
)

# %% What is given
CAMPAIGN = Path(__file__).with_name("eha.toml")
ANCHOR = 5.0  # the motion since a measured position is compared, and so often begins again [s]
NOISE = 1e-4  # what one unit of residual is [m]
ATMOSPHERE = 1.0  # [bar]
FILTER = 0.01  # of the logarithms of the pressures, whose slopes are taken [s]
DRAWS = 2000  # resampled sets of windows for an interval
FULL = "pump and pressures"
Values = Mapping[str, float]


# %% The actuator: a pump with slip, and two chambers whose oil holds air
class Actuator(NamedTuple):
    """Numbers of pump and cylinder."""

    stroke: float  # outward for a turn of the pump [m]
    area_ratio: float  # of the two chambers [1]
    slip: float  # [1/(min bar)]
    air_a: float  # turns of the pump for which the absolute pressure grows e-fold
    air_b: float


class State(NamedTuple):
    """Filtered logarithms of the absolute pressures [1], and the rod's position [m]."""

    log_a: float
    log_b: float
    position: float


@equation
def delivered(speed: float, drop: float, squeeze: float, slip: float) -> float:
    """Turns a second that move the rod: not the slip, and not what squeezes the chamber's oil.

    A check valve shuts off the chamber from a pump that slips as fast as it turns.
    """
    turns = (speed - slip * drop) / 60.0
    return turns - squeeze if speed > 0.0 and turns > 0.0 else 0.0


@equation
def step(
    state: State, pump: float, pressure_a: float, pressure_b: float, p: Actuator, h: float
) -> State:
    """Pressures and position one step on; the chamber that is filled leads."""
    follow = 1.0 - exp(-h / FILTER)
    rise_a = follow * (log(pressure_a + ATMOSPHERE) - state.log_a)
    rise_b = follow * (log(pressure_b + ATMOSPHERE) - state.log_b)
    drop = pressure_a - pressure_b
    if pump > 0.0:
        speed = p.stroke * delivered(pump, drop, p.air_a * rise_a / h, p.slip)
    else:
        back = delivered(-pump, -drop, p.air_b * rise_b / h, p.slip)
        speed = -p.stroke * p.area_ratio * back
    return State(state.log_a + rise_a, state.log_b + rise_b, state.position + h * speed)


ACTUATOR_UNKNOWNS = (
    Unknown("stroke", 7e-4, 1e-4, 5e-3, "m", log=True),
    Unknown("area_ratio", 1.5, 1.0, 3.0),
    Unknown("slip", 1.0, 0.0, 20.0, "1/(min bar)"),
    Unknown("air_a", 1.0, 0.0, 20.0),
    Unknown("air_b", 1.0, 0.0, 20.0),
)
ACTUATOR = ModelSetup(
    Model("actuator", Actuator, State, step),
    {unknown.name: unknown for unknown in ACTUATOR_UNKNOWNS},
    begin={"position": "position"},
)


# %% A model without pressures: dead zone and gain for each direction, a lag and a delay
class Lag(NamedTuple):
    """Numbers of the lag model."""

    dead_out: float  # [1/min]
    dead_back: float
    gain_out: float  # [m a turn]
    gain_back: float
    lag: float  # [s]
    delay: float


class Lagging(NamedTuple):
    """Lagging speed [m/s] and position [m]."""

    speed: float
    position: float


@equation
def lag_step(state: Lagging, pump: float, p: Lag, h: float) -> Lagging:
    """Speed and position one step on."""
    out = p.gain_out * max(pump - p.dead_out, 0.0) / 60.0
    back = p.gain_back * max(-pump - p.dead_back, 0.0) / 60.0
    speed = state.speed + (1.0 - exp(-h / p.lag)) * (out - back - state.speed)
    return Lagging(speed, state.position + h * speed)


LAG_UNKNOWNS = (
    Unknown("dead_out", 50.0, 0.0, 500.0, "1/min"),
    Unknown("dead_back", 50.0, 0.0, 500.0, "1/min"),
    Unknown("gain_out", 7e-4, 1e-4, 5e-3, "m", log=True),
    Unknown("gain_back", 1e-3, 1e-4, 5e-3, "m", log=True),
    Unknown("lag", 0.05, 0.002, 1.0, "s", log=True),
    Unknown("delay", 0.02, 0.0, 0.3, "s"),
)
LAG = ModelSetup(
    Model("lag", Lag, Lagging, lag_step, taps={"pump": Tap("pump", delay="delay")}),
    {unknown.name: unknown for unknown in LAG_UNKNOWNS},
    begin={"position": "position"},
)


# %% Compared is the motion since the last anchor
def windows(time: np.ndarray) -> np.ndarray:
    """(m,) number of the window that each sample is in."""
    return np.floor((time - time[0]) / ANCHOR).astype(int)


def since_anchor(channel: Channel, rows: np.ndarray) -> np.ndarray:
    """Rows (m,) or (m, k) of a time series less the row at the beginning of their window."""
    numbers = windows(channel.time)
    _, first, window = np.unique(numbers, return_index=True, return_inverse=True)
    return rows - rows[first][window]


# %% Fits to one load case, errors in the other
MODELS: Mapping[str, tuple[ModelSetup, Values]] = {
    "lag": (LAG, {}),
    "without slip": (ACTUATOR, {"slip": 0.0}),
    "without air": (ACTUATOR, {"air_a": 0.0, "air_b": 0.0}),
    FULL: (ACTUATOR, {}),
}


def error(model: ModelSetup, values: Values, run: Experiment) -> np.ndarray:
    """(m,) simulated less measured motion. [m]"""
    position = run["position"]
    return since_anchor(
        position, model.measured.simulate(values, run)["position"] - position.values
    )


def line_error(fitted: Experiment, run: Experiment) -> np.ndarray:
    """The same of a rod whose speed is a straight line over the pump's speed. [m]"""

    def columns(run: Experiment) -> np.ndarray:
        turns = np.cumsum(run.input.values) * np.gradient(run.input.time)
        return since_anchor(run["position"], np.stack([turns, run.input.time], axis=1))

    def motion(run: Experiment) -> np.ndarray:
        return since_anchor(run["position"], run["position"].values)

    line, *_ = np.linalg.lstsq(columns(fitted), motion(fitted), rcond=None)
    return columns(run) @ line - motion(run)


def fit(model: ModelSetup, fixed: Values, run: Experiment) -> Values:
    """Numbers of a model fitted to one load case; the actuator's are printed with intervals."""
    free = Unknowns(tuple(each for name, each in model.free.items() if name not in fixed))
    problem = Problem(
        model.measured,
        (run,),
        free,
        channels=("position",),
        scales={"position": NOISE},
        fixed=fixed,
        compare=since_anchor,
    )
    solution = solve(problem)
    if model is ACTUATOR and not fixed:
        print(f"Fitted to the {run.run}, with 95 % intervals:")
        for estimate in uncertainty(linearised_fit(problem, solution.vector)).estimates:
            interval = f"from {estimate.lower:.4g} to {estimate.upper:.4g}"
            print(f"{estimate.name:10s}  {estimate.value:.4g}, {interval}")
        print()
    return {**fixed, **free.values(solution.vector)}


def errors(fitted: Experiment, run: Experiment) -> dict[str, np.ndarray]:
    """Errors (m,) in a load case by model, each fitted to the other one. [m]"""
    by_model = {"straight line": line_error(fitted, run)}
    for name, (model, fixed) in MODELS.items():
        by_model[name] = error(model, fit(model, fixed, fitted), run)
    return by_model


def ratio(of: Sequence[np.ndarray], to: Sequence[np.ndarray]) -> tuple[float, float, float]:
    """Ratio of two models' errors with its 95 % interval, which resamples windows.

    `of` and `to` are the squared errors of both models, summed over each window.
    """
    windows = np.stack([np.concatenate(of), np.concatenate(to)])
    draws = np.random.default_rng(1).integers(windows.shape[1], size=(DRAWS, windows.shape[1]))
    resampled = windows[:, draws].sum(axis=2)
    low, high = np.quantile(np.sqrt(resampled[0] / resampled[1]), [0.025, 0.975])
    total = windows.sum(axis=1)
    return float(np.sqrt(total[0] / total[1])), float(low), float(high)


def rms(rows: np.ndarray) -> float:
    """Root mean square, of metres in millimetres."""
    return 1e3 * float(np.sqrt(np.mean(rows**2)))


# %% The run
def main() -> None:
    """Print the scores of both directions; draw the heavy load if asked to."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("data", type=Path, help="folder with the two load cases")
    parser.add_argument("--figure", type=Path, help="draw the heavy load here")
    options = parser.parse_args()
    light, heavy = Campaign.from_toml(CAMPAIGN, logs=options.data).experiments
    to_heavy, to_light = errors(light, heavy), errors(heavy, light)
    cases = ((heavy, to_heavy), (light, to_light))
    squares = {
        name: [
            np.bincount(windows(run["position"].time), by_model[name] ** 2)
            for run, by_model in cases
        ]
        for name in to_heavy
    }
    print("| model | light to heavy [mm] | heavy to light [mm] | to the line | to the lag model |")
    print("|---|---|---|---|---|")
    for name, summed in squares.items():
        ratios = [ratio(summed, squares[baseline]) for baseline in ("straight line", "lag")]
        shown = [f"{middle:.2f} ({low:.2f} to {high:.2f})" for middle, low, high in ratios]
        scores = f"{rms(to_heavy[name]):.2f} | {rms(to_light[name]):.2f}"
        print(f"| {name} | {scores} | {shown[0]} | {shown[1]} |")
    if options.figure:
        figure = Figure(figsize=(9, 5), layout="constrained")
        plot = figure.add_subplot(title="heavy load", xlabel="time [s]", ylabel="error [mm]")
        for name in ("lag", FULL):
            plot.plot(heavy["position"].time, 1e3 * to_heavy[name], label=name)
        plot.legend()
        figure.savefig(options.figure, dpi=150)


if __name__ == "__main__":
    main()
