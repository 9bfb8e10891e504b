"""Speed from counts: the filters of Kruse (2001), their exact form, and the moving parabola."""

import re
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import lsim

from swashplate.campaign import (
    DIFFERENTIATOR,
    LOW_PASS,
    matched_speed,
    path_delay,
    savitzky_golay_speed,
    speed_from_angle,
    speed_from_counts,
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


def test_matched_speed_is_its_two_recursions() -> None:
    """As printed, w ← (1 - ah) w + ah u₋₁ and y ← (1 - bh) y + bh w₋₁ are not aligned."""
    speed = np.random.default_rng(6).normal(size=400)
    low, expected = np.zeros(400), np.zeros(400)
    for n in range(1, 400):
        low[n] = (1.0 - LOW_PASS * H) * low[n - 1] + LOW_PASS * H * speed[n - 1]
        expected[n] = (1.0 - DIFFERENTIATOR * H) * expected[n - 1] + DIFFERENTIATOR * H * low[n - 1]
    found = matched_speed(np.arange(400) * H, speed, aligned=False)
    np.testing.assert_allclose(found, expected, atol=1e-12)


def test_source_path_is_its_two_recursions() -> None:
    rng = np.random.default_rng(3)
    counts = np.floor(rng.normal(0.3, 2.0, 1500).cumsum())
    time = np.arange(counts.size) * H
    angle = -2.0 * np.pi / 2526.3 * counts
    np.testing.assert_allclose(
        speed_from_angle(time, angle), recursions(angle, LOW_PASS, DIFFERENTIATOR, H), atol=1e-10
    )
    # every count new: nothing to interpolate
    counts = (np.arange(300.0) * 3.0) % 701.0
    np.testing.assert_allclose(
        speed_from_counts(time[:300], counts, counts_per_turn=2526.3, sign=-1),
        recursions(-2.0 * np.pi / 2526.3 * counts, LOW_PASS, DIFFERENTIATOR, H),
        atol=1e-10,
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
    found = speed_from_angle(time, angle, form="exact")
    np.testing.assert_allclose(found, speed, atol=1e-8 * np.abs(speed).max())


@given(st.lists(st.tuples(st.floats(1e-4, 0.05), st.floats(-1, 1)), min_size=2, max_size=30))
def test_exact_path_does_not_see_stamps_put_between(steps: list[tuple[float, float]]) -> None:
    time = np.cumsum([step for step, _ in steps])
    angle = np.array([value for _, value in steps])
    finer = np.sort(np.concatenate([time, 0.7 * time[1:] + 0.3 * time[:-1]]))
    speed = speed_from_angle(time, angle, form="exact")
    between = speed_from_angle(finer, np.interp(finer, time, angle), form="exact")
    # stamps that are even but for 5 % are taken as even: that is the tolerance here
    scale = np.abs(np.diff(angle) / np.diff(time)).max()
    np.testing.assert_allclose(between[::2], speed, atol=0.2 * scale + 1e-12)
    if np.ptp(np.diff(time)) > 0.5 * np.diff(time).max():
        np.testing.assert_allclose(between[::2], speed, atol=1e-9 * scale + 1e-12)


def test_a_gap_leaves_its_mean_speed_and_no_overflow() -> None:
    speed = speed_from_angle([0.0, 0.1, 1000.0, 1000.1], [0.0, 0.2, 1000.0, 1000.1], form="exact")
    assert speed[2] == pytest.approx((1000.0 - 0.2) / (1000.0 - 0.1), rel=1e-12)


@pytest.mark.parametrize("form", FORMS)
def test_steady_speed_passes_unchanged(form: str) -> None:
    time = np.arange(2000) * H
    np.testing.assert_allclose(speed_from_angle(time, 3.0 * time, form=form)[-1], 3.0, rtol=1e-9)
    matched = matched_speed(time, np.full(time.size, 3.0), form=form)
    assert matched[-1] == pytest.approx(3.0, rel=1e-9)


def test_why_the_angle_is_not_held() -> None:
    # a held angle, then b s/(s + b), both exact: y ← exp(-bh) y + b (u - u₋₁)
    kept, speed = np.exp(-DIFFERENTIATOR * H), 0.0
    for _ in range(200):
        speed = kept * speed + DIFFERENTIATOR * (1.0 * H)
    assert speed == pytest.approx(DIFFERENTIATOR * H / (1.0 - kept), rel=1e-12)
    assert speed == pytest.approx(1.20, abs=0.005)


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


@pytest.mark.parametrize("form", FORMS)
def test_matched_ramp_comes_when_the_measured_one_does(form: str) -> None:
    time = np.arange(2000) * H
    speed, angle = 4.0 * time, 2.0 * time**2
    measured = speed_from_angle(time, angle, form=form)
    matched = matched_speed(time, speed, form=form)
    raw = matched_speed(time, speed, form=form, aligned=False)
    lags = [(measured - each)[-1] / 4.0 / H for each in (matched, raw)]
    np.testing.assert_allclose(lags, [0.0, 0.5], atol=1e-6)
    assert time[-1] - measured[-1] / 4.0 == pytest.approx(path_delay(H, form=form), rel=1e-6)


def test_delay_of_the_paths() -> None:
    a, b = LOW_PASS, DIFFERENTIATOR
    assert path_delay(H) == pytest.approx(1 / a + 1 / b - H / 2, rel=1e-12)
    assert path_delay(H) == pytest.approx(20.24e-3, abs=5e-6)
    # the exact one's position is straight between samples: 1/a + 1/b but for terms in h²
    assert path_delay(H, form="exact") == pytest.approx(1 / a + 1 / b, rel=1e-5)


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


def test_wrong_arguments_are_refused() -> None:
    time = np.arange(10) * H
    with pytest.raises(InputError, match="angle must be finite, but row 3"):
        speed_from_angle(time, np.where(np.arange(10) == 3, np.nan, 0.0))
    with pytest.raises(
        InputError, match="speed must be one signal with one row for each of the 10"
    ):
        matched_speed(time, np.zeros((3, 10)))
    with pytest.raises(InputError, match="counts must be one signal"):
        speed_from_counts(time, np.zeros((10, 2)), counts_per_turn=100.0)


# --- measured against a known motion --------------------------------------------------------------


ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "speed-from-counts.md").read_text("utf-8")
ROWS = [[cell.strip() for cell in row.strip("|").split("|")] for row in PAGE.splitlines()]


@pytest.fixture(scope="module")
def benchmark() -> ModuleType:
    """The script that writes the page's tables."""
    spec = spec_from_file_location("speed_from_counts", ROOT / "benchmarks/speed_from_counts.py")
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def stated(motion: str, method: str, speed_deg_s: float) -> tuple[float, float]:
    """Noise and bias in the page's table [deg/s]."""
    (row,) = [row for row in ROWS if row[:2] == [motion, method]]
    cell = row[2 + (0.1, 1.0, 10.0, 100.0).index(speed_deg_s)]
    found = re.fullmatch(r"(\S+) \((\S+)\)", cell)
    assert found is not None
    return float(found.group(1)), float(found.group(2))


@pytest.mark.parametrize(
    ("motion", "method", "speed_deg_s"),
    [
        ("step, once settled", "differences", 1.0),
        ("step, once settled", "source", 0.1),
        ("ramp of 8 s", "source", 100.0),
        ("ramp of 8 s", "Savitzky-Golay", 10.0),
        ("sine of 0.3 Hz", "source", 1.0),
        ("sine of 0.3 Hz", "source, to its match", 100.0),
    ],
)
def test_table_holds(benchmark: ModuleType, motion: str, method: str, speed_deg_s: float) -> None:
    noise, bias = stated(motion, method, speed_deg_s)
    found = benchmark.errors(motion, method, speed_deg_s)
    # two digits are printed
    assert found.noise == pytest.approx(noise, rel=0.08)
    assert found.bias == pytest.approx(bias, abs=0.1 * noise + 0.5 * abs(bias))


def test_differences_have_the_noise_of_rounding() -> None:
    # fast motion: rounding errors independent and even over a count, variance 2/12, over 1/512 s
    expected = np.sqrt(2.0 / 12.0) * 512.0 * 360.0 / 2526.3
    assert stated("ramp of 8 s", "differences", 100.0)[0] == pytest.approx(expected, rel=0.03)


def test_delays_hold(benchmark: ModuleType) -> None:
    # late by d, a sine of 100 deg/s and 0.3 Hz is off by 100/√2·ω·d
    (row,) = [row for row in ROWS if row[0] == "source" and row[1].endswith("ms")]
    delay = 1e-3 * float(row[1].removesuffix(" ms"))
    raw, aligned = (float(cell.removesuffix(" deg/s")) for cell in row[2:4])
    late = 100.0 / np.sqrt(2.0) * 2.0 * np.pi * 0.3 * delay
    assert raw == pytest.approx(np.hypot(late, aligned), rel=0.02)
    assert 1e3 * benchmark.rise_time("source") == pytest.approx(
        float(row[4].removesuffix(" ms")), abs=1.0
    )


def test_the_moving_parabola_by_hand() -> None:
    # five samples, order 2: (-2 u₋₂ - u₋₁ + u₁ + 2 u₂)/10 per sample
    time, angle = np.arange(7.0) * 0.02, np.array([0.0, 1.0, 0.0, 4.0, 2.0, 1.0, 0.0])
    speed = savitzky_golay_speed(time, angle)
    assert speed[3] == pytest.approx((-2.0 * 1.0 - 0.0 + 2.0 + 2.0 * 1.0) / 10.0 / 0.02)
    # a parabola is differentiated exactly, also at the ends
    np.testing.assert_allclose(savitzky_golay_speed(time, 3.0 * time**2), 6.0 * time, atol=1e-12)


def test_a_moving_parabola_that_cannot_be() -> None:
    with pytest.raises(InputError, match="evenly spaced .* resample"):
        savitzky_golay_speed(np.arange(9.0) ** 1.5, np.zeros(9))
    with pytest.raises(InputError, match="from 3 samples to the record's 9, but at 1 Hz it holds"):
        savitzky_golay_speed(np.arange(9.0), np.zeros(9))
