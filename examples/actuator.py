"""User-defined equations of a hydraulic actuator against a benchmark: valve opening to pressure.

    .venv/bin/python examples/actuator.py DATA [--splits]

DATA is a folder with actuator.mat, from github.com/zhenwendai/RGP, datasets/system_identification.
The last 512 samples are run freely, driven by the opening alone, after a fit to the first 512.
docs/user-defined-models.md has the equations and says what was chosen on what.
"""

import sys
from dataclasses import replace
from math import sqrt
from pathlib import Path
from typing import NamedTuple

import numpy as np

from swashplate import Campaign, Experiment, Model, discretised, equation
from swashplate.identification import (
    ModelSetup,
    Problem,
    Unknown,
    Unknowns,
    sobol_starts,
    solve_from,
)

# %% What is given
CAMPAIGN = Path(__file__).with_name("actuator.toml")
PUBLISHED = {"recurrent Gaussian process, published": 0.773}
PUBLISHED["online Gaussian-process state space, published"] = 1.048
TRAINING = np.arange(512)
SPLITS = {"0 to 279": TRAINING < 280, "0 to 349": TRAINING < 350, "0 to 419": TRAINING < 420}
SPLITS["160 to 511"] = TRAINING >= 160
SPLITS["0 to 199, 360 to 511"] = (TRAINING < 200) | (TRAINING >= 360)
# Generous bounds, read off the first 512 samples: an oscillation of some twenty is stiffness 0.1.
BOUNDS = {"lag": (0.3, 6.0), "supply": (3.8, 15.0), "stiffness": (0.02, 0.5), "drag": (0.1, 3.0)}
BOUNDS |= {"dead_plus": (-0.1, 0.4), "dead_minus": (-0.1, 0.5)}
BOUNDS |= {"gain_plus": (0.3, 10.0), "gain_minus": (0.3, 10.0)}
BOUNDS |= {"full_plus": (0.1, 2.0), "full_minus": (0.1, 2.0)}
UNKNOWNS = Unknowns(tuple(Unknown(name, sum(b) / 2.0, *b) for name, b in BOUNDS.items()))
Numbers = NamedTuple("Numbers", [(name, float) for name in BOUNDS])


# %% The equations: spool, pressure and the load's speed, time counted in samples
class State(NamedTuple):
    spool: float
    p: float
    speed: float


@equation
def orifice(drop: float) -> float:
    """Square root of a pressure drop, with its sign; straight close to 0, where flow is laminar."""
    return drop / sqrt(abs(drop) + 1e-3)


@equation
def rates(state: State, u: float, p: Numbers) -> State:
    """Derivatives of the state by the sample."""
    plus = min(max(state.spool - p.dead_plus, 0.0), p.full_plus)
    minus = min(max(-state.spool - p.dead_minus, 0.0), p.full_minus)
    flow = p.gain_minus * minus * orifice(1.0 - state.p / p.supply)
    flow -= p.gain_plus * plus * orifice(1.0 + state.p / p.supply)
    force = state.p - p.drag * state.speed
    return State((u - state.spool) / p.lag, flow - state.speed, p.stiffness * force)


# the opening, straight between samples, is held over a quarter of one
actuator = Model("actuator", Numbers, State, discretised(rates, "midpoint"))
measured = ModelSetup(actuator, {each.name: each for each in UNKNOWNS}, rate=4.0).measured


def fitted(training: Experiment) -> dict[str, float]:
    """Values of the unknowns: the best of several starts all over the bounds."""
    problem = Problem(measured, (training,), UNKNOWNS, ("p",), {"p": 1.0})
    starts = list(sobol_starts(problem, 8, seed=0))
    results = solve_from(problem, starts, tolerance=1e-8, max_evaluations=150)
    return UNKNOWNS.values(np.array(min(results, key=lambda each: each.cost).vector))


def error(values: dict[str, float], run: Experiment, on: slice | np.ndarray) -> float:
    """RMSE of a free run on some of its samples."""
    wrong = measured.simulate(values, run)["p"] - run["p"].values
    return float(np.sqrt(np.mean(wrong[on] ** 2)))


# %% A linear model to compare with
def arx(u: np.ndarray, p: np.ndarray, order: int = 10) -> np.ndarray:
    """Free run over the test of p[t] = c + Σ a_i p[t-i], i = 1...10, + Σ b_j u[t-j], j = 0...9."""
    past, size = np.arange(-order, 0), TRAINING.size
    rows = np.array([[*p[t + past], *u[t + past + 1], 1.0] for t in range(order, size)])
    numbers, *_ = np.linalg.lstsq(rows, p[order:size], rcond=None)
    run = p.copy()
    for t in range(size, p.size):
        run[t] = numbers @ [*run[t + past], *u[t + past + 1], 1.0]
    return run[size:]


# %% The run
def main(data: str, *options: str) -> None:
    """Fit, run freely over the test, compare."""
    tests = Campaign.from_toml(CAMPAIGN, logs=data)
    train, whole, test = tests["train"], tests["whole"], slice(TRAINING.size, None)
    linear = arx(whole.input.values, whole["p"].values) - whole["p"].values[test]
    rows = {"these equations": error(fitted(train), whole, test)}
    rows["ARX(10,10), computed here"] = float(np.sqrt(np.mean(linear**2)))
    print("| free run over the last 512 samples | RMSE of p |\n|---|---|")
    for name, rmse in (rows | PUBLISHED).items():
        print(f"| {name} | {rmse:.3f} |")
    if "--splits" in options:
        print("\n| fitted to samples | RMSE on the rest of the first 512 |\n|---|---|")
        for name, seen in SPLITS.items():
            part = replace(train["p"], weight=seen.astype(float))
            values = fitted(replace(train, channels={"p": part}))
            print(f"| {name} | {error(values, train, ~seen):.3f} |")


if __name__ == "__main__":
    main(*sys.argv[1:])
