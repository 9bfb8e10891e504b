"""Observations: what they refuse, and where their stamps lie on the grid."""

import numpy as np
import pytest
from tests.simulation.experiments import residuals

from swashplate import Drive, InputError, maneuvers
from swashplate.equations.marching.observation import Observation, ObservedRecord, Own
from swashplate.equations.marching.record import Record, record_of

pytestmark = pytest.mark.traced

TIME = np.array([0.0, 1.0, 2.0])
VALUES = np.array([1.0, 2.0, 3.0])


def speed(**changes) -> Observation:
    return Observation(**{"signal": "shaft_speed", "time": TIME, "values": VALUES} | changes)


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"time": [], "values": []}, "The observation of shaft_speed: the time is empty"),
        ({"time": [0.0, 1.0]}, "has 2 stamps for 3 values"),
        ({"time": [0.0, 2.0, 1.0]}, "never fall, but is 1 s at sample 2"),
        ({"time": [0.0, np.nan, 1.0]}, "must be finite and never fall, but is nan s at sample 1"),
        ({"time": np.zeros((3, 1))}, "the time must be one column, not 2-dimensional"),
        ({"values": ["a", "b", "c"]}, "the values must be a sequence of real numbers"),
        ({"values": [1.0, np.nan, 2.0]}, "not finite, or the weight negative, at sample 1"),
        ({"weight": [1.0, 1.0, -1.0]}, "the weight negative, at sample 2"),
        ({"weight": [1.0, 2.0]}, "one number or 3 of them, not of shape"),
    ],
)
def test_refusals(changes: dict, sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        speed(**changes)


def test_samples_without_weight_may_be_anything() -> None:
    observed = ObservedRecord(
        record_of(np.zeros(2000), 512.0, what="voltage"),
        [speed(values=[1.0, np.nan, np.inf], weight=[2.0, 0.0, 0.0])],
    )
    assert observed.plan((), 0).measured.tolist() == [1.0, 0.0, 0.0]


def record(samples: int = 11, rate: float = 100.0, substeps: int = 6) -> Record:
    return record_of(np.zeros(samples), rate, what="voltage", substeps=substeps)


def test_residuals_at_any_stamps(hoist: Drive) -> None:
    """On the grid, between its points, and outside the record, where the ends are held."""
    command = maneuvers.step(4.0, start=0.1, stop=0.6, length=1.0).sample(100.0)
    run = hoist.simulate(command, 100.0)
    fine = hoist.simulate_current(run.fine("current"), 600.0)
    time = np.array([-1.0, 0.0, 0.07, 0.07 + 0.25 / 600.0, 0.5, 0.5, 5.0])
    observed = ObservedRecord(
        record_of(command, 100.0, what="voltage"),
        [
            speed(time=time, values=np.arange(7.0), weight=2.0, free_offset=True),
            speed(time=time, values=np.zeros(7), free_offset=True),
        ],
    )
    assert observed.own_columns == ("offset of shaft_speed [0]", "offset of shaft_speed [1]")
    assert observed.rows_of(1) == slice(7, 14)
    found = residuals(hoist.parameters, observed, Own({}, (0.5, 0.0)))
    seen = np.interp(time, fine.time, fine.shaft_speed)
    expected = 2.0 * (seen + 0.5 - np.arange(7.0))
    np.testing.assert_allclose(found[:7], expected, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(found[7:], seen, rtol=0.0, atol=1e-12)


def test_offsets_must_fit() -> None:
    for offsets in ((1.0, 2.0), (np.nan,)):
        with pytest.raises(InputError, match="1 observations, which need as many finite offsets"):
            ObservedRecord(record(), [speed()]).plan(offsets, 0)


def test_refused_records() -> None:
    with pytest.raises(InputError, match="nothing observed"):
        ObservedRecord(record(), [])
    with pytest.raises(InputError, match="load_torque has 3 points, but the grid has 61"):
        ObservedRecord(record(), [speed()], others={"load_torque": np.zeros(3)})
    with pytest.raises(InputError, match="start is 'later'"):
        ObservedRecord(record(), [speed()], start="later")
