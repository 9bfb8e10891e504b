"""Rows of the table for the crane: rope, seaway, runs, a judgment, a year's operability."""

from collections.abc import Iterator
from time import process_time

import numpy as np
from processes import limited
from table import Row, duration
from timing import Run, alone, in_turns

from swashplate.crane import (
    Crane,
    Scatter,
    Seaway,
    Stick,
    control,
    judge,
    load_motion,
    operability,
    simulate,
)

ROPE, SEAWAY, JUDGED, YEAR = 1e-3, 12e-3, 20.0, 60.0
"""Targets. [s]"""
IDEAL, OPEN, CLOSED = 4.0, 9.0, 17.0
"""Targets of runs of 60 s, over the march of the rope."""
ROUNDS = 15
LAW = control.DelayedFeedback(0.2, 0.2) | control.ShipCompensation()
CLIPPED = LAW | control.Clip()


def crane_rows() -> Iterator[Row]:
    """60 s at 512 Hz unless said otherwise, on one core but for what says so."""
    crane, stick = Crane.preset("tg3637"), Stick.rest(60.0)
    how = {"slew_deg": 90.0, "rope_m": 27.0}
    ship = Seaway("ss3", seed=1).motion(60 * 512 + 1)
    tip = simulate(crane, stick, sea=ship, **how).tip
    rope = np.full(len(tip), 27.0)

    def march() -> None:
        load_motion(tip, rope)

    def row(what: str, seconds: float, target: float) -> Row:
        return limited(what, seconds, target, duration(seconds), f"< {duration(target)}")

    def over_rope(what: str, run: Run, target: float) -> Row:
        timed = in_turns(march, run, ROUNDS)
        ratio = 1.0 / timed.ratio
        text = duration(timed.seconds)
        return Row(what, text, f"{ratio:.1f}× rope", f"≤ {target:g}× rope", ratio <= target)

    yield row("crane: rope march, 60 s", alone(march, ROUNDS), ROPE)
    seaway = alone(lambda: Seaway("ss3", seed=1).motion(600 * 512 + 1), ROUNDS)
    yield row("crane: ship's motion in a seaway, 600 s", seaway, SEAWAY)
    yield over_rope(
        "crane: ideal drives in a seaway, 60 s",
        lambda: simulate(crane, stick, sea=ship, actuation="ideal", **how),
        IDEAL,
    )
    yield over_rope(
        "crane: open loop, three drives, in a seaway, 60 s",
        lambda: simulate(crane, stick, sea=ship, **how),
        OPEN,
    )
    yield over_rope(
        "crane: closed loop in a seaway, 60 s",
        lambda: simulate(crane, stick, sea=ship, control=CLIPPED, **how),
        CLOSED,
    )
    seconds = processor_time(
        lambda: judge(crane, CLIPPED, seeds=range(20), remedies=False, turns=False)
    )
    yield row("crane: judgment, 20 seaways of 600 s, 3 variants, processor time", seconds, JUDGED)
    year = alone(lambda: operability(crane, CLIPPED, Scatter.packaged()), 1)
    yield row("crane: operability over the packaged diagram, 8 headings, all cores", year, YEAR)


def processor_time(run: Run) -> float:
    """Processor time of a run on all its threads. [s]"""
    begin = process_time()
    run()
    return process_time() - begin
