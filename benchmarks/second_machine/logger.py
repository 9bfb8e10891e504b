"""Campaigns: the runs of a day, logged to CSV files as a user has them, and the truth apart."""

import csv
import json
import os
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from . import controller, draws, instruments
from .draws import LEVELS
from .equations import Cylinder, march_cylinder, march_drive

NEW_RATE = 512.0
"""Rows a second of new maneuvers."""
COMMAND_DIGITS = 6
"""Decimals of the command's column, in volts."""


@dataclass(frozen=True)
class Machine:
    """A drive without instruments."""

    numbers: dict[str, float]

    def march(self, command, length, condition=draws.STEADY):
        """Rows of `march_drive` under a held command."""
        late = command.delayed(self.numbers["tau"], length)
        rows = march_drive(
            late.edges,
            late.volts,
            draws.channel(self.numbers, "plus"),
            draws.channel(self.numbers, "minus"),
            draws.pump(self.numbers),
            condition,
        )
        if not np.isfinite(rows).all():
            raise ValueError("The spool leaves the range of the balance: draw Z5, Z4, Z19 closer.")
        return rows


def sample_instants(logger, length, random):
    """True instants of a run's samples and the stamps that the logger writes. [s]"""
    own = np.arange(int(length * logger.rate) + 1) / logger.rate
    own[1:] += logger.jitter * random.standard_normal(own.size - 1)
    true = own * (1.0 + logger.drift)
    inside = true <= length
    stamps = np.round(own + logger.offset, logger.stamp_digits)
    return true[inside], stamps[inside]


def read_command(logger, volts, random):
    """The command as the logger's converter reads it. [V]"""
    analogue = logger.gain * volts + logger.zero + logger.noise * random.standard_normal(volts.size)
    step = 2.0 * controller.LARGEST / 2**logger.bits
    return np.clip(np.round(analogue / step) * step, -controller.LARGEST, controller.LARGEST)


def written(values, digits):
    """A column as text; no minus before a zero."""
    return [f"{value:.{digits}f}" for value in np.round(values, digits) + 0.0]


def file_name(axis, run):
    """Name of a run's log: it sorts by maneuver, not by the day."""
    return f"{axis}_{run}".replace(", ", "_").replace(" ", "_").replace("/", "-") + ".csv"


class DriveRun(NamedTuple):
    """A run of a drive as its instruments read it."""

    stamps: np.ndarray
    """[s]"""
    volts: np.ndarray
    """[V]"""
    current: np.ndarray | None
    """Of the ammeter, if there is one. [A]"""
    counts: np.ndarray
    speed: np.ndarray | None
    """Of the tacho, if there is one. [rad/s]"""


def run_random(axis, seed, run):
    """Random generator of a run's instruments."""
    return np.random.default_rng([seed, LEVELS["seeds"][axis], 100 + run_index(axis, run)])


def given_command(equipment, run, random, exact):
    """Command of a run, instants and stamps of its samples [s], and what is logged of it [V].

    With `exact` it goes straight between the samples, unrounded, and is logged without an error.
    """
    axis, seed, logger = equipment.axis, equipment.seed, equipment.logger
    length, wish = controller.maneuver(run.split(",")[0], axis)
    instants, stamps = sample_instants(logger, length, random)
    if exact:
        return controller.straight(instants, wish(instants)), instants, stamps, wish(instants)
    command = controller.held(wish, length, draws.drawn_controller(axis, seed, run))
    volts = command.at(instants - logger.command_delay)
    return command, instants, stamps, read_command(logger, volts, random)


def drive_run(equipment, run, exact=False):
    """Run a drive once and read its instruments; `exact` as of `given_command`."""
    random = run_random(equipment.axis, equipment.seed, run)
    command, instants, stamps, volts = given_command(equipment, run, random, exact)
    machine = Machine(equipment.parameters)
    rows = machine.march(command, command.edges[-1], equipment.conditions[run])
    zero = random.uniform(0.0, 4.0)
    counts = instruments.encoder(rows, rows[:, 4], instants, equipment.encoder, zero)
    current, speed = None, None
    if equipment.ammeter is not None:
        current = instruments.ammeter(rows, instants, equipment.ammeter, random)
    if equipment.tacho is not None:
        speed = instruments.tacho(rows, instants, equipment.tacho, random)
    return DriveRun(stamps, volts, current, counts, speed)


def drive_columns(equipment, run, exact=False):
    """Header and text of the columns of a drive's run."""
    equipment = equipment.elsewhere.get(run, equipment)
    signals = drive_run(equipment, run, exact)
    columns = {
        "time [s]": written(signals.stamps, equipment.logger.stamp_digits),
        "voltage [V]": written(signals.volts, COMMAND_DIGITS),
    }
    if signals.current is not None:
        columns["current [A]"] = written(signals.current, 4)
    columns["encoder [counts]"] = written(signals.counts, 0)
    if signals.speed is not None:
        columns["speed [rad/s]"] = written(signals.speed, 6)
    return columns


def cylinder_columns(equipment, run, exact=False):
    """Header and text of the columns of a cylinder's run."""
    random = run_random("cylinder", equipment.seed, run)
    command, instants, stamps, volts = given_command(equipment, run, random, exact)
    cylinder = Cylinder(**equipment.parameters)
    rows = march_cylinder(command.edges, command.volts, cylinder, equipment.conditions[run])
    zero = random.uniform(0.0, 4.0)
    counts = instruments.encoder(rows, rows[:, 2], instants, equipment.encoder, zero)
    return {
        "time [s]": written(stamps, equipment.logger.stamp_digits),
        "valve [V]": written(volts, COMMAND_DIGITS),
        "rod [m]": written(counts * equipment.encoder.step, 6),
    }


def run_index(axis, run):
    """Place of a run in the list of levels.toml, which its noise is drawn by."""
    return draws.run_names(axis).index(run)


def write_run(path, columns, stamp):
    """Write a log and set its file's time."""
    with path.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows(zip(*columns.values(), strict=True))
    os.utime(path, (stamp, stamp))


def write_campaign(equipment, folder, exact_command=False):
    """Write the logs of a campaign and what they were made with.

    Parameters
    ----------
    equipment : draws.Equipment
        As drawn, or changed by a fault.
    folder : Path
        Gets `logs/` and `truth.json`.
    exact_command : bool
        Whether the command goes straight between the samples and is logged without an error. It
        does not in a sound campaign: this is for what a fit gets of knowing it.

    Returns
    -------
    dict
        "parameters" by name, "counts_per_turn" (1 for a cylinder), "ammeter_gain" (1 without an
        ammeter), "held_out" (names of files), "runs" (names of files in the order of the day).
    """
    folder = Path(folder)
    logs = folder / "logs"
    logs.mkdir(parents=True, exist_ok=True)
    axis = equipment.axis
    columns = cylinder_columns if axis == "cylinder" else drive_columns
    for run in equipment.conditions:
        write_run(
            logs / file_name(axis, run),
            columns(equipment, run, exact_command),
            equipment.stamps[run],
        )
    truth = {
        "axis": axis,
        "seed": equipment.seed,
        "rate": equipment.logger.rate,
        "parameters": equipment.parameters,
        "counts_per_turn": equipment.counts_per_turn,
        "ammeter_gain": 1.0 if equipment.ammeter is None else equipment.ammeter.gain,
        "held_out": [file_name(axis, run) for run in equipment.held_out],
        "runs": [file_name(axis, run) for run in equipment.conditions],
    }
    (folder / "truth.json").write_text(json.dumps(truth, indent=1), "utf-8")
    return truth


def new_command(name, axis):
    """Rows of a new maneuver's command, straight between them: time [s] and command [V]."""
    length, wish = controller.new_maneuver(name, axis)
    time = np.arange(round(length * NEW_RATE) + 1) / NEW_RATE
    return time, wish(time)


def new_run(numbers, axis, name, condition=draws.STEADY):
    """A new maneuver of a drive, without instruments, 512 rows a second.

    Returns
    -------
    (n, 3) array
        Time [s], command [V], straight between rows, and speed of the drum [rad/s].
    """
    time, volts = new_command(name, axis)
    rows = Machine(numbers).march(controller.straight(time, volts), time[-1], condition)
    return np.column_stack([time, volts, np.interp(time, rows[:, 0], rows[:, 5])])


def new_cylinder_run(cylinder, name):
    """A new maneuver of a cylinder: time [s], command [V] and speed of the rod [m/s], (n, 3)."""
    time, volts = new_command(name, "cylinder")
    command = controller.straight(time, volts)
    rows = march_cylinder(command.edges, command.volts, cylinder, 1.0)
    return np.column_stack([time, volts, np.interp(time, rows[:, 0], rows[:, 3])])
