"""What a fit states of the speed's error, beside the true one in new maneuvers.

A verdict states errors of classes of motion, each as fast as the tests; the band about a simulation
states that of one maneuver, whatever it is.
"""

from types import SimpleNamespace

import numpy as np
from command_line import new_names
from second_machine import logger

from swashplate import Drive
from swashplate.errors import InputError
from swashplate.identification import Identification
from swashplate.identification.diagnostics import discrepancy

FEWEST = 50
"""Samples of a new maneuver from which a class of motion counts."""
STILL = 1e-4
"""Part of the speed's range by which it changes in a class at least, if it counts."""
FASTER = "sine 0.5 Hz"
"""The new maneuver that verdicts state apart where no test is as fast."""


def in_new_maneuvers(folder, equipment, record):
    """Stated and true error of the speed in new maneuvers under conditions of the machine's day.

    Parameters
    ----------
    folder : Path
        Holds the logs and the fit.
    equipment : draws.Equipment
    record : dict
        As of `command_line.fit`.

    Returns
    -------
    list of dict
        "maneuver", "motion" (a class of `discrepancy.classes_of`), "samples", and, RMS in % of the
        signal's range: "true", "stated" for such a signal and such a change of it, "printed" for
        the class, and "faster" for the sine that is faster than any test. What is not stated is
        None, as of a class that the verdict calls unknown.
    """
    stored = [each for each in record["predictions"] if each["channel"] in record["decisive"][:1]]
    if not stored:
        return []
    prediction = restored(stored[0])
    drive = Drive.from_toml(folder / "fitted" / "drive.toml")
    logs = sorted((folder / "logs").iterdir())
    volts = [np.loadtxt(path, delimiter=",", skiprows=1, usecols=1) for path in logs]
    largest, rows = float(np.abs(np.concatenate(volts)).max()), []
    for name, run in new_runs(equipment):
        errors = stated_and_true(prediction, drive, run, largest)
        apart = [part.error for part in prediction.beyond if name == FASTER and "Hz" in part.motion]
        faster = 100.0 * apart[0] if apart else None
        rows += [{"maneuver": name, **each, "faster": faster} for each in errors]
    return rows


def new_runs(equipment):
    """Each new maneuver's name and run, (n, 3) as of `logger.new_run`, over the machine's day."""
    conditions, names = list(equipment.conditions.values()), new_names()
    for index, name in enumerate(names):
        place = round((index + 0.5) / len(names) * (len(conditions) - 1))
        yield name, logger.new_run(equipment.parameters, equipment.axis, name, conditions[place])


def bands_in_new_maneuvers(folder, equipment):
    """The band about the speed in new maneuvers under conditions of the machine's day.

    Returns
    -------
    list of dict
        "maneuver", "true" (RMS error) and "band" (RMS of the band's half width) in % of the range
        of the tests, and "inside", the share of samples in the band. Empty if no run moved.
    """
    fit, rows = Identification.load(folder / "fitted"), []
    for name, run in new_runs(equipment):
        _, command, speed = run.T
        try:
            band = fit.band(command, logger.NEW_RATE)
        except InputError:
            return []
        error, full = band.speed - speed, 0.01 * band.reach
        rows.append({
            "maneuver": name,
            "true": float(np.sqrt(np.mean(error**2))) / full,
            "band": float(np.sqrt(np.mean(band.half_width**2))) / full,
            "inside": float(np.mean(np.abs(error) <= band.half_width)),
        })  # fmt: skip
    return rows


def stated_and_true(prediction, drive, run, largest):
    """Errors of `in_new_maneuvers` in one maneuver, (n, 3) as of `logger.new_run`."""
    _, command, speed = run.T
    signal, step = drive.simulate(command, logger.NEW_RATE).shaft_speed, 1.0 / logger.NEW_RATE
    rate = discrepancy.TIME * np.gradient(signal, step)
    # all that its class depends on
    record = SimpleNamespace(step=step, signal=signal, rate=rate, command=command)
    classes = {stated.motion: stated for stated in prediction.classes}
    for motion, inside in discrepancy.classes_of(record, prediction.reach, largest).items():
        if inside.sum() < FEWEST or np.ptp(speed[inside]) < STILL * prediction.reach:
            continue
        true = 100.0 * np.sqrt(np.mean((signal - speed)[inside] ** 2)) / prediction.reach
        row = {"motion": motion, "samples": int(inside.sum()), "true": float(true)}
        if (stated := classes.get(motion)) is None:
            yield row | {"stated": None, "printed": None}
            continue
        changes = rate[inside] / discrepancy.TIME
        model = np.mean(prediction.squares(signal[inside], changes)) / prediction.reach**2
        error = 100.0 * float(np.sqrt(model + stated.left_open**2))
        yield row | {"stated": error, "printed": 100.0 * stated.error}


def restored(entry):
    """The `discrepancy.PredictionError` that a verdict stores."""
    entry = dict(entry)
    entry["classes"] = tuple(discrepancy.ClassError(*each) for each in entry["classes"])
    entry["beyond"] = tuple(discrepancy.BeyondTests(*each) for each in entry.get("beyond", ()))
    return discrepancy.PredictionError(**entry)
