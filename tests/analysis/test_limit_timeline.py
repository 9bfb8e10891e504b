"""Stretches of time in which limits act."""

import numpy as np
import pytest

from swashplate import Drive, Limit, maneuvers
from swashplate.analysis.limits import limit_timeline


def test_spans_hold_what_the_flags_say(hoist: Drive) -> None:
    run = hoist.simulate(maneuvers.step(9.0).sample())
    found = limit_timeline(run)
    assert found.limits == (Limit.DEAD_ZONE, Limit.CURRENT_RATE, Limit.ORIFICE, Limit.SWASH_STOP)
    for limit, spans, share in zip(found.limits, found.spans, found.shares, strict=True):
        inside = np.zeros(run.time.size, dtype=bool)
        for begin, end in spans:
            inside |= (run.time >= begin) & (run.time <= end)
        np.testing.assert_array_equal(inside, run.active(limit))
        assert share == pytest.approx(run.active(limit).mean())
    assert found.free == pytest.approx((run.limits == 0).mean())
    # the plate reaches its stop once and leaves it once
    (stop,) = found.spans[3]
    assert 2.4 < stop[0] < 2.6
    assert 6.0 < stop[1] < 6.25


def test_ends_of_the_record_and_single_samples() -> None:
    drive = Drive.preset("neutral").replace(Z17=0.5)
    run = drive.simulate(np.array([0.0, 0.0]), 512.0)
    found = limit_timeline(run)
    np.testing.assert_array_equal(found.spans[0], [[0.0, 1.0 / 512.0]])
    table = found.to_polars()
    assert table.rows() == [("dead_zone", 0.0, 1.0 / 512.0)]


def test_no_limit_acts() -> None:
    run = Drive.preset("neutral").simulate(np.full(10, 2.0), start="steady")
    found = limit_timeline(run)
    assert found.limits == found.spans == found.shares == ()
    assert found.free == 1.0
    assert found.to_polars().is_empty()
