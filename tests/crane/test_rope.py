"""The load on its rope, against closed forms and an independent integration (DOP853)."""

from math import cos, hypot, inf, pi, radians, sin, sqrt

import numpy as np
import pytest

from swashplate.crane import Crane, Suspension, load_motion
from swashplate.crane.kinematics import (
    Boom,
    Shafts,
    Vector,
    boom_of,
    luff_rope,
    rope_length,
    rotation,
    shaft_torques,
    shafts_for,
    tip_of,
    to_inertial,
)
from swashplate.errors import InputError

G = 9.80665
RATE = 512.0


def clock(seconds, rate=RATE):
    return np.arange(round(seconds * rate) + 1) / rate


def still(seconds, rate=RATE):
    """A tip at rest."""
    return np.zeros((round(seconds * rate) + 1, 3))


REST = [0.0, 0.0, 0.0]


def swung(degrees_, length=20.0):
    """Place of a load swung forward."""
    angle = radians(degrees_)
    return [length * sin(angle), 0.0, -length * cos(angle)]


def rising(x, rate):
    """Times at which a signal rises through zero, straight between samples."""
    i = np.flatnonzero((x[:-1] < 0.0) & (x[1:] >= 0.0))
    return (i - x[i] / (x[i + 1] - x[i])) / rate


def highest(x):
    """Samples of its peaks."""
    return 1 + np.flatnonzero((x[1:-1] > x[:-2]) & (x[1:-1] >= x[2:]))


def angle_of(made, tip):
    d = made.position - tip
    return np.degrees(np.arctan2(np.hypot(d[:, 0], d[:, 1]), -d[:, 2]))


@pytest.mark.parametrize(("rate", "error"), [(512.0, -1.80e-7), (64.0, -1.15e-5)])
def test_large_swing_has_the_period_of_the_elliptic_integral(rate, error):
    tip = still(60.0, rate)
    made = load_motion(tip, 20.0, rate, start=swung(60.0), velocity=REST)
    period = np.diff(rising(made.position[:, 0], rate)).mean()
    assert period / 9.629592541 - 1.0 == pytest.approx(error, rel=0.02)
    assert made.pull.max() == pytest.approx(2.0 * G, rel=3e-5)
    assert np.abs(np.linalg.norm(made.position, axis=1) - 20.0).max() < 2e-14
    middle = (made.position[2:] - made.position[:-2]) * rate / 2.0
    energy = 0.5 * (middle**2).sum(axis=1) + G * made.position[1:-1, 2]
    assert np.ptp(energy) < 8e-7 * G * 20.0 * (512.0 / rate) ** 2


def test_conical_pendulum_turns_at_its_rate():
    radius, omega = 20.0 * sin(radians(30.0)), 0.752454119
    start = swung(30.0)
    made = load_motion(still(60.0), 20.0, start=start, velocity=[0.0, radius * omega, 0.0])
    turn = np.unwrap(np.arctan2(made.position[:, 1], made.position[:, 0]))
    assert turn[-1] / 60.0 == pytest.approx(omega, abs=2e-7)
    assert made.pull.mean() == pytest.approx(1.154700538 * G, rel=1e-6)


def test_ellipse_precesses():
    b = 20.0 * radians(3.0)
    start = swung(10.0)
    made = load_motion(still(600.0), 20.0, start=start, velocity=[0.0, b * sqrt(G / 20.0), 0.0])
    x, y = made.position[:, 0], made.position[:, 1]
    r = np.hypot(x, y)
    peaks = highest(r)
    turned = np.unwrap(2.0 * np.arctan2(y[peaks], x[peaks])) / 2.0
    rate = np.polyfit(peaks / RATE, turned, 1)[0]
    # to leading order 3/8 ab/L² √(g/L); the next one is of the amplitude's square, 0.03
    assert rate == pytest.approx(0.0023997, rel=5e-3)


def test_slowly_hoisted_load_swings_further():
    time = clock(200.0)
    length = 30.0 - 0.1 * time
    made = load_motion(still(200.0), length, start=swung(1.0, 30.0), velocity=REST)
    angle = angle_of(made, 0.0)
    last = highest(angle)[-1]
    # adiabatic invariant: amplitude ∝ L^(-3/4), 2.27153 degrees at 10.047 m
    assert angle[last] * (length[last] / 10.047) ** 0.75 == pytest.approx(2.27153, rel=2e-4)


STRESS = np.array([40.756697, -1.019942, 36.518782])


def stressed(rate):
    """A crane on a ship in six degrees of freedom: path of the tip, rope, first velocity."""
    g = Crane.preset("tg3637").geometry

    def tip_at(t):
        psi, beta = 0.8 * sin(0.35 * t) - 0.8, radians(45.0 + 8.0 * sin(0.27 * t))
        shift = Vector(0.3 * sin(0.5 * t), 0.4 * sin(0.62 * t + 0.3), 0.5 * sin(0.7 * t + 1.0))
        angles = 2.0 * sin(0.6 * t), sin(0.75 * t + 0.5), 0.5 * sin(0.4 * t)
        r = rotation(*map(radians, angles))
        return np.array(to_inertial(r, tip_of(psi, Boom(cos(beta), sin(beta)), g), shift))

    time = clock(30.0, rate)
    tip = np.array([tip_at(t) for t in time])
    u = np.array([sin(0.1), 0.0, -cos(0.1)])
    velocity = (tip_at(1e-5) - tip_at(-1e-5)) / 2e-5 - 0.8 * u
    rope = 20.0 - 4.0 * np.sin(0.2 * time)
    return load_motion(tip, rope, rate, start=tip[0] + 20.0 * u, velocity=velocity)


@pytest.mark.slow
def test_crane_on_a_moving_ship_agrees_with_dop853_by_order_two():
    error = {rate: stressed(rate).position[-1] - STRESS for rate in (64.0, 128.0, 512.0)}
    size = {rate: np.abs(each).max() for rate, each in error.items()}
    assert size[512.0] < 1.1e-4
    assert size[64.0] < 7.2e-3
    order = np.log2(np.linalg.norm(error[64.0]) / np.linalg.norm(error[128.0]))
    assert order == pytest.approx(2.0, abs=0.1)


def dropped():
    """A tip that falls slower than its load, then at a steady speed."""
    time, tip = clock(2.0), still(2.0)
    tip[:, 2] = np.where(time < 0.5, -7.5 * time**2, -1.875 - 7.5 * (time - 0.5))
    return time, tip


def test_slack_rope_is_caught_where_the_load_falls_behind():
    time, tip = dropped()
    made = load_motion(tip, 10.0, velocity=REST)
    slack = made.pull == 0.0
    first = int(np.argmax(~slack & (time > 0.1)))
    assert time[first] == pytest.approx(1.21479, abs=1.0 / RATE)
    assert slack[1:first].all()
    speed = np.diff(made.position[:, 2]) * RATE
    assert speed[first + 1] == pytest.approx(-7.5, abs=1e-9)


def test_steady_slewing_holds_the_load_outwards():
    rho = 2.5 + 36.0 * cos(radians(45.0))
    omega, outward = radians(4.24205156), radians(0.9053717)
    time = clock(60.0)
    tip = np.stack([rho * np.cos(omega * time), rho * np.sin(omega * time), 0.0 * time], axis=1)
    radius = rho + 20.0 * sin(outward)
    made = load_motion(
        tip, 20.0, start=[radius, 0.0, -20.0 * cos(outward)], velocity=[0.0, omega * radius, 0.0]
    )
    assert angle_of(made, tip) == pytest.approx(0.9053717, abs=2e-7)


def test_forced_sway_has_the_linear_amplitude():
    time = clock(120.0)
    tip = still(120.0)
    tip[:, 1] = 0.05 * np.sin(0.4 * time)
    forced = 0.05 / (1.0 - 0.16 * 20.0 / G)
    made = load_motion(tip, 20.0, velocity=[0.0, 0.4 * forced, 0.0])
    assert angle_of(made, tip).max() == pytest.approx(0.0693795, abs=2e-6)


def steps(times, part):
    """A tip that gets its speed of 0.1 m/s in steps."""
    time = clock(60.0)
    tip = still(60.0)
    tip[:, 0] = sum(
        0.1 * each * np.maximum(time - t, 0.0) for t, each in zip(times, part, strict=True)
    )
    return tip


def test_step_of_speed_swings_the_load():
    tip = steps([0.0], [1.0])
    made = load_motion(tip, 20.0, velocity=REST)
    assert angle_of(made, tip).max() == pytest.approx(0.409117, abs=2e-6)


@pytest.mark.parametrize(
    ("ratio", "left"), [(0.5, 0.444016), (0.7, 0.253768), (1.3, 0.218412), (1.5, 0.345741)]
)
def test_shaper_for_another_rope_leaves_its_share(ratio, left):
    half = pi * sqrt(20.0 * ratio / G)
    tip = steps([0.0, half], [0.5, 0.5])
    made = load_motion(tip, 20.0, velocity=REST)
    after = round((half + 1.0) * RATE)
    assert angle_of(made, tip)[after:].max() / 0.409117 == pytest.approx(left, abs=4e-6)


def test_drag_leads_to_a_terminal_lean():
    made = load_motion(still(600.0), 10.0, velocity=REST, drag=0.01, wind=[8.0, 0.0, 0.0])
    lean = np.arctan(0.01 * 64.0 / G)
    tail = made.position[-round(60.0 * RATE) :, 0]
    assert tail.mean() == pytest.approx(10.0 * sin(lean), rel=1e-3)
    assert np.ptp(tail) < 0.5 * 2.0 * 10.0 * sin(lean)


def test_rope_too_short_for_the_step_is_refused():
    tip = still(1.0)
    tip[100:, 0] = 5.0
    with pytest.raises(InputError, match=r"0.195312 s .* rope of 2 m"):
        load_motion(tip, 2.0)
    with pytest.raises(InputError, match="rope .* 0 m"):
        load_motion(tip, 0.0)
    with pytest.raises(InputError, match="rows of x, y and z"):
        load_motion(tip[:, :2], 2.0)


# --- damping of the swing -------------------------------------------------------------------------


def decrement(x):
    """Damping ratio by the logarithmic decrement of all peaks but the first."""
    peaks = highest(x)
    peaks = peaks[x[peaks] > 0.0][1:]
    decay = np.polyfit(np.arange(peaks.size), np.log(x[peaks]), 1)[0] / (2.0 * pi)
    return -decay / sqrt(1.0 + decay**2)


@pytest.mark.parametrize("ratio", [0.002, 0.005, 0.02])
def test_a_small_free_swing_decays_by_its_damping_ratio(ratio):
    made = load_motion(still(200.0), 20.0, start=swung(0.5), velocity=REST, swing_damping=ratio)
    assert decrement(made.position[:, 0]) == pytest.approx(ratio, rel=2e-4)
    # the amplitude takes 5e-6 of it, and the velocity of half a sample ago adds ζ ω h/2
    omega = 2.0 * pi / np.diff(rising(made.position[:, 0], RATE)).mean()
    assert omega / sqrt(G / 20.0) == pytest.approx(sqrt(1.0 - ratio**2), abs=1.5e-5)


def test_a_forced_swing_has_the_damped_amplitude_and_only_the_motion_past_the_tip_is_damped():
    # x'' = -ω₀² (x - p) - 2 ζ ω₀ (x' - p') with p = a sin ωt, at resonance
    omega, ratio = sqrt(G / 20.0), 0.05
    time, tip = clock(400.0), still(400.0)
    tip[:, 1] = 0.01 * np.sin(omega * time)
    made = load_motion(tip, 20.0, velocity=REST, swing_damping=ratio)
    away = (made.position - tip)[-round(60.0 * RATE) :, 1]
    assert away.max() == pytest.approx(0.01 / (2.0 * ratio), rel=2e-3)
    steady = still(30.0)
    steady[:, 0] = 3.0 * clock(30.0)
    led = load_motion(steady, 20.0, swing_damping=0.2)
    np.testing.assert_allclose(led.position[:, 0], steady[:, 0], atol=1e-10)


def test_damping_of_the_swing_leaves_a_straight_hoist_as_it_is():
    length = 20.0 - 1.0 * clock(10.0) + 0.3 * np.sin(clock(10.0))
    free, damped = (
        load_motion(still(10.0), length, velocity=[0.0, 0.0, 0.7], swing_damping=ratio)
        for ratio in (0.0, 0.2)
    )
    np.testing.assert_allclose(damped.pull, free.pull, rtol=1e-9)
    np.testing.assert_allclose(damped.position, free.position, atol=1e-12)
    # nor does it damp the bounce of an elastic rope
    suspension = Suspension(6e7, 0.0)
    bounces = [
        load_motion(
            still(10.0),
            20.0,
            start=[0.0, 0.0, -20.3],
            velocity=REST,
            suspension=suspension,
            mass=35000.0,
            swing_damping=ratio,
        )
        for ratio in (0.0, 0.2)
    ]
    np.testing.assert_allclose(bounces[1].position, bounces[0].position, atol=1e-12)


def test_first_mode_of_a_hook_with_slings_decays_by_about_the_damping_ratio():
    made = load_motion(
        still(300.0),
        15.0,
        start=[0.1, 0.0, -sqrt(21.0**2 - 0.1**2)],
        velocity=REST,
        suspension=Suspension(hook=5000.0, sling=6.0),
        mass=30000.0,
        swing_damping=0.01,
    )
    # x_load = g/(g - l ω²) x_hook in the second mode, which falls out
    share = G / (G - 6.0 * 3.94158260**2)
    first = made.position[:, 0] - share * made.hook[:, 0]
    # damped as √(g/(L + l)) = 0.68336 rad/s, while the mode has 0.69387
    assert decrement(first) == pytest.approx(0.01 * 0.68336 / 0.69387, rel=2e-3)


def test_damping_beyond_its_range_is_refused():
    with pytest.raises(InputError, match="swing_damping .* 0.3, .* 0.2"):
        load_motion(still(1.0), 20.0, swing_damping=0.3)


# --- elastic rope, hook and slings ----------------------------------------------------------------


def test_elastic_rope_bounces_at_its_frequency_and_damping():
    # √(EA/(L m)) = 9.258201 rad/s, by Verlet's step (ωh)²/24 = 1.36e-5 faster
    stiff, mass, length = 6e7, 35000.0, 20.0
    hangs = length * (1.0 + G * mass / stiff)
    paths = [
        load_motion(
            still(20.0),
            length,
            start=[0.0, 0.0, -hangs - 0.01],
            velocity=REST,
            suspension=Suspension(stiff, damping),
            mass=mass,
        )
        for damping in (0.0, 0.05)
    ]
    free, damped = (each.position[:, 2] + hangs for each in paths)
    omega = 2.0 * pi / np.diff(rising(free, RATE)).mean()
    assert omega / 9.258201 - 1.0 == pytest.approx(1.36e-5, abs=2e-7)
    assert paths[0].pull.max() == pytest.approx(G + 0.01 * stiff / (length * mass), rel=1e-4)
    peaks = highest(damped)
    decay = np.log(damped[peaks[0]] / damped[peaks[4]]) / (8.0 * pi)
    assert decay / sqrt(1.0 + decay**2) == pytest.approx(0.05, rel=2e-3)


def test_hook_and_load_swing_at_the_frequencies_of_a_double_pendulum():
    # m1 L l ω⁴ - (m1 + m2) g (L + l) ω² + (m1 + m2) g² = 0 for 5 t on 15 m and 30 t on 6 m
    made = load_motion(
        still(400.0),
        15.0,
        start=[0.05, 0.0, -sqrt(21.0**2 - 0.05**2)],
        velocity=REST,
        suspension=Suspension(hook=5000.0, sling=6.0),
        mass=30000.0,
    )
    slow, quick = 0.69386952, 3.94158260
    for omega, other in ((slow, quick), (quick, slow)):
        # x_load = g/(g - l ω²) x_hook in a mode: what the other one has falls out
        share = G / (G - 6.0 * other**2)
        alone = made.position[:, 0] - share * made.hook[:, 0]
        found = 2.0 * pi / np.diff(rising(alone, RATE)).mean()
        assert found == pytest.approx(omega, rel=4e-6)
    slings = np.linalg.norm(made.position - made.hook, axis=1)
    assert np.abs(slings - 6.0).max() < 1e-13
    assert np.abs(np.linalg.norm(made.hook, axis=1) - 15.0).max() < 1e-13


def test_hook_and_load_fall_together_and_are_caught_together():
    _, tip = dropped()
    hooked = Suspension(hook=500.0, sling=2.0)
    made = load_motion(tip, 10.0, velocity=REST, suspension=hooked, mass=9500.0)
    one = load_motion(tip, 10.0, velocity=REST)
    assert made.hook is not None
    np.testing.assert_allclose(made.hook[:, 2], one.position[:, 2], atol=1e-9)
    np.testing.assert_allclose(made.position[:, 2], one.position[:, 2] - 2.0, atol=1e-9)
    np.testing.assert_allclose(made.pull[1:], one.pull[1:], atol=1e-6)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Suspension(stiffness=0.0), "stiffness .* 0 N, .* 1000 to 1e.12 N"),
        (lambda: Suspension(stiffness=1e300), "stiffness .* 1e.300 N, .* inf for a rigid"),
        (lambda: Suspension(hook=1e300, sling=2.0), "hook .* 1e.300, .* 1e.06"),
        (lambda: Suspension(hook=500.0, sling=1e300), "sling .* 1e.300, .* 200"),
        (lambda: Suspension(bounce_damping=inf), "bounce_damping .* inf, .* 1"),
        (lambda: load_motion(still(1.0), 3.0, mass=1e-300), "load .* 1e-300 kg, .* 0.1"),
        (lambda: Suspension(hook=500.0), "500 kg .* 0 m: .* 0"),
        (lambda: Suspension(bounce_damping=-1.0), "bounce_damping .* -1, .* 0"),
        (
            lambda: load_motion(still(1.0), 3.0, suspension=Suspension(1e9), mass=100.0),
            "100 kg .* 3 m .* 1e.09 N .* 291 Hz, .* 512",
        ),
        (
            lambda: load_motion(
                still(1.0), 3.0, start=[0, 0, -1], suspension=Suspension(hook=1.0, sling=2.0)
            ),
            "1 m from the tip, .* 2 m",
        ),
    ],
)
def test_suspensions_that_make_no_sense_are_refused(make, message):
    with pytest.raises(InputError, match=message):
        make()


# --- kinematics -----------------------------------------------------------------------------------


def test_luff_rope_has_the_lengths_that_were_worked_out_by_hand():
    g = Crane.preset("tg3637").geometry
    found = [
        luff_rope(Boom(cos(radians(b)), sin(radians(b))), g) for b in (20.0, 38.0, 45.0, 53.5, 70.0)
    ]
    np.testing.assert_allclose(found, [35.902, 32.712, 31.505, 30.112, 27.794], atol=5e-4)


@pytest.mark.parametrize("boom_deg", [16.0, 45.0, 79.0])
@pytest.mark.parametrize("slew_deg", [-200.0, -30.0, 0.0, 179.0, 181.0])
def test_inverse_kinematics_return_to_the_same_shafts(boom_deg, slew_deg):
    crane = Crane.preset("tg3637")
    g, home = crane.geometry, crane.home(np.degrees(0.1))
    boom = Boom(cos(radians(boom_deg)), sin(radians(boom_deg)))
    rope = luff_rope(boom, g)
    assert boom_of(rope, g) == pytest.approx(boom, abs=1e-14)
    tip = tip_of(radians(slew_deg), boom, g)
    near = Shafts(0.0, radians(slew_deg + 25.0) - 0.1, 0.0)
    found = shafts_for(tip.x, tip.y, near, g, home)
    assert found.slew + 0.1 == pytest.approx(radians(slew_deg), abs=1e-12)
    assert found.luff == pytest.approx((home.luff_rope - rope) / g.luff, abs=1e-10)
    assert hypot(tip.x - g.axis.x, tip.y - g.axis.y) == pytest.approx(2.5 + 36.0 * boom.cos)


@pytest.mark.parametrize(("slew_deg", "boom_deg"), [(0.0, 20.0), (70.0, 45.0), (-130.0, 75.0)])
def test_torques_of_the_rope_do_the_work_that_lifts_the_load(slew_deg, boom_deg):
    crane = Crane.preset("tg3637")
    g, home = crane.geometry, crane.home(slew_deg, boom_deg)
    n = np.array([0.3, -0.2, -0.9])
    n, tension = n / np.linalg.norm(n), 3e5

    def loss(hoist, slew, luff):
        """What the tension loses for a load kept where it is: T times the rope's shortening."""
        boom = boom_of(home.luff_rope - g.luff * luff, g)
        tip = np.array(tip_of(home.slew + slew, boom, g))
        length = rope_length(Shafts(hoist, slew, luff), g, home)
        return -tension * (length + n @ tip)

    boom = boom_of(home.luff_rope, g)
    found = shaft_torques(Vector(*(tension * n)), home.slew, boom, tension, g)
    step = 1e-4
    for axis, torque in zip(("hoist", "slew", "luff"), found, strict=True):
        angles = {each: step * (each == axis) for each in ("hoist", "slew", "luff")}
        back = {each: -angle for each, angle in angles.items()}
        work = loss(**angles) - loss(**back)
        assert torque == pytest.approx(work / (2.0 * step), rel=1e-6, abs=1e-3)
