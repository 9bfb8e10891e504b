"""Observations: what they refuse, and where their stamps lie on the grid."""

import numpy as np
import pytest

from swashplate import InputError
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
        ({"time": [], "values": []}, "The observation of shaft_speed is empty"),
        ({"time": [0.0, 1.0]}, "has 2 stamps for 3 values"),
        ({"time": [0.0, 2.0, 1.0]}, "never fall, but is 1 s at sample 2"),
        ({"time": [0.0, np.nan, 1.0]}, "must be finite and never fall, but is nan s at sample 1"),
        ({"time": np.zeros((3, 1))}, "the time must be one column, not 2-dimensional"),
        ({"values": ["a", "b", "c"]}, "the values must be a sequence of numbers"),
        ({"values": [1.0, np.nan, 2.0]}, "not finite, or the weight negative, at sample 1"),
        ({"weight": [1.0, 1.0, -1.0]}, "the weight negative, at sample 2"),
        ({"weight": [1.0, 2.0]}, "one number or 3 of them, not of shape"),
        ({"poles": (62.8, 0.0)}, "poles are in rad/s, above 0 and finite"),
        ({"poles": (np.inf,)}, "poles are in rad/s, above 0 and finite"),
        ({"delay": np.nan}, "the delay must be a finite time"),
        ({"unknown": ("gain",)}, "can be 'offset', 'clock_offset' or both, not"),
        ({"unknown": ("offset", "offset")}, "can be 'offset', 'clock_offset' or both, not"),
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
    assert observed.plan(Own(), 0).measured.tolist() == [1.0, 0.0, 0.0]


def record(samples: int = 11, rate: float = 100.0, substeps: int = 6) -> Record:
    return record_of(np.zeros(samples), rate, what="voltage", substeps=substeps)


def test_stamps_on_the_grid() -> None:
    # 11 samples at 100 Hz, six steps each: 61 points, 1/600 s apart; 0.07 is no binary number
    time = [-1.0, 0.0, 0.07, 0.07 + 0.25 / 600.0, 0.1, 5.0]
    observed = ObservedRecord(
        record(), [speed(time=time, values=np.zeros(6), unknown=["clock_offset"])]
    )
    plan = observed.plan(Own(), 7)
    assert plan.cell.tolist() == [0, 0, 42, 42, 60, 60]
    np.testing.assert_allclose(plan.fraction, [0, 0, 0, 0.25, 0, 0], rtol=0.0, atol=1e-9)
    assert (plan.fraction[[0, 1, 2, 4, 5]] == 0.0).all()
    # held outside, half of one side's slope at the ends, the mean of both on the grid
    np.testing.assert_allclose(plan.back / 600.0, [0, 0, 0.5, 0, 0.5, 0], atol=1e-12)
    np.testing.assert_allclose(plan.ahead / 600.0, [0, 0.5, 0.5, 1, 0, 0], atol=1e-12)
    assert (plan.offset_column.tolist(), plan.clock_column.tolist()) == ([-1], [7])
    assert not plan.regular[0]


def test_successive_points_are_noticed() -> None:
    grid = record_of(np.zeros(50), 512.0, what="voltage")
    time = np.arange(10, 40) / 512.0
    plain = speed(time=time, values=time)
    gap = speed(time=np.delete(time, 5), values=np.delete(time, 5))
    late = speed(time=time, values=time, delay=0.5 / 512.0)
    whole = speed(time=time, values=time, delay=3.0 / 512.0)
    plan = ObservedRecord(grid, [plain, gap, late, whole]).plan(Own(), 0)
    assert plan.regular.tolist() == [True, False, False, True]
    assert plan.cell[[0, 30 + 29 + 30]].tolist() == [10, 7]
    assert plan.kept.shape == (4, 0)
    assert plan.back.size == 0


def test_offsets_of_values_and_clocks() -> None:
    both = ("clock_offset", "offset")
    observed = ObservedRecord(
        record_of(np.zeros(2000), 512.0, what="voltage"),
        [
            speed(),
            speed(unknown=both, poles=(10.0, 20.0)),
            speed(unknown=("offset",), poles=(5.0,)),
        ],
    )
    assert observed.own_columns == (
        "offset of shaft_speed [1]",
        "clock_offset of shaft_speed [1]",
        "offset of shaft_speed [2]",
    )
    plan = observed.plan(Own(offsets=(0.0, 0.5, 0.0), clock_offsets=(0.0, 0.0, 0.25)), 4)
    assert plan.measured.tolist() == [1.0, 2.0, 3.0, 0.5, 1.5, 2.5, 1.0, 2.0, 3.0]
    assert plan.cell.tolist() == [0, 512, 1024, 0, 512, 1024, 128, 640, 1152]
    assert plan.offset_column.tolist() == [-1, 4, 6]
    assert plan.clock_column.tolist() == [-1, 5, -1]
    expected = np.exp(-np.array([[np.inf, np.inf], [10.0, 20.0], [5.0, np.inf]]) / 512.0)
    np.testing.assert_allclose(plan.kept, expected, rtol=1e-15)
    assert observed.rows == 9
    assert observed.rows_of(1) == slice(3, 6)


@pytest.mark.parametrize(
    ("own", "sentence"),
    [
        (Own(offsets=(1.0, 2.0)), "There are 1 observations, which need as many finite offsets"),
        (Own(clock_offsets=(np.nan,)), "need as many finite clock offsets"),
    ],
)
def test_own_unknowns_must_fit(own: Own, sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        ObservedRecord(record(), [speed()]).plan(own, 0)


def test_refused_records() -> None:
    with pytest.raises(InputError, match="nothing observed"):
        ObservedRecord(record(), [])
    with pytest.raises(InputError, match="load_torque has 3 points, but the grid has 61"):
        ObservedRecord(record(), [speed()], others={"load_torque": np.zeros(3)})
    with pytest.raises(InputError, match="start is 'later'"):
        ObservedRecord(record(), [speed()], start="later")
