"""From an operator's log to a model that predicts another operator: a hydraulic excavator's boom.

    .venv/bin/python examples/excavator.py DATA [--figure boom.png]

DATA is a folder with the trials of github.com/mitchallain/BeagleBone-excavator, tests/data: the
command is the duty cycle of a servo valve in %, the output the position of the cylinder in cm, and
time stamps are irregular. A straight-line drive is given a dead zone and a gain each way, a lag and
a delay; all six are found by least squares on exact sensitivities of the position.
"""

import argparse
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from scipy.optimize import least_squares

from swashplate import Drive
from swashplate.logs import read_series

TRAIN = ["manual_1021_mitch.csv", "manual_mitch_1101_2333.csv"]
PREDICT = "manual_shyam_1102_1824.csv"
NAMES = ["V_dz_plus", "V_dz_minus", "G1_plus", "G1_minus", "Z8", "tau"]
START = np.array([1.0, 1.0, 4.0, 4.0, 1.0 / 0.1, 0.08])  # %, %, (cm/s)/%, (cm/s)/%, 1/s, s
LOWER, UPPER = [0.0, 0.0, 0.1, 0.1, 1.0, 0.0], [2.0, 2.0, 50.0, 50.0, 100.0, 0.5]
ANCHOR = 5.0  # the prediction is set to the measured position this often [s]


def load(path):
    """Time stamps [s], command from neutral [%] and cylinder position [cm] of one trial."""
    time, duty = read_series(path, "Boom Cmd", "1", time_column="Time")
    position = read_series(path, "Boom Ms", "cm", time_column="Time").values
    return time, duty - duty[0], position  # every trial begins with the valve at rest


def drive_of(numbers):
    """The straight-line drive with the six numbers put in."""
    return Drive.preset("neutral").replace(**dict(zip(NAMES, map(float, numbers), strict=True)))


def anchored(time, rows):
    """Rows of a time series less the row at which their window of ANCHOR seconds begins."""
    window = (time - time[0]) // ANCHOR
    return rows - rows[np.searchsorted(window, window)]


def residual(numbers, trials):
    """Simulated less measured motion since the last anchor."""
    errors = []
    for time, command, position in trials:
        run = drive_of(numbers).simulate(command, time=time, interpolation="previous")
        errors.append(anchored(time, run.at(time, "shaft_position") - position))
    return np.concatenate(errors)


def jacobian(numbers, trials):
    """Exact derivatives of the residual."""
    rows = []
    for time, command, _ in trials:
        by = drive_of(numbers).sensitivities(
            command, time=time, interpolation="previous", parameters=NAMES
        )
        rows.append(anchored(time, by.at(time, "shaft_position")))
    return np.vstack(rows)


def main():
    """Fit on one operator, predict another, print and plot the outcome."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("data", type=Path, help="folder with the trials")
    parser.add_argument("--figure", type=Path, help="write the prediction's figure here")
    options = parser.parse_args()
    trials = [load(options.data / name) for name in TRAIN]
    fit = least_squares(
        residual, START, jacobian, bounds=(LOWER, UPPER), x_scale=START, args=(trials,)
    )
    for name, number in zip(NAMES, fit.x, strict=True):
        print(f"{name:11s} {number:8.4f}")
    time, command, position = load(options.data / PREDICT)
    run = drive_of(fit.x).simulate(command, time=time, interpolation="previous")
    error = anchored(time, run.at(time, "shaft_position") - position)
    rmse, motion = (np.sqrt(np.mean(x**2)) for x in (error, anchored(time, position)))
    print(f"{fit.nfev} evaluations; {PREDICT}: RMSE {10 * rmse:.2f} mm, moved {10 * motion:.2f} mm")
    if options.figure:
        figure = Figure(figsize=(10, 5), layout="constrained")
        axes = figure.subplots()
        axes.plot(time, position, color="0.3", label="measured")
        axes.plot(
            time, position + error, color="C1", label=f"predicted, anchored every {ANCHOR:g} s"
        )
        axes.set(xlabel="time [s]", ylabel="boom cylinder [cm]", title=PREDICT)
        axes.legend()
        figure.savefig(options.figure)


if __name__ == "__main__":
    main()
