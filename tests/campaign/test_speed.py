"""Speed from counts: the filters of Kruse (2001) in their exact form."""

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
    speed_from_angle,
    speed_of,
)

H = 1.0 / 512.0


def position(
    time: np.ndarray, values: np.ndarray, encoder: Encoder | None = None, kind: str = "position"
) -> Channel:
    """A channel; of an encoder `values` are counts."""
    angle = values if encoder is None else values * encoder.angle_per_count
    counts, source = None if encoder is None else values, Source(Path("log.csv"), "x")
    return Channel(
        "x", kind, "rad", time, angle, np.ones(values.size), source, encoder=encoder, counts=counts
    )


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
    found = speed_from_angle(time, angle)
    np.testing.assert_allclose(found, speed, atol=1e-8 * np.abs(speed).max())


def test_a_gap_leaves_its_mean_speed_and_no_overflow() -> None:
    speed = speed_from_angle([0.0, 0.1, 1000.0, 1000.1], [0.0, 0.2, 1000.0, 1000.1])
    assert speed[2] == pytest.approx((1000.0 - 0.2) / (1000.0 - 0.1), rel=1e-12)


def test_the_plain_difference_and_a_measured_speed() -> None:
    time, values = np.array([0.0, 1.0, 3.0]), np.array([1.0, 2.0, 6.0])
    found = speed_of(position(time, values), "difference")
    assert (found.time.tolist(), found.speed.tolist()) == ([1.0, 3.0], [1.0, 2.0])
    assert speed_of(position(time, values, kind="shaft_speed")).speed is values


def test_counts_are_joined_before_they_are_filtered() -> None:
    counts = np.floor(0.3 * np.arange(400.0))
    winch = position(np.arange(400) * H, counts, Encoder(2526.3, 1.0, -1, None), "encoder_counts")
    found = speed_of(winch)
    # 0.3 counts a sample, backwards: neighbours alone would give 0 or a whole count
    expected = -0.3 * 2.0 * np.pi / 2526.3 / H
    np.testing.assert_allclose(found.speed[200:380], expected, rtol=0.02)
    assert found.delay == pytest.approx(0.02122, abs=1e-5)
