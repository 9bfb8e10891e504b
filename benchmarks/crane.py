"""Rows of the table for the crane: rope, open and closed loop, seaways, a judgment."""

from collections.abc import Iterator

import numpy as np
from processes import limited
from table import Row, duration
from timing import alone

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

ROPE, SEAWAY = 1e-3, 12e-3
IDEAL, OPEN, CLOSED = 4.0, 9.0, 17.0
"""Targets, times of the rope's march."""
JUDGED, YEAR = 10.0, 60.0
"""Targets on two cores: of 20 seaways 20 s of processor time. [s]"""
CLIPPED = control.DelayedFeedback(0.2, 0.2) | control.ShipCompensation() | control.Clip()


def crane_rows() -> Iterator[Row]:
    """60 s at 512 Hz unless said otherwise, on one core but for what says so."""
    crane, stick = Crane.preset("tg3637"), Stick.rest(60.0)
    how = {"slew_deg": 90.0, "rope_m": 27.0}
    ship = Seaway("ss3", seed=1).motion(60 * 512 + 1)
    tip = simulate(crane, stick, sea=ship, **how).tip

    def row(what: str, seconds: float, target: float) -> Row:
        return limited(what, seconds, target, duration(seconds), f"< {duration(target)}")

    lengths = np.full(len(tip), 27.0)
    rope = alone(lambda: load_motion(tip, lengths), 15)
    yield row("crane: rope march, 60 s", rope, ROPE)
    seaway = alone(lambda: Seaway("ss3", seed=1).motion(600 * 512 + 1), 15)
    yield row("crane: ship's motion in a seaway, 600 s", seaway, SEAWAY)

    def over_rope(what: str, seconds: float, target: float) -> Row:
        ratio = seconds / rope
        shown = f"{duration(seconds)}, {ratio:.1f} times the rope"
        return limited(what, ratio, target, shown, f"< {target:g} times the rope")

    moving = {**how, "sea": ship}
    ideal = alone(lambda: simulate(crane, stick, actuation="ideal", **moving), 9)
    yield over_rope("crane: ideal drives in a seaway, 60 s", ideal, IDEAL)
    plain = alone(lambda: simulate(crane, stick, **moving), 9)
    yield over_rope("crane: open loop, three drives, in a seaway, 60 s", plain, OPEN)
    law = control.TipShaper("zv") | CLIPPED
    closed = alone(lambda: simulate(crane, stick, control=law, **moving), 9)
    yield over_rope("crane: closed loop, three drives, in a seaway, 60 s", closed, CLOSED)
    short = {"remedies": False, "turns": False}
    judged = alone(lambda: judge(crane, CLIPPED, seeds=range(20), **short), 1)
    yield row("crane: judgment, 20 seaways of 10 min, 3 variants, all cores", judged, JUDGED)
    year = alone(lambda: operability(crane, CLIPPED, Scatter.packaged()), 1)
    yield row("crane: operability, a year, 8 headings, 3 variants, all cores", year, YEAR)
