"""Rows of the table for the crane: rope, open and closed loop, seaways, a judgment."""

from collections.abc import Iterator

import numpy as np
from processes import limited
from table import Row, duration
from timing import alone

from swashplate.crane import Crane, Seaway, Stick, Study, control, judge, load_motion, simulate

ROPE, OPEN, CLOSED, SEAWAY = 1e-3, 6e-3, 12e-3, 12e-3
THOUSAND, JUDGED = 15.0, 10.0
"""Targets. [s]"""
MEANT = control.DelayedFeedback(0.2, 0.2) | control.ShipCompensation()


def crane_rows() -> Iterator[Row]:
    """60 s at 512 Hz unless said otherwise, on one core but for what says so."""
    crane, stick = Crane.preset("tg3637"), Stick.rest(60.0)
    how = {"slew_deg": 90.0, "rope_m": 27.0}
    ship = Seaway("ss3", seed=1).motion(60 * 512 + 1)
    tip = simulate(crane, stick, sea=ship, **how).tip

    def row(what: str, seconds: float, target: float) -> Row:
        return limited(what, seconds, target, duration(seconds), f"< {duration(target)}")

    rope = np.full(len(tip), 27.0)
    yield row("crane: rope march, 60 s", alone(lambda: load_motion(tip, rope), 15), ROPE)
    seaway = alone(lambda: Seaway("ss3", seed=1).motion(600 * 512 + 1), 15)
    yield row("crane: ship's motion in a seaway, 600 s", seaway, SEAWAY)
    plain = alone(lambda: simulate(crane, stick, **how), 9)
    yield row("crane: open loop, three drives, 60 s", plain, OPEN)
    closed = alone(lambda: simulate(crane, stick, sea=ship, control=MEANT, **how), 9)
    yield row("crane: closed loop in a seaway, 60 s", closed, CLOSED)
    study = Study.of(crane, MEANT, seeds=range(1000))
    many = alone(lambda: study.outcomes([study.cases["identified"]]), 1)
    yield row("crane: 1,000 seaways of 120 s, closed loop, all cores", many, THOUSAND)
    judged = alone(lambda: judge(crane, MEANT, seeds=range(200), remedies=False), 1)
    yield row("crane: judgment, 200 seaways, 2 sets of drives, all cores", judged, JUDGED)
