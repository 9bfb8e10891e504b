"""What the instruments make of a run, one error at a time."""

from dataclasses import replace

import numpy as np
import pytest

from swashplate import InputError, maneuvers
from swashplate.campaign import ChannelKind, rig

STEP = maneuvers.step(9.0)


def seen(
    *, kinds: tuple[ChannelKind, ...] = ("rectified_current",), **errors: float
) -> rig.VirtualRun:
    tests = rig.run("hoist", [STEP], instruments=rig.Instruments(**errors), channels=kinds)
    return tests.runs[STEP.name]


def both(run: rig.VirtualRun) -> np.ndarray:
    return run.truth.current_positive + run.truth.current_negative


def test_the_command_is_put_out_and_read_back_in_codes_of_twelve_bits() -> None:
    run = seen(command_bits=12, voltage_bits=12, voltage_noise=0.01)
    for volts in (run.truth.voltage, run.columns["voltage"]):
        codes = volts * 2048 / 10.0
        np.testing.assert_allclose(codes, np.rint(codes), atol=1e-9)
        assert np.abs(volts).max() < 10.0
    error = run.columns["voltage"] - run.truth.voltage
    assert error.std() == pytest.approx(0.01, rel=0.05)
    offset = seen(voltage_offset=0.02)
    np.testing.assert_allclose(offset.columns["voltage"] - offset.truth.voltage, 0.02, atol=1e-12)


def test_the_ammeter_has_gain_zero_noise_and_steps() -> None:
    run = seen(current_gain_error=0.01, current_zero=4e-3)
    np.testing.assert_allclose(run.columns["current"], 1.01 * both(run) + 4e-3, rtol=1e-12)
    run = seen(current_noise=2e-3, current_resolution=5e-4)
    error = run.columns["current"] - both(run)
    assert error.std() == pytest.approx(2e-3, rel=0.05)
    steps = run.columns["current"] / 5e-4
    np.testing.assert_allclose(steps, np.rint(steps), atol=1e-9)


def test_the_dither_shows_at_its_aliases() -> None:
    run = seen(dither=0.015)
    held = slice(1024, 3072)  # 2 s to 6 s: the current stands
    ripple = (run.columns["current"] - both(run))[held]
    power = np.abs(np.fft.rfft(ripple * np.hanning(ripple.size))) ** 2
    hertz = np.fft.rfftfreq(ripple.size, 1.0 / 512.0)
    assert hertz[power.argmax()] == pytest.approx(100.0, abs=0.3)
    beat = (hertz > 10.0) & (hertz < 14.0)  # the fifth multiple, 500 Hz, at 512 Hz
    assert power[beat].max() > 100.0 * np.median(power)


def test_counts_are_passed_edges_and_roll_over() -> None:
    run = seen(kinds=("encoder_counts",), encoder_step=4)
    turns = run.truth.shaft_position * 400.0 * 120.0 / 19.0 / (2.0 * np.pi)
    assert np.all(run.columns["counts"] % 4 == 0.0)
    assert np.abs(run.columns["counts"] - turns).max() <= 4.0
    small = seen(kinds=("encoder_counts",), encoder_step=1, counter_bits=8).columns["counts"]
    assert small.min() == -128.0
    assert small.max() == 127.0


def test_stamps_tell_the_jitter_and_keep_the_order() -> None:
    run = seen(kinds=("shaft_speed",), jitter=2e-4, stamp_resolution=1e-6)
    stamps = run.columns["time"]
    assert (stamps - run.truth.time)[1:-1].std() == pytest.approx(2e-4, rel=0.05)
    speed = np.interp(stamps, run.truth.time, run.truth.shaft_speed)
    np.testing.assert_allclose(run.columns["shaft_speed"], speed, atol=2e-3)
    assert np.diff(seen(jitter=1.0).columns["time"]).min() > 0.0


def test_rows_and_cells_are_lost() -> None:
    run = seen(lost_rows=0.05, longest_loss=20, empty_cells=0.01)
    assert run.columns["time"].size == pytest.approx(0.95 * run.truth.time.size, rel=0.03)
    assert np.isfinite(run.columns["time"]).all()
    assert np.isnan(run.columns["current"]).mean() == pytest.approx(0.01, abs=0.006)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"jitter": -1.0}, "jitter must be 0 or more, not -1."),
        ({"dither": float("nan")}, "dither must be finite, not nan."),
        ({"lost_rows": 2.0}, "lost_rows must be a share, at most 1, not 2."),
        ({"dither_frequency": 0.0}, "dither_frequency must be positive, not 0."),
    ],
)
def test_impossible_instruments_are_refused(change: dict[str, float], sentence: str) -> None:
    with pytest.raises(InputError) as error:
        replace(rig.Instruments(), **change)
    assert str(error.value) == sentence
