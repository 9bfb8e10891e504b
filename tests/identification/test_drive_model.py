"""The measured current as what drives the pump, from each way of measuring it."""

from pathlib import Path

import numpy as np
import pytest

from swashplate import Channel, Experiment
from swashplate.campaign import ChannelKind
from swashplate.campaign.experiment import InputSignal, Source
from swashplate.errors import InputError
from swashplate.identification.drive_model import measured_current

RATE = 512.0
TIME = np.arange(1025) / RATE
SOURCE = Source(Path("log.csv"), "I")
# 0.3 A forwards for a second, then 0.2 A backwards
CURRENT = np.where(TIME < 1.0, 0.3, -0.2)
VOLTAGE = np.where(TIME < 1.0, 4.0, -4.0)


def run(**channels: np.ndarray) -> Experiment:
    drive = InputSignal("voltage", "V", TIME, VOLTAGE, "previous", SOURCE)
    made = {kind: made_of(kind, values) for kind, values in channels.items()}
    return Experiment("step", "hoist", "step", "fit", "rest", None, drive, made)


def made_of(kind: ChannelKind, values: np.ndarray) -> Channel:
    return Channel(kind, kind, "A", TIME, values, np.ones(TIME.size), SOURCE)


def test_signed() -> None:
    record = measured_current(run(signed_current=CURRENT))
    np.testing.assert_array_equal(record.values, CURRENT)
    assert record.rate == RATE


def test_of_both_solenoids_the_difference() -> None:
    plus, minus = np.maximum(CURRENT, 0.0) + 0.05, np.maximum(-CURRENT, 0.0) + 0.05
    record = measured_current(run(current_plus=plus, current_minus=minus))
    np.testing.assert_allclose(record.values, CURRENT, atol=1e-15)


def test_one_ammeter_takes_the_command_s_sign() -> None:
    noisy = np.abs(CURRENT)
    noisy[3] = -0.001  # noise below zero is no current backwards
    record = measured_current(run(rectified_current=noisy))
    expected = CURRENT.copy()
    expected[3] = 0.0
    np.testing.assert_allclose(record.values, expected, atol=1e-15)


def test_a_scale_multiplies_and_a_current_that_drove_the_run_is_it() -> None:
    record = measured_current(run(signed_current=CURRENT), scale=1.5)
    np.testing.assert_allclose(record.values, 1.5 * CURRENT)
    drive = InputSignal("current", "A", TIME, CURRENT, "linear", SOURCE)
    driven = Experiment("step", "luff", "step", "fit", "rest", None, drive, {})
    np.testing.assert_allclose(measured_current(driven, 1.5).values, 1.5 * CURRENT)


def test_without_a_current_it_says_what_it_needs() -> None:
    with pytest.raises(InputError, match="step has no measured current to drive the pump: it need"):
        measured_current(run())
