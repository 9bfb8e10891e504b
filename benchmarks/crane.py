"""Rows of the table for the crane: rope, seaway, runs, an assessment, a year of operability."""

from collections.abc import Iterator
from statistics import median
from time import process_time

import numpy as np
from processes import limited
from table import Row, duration
from timing import Run, alone

from swashplate.crane import (
    Crane,
    OperatorCommand,
    Scatter,
    Seaway,
    assess,
    control,
    load_motion,
    operability,
    simulate,
)

ROPE, SEAWAY = 1e-3, 12e-3
IDEAL, OPEN, CLOSED = 4.0, 9.0, 17.0
"""Targets, times of the rope's march."""
ASSESSED, YEAR = 20.0, 60.0
"""Targets: processor time of an assessment, and time of a year on two cores. [s]"""
CLIPPED = control.DelayedFeedback(0.2, 0.2) | control.ShipCompensation() | control.Clip()


def crane_rows() -> Iterator[Row]:
    """60 s at 512 Hz unless said otherwise, in processor time but for what says so."""
    crane, command = Crane.preset("tg3637"), OperatorCommand.rest(60.0)
    how = {"slew_deg": 90.0, "rope_m": 27.0}
    ship = Seaway("ss3", seed=1).motion(60 * 512 + 1)
    tip = simulate(crane, command, sea=ship, **how).tip
    lengths = np.full(len(tip), 27.0)

    def row(what: str, seconds: float, target: float) -> Row:
        return limited(what, seconds, target, duration(seconds), f"< {duration(target)}")

    def over_rope(what: str, run: Run, target: float) -> Row:
        seconds = processor_time(run, 15)
        ratio = seconds / rope
        shown = f"{duration(seconds)}, {ratio:.1f} times the rope"
        return limited(what, ratio, target, shown, f"< {target:g} times the rope")

    rope = processor_time(lambda: load_motion(tip, lengths), 15)
    yield row("crane: rope march, 60 s", rope, ROPE)
    seaway = processor_time(lambda: Seaway("ss3", seed=1).motion(600 * 512 + 1), 15)
    yield row("crane: ship's motion in a seaway, 600 s", seaway, SEAWAY)
    moving = {**how, "sea": ship}
    yield over_rope(
        "crane: ideal drives in a seaway, 60 s",
        lambda: simulate(crane, command, actuation="ideal", **moving),
        IDEAL,
    )
    yield over_rope(
        "crane: open loop, three drives, in a seaway, 60 s",
        lambda: simulate(crane, command, **moving),
        OPEN,
    )
    law = control.TipShaper("zv") | CLIPPED
    yield over_rope(
        "crane: closed loop, three drives, in a seaway, 60 s",
        lambda: simulate(crane, command, control=law, **moving),
        CLOSED,
    )
    short = {"remedies": False, "tipping_points": False}
    assessed = processor_time(lambda: assess(crane, CLIPPED, seeds=range(20), **short), 1)
    yield row("crane: assessment, 20 seaways of 10 min, 3 variants", assessed, ASSESSED)
    year = alone(lambda: operability(crane, CLIPPED, Scatter.packaged()), 1)
    yield row(
        "crane: operability, a year, 8 headings, 3 variants, all cores, wall clock", year, YEAR
    )


def processor_time(run: Run, rounds: int) -> float:
    """Median processor time of a run on all its threads, which other loads change little. [s]"""
    found = []
    for _ in range(rounds):
        begin = process_time()
        run()
        found.append(process_time() - begin)
    return median(found)
