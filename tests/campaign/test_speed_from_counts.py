"""The page on speed from counts says what is measured, and what is measured is plausible."""

import re
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from swashplate.campaign import savitzky_golay_speed
from swashplate.errors import InputError

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
