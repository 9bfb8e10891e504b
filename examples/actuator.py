"""One's own hydraulic equations against a benchmark: from a valve's opening to the oil's pressure.

    .venv/bin/python examples/actuator.py DATA [--figure actuator.png] [--splits]

DATA is a folder with actuator.mat, from github.com/zhenwendai/RGP, datasets/system_identification.
The first 512 samples are the training, the last 512 the test: a free run, driven by the opening
alone, compared by its RMSE. docs/own-models.md has the equations and says what was chosen on what.
"""

import argparse
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from matplotlib.figure import Figure
from numba import njit

from swashplate import Campaign
from swashplate.campaign.experiment import Experiment
from swashplate.identification.problem import Problem
from swashplate.identification.starts import sobol_starts, solve_from
from swashplate.identification.unknowns import Unknown, Unknowns

# %% What is given
CAMPAIGN = Path(__file__).with_name("actuator.toml")
TRAINING = 512
PUBLISHED = {"recurrent Gaussian process": 0.773, "online Gaussian-process state space": 1.048}
SPLITS = {
    "0 to 279": np.arange(280),
    "0 to 349": np.arange(350),
    "0 to 419": np.arange(420),
    "160 to 511": np.arange(160, 512),
    "0 to 199, 360 to 511": np.concatenate([np.arange(200), np.arange(360, 512)]),
}
SUBSTEPS = 4  # of the march, in one sample
STARTS = 8
NAMES = (
    "lag",
    "dead zone +",
    "dead zone -",
    "gain +",
    "gain -",
    "full opening +",
    "full opening -",
    "supply",
    "stiffness",
    "drag",
)
# Generous bounds, read off the first 512 samples: openings and dead zones within the range of u, a
# supply above the largest pressure, and an oscillation of some twenty samples (stiffness 0.1).
BOUNDS = (
    *((0.3, 6.0), (-0.1, 0.4), (-0.1, 0.5), (0.3, 10.0), (0.3, 10.0), (0.1, 2.0), (0.1, 2.0)),
    *((3.8, 15.0), (0.02, 0.5), (0.1, 3.0)),
)
UNKNOWNS = Unknowns(
    tuple(
        Unknown(name, 0.5 * (low + high), low, high)
        for name, (low, high) in zip(NAMES, BOUNDS, strict=True)
    )
)


# %% The equations
@njit(cache=True)
def orifice(drop):
    """Square root of a pressure drop, with its sign; straight close to 0, where flow is laminar."""
    return drop / np.sqrt(abs(drop) + 1e-3)


@njit(cache=True)
def rates(state, opening, numbers):
    """Derivatives of the spool, the pressure and the load's speed, by the sample."""
    spool, pressure, speed = state
    lag, dead_plus, dead_minus, gain_plus, gain_minus, full_plus, full_minus = numbers[:7]
    supply, stiffness, drag = numbers[7:]
    plus = min(max(spool - dead_plus, 0.0), full_plus)
    minus = min(max(-spool - dead_minus, 0.0), full_minus)
    flow = gain_minus * minus * orifice(1.0 - pressure / supply)
    flow -= gain_plus * plus * orifice(1.0 + pressure / supply)
    return np.array([(opening - spool) / lag, flow - speed, stiffness * (pressure - drag * speed)])


@njit(cache=True)
def free_run(opening, numbers):
    """Pressure at every sample, from rest: midpoint rule, the opening linear between samples."""
    pressure = np.zeros(opening.size)
    state, h = np.zeros(3), 1.0 / SUBSTEPS
    for k in range(opening.size - 1):
        slope = opening[k + 1] - opening[k]
        for j in range(SUBSTEPS):
            middle = state + 0.5 * h * rates(state, opening[k] + slope * h * j, numbers)
            state = state + h * rates(middle, opening[k] + slope * h * (j + 0.5), numbers)
        pressure[k + 1] = state[1]
    return pressure


# %% The model, as a fit sees it
class Actuator:
    """A valve that feeds oil to a load: what a fit needs is this one method."""

    def simulate(
        self, values: Mapping[str, float], experiment: Experiment
    ) -> Mapping[str, np.ndarray]:
        """Pressure, from rest."""
        numbers = np.array([values[name] for name in NAMES])
        return {"p": free_run(experiment.input.values, numbers)}


def fitted(training: Experiment) -> dict[str, float]:
    """Values of the unknowns: the best of several starts all over the bounds."""
    problem = Problem(Actuator(), (training,), UNKNOWNS, ("p",), {"p": 1.0})
    starts = list(sobol_starts(problem, STARTS, seed=0))
    results = solve_from(problem, starts, tolerance=1e-8, max_evaluations=150)
    best = min(results, key=lambda each: each.cost)
    return UNKNOWNS.values(np.array(best.vector))


# %% A linear model to compare with
def arx(opening: np.ndarray, pressure: np.ndarray, order: int = 10) -> np.ndarray:
    """Free run of a linear model over the test.

    p[t] = c + sum of a_i p[t-i], i = 1 to 10, + sum of b_j u[t-j], j = 0 to 9. All 21 numbers by
    least squares on t = 10 to 511; from t = 512 on p[t-i] is the model's own, before that measured.
    """

    def regressors(p: np.ndarray, t: int) -> np.ndarray:
        window = slice(t - order + 1, t + 1)
        return np.concatenate([p[t - order : t], opening[window], [1.0]])

    rows = np.array([regressors(pressure, t) for t in range(order, TRAINING)])
    numbers, *_ = np.linalg.lstsq(rows, pressure[order:TRAINING], rcond=None)
    run = np.concatenate([pressure[:TRAINING], np.zeros(pressure.size - TRAINING)])
    for t in range(TRAINING, run.size):
        run[t] = regressors(run, t) @ numbers
    return run[TRAINING:]


def rmse(simulated: np.ndarray, measured: np.ndarray) -> float:
    """Root of the mean squared difference."""
    return float(np.sqrt(np.mean((simulated - measured) ** 2)))


def split_error(training: Experiment, part: np.ndarray) -> float:
    """RMSE on the samples of the training that a fit to a part of it did not see."""
    seen = np.isin(np.arange(TRAINING), part)
    channel = replace(training["p"], weight=seen.astype(float))
    values = fitted(replace(training, channels={"p": channel}))
    simulated = Actuator().simulate(values, training)["p"]
    return rmse(simulated[~seen], channel.values[~seen])


# %% The data, and the run
def load(folder: Path) -> Campaign:
    """The two runs of a folder, which need not be writable: the campaign file stays here."""
    text = CAMPAIGN.read_text("utf-8")
    with TemporaryDirectory() as place:
        path = Path(place) / CAMPAIGN.name
        beside = f'file = "{folder.resolve().as_posix()}/'
        path.write_text(text.replace('file = "', beside), "utf-8")
        return Campaign.from_toml(path)


def main() -> None:
    """Fit, run freely over the test, compare."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("data", type=Path, help="folder with actuator.mat")
    parser.add_argument("--figure", type=Path, help="draw the free run here")
    parser.add_argument("--splits", action="store_true", help="also judge it within the training")
    options = parser.parse_args()
    tests = load(options.data)
    values = fitted(tests["train"])
    for name, value in values.items():
        print(f"{name:15s} {value:8.4f}")
    whole = tests["whole"]
    simulated = Actuator().simulate(values, whole)["p"]
    measured, linear = whole["p"].values, arx(whole.input.values, whole["p"].values)
    test = slice(TRAINING, None)
    print(f"\nRMSE in training: {rmse(simulated[:TRAINING], measured[:TRAINING]):.3f}")
    rows = {
        "these equations": rmse(simulated[test], measured[test]),
        "ARX(10,10), computed here": rmse(linear, measured[test]),
        **{f"{name}, published": error for name, error in PUBLISHED.items()},
    }
    print("\n| free run over the last 512 samples | RMSE of p |\n|---|---|")
    for name, error in rows.items():
        print(f"| {name} | {error:.3f} |")
    if options.splits:
        print("\n| fitted to samples | RMSE on the rest of the first 512 |\n|---|---|")
        for name, part in SPLITS.items():
            print(f"| {name} | {split_error(tests['train'], part):.3f} |")
    if options.figure:
        figure = Figure(figsize=(11, 5), layout="constrained")
        axes = figure.subplots()
        axes.plot(measured, color="0.3", label="measured")
        axes.plot(simulated, "C1", label="simulated from the opening alone")
        axes.axvline(TRAINING, color="0.7")
        axes.set(xlabel="sample", ylabel="p", title="trained on the left, tested on the right")
        axes.legend()
        figure.savefig(options.figure, dpi=150)


if __name__ == "__main__":
    main()
