"""Campaigns: the runs of a day, logged to CSV files as a user has them, and the truth apart."""

import csv
import json
import os
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import NamedTuple

import numpy as np

from . import controller, draws, instruments
from .draws import LEVELS
from .equations import march_cylinder, march_drive

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
    current: np.ndarray
    """[A]"""
    counts: np.ndarray
    speed: np.ndarray | None
    """Of the tacho, if there is one. [rad/s]"""


def run_random(axis, seed, run):
    """Random generator of a run's instruments."""
    return np.random.default_rng([seed, LEVELS["seeds"][axis], 100 + run_index(axis, run)])


def given_command(axis, seed, logger, run, random, exact):
    """Command of a run, instants and stamps of its samples [s], and what is logged of it [V].

    With `exact` it goes straight between the samples, unrounded, and is logged without an error.
    """
    length, wish = controller.maneuver(run.split(",")[0], axis)
    instants, stamps = sample_instants(logger, length, random)
    if exact:
        return controller.straight(instants, wish(instants)), instants, stamps, wish(instants)
    command = controller.held(wish, length, draws.drawn_controller(axis, seed, run))
    return command, instants, stamps, read_command(logger, command.at(instants), random)


def drive_run(axis, seed, logger, run, condition, machine, exact=False):
    """Run a drive once and read its instruments; `exact` as of `given_command`."""
    random = run_random(axis, seed, run)
    command, instants, stamps, volts = given_command(axis, seed, logger, run, random, exact)
    rows = machine.march(command, command.edges[-1], condition)
    zero = random.uniform(0.0, 4.0)
    encoder = draws.drawn_encoder(axis, seed)
    counts = instruments.encoder(rows, rows[:, 4], instants, encoder, zero)
    current = instruments.ammeter(rows, instants, draws.drawn_ammeter(axis, seed), random)
    tacho = draws.drawn_tacho(axis, seed)
    speed = None if tacho is None else instruments.tacho(rows, instants, tacho, random)
    return DriveRun(stamps, volts, current, counts, speed)


def drive_columns(axis, seed, logger, run, condition, machine, exact):
    """Header and text of the columns of a drive's run."""
    signals = drive_run(axis, seed, logger, run, condition, machine, exact)
    columns = {
        "time [s]": written(signals.stamps, logger.stamp_digits),
        "voltage [V]": written(signals.volts, COMMAND_DIGITS),
        "current [A]": written(signals.current, 4),
        "encoder [counts]": written(signals.counts, 0),
    }
    if signals.speed is not None:
        columns["speed [rad/s]"] = written(signals.speed, 6)
    return columns


def cylinder_columns(seed, logger, run, gain, cylinder, exact):
    """Header and text of the columns of a cylinder's run."""
    random = run_random("cylinder", seed, run)
    command, instants, stamps, volts = given_command("cylinder", seed, logger, run, random, exact)
    rows = march_cylinder(command.edges, command.volts, cylinder, gain)
    tool = draws.drawn_encoder("cylinder", seed)
    zero = random.uniform(0.0, 4.0)
    rod = instruments.encoder(rows, rows[:, 2], instants, tool, zero) * tool.step
    return {
        "time [s]": written(stamps, logger.stamp_digits),
        "valve [V]": written(volts, COMMAND_DIGITS),
        "rod [m]": written(rod, 6),
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


def write_campaign(axis, seed, folder, rate=512.0, stated_spread=0.0, exact_command=False):
    """Write the logs of a campaign and what they were made with.

    Parameters
    ----------
    axis : str
        "hoist", "slew", "luff" or "cylinder".
    seed : int
    folder : Path
        Gets `logs/` and `truth.json`.
    rate : float
        Samples a second of the logger.
    stated_spread : float
        As of `draws.drawn_parameters`.
    exact_command : bool
        Whether the command goes straight between the samples and is logged without an error. It
        does not in a sound campaign: this is for what a fit gets of knowing it.

    Returns
    -------
    dict
        "parameters" by name, "counts_per_turn" (1 for a cylinder), "ammeter_gain", "held_out"
        (names of files), "runs" (names of files in the order of the day).
    """
    folder = Path(folder)
    logs = folder / "logs"
    logs.mkdir(parents=True, exist_ok=True)
    logger = draws.drawn_logger(axis, seed, rate)
    names, gaps = draws.day(axis, seed)
    clock = datetime.fromisoformat(LEVELS["campaign"]["start"]).timestamp()
    if axis == "cylinder":
        cylinder = draws.drawn_cylinder(seed)
        parameters = cylinder._asdict()
        conditions = draws.drawn_gains(seed)
    else:
        parameters = draws.drawn_parameters(axis, seed, stated_spread)
        machine = Machine(parameters)
        conditions = draws.drawn_conditions(axis, seed)
    for run, gap, condition in zip(names, gaps, conditions, strict=True):
        if axis == "cylinder":
            columns = cylinder_columns(seed, logger, run, condition, cylinder, exact_command)
        else:
            columns = drive_columns(axis, seed, logger, run, condition, machine, exact_command)
        clock += gap
        write_run(logs / file_name(axis, run), columns, clock)
    truth = {
        "axis": axis,
        "seed": seed,
        "rate": rate,
        "parameters": parameters,
        "counts_per_turn": turn(axis, seed),
        "ammeter_gain": 1.0 if axis == "cylinder" else draws.drawn_ammeter(axis, seed).gain,
        "held_out": [file_name(axis, run) for run in LEVELS["held_out"][axis]],
        "runs": [file_name(axis, run) for run in names],
    }
    (folder / "truth.json").write_text(json.dumps(truth, indent=1), "utf-8")
    return truth


def turn(axis, seed):
    """Counts a turn of a campaign's encoder, as its label says; 1 for a cylinder."""
    if axis == "cylinder":
        return 1.0
    return 2.0 * np.pi / draws.drawn_encoder(axis, seed).step


def new_command(name, axis):
    """Rows of a new maneuver's command, straight between them: time [s] and command [V]."""
    length, wish = controller.new_maneuver(name, axis)
    time = np.arange(round(length * NEW_RATE) + 1) / NEW_RATE
    return time, wish(time)


def new_run(numbers, axis, name):
    """A new maneuver of a drive, without instruments, 512 rows a second.

    Returns
    -------
    (n, 3) array
        Time [s], command [V], straight between rows, and speed of the drum [rad/s].
    """
    time, volts = new_command(name, axis)
    rows = Machine(numbers).march(controller.straight(time, volts), time[-1])
    return np.column_stack([time, volts, np.interp(time, rows[:, 0], rows[:, 5])])


def new_cylinder_run(cylinder, name):
    """A new maneuver of a cylinder: time [s], command [V] and speed of the rod [m/s], (n, 3)."""
    time, volts = new_command(name, "cylinder")
    command = controller.straight(time, volts)
    rows = march_cylinder(command.edges, command.volts, cylinder, 1.0)
    return np.column_stack([time, volts, np.interp(time, rows[:, 0], rows[:, 3])])
