"""Two models of an excavator's cylinders, fitted to some trials and scored on the ones left out.

    .venv/bin/python examples/excavator.py DATA [--figure excavator.png]

DATA is a folder with the trials of github.com/mitchallain/BeagleBone-excavator, tests/data. The
models are the drive "neutral" and a valve of one's own equations; see docs/own-models.md.
"""

import argparse
from collections.abc import Iterator
from math import exp, inf
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure

from swashplate import Campaign, Channel, Drive, Experiment
from swashplate.equations import Model, Tap, equation
from swashplate.identification import DriveModel, OwnModel, Prior, Problem, Unknown, Unknowns
from swashplate.identification.solving import solve
from swashplate.identification.starts import sobol_starts

# %% What is given
CAMPAIGN = Path(__file__).with_name("excavator.toml")
ANCHOR = 5.0  # what is predicted is set to the measured position this often [s]
NOISE = 0.003  # what one unit of residual is [m]
RATE = 150.0  # steps a second, some eight a sample [Hz]
STROKE = 0.04  # half the stroke that a cylinder uses, roughly [m]
MIDDLE = {"boom": 0.088, "stick": 0.080, "bucket": 0.060}  # of that stroke [m]
QUICK = 1e6 / 4.8  # Z8 of the drive "neutral" for a lag of 1 s
LINE = (
    Unknown("V_dz_plus", 1.0, 0.0, 2.0, "%"),
    Unknown("V_dz_minus", 1.0, 0.0, 2.0, "%"),
    Unknown("G1_plus", 0.02, 0.002, 0.5, "m/s/%", log=True),
    Unknown("G1_minus", 0.02, 0.002, 0.5, "m/s/%", log=True),
    Unknown("Z8", 15.0 * QUICK, 2.0 * QUICK, 200.0 * QUICK, "sqrt(Pa)/(m s)", log=True),
    Unknown("tau", 0.08, 0.0, 0.3, "s"),
)
# Dead zones of 0.6 to 1.5 % duty and delays near 0.1 s stand in the description of the data; the
# rest is known by its order. Mean, deviation and bounds:
KNOWN = {
    "delay": (0.1, 0.03, 0.0, 0.3),
    "lag": (0.06, 0.5, 0.005, 0.5),
    "overlap_out": (1.05, 0.25, 0.1, 1.9),
    "overlap_back": (1.05, 0.25, 0.1, 1.9),
    "width": (0.3, 0.5, 0.02, 1.5),
    "speed_out": (0.022, 0.4, 0.005, 0.12),
    "speed_back": (0.022, 0.4, 0.005, 0.12),
    "slope": (0.0, 0.1, -0.6, 0.6),
}
Valve = NamedTuple("Valve", [(name, float) for name in KNOWN])
LOGARITHMS = ("lag", "width", "speed_out", "speed_back")
VALVE = [  # a window of 95 samples tells no more than one of them
    Unknown(name, mean, *bounds, log=name in LOGARITHMS, prior=Prior(mean, deviation / 95.0**0.5))
    for name, (mean, deviation, *bounds) in KNOWN.items()
]


# %% The valve: a servo that turns a rotary valve, with overlap, flow that saturates, and a load
class Stroke(NamedTuple):
    """Where a cylinder's load is counted from, and its end stops. [m]"""

    middle: float
    low: float = -inf
    high: float = inf


class Rod(NamedTuple):
    """Opening of the valve [%] and position of the rod [m]."""

    opening: float
    position: float


@equation
def flow(opening: float, overlap: float, width: float) -> float:
    """Share of the full flow [1]: none within the overlap, then more, up to what the pump has."""
    return 1.0 - exp(-max(opening - overlap, 0.0) / width)


@equation
def step(state: Rod, command: float, p: Valve, h: float, given: Stroke) -> Rod:
    """Opening and position one step on."""
    opening = state.opening + (1.0 - exp(-h / p.lag)) * (command - state.opening)
    load = p.slope * (state.position - given.middle) / STROKE
    out = p.speed_out * flow(opening, p.overlap_out, p.width) * (1.0 - load)
    back = p.speed_back * flow(-opening, p.overlap_back, p.width) * (1.0 + load)
    return Rod(opening, min(max(state.position + h * (out - back), given.low), given.high))


COMMAND = Tap("command", delay="delay", hold="mean")
valve = Model("valve", Valve, Rod, step, given=Stroke, taps={"command": COMMAND})


# %% Fitted to some trials, scored on another
# A position is the integral of a speed, so a small error of the speed grows without end. Counted
# from the measured position at the beginning of each window, runs of any length are comparable.
def since_anchor(channel: Channel, rows: np.ndarray) -> np.ndarray:
    """Rows of a time series less the row at the first sample of each window."""
    windows = (channel.time - channel.time[0]) // ANCHOR
    return rows - rows[np.searchsorted(windows, windows)]


def errors(tests: Campaign, left_out: Experiment) -> Iterator[np.ndarray]:
    """Errors [m] of the straight line and the valve in a trial that they were not fitted to."""
    others = tuple(e for e in tests.select(axis=left_out.axis) if e is not left_out)
    # of the drive "neutral" an ampere is 2/3 Z10, here 1 m/s: its gains are speeds for a per cent
    line = DriveModel(Drive.preset("neutral").replace(Z10=1.5).parameters)
    given, begin = Stroke(MIDDLE[left_out.axis]), {"position": "position"}
    own = OwnModel(valve, rate=RATE, given=given, begin=begin)
    for model, unknowns, starts in ((line, Unknowns(LINE), 2), (own, Unknowns(tuple(VALVE)), 1)):
        scale = {"position": NOISE}
        problem = Problem(model, others, unknowns, ("position",), scale, compare=since_anchor)
        begins = [problem.start, *sobol_starts(problem, starts - 1, seed=1)]
        found = [solve(problem, each, loss="soft_l1", tolerance=1e-4) for each in begins]
        values = unknowns.values(min(found, key=lambda each: each.cost).vector)
        position = left_out["position"]
        simulated = model.simulate(values, left_out)["position"]
        yield since_anchor(position, simulated - position.values)


# %% The run
def main() -> None:
    """Print each trial's score; draw what the valve makes of the last trial if asked to."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("data", type=Path, help="folder with the trials")
    parser.add_argument("--figure", type=Path, help="draw the last trial here")
    options = parser.parse_args()
    tests = Campaign.from_toml(CAMPAIGN, logs=options.data)
    figure, wins = Figure(figsize=(11, 8), layout="constrained"), 0
    print("| cylinder | trial left out | moves [mm] | straight line [mm] | valve [mm] | |")
    print("|---|---|---|---|---|---|")
    for number, axis in enumerate(tests.axes, start=1):
        for left_out in tests.select(axis=axis):
            position = left_out["position"]
            moved = since_anchor(position, position.values)
            rows = np.array([moved, *errors(tests, left_out)])
            moves, line, own = 1e3 * np.sqrt(np.mean(rows**2, axis=1))
            lost, wins = "" if own < line else "lost", wins + (own < line)
            print(f"| {axis} | {left_out.run} | {moves:.2f} | {line:.2f} | {own:.2f} | {lost} |")
        plot = figure.add_subplot(3, 1, number, title=left_out.name, ylabel="position [mm]")
        plot.plot(position.time, 1e3 * position.values, color="0.3", label="measured")
        plot.plot(position.time, 1e3 * (position.values + rows[2]), label="predicted")
        plot.legend()
    print(f"\nThe valve is the better one in {wins} of {len(tests)}.")
    if options.figure:
        figure.savefig(options.figure, dpi=150)


if __name__ == "__main__":
    main()
