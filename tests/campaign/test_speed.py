"""Speed from counts: the filters of Kruse (2001), their exact form, and the moving parabola."""

from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lsim

from swashplate.campaign import (
    DIFFERENTIATOR,
    LOW_PASS,
    Channel,
    Encoder,
    Source,
    matched_speed,
    path_delay,
    speed_from_angle,
    speed_of,
)
from swashplate.errors import InputError

H = 1.0 / 512.0
FORMS = ("source", "exact")


def recursions(angle: np.ndarray, a: float, b: float, h: float) -> np.ndarray:
    """Both of Kruse's recursions, one after the other, as they are printed."""
    low = np.full_like(angle, angle[0])
    speed = np.zeros_like(angle)
    for n in range(1, angle.size):
        low[n] = (1.0 - a * h) * low[n - 1] + a * h * angle[n - 1]
        speed[n] = (1.0 - b * h) * speed[n - 1] + b * (low[n] - low[n - 1])
    return speed


def position(
    time: np.ndarray, values: np.ndarray, encoder: Encoder | None = None, kind: str = "position"
) -> Channel:
    """A channel; of an encoder `values` are counts."""
    return Channel(
        "x",
        kind,
        "rad",
        np.asarray(time),
        values if encoder is None else values * encoder.angle_per_count,
        np.ones(values.size),
        Source(Path("log.csv"), "x"),
        encoder=encoder,
        counts=None if encoder is None else values,
    )


def test_source_path_is_its_two_recursions() -> None:
    rng = np.random.default_rng(3)
    counts = np.floor(rng.normal(0.3, 2.0, 1500).cumsum())
    time = np.arange(counts.size) * H
    angle = -2.0 * np.pi / 2526.3 * counts
    expected = recursions(angle, LOW_PASS, DIFFERENTIATOR, H)
    np.testing.assert_allclose(speed_from_angle(time, angle), expected, atol=1e-10)
    # every count new: nothing to interpolate
    counts = (np.arange(300.0) * 3.0) % 701.0
    winch = position(time[:300], counts, Encoder(2526.3, 1.0, -1, None), "encoder_counts")
    found = speed_of(winch)
    expected = recursions(-2.0 * np.pi / 2526.3 * counts, LOW_PASS, DIFFERENTIATOR, H)
    np.testing.assert_allclose(found.speed, expected, atol=1e-10)
    assert found.delay == path_delay(H)


@pytest.mark.interpreted
@pytest.mark.parametrize("rate", [512.0, 50.0])
def test_exact_path_is_the_continuous_one(rate: float) -> None:
    b = DIFFERENTIATOR
    time = np.arange(400) / rate
    angle = np.random.default_rng(4).normal(size=time.size).cumsum()
    # a b s / ((s + a)(s + b)), straight between samples
    _, speed, _ = lsim(
        ([LOW_PASS * b, 0.0], [1.0, LOW_PASS + b, LOW_PASS * b]), angle - angle[0], time
    )
    found = speed_from_angle(time, angle, form="exact")
    np.testing.assert_allclose(found, speed, atol=1e-8 * np.abs(speed).max())


def test_a_gap_leaves_its_mean_speed_and_no_overflow() -> None:
    speed = speed_from_angle([0.0, 0.1, 1000.0, 1000.1], [0.0, 0.2, 1000.0, 1000.1], form="exact")
    assert speed[2] == pytest.approx((1000.0 - 0.2) / (1000.0 - 0.1), rel=1e-12)


def phase_and_amplitude(time: np.ndarray, values: np.ndarray, frequency: float) -> complex:
    """Complex amplitude of a steady sine, by least squares."""
    angle = 2.0 * np.pi * frequency * time
    basis = np.column_stack([np.cos(angle), np.sin(angle), np.ones_like(time)])
    (c, s, _), *_ = np.linalg.lstsq(basis, values, rcond=None)
    return complex(c, -s)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("frequency", [0.3, 3.0, 10.0])
def test_matched_sine_has_the_phase_of_the_measured_one(form: str, frequency: float) -> None:
    time = np.arange(4096) * H
    omega = 2.0 * np.pi * frequency
    speed, angle = np.cos(omega * time), np.sin(omega * time) / omega
    settled = time > 2.0
    measured, matched, raw = (
        phase_and_amplitude(time[settled], values[settled], frequency)
        for values in (
            speed_from_angle(time, angle, form=form),
            matched_speed(time, speed, form=form),
            matched_speed(time, speed, form=form, aligned=False),
        )
    )

    def lag(of: complex) -> float:
        return float(-np.angle(of / measured) / omega / H)

    assert lag(matched) == pytest.approx(0.0, abs=1e-6)
    assert lag(raw) == pytest.approx(0.5, abs=1e-6)
    x = np.pi * frequency * H
    assert abs(matched / measured) == pytest.approx(x / np.tan(x), rel=1e-6)


def test_unstable_and_uneven_are_refused_for_the_explicit_form_only() -> None:
    slow = np.arange(100) / 94.0
    with pytest.raises(InputError, match="unstable at 94 Hz, as at every rate up to 94.25 Hz"):
        speed_from_angle(slow, slow)
    assert speed_from_angle(slow, slow, form="exact")[-1] == pytest.approx(1.0)
    assert speed_from_angle(np.arange(999) / 95.0, np.arange(999) / 95.0)[-1] == pytest.approx(1.0)
    uneven = np.arange(50.0) ** 1.5 * H
    with pytest.raises(InputError, match="evenly spaced stamps; take form 'exact'"):
        matched_speed(uneven, uneven)
    with pytest.raises(InputError, match="form must be 'source' or 'exact', not 'zoh'"):
        matched_speed(slow, slow, form="zoh")


def test_the_moving_parabola_by_hand() -> None:
    # five samples, order 2: (-2 u₋₂ - u₋₁ + u₁ + 2 u₂)/10 per sample
    time, angle = np.arange(7.0) * 0.02, np.array([0.0, 1.0, 0.0, 4.0, 2.0, 1.0, 0.0])
    found = speed_of(position(time, angle), "savitzky_golay")
    assert found.speed[3] == pytest.approx((-2.0 * 1.0 - 0.0 + 2.0 + 2.0 * 1.0) / 10.0 / 0.02)
    assert found.delay == 0.0
    # a parabola is differentiated exactly, also at the ends
    found = speed_of(position(time, 3.0 * time**2), "savitzky_golay")
    np.testing.assert_allclose(found.speed, 6.0 * time, atol=1e-12)


def test_the_plain_difference_and_a_measured_speed() -> None:
    time, values = np.array([0.0, 1.0, 3.0]), np.array([1.0, 2.0, 6.0])
    found = speed_of(position(time, values), "difference")
    assert (found.time.tolist(), found.speed.tolist()) == ([1.0, 3.0], [1.0, 2.0])
    assert speed_of(position(time, values, kind="shaft_speed")).speed is values


@pytest.mark.parametrize(
    ("channel", "method", "said"),
    [
        (position(np.arange(9.0) ** 1.5, np.zeros(9)), "savitzky_golay", "evenly spaced .* resamp"),
        (position(np.arange(9.0), np.zeros(9)), "savitzky_golay", "record's 9, but at 1 Hz it hol"),
        (position(np.arange(9.0), np.zeros(9)), "kalman", "no method 'kalman'; there are source"),
        (position(np.arange(9.0), np.zeros(9), kind="other"), "exact", "column 'x' is a other"),
    ],
)
def test_methods_that_cannot_be(channel: Channel, method: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        speed_of(channel, method)
