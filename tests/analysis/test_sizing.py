"""Sizing: closed forms of the smallest change, and what cannot be met."""

import numpy as np
import pytest

from swashplate import Drive, InputError, maneuvers
from swashplate.analysis import (
    DEFAULT_RANGE,
    Performance,
    Requirements,
    Trial,
    performance,
    proportional_speed,
    size,
    sizing,
    smallest_change,
    trial_of,
)

BOX = np.full(2, 0.5), np.full(2, 2.0)


@pytest.mark.parametrize(
    ("slack", "expected", "close"),
    [
        # a b = 2: shared equally
        (lambda x: np.array([x[0] * x[1] - 2.0]), [np.sqrt(2.0)] * 2, 1e-4),
        # a ≥ 1.5 and a + b ≤ 2.3: their corner
        (lambda x: np.array([x[0] - 1.5, 2.3 - x[0] - x[1]]), [1.5, 0.8], 1e-6),
        (lambda x: np.array([1.0]), [1.0, 1.0], 0.0),
    ],
)
def test_the_least_change(slack, expected, close):
    found = smallest_change(slack, *BOX)
    assert found == pytest.approx(expected, rel=close)
    assert slack(found).min() >= 0.0
    assert smallest_change(lambda x: np.array([x[0] - 3.0]), *BOX) is None


def test_a_speed_is_met_by_the_pump_in_proportion(hoist):
    required = Requirements(speed=np.radians(250.0))
    found = size(hoist, required, {"pump": DEFAULT_RANGE})
    expected = 250.0 / np.degrees(12.396 * 0.26047)  # Z10 times the minus stop
    assert found.factors["pump"] == pytest.approx(expected, rel=1e-6)
    assert found.sufficient_factors["pump"] == pytest.approx(expected, rel=1e-6)
    assert found.after.speed >= required.speed
    assert found.drive["Z10"].value == pytest.approx(12.396 * expected, rel=1e-6)
    found = size(hoist, Requirements(speed=np.radians(180.0)), {"pump": DEFAULT_RANGE})
    assert (found.factors, found.change) == ({"pump": 1.0}, 0.0)


@pytest.mark.slow
def test_an_acceleration_is_shared_by_orifice_and_pump(hoist):
    """It goes with their product: equal factors, the root of the ratio."""
    required = Requirements(acceleration=np.radians(200.0))
    found = size(hoist, required, {"orifice": DEFAULT_RANGE, "pump": DEFAULT_RANGE})
    ratio = np.radians(200.0) / found.before.acceleration
    assert list(found.factors.values()) == pytest.approx([np.sqrt(ratio)] * 2, rel=2e-3)
    assert found.sufficient_factors["orifice"] == pytest.approx(ratio, rel=2e-3)
    assert found.change == pytest.approx(np.sqrt(2.0) * (np.sqrt(ratio) - 1.0), rel=5e-3)
    assert found.after.acceleration >= required.acceleration


@pytest.mark.slow
def test_a_tracking_error(hoist):
    volts = maneuvers.sine(9.0, 0.1).sample()
    follow = trial_of(hoist, volts, reference=proportional_speed(hoist, volts, limited=False))
    required = Requirements(tracking_error=np.radians(18.0))
    found = size(hoist, required, {"pump": DEFAULT_RANGE}, follow=follow)
    assert found.before.tracking_error > required.tracking_error >= found.after.tracking_error
    less = hoist.scale(Z10=1.0 + 0.99 * (found.factors["pump"] - 1.0))
    assert performance(less, follow).tracking_error > required.tracking_error


@pytest.mark.slow
def test_what_cannot_be_met_says_what_can(hoist, monkeypatch):
    required = Requirements(speed=np.radians(500.0))
    with pytest.raises(InputError) as error:
        size(hoist, required, {"orifice": DEFAULT_RANGE, "pump": DEFAULT_RANGE})
    assert str(error.value) == (
        "Within orifice x 0.5 to 2, pump x 0.5 to 2 the hoist reaches speed 370 deg/s (required "
        "500 deg/s)."
    )

    def made_up(drive: Drive, *_: object, **__: object) -> Performance:
        """A drive whose tracking error grows with its pump."""
        pump = float(drive["Z10"].value) / 12.396
        return Performance(np.radians(200.0 * pump), 1.0, np.radians(10.0 * pump))

    monkeypatch.setattr(sizing, "performance", made_up)
    required = Requirements(speed=np.radians(300.0), tracking_error=np.radians(12.0))
    follow = Trial(np.zeros(2), 512.0, np.array([0.0, 1.0]))
    with pytest.raises(InputError, match="each .* not all"):
        size(hoist, required, {"pump": DEFAULT_RANGE}, follow=follow)


@pytest.mark.parametrize(
    ("required", "ranges", "said"),
    [
        ({}, {"pump": DEFAULT_RANGE}, "speed, an acceleration, a tracking error"),
        ({"speed": -1.0}, {"pump": DEFAULT_RANGE}, "speed .* -1, .* positive"),
        ({"speed": 1.0}, {}, "design variable"),
        ({"speed": 1.0}, {"pump": (1.2, 2.0)}, "pump.* 0 .* 1 "),
        (
            {"tracking_error": 0.1},
            {"pump": DEFAULT_RANGE},
            "reference speed",
        ),
    ],
)
def test_refusals(hoist, required, ranges, said):
    with pytest.raises(InputError, match=said):
        size(hoist, Requirements(**required), ranges)
