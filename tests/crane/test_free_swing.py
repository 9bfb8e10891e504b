"""Damping of a free swing: against pendulums that SciPy integrates, with noise."""

from math import pi, sqrt

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from tests.marks import rest_slow
from typer.testing import CliRunner

from swashplate.cli import app
from swashplate.crane import swing_damping
from swashplate.errors import InputError

ROPE = 20.0
OMEGA = sqrt(9.80665 / ROPE)
TIME = np.arange(0.0, 150.0, 0.1)


def rope_swing(ratio, *, drag=0.0, sideways=0.0, length=120.0, angle=0.2, other=1.0, noise=0.001):
    """Stamps, angles along and across of a load on 20 m of rope, by its equations of motion. [rad]

    The load is a point on a sphere, damped linearly across the rope, along the second angle `other`
    times as much, with a drag [1/m] by the square of its speed, and a speed across the swing at the
    start. [m/s]
    """
    rates = 2.0 * ratio * OMEGA * np.array([1.0, other, 1.0])

    def motion(_, state):
        place, velocity = state[:3], state[3:]
        pull = -(rates + drag * np.linalg.norm(velocity)) * velocity - [0.0, 0.0, 9.80665]
        along = (velocity @ velocity + pull @ place) / ROPE**2
        return np.concatenate([velocity, pull - along * place])

    start = [ROPE * np.sin(angle), 0.0, -ROPE * np.cos(angle), 0.0, sideways, 0.0]
    time = np.arange(0.0, length, 0.1)
    x, y, z = solve_ivp(
        motion, (0.0, length), start, t_eval=time, rtol=1e-9, atol=1e-9
    ).y[:3]  # fmt: skip
    errors = noise * np.random.default_rng(4).standard_normal((2, time.size))
    return time, np.arctan2(x, -z) + 0.01 + errors[0], np.arctan2(y, -z) - 0.02 + errors[1]


def free_swing(ratio, *, time=TIME):
    """Small angles along and across by the closed form. [rad]"""
    damped = OMEGA * sqrt(1.0 - ratio**2)
    swing = 0.05 * np.exp(-ratio * OMEGA * time) * np.cos(damped * time + 0.7)
    noise = 1e-4 * np.random.default_rng(5).standard_normal((2, time.size))
    return swing + 0.01 + noise[0], noise[1]


def holds(estimate, truth):
    """Whether the 95 % interval of an estimate has the truth."""
    return estimate.lower <= truth <= estimate.upper


@pytest.mark.parametrize(
    ("ratio", "drag", "sideways"),
    rest_slow([(0.005, 0.004, 0.5), (0.005, 0.0, 0.0), (0.003, 0.01, -1.0), (0.02, 0.002, 1.5)]),
)
def test_damping_drag_and_rope_are_held_by_their_intervals(ratio, drag, sideways):
    time, along, across = rope_swing(ratio, drag=drag, sideways=sideways)
    found = swing_damping(time + 40.0, along, across, rope=ROPE)
    assert holds(found.damping, ratio)
    assert holds(found.rope, ROPE)
    assert found.drag.value == pytest.approx(drag, abs=6e-4)
    assert found.period == pytest.approx(2.0 * pi / OMEGA, rel=1e-3)
    assert found.largest == pytest.approx(0.2, rel=0.04)
    (sentence,) = found.sentences()
    assert f"swings of {np.degrees(found.largest):.3g} down to" in sentence


def test_without_drag_the_interval_is_that_of_the_damping_alone():
    along, across = free_swing(0.01)
    found = swing_damping(TIME, along, across, drag=0.0)
    assert found.damping.value == pytest.approx(0.01, rel=2e-3)
    assert found.damping.upper - found.damping.lower < 2e-4
    assert found.drag.value == 0.0
    assert found.drag.interval == (None, None)


@pytest.mark.slow
def test_a_drag_that_the_log_contradicts_is_refused():
    time, along, across = rope_swing(0.002, drag=0.01)
    with pytest.raises(InputError, match="shows a drag of 0.0.* not the 0 1/m"):
        swing_damping(time, along, across, drag=0.0)


def turning():
    """A swing whose plane something turns by half a right angle. [rad]"""
    swing = 0.2 * np.exp(-0.005 * OMEGA * TIME) * np.cos(OMEGA * TIME)
    turn = np.radians(45.0) * TIME / TIME[-1]
    return TIME, swing * np.cos(turn), swing * np.sin(turn)


def two_dampings():
    """A swing on an ellipse that is damped along one axis more than along the other. [rad]"""
    return rope_swing(0.004, sideways=1.0, other=2.5, length=200.0)


@pytest.mark.parametrize("log", rest_slow([turning, two_dampings]))
def test_what_one_damping_does_not_explain_is_refused(log):
    with pytest.raises(InputError, match=r"does not show a damping ratio above 0: .* Use a longer"):
        swing_damping(*log())


def test_stamps_need_not_be_even():
    time = np.sort(np.random.default_rng(3).uniform(0.0, 150.0, 1500))
    found = swing_damping(time, *free_swing(0.01, time=time), drag=0.0)
    assert found.damping.value == pytest.approx(0.01, rel=2e-3)


def test_logs_that_cannot_be_a_free_swing_are_refused():
    along, across = free_swing(0.01)
    cases = [
        (TIME[:400], along[:400], across[:400], r"4\.[3-5] swings, .* 5 "),
        (TIME, np.abs(along) + 0.1, across, "signed angles"),
        (TIME, np.degrees(along), across, r"[23]\.\d+ rad, .* degrees"),
        (TIME[::-1], along, across, "time .* rise"),
        (TIME, along[:9], across, "equal length"),
        (TIME, along, across[:9], "equal length"),
    ]
    for time, first, second, sentence in cases:
        with pytest.raises(InputError, match=sentence):
            swing_damping(time, first, second)
    with pytest.raises(InputError, match="drag is -1"):
        swing_damping(TIME, along, across, drag=-1.0)


def test_a_log_of_something_else_is_refused():
    random = 0.1 * np.random.default_rng(1).standard_normal((2, TIME.size))
    with pytest.raises(InputError, match="swinging load explains"):
        swing_damping(TIME, *random)


def test_another_rope_than_that_of_the_log_is_refused():
    with pytest.raises(InputError, match=r"8.97 s, .* 30 m .* 11 s"):
        swing_damping(TIME, *free_swing(0.01), rope=30.0)
    with pytest.raises(InputError, match="rope .* -1 m"):
        swing_damping(TIME, *free_swing(0.01), rope=-1.0)


@pytest.mark.parametrize("gap", [(40.0, 140.0), (20.0, 60.0), (100.0, 112.0)])
def test_a_gap_is_said_where_it_is(gap):
    begin, end = gap
    along, across = free_swing(0.005)
    there = ~((begin < TIME) & (end > TIME))
    with pytest.raises(
        InputError, match=rf"gap of {end - begin:g} s, {begin:g} s after .* [89]\.\d+ s"
    ):
        swing_damping(TIME[there], along[there], across[there])


def said(*words):
    return CliRunner().invoke(app, ["crane", "damping", *words], env={"COLUMNS": "120"})


def test_the_command_reads_a_log_with_its_units(tmp_path):
    path = tmp_path / "swing.csv"
    along, across = map(np.degrees, free_swing(0.01))
    # before it swings freely the crane moves
    rows = [f"{1000.0 * t:.0f};{9.0 * np.sin(t):.6f};0.1" for t in np.arange(0.0, 20.0, 0.1)]
    rows += [
        f"{1000.0 * (t + 20.0):.0f};{x:.6f};{y:.6f}"
        for t, x, y in zip(TIME, along, across, strict=True)
    ]
    path.write_text("\n".join(["time [ms];angle [deg];side_lead [deg]", *rows]), "utf-8")
    words = [str(path), "--column", "angle"]
    found = said(*words, "--start", "20", "--rope", "20", "--drag", "0")
    assert found.exit_code == 0, found.output
    rows = [line.split() for line in found.stdout.splitlines() if line[:4] in ("damp", "rope")]
    (_, _, ratio, low, high, _), (_, length, *_) = rows
    assert float(ratio) == pytest.approx(1.0, rel=2e-3)
    assert float(low) < 1.0 < float(high)
    assert float(length) == pytest.approx(20.0, rel=1e-3)
    late = said(*words, "--start", "150", "--stop", "500")
    assert late.exit_code == 2
    assert "lasts from 0 to 169.9 s, but 150 to 500 s are requested" in " ".join(
        late.stderr.split()
    )
    few = said(*words, "--start", "20", "--stop", "40")
    assert few.exit_code == 2
    assert "swing.csv, angle: The log has 2.2 swings" in " ".join(few.stderr.split())
