"""Damping of a free swing: against decaying sines with noise."""

from math import pi, sqrt

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from tests.marks import rest_slow
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
@pytest.mark.slow
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


def rope_swing(ratio, *, drag=0.0, sideways=0.0, length=120.0, angle=0.2):
    """Angles along and across of a load on 20 m of rope, by its equations of motion. [rad]

    The load is a point on a sphere, damped linearly across the rope, with a drag [1/m] by the
    square of its speed, and a speed across the swing at the start. [m/s]
    """
    rope = 20.0
    rate = 2.0 * ratio * sqrt(9.80665 / rope)

    def motion(_, state):
        place, velocity = state[:3], state[3:]
        pull = -(rate + drag * np.linalg.norm(velocity)) * velocity - [0.0, 0.0, 9.80665]
        along = (velocity @ velocity + pull @ place) / rope**2
        return np.concatenate([velocity, pull - along * place])

    start = [rope * np.sin(angle), 0.0, -rope * np.cos(angle), 0.0, sideways, 0.0]
    time = np.arange(0.0, length, 0.05)
    x, y, z = solve_ivp(
        motion, (0.0, length), start, t_eval=time, rtol=1e-9, atol=1e-9
    ).y[:3]  # fmt: skip
    return time, np.arctan2(x, -z), np.arctan2(y, -z)


@pytest.mark.parametrize("seed", rest_slow(range(3)))
@pytest.mark.parametrize(("angle", "length"), rest_slow([(0.05, 60.0), (0.2, 120.0), (0.4, 200.0)]))
def test_a_rope_of_known_damping_passes_and_its_interval_holds_it(angle, length, seed):
    time, along, across = rope_swing(0.005, angle=angle, length=length)
    noise_along, noise_across = 0.001 * np.random.default_rng(seed).standard_normal((2, time.size))
    found = swing_damping(time, along + noise_along, across=across + noise_across, rope=20.0)
    # 95 % intervals: of these nine seeded ones all hold it
    assert found.low <= 0.005 <= found.high
    assert found.high - found.low < 0.0012
    # exp(-0.005 omega t) by hand
    left = np.exp(-0.005 * sqrt(9.80665 / 20.0) * length)
    assert found.largest == pytest.approx(angle, rel=0.01)
    assert found.smallest == pytest.approx(left * angle, rel=0.02)
    (holds,) = found.sentences()
    assert f"{np.degrees(found.largest):.3g} down to" in holds


def turned(angle, period, start=0.0):
    """A planar swing of 0.5 % as sensors along and across see it whose plane turns. [rad]"""
    time = np.arange(0.0, 150.0, 0.05)
    omega = sqrt(9.80665 / 20.0)
    swing = angle * np.exp(-0.005 * omega * time) * np.cos(omega * time)
    turn = 2.0 * pi * time / period + start
    return time, swing * np.cos(turn), swing * np.sin(turn)


@pytest.mark.parametrize(
    ("log", "reason"),
    [
        (turned(0.2, 1000.0), "halves .* turns"),
        (turned(0.2, -1000.0), "halves .* turns"),
        (turned(0.2, 700.0, -0.3), "halves .* turns"),
        (turned(0.2, 400.0), "not a free swing|halves"),
        (rope_swing(0.002, drag=0.01), "halves .* depends on the angle"),
        (rope_swing(0.002, drag=0.03), "halves .* depends on the angle"),
    ],
)
def test_halves_of_a_log_that_do_not_agree_are_refused(log, reason):
    """By the closed form of a plane that turns, and by drag: all these are a sure 20 % apart."""
    time, along, _ = log
    with pytest.raises(InputError, match=reason):
        swing_damping(time, along)


@pytest.mark.parametrize("ratio", [1.03, 0.97])
def test_wind_that_beats_with_the_swing_is_refused(ratio):
    omega = sqrt(9.80665 / 20.0)
    time = np.arange(0.0, 200.0, 0.05)
    swing = 0.15 * np.exp(-0.005 * omega * time) * np.cos(omega * time)
    with pytest.raises(InputError, match=r"halves .* wind"):
        swing_damping(time, swing + 0.03 * np.cos(ratio * omega * time + 0.3))


@pytest.mark.parametrize(
    "log",
    [
        rope_swing(0.005, sideways=0.5),
        rope_swing(0.005, sideways=-1.0),
        turned(0.2, 3000.0, 0.8),
        turned(0.2, -4000.0, 0.8),
    ],
)
def test_planes_of_a_log_that_do_not_agree_are_refused(log):
    time, along, across = log
    with pytest.raises(InputError, match=r"(planes|halves) of the log do not agree"):
        swing_damping(time, along, across=across)
    try:
        alone = swing_damping(time, along)
    except InputError:
        return
    # from one plane it cannot be seen, and that is said
    assert "one plane" in " ".join(alone.sentences())


def test_noise_across_is_no_swing_across():
    time, along, across = rope_swing(0.005, angle=0.05)
    noise_along, noise_across = 0.004 * np.random.default_rng(5).standard_normal((2, time.size))
    found = swing_damping(time, along + noise_along, across=across + noise_across)
    assert found.low <= 0.005 <= found.high


@pytest.mark.parametrize("gap", [(40.0, 140.0), (20.0, 60.0), (100.0, 112.0)])
def test_a_gap_is_said_where_it_is(gap):
    begin, end = gap
    there = ~((begin < TIME) & (end > TIME))
    with pytest.raises(
        InputError, match=rf"gap of {end - begin:g} s, {begin:g} s after .* 8\.\d+ s"
    ):
        swing_damping(TIME[there], free_swing(0.005)[there])


def test_a_gap_within_half_a_swing_is_none():
    there = np.abs(TIME - 41.5) >= 1.5
    found = swing_damping(TIME[there], free_swing(0.005)[there])
    assert found.value == pytest.approx(0.005, rel=1e-6)


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
    row = next(line for line in found.stdout.splitlines() if line.rstrip().endswith("8.27"))
    ratio, low, high, period = row.replace(" %", "%").split()
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


def test_the_command_takes_both_planes(tmp_path):
    path = tmp_path / "swing.csv"
    for log, code, words in [
        (rope_swing(0.005), 0, "It holds for swings of 11.5 down to 7.5"),
        (rope_swing(0.005, sideways=0.5), 2, "planes of the log do not agree"),
    ]:
        rows = [f"{t:.2f},{x:.7f},{y:.7f}" for t, x, y in zip(*log, strict=True)]
        path.write_text("\n".join(["time [s],swing [rad],sway [rad]", *rows]), "utf-8")
        found = said(str(path), "--across", "sway", "--rope", "20")
        assert found.exit_code == code, found.output
        assert words in " ".join((found.stdout + found.stderr).split())
