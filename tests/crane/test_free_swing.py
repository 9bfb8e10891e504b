"""Damping of a free swing: against decaying sines with noise."""

from math import pi, sqrt

import numpy as np
import pytest
from typer.testing import CliRunner

from swashplate.cli import app
from swashplate.crane import swing_damping
from swashplate.errors import InputError

ROPE = 17.0
OMEGA = sqrt(9.80665 / ROPE)
TIME = np.arange(0.0, 150.0, 0.1)


def free_swing(ratio, *, omega=OMEGA, time=TIME):
    """A swing of 7 degrees under a sensor's offset. [rad]"""
    damped = omega * sqrt(1.0 - ratio**2)
    return 0.12 * np.exp(-ratio * omega * time) * np.cos(damped * time + 0.7) + 0.01


def noise(seed, memory=0.0):
    """Noise of 0.004 rad, of which each sample remembers a part of the last."""
    white = np.random.default_rng(seed).standard_normal(TIME.size)
    made = [white[0]]
    for value in white[1:]:
        made.append(memory * made[-1] + sqrt(1.0 - memory**2) * value)
    return 0.004 * np.array(made)


@pytest.mark.parametrize("ratio", [0.002, 0.01, 0.1])
def test_a_swing_without_noise_gives_its_own_ratio_and_period(ratio):
    found = swing_damping(TIME + 40.0, free_swing(ratio), rope=ROPE)
    assert found.value == pytest.approx(ratio, rel=1e-6)
    assert found.period == pytest.approx(2.0 * pi / OMEGA, rel=1e-6)
    assert found.low <= found.value <= found.high


# of 300 seeds each: 95 % with white noise, 98 % with noise that lasts for a second
@pytest.mark.parametrize(("memory", "fewest", "most"), [(0.0, 88, 100), (0.9, 92, 100)])
def test_intervals_hold_the_ratio(memory, fewest, most):
    hits = 0
    for seed in range(100):
        found = swing_damping(TIME, free_swing(0.005) + noise(seed, memory))
        hits += found.low <= 0.005 <= found.high
    assert fewest <= hits <= most


def test_stamps_need_not_be_even():
    random = np.random.default_rng(3)
    time = np.sort(random.uniform(0.0, 150.0, 1500))
    found = swing_damping(time, free_swing(0.01, time=time))
    assert found.value == pytest.approx(0.01, rel=1e-6)


def test_logs_that_are_no_free_swing_are_refused():
    grown = 0.01 * np.exp(0.01 * TIME) * np.cos(OMEGA * TIME)
    random = np.random.default_rng(1).standard_normal(TIME.size)
    cases = [
        (TIME[:400], free_swing(0.01)[:400], r"4\.[89] swings, .* 5 "),
        (TIME, grown, "decays: .*-0.013"),
        (TIME, 0.1 * np.cos(OMEGA * TIME) + noise(2), "swing decays"),
        (TIME, 0.1 * random, "decaying sine"),
        (TIME, np.abs(free_swing(0.01)), "signed angle"),
        (TIME, np.degrees(free_swing(0.01)), r"7.\d+ rad, .* degrees"),
        (TIME[::-1], free_swing(0.01), "time .* rise"),
        (TIME, free_swing(0.01)[:9], "equal length"),
    ]
    for time, angle, sentence in cases:
        with pytest.raises(InputError, match=sentence):
            swing_damping(time, angle)
    with pytest.raises(InputError, match="8.27 s, .* 30 m .* 11 s"):
        swing_damping(TIME, free_swing(0.01), rope=30.0)
    with pytest.raises(InputError, match="rope .* -1 m"):
        swing_damping(TIME, free_swing(0.01), rope=-1.0)


def said(*words):
    return CliRunner().invoke(app, ["crane", "damping", *words], env={"COLUMNS": "120"})


def test_the_command_reads_a_log_with_its_units(tmp_path):
    path, swing = tmp_path / "swing.csv", np.degrees(free_swing(0.01) + noise(0))
    # before it swings freely the crane moves
    rows = [f"{1000.0 * t:.0f};{9.0 * np.sin(t):.6f}" for t in np.arange(0.0, 20.0, 0.1)]
    rows += [f"{1000.0 * (t + 20.0):.0f};{x:.6f}" for t, x in zip(TIME, swing, strict=True)]
    path.write_text("\n".join(["time [ms];angle [deg]", *rows]), "utf-8")
    words = ["--column", "angle", "--start", "20", "--rope", "17"]
    found = said(str(path), *words)
    assert found.exit_code == 0, found.output
    ratio, low, high, period = found.stdout.replace(" %", "%").split()[-4:]
    percent = swing_damping(TIME, np.radians(swing))
    assert float(ratio.rstrip("%")) == pytest.approx(100.0 * percent.value, abs=1e-3)
    assert float(low.rstrip("%")) < 1.0 < float(high.rstrip("%"))
    assert float(period) == pytest.approx(8.27, abs=0.01)
    late = said(str(path), "--column", "angle", "--start", "150", "--stop", "500")
    assert late.exit_code == 2
    assert "lasts from 0 to 169.9 s, but 150 to 500 s are requested" in " ".join(
        late.stderr.split()
    )
    few = said(str(path), "--column", "angle", "--start", "20", "--stop", "40")
    assert few.exit_code == 2
    assert "swing.csv, angle: The log has 2.4 swings" in " ".join(few.stderr.split())
