"""A crane's body in a fit: logs of angles and of the load's position that SciPy integrated."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from swashplate import Campaign, Drive, identify, maneuvers
from swashplate.campaign import campaign_findings
from swashplate.crane import Crane, body
from swashplate.errors import InputError, ParameterError
from swashplate.identification import ModelSetup

ROPE, DAMPING, GRAVITY = 24.0, 0.01, 9.80665
EACH_RUN = ("offset_x", "offset_y", "velocity_x", "velocity_y")
FREE = {
    "swing_damping": (0.0, 0.05),
    "rope": (5.0, 50.0),
    **dict.fromkeys(EACH_RUN, (-20.0, 20.0)),
}
CRANE = Crane.preset("tg3637")
AT_REST = """
[axes.load]
time = { column = "time", unit = "s" }
input = { kind = "none" }
channels.off_lead = { kind = "swing_angle", column = "off_lead", unit = "deg", noise = 0.1 }
channels.side_lead = { kind = "swing_angle", column = "side_lead", unit = "deg", noise = 0.1 }
"""


def load_path(time, start, speed, *, tip=None, ropes=ROPE):
    """(3, n) from the tip to a load that is damped against it, and the tip's path (3, n). [m]

    `tip` gives position, velocity and acceleration of the upper end at a time.
    """

    def still(_):
        return np.zeros((3, 3))

    moves = tip or still

    def motion(t, state):
        line, velocity = state[:3], state[3:]
        a = -2.0 * DAMPING * np.sqrt(GRAVITY / ropes) * velocity - moves(t)[2]
        a[2] -= GRAVITY
        along = (velocity @ velocity + a @ line) / ropes**2
        return np.concatenate([velocity, a - along * line])

    first = [*start, -np.sqrt(ropes**2 - start[0] ** 2 - start[1] ** 2)]
    drop = -(speed[0] * first[0] + speed[1] * first[1]) / first[2]
    path = solve_ivp(
        motion, (0.0, time[-1]), [*first, *speed, drop], t_eval=time, rtol=1e-9, atol=1e-9
    ).y[:3]  # fmt: skip
    return path, np.array([moves(t)[0] for t in time]).T


def written(folder, name, columns):
    """A log of columns by name."""
    rows = np.column_stack([*columns.values()])
    text = "\n".join([",".join(columns), *(",".join(f"{x:.7g}" for x in row) for row in rows)])
    (folder / name).write_text(text, "utf-8")


def at_rest(folder, runs, ropes=(ROPE,)):
    """A campaign of logs of angles of a load on one rope or several."""
    random = np.random.default_rng(2)
    text = AT_REST
    for number, (start, speed) in enumerate(runs):
        time = np.arange(0.0, 100.0, 0.2)
        (x, y, z), _ = load_path(time, start, speed, ropes=ropes[number % len(ropes)])
        angles = np.degrees(np.arctan2([x, -y], -z)) + 0.1 * random.standard_normal((2, time.size))
        columns = dict(zip(("time", "off_lead", "side_lead"), (time, *angles), strict=True))
        written(folder, f"run{number}.csv", columns)
        text += f'\n[[runs]]\nfile = "run{number}.csv"\n'
    (folder / "campaign.toml").write_text(text, "utf-8")
    return folder / "campaign.toml"


def setup(machine, free=None, **how):
    """A machine whose inputs rest, and where the load begins free in each run."""
    how.setdefault("inputs", dict.fromkeys(machine.ports.external, 0.0))
    how.setdefault("each_run", EACH_RUN)
    return ModelSetup(machine, free or FREE, rate=128.0, **how)


def holds(estimate, truth):
    """Whether the 95 % interval of an estimate has the truth."""
    low, high = estimate.interval
    return low <= truth <= high


def test_damping_and_rope_of_two_logs(tmp_path):
    file = at_rest(tmp_path, [((3.0, 1.0), (0.0, 1.0)), ((-1.0, 2.0), (0.5, 0.0))])
    result = identify(file, setup(body(CRANE, rope_m=23.0)))
    assert result.verdict.usable
    assert holds(result["hanging.swing_damping"], DAMPING)
    assert holds(result["home.rope"], ROPE)
    assert result["hanging.swing_damping"].relative_half_width < 0.05
    begins = {name: result[f"release.{name} (run1)"].value for name in EACH_RUN}
    truth = dict(zip(EACH_RUN, (-1.0, 2.0, 0.5, 0.0), strict=True))
    assert begins == pytest.approx(truth, abs=0.05)
    assert not result.verdict.validity


@pytest.mark.slow
def test_a_rope_of_another_length_in_each_run(tmp_path):
    runs = [((3.0, 1.0), (0.0, 1.0)), ((-1.0, 2.0), (0.5, 0.0))]
    file = at_rest(tmp_path, runs, ropes=(20.0, 30.0))
    machine = body(CRANE, rope_m=25.0)
    result = identify(file, setup(machine, each_run=(*EACH_RUN, "rope")))
    assert result["home.rope (run0)"].value == pytest.approx(20.0, rel=5e-4)
    assert result["home.rope (run1)"].value == pytest.approx(30.0, rel=5e-4)
    assert result["hanging.swing_damping"].value == pytest.approx(DAMPING, rel=0.02)


@pytest.mark.slow
def test_a_slewing_crane_and_the_position_of_its_load(tmp_path):
    """Slew speed is the campaign's input, and a total station sees the load from anywhere."""
    reach = 2.5 + 36.0 * np.cos(np.radians(45.0))
    turn = 0.05  # rad/s to starboard, once it has begun softly

    def slewed(t):
        """Slew, its speed and acceleration."""
        w = 2.0 * np.pi / 20.0
        if t > 10.0:
            return turn * (t - 5.0), turn, 0.0
        return (
            0.5 * turn * (t - np.sin(w * t) / w),
            0.5 * turn * (1.0 - np.cos(w * t)),
            0.5 * turn * w * np.sin(w * t),
        )

    def tip(t):
        psi, rate, growth = slewed(t)
        c, s = np.cos(psi), np.sin(psi)
        return reach * np.array(
            [
                [c, -s, 0.0],
                [-rate * s, -rate * c, 0.0],
                [-growth * s - rate**2 * c, -growth * c + rate**2 * s, 0.0],
            ]
        )

    time = np.arange(0.0, 60.0, 0.05)
    line, tips = load_path(time, (0.0, 0.0), (0.0, 0.0), tip=tip)
    random = np.random.default_rng(3)
    place = line + tips + 0.02 * random.standard_normal(line.shape) + [[7.0], [-3.0], [0.0]]
    speed = np.array([slewed(t)[1] for t in time])
    written(tmp_path, "slew.csv", {"time": time, "slew": speed, "x": place[0], "y": place[1]})
    (tmp_path / "campaign.toml").write_text(
        """
[axes.load]
time = { column = "time", unit = "s" }
input = { kind = "other", column = "slew", interpolation = "linear" }
channels.load_x = { kind = "hook_position", column = "x", unit = "m", noise = 0.02 }
channels.load_y = { kind = "hook_position", column = "y", unit = "m", noise = 0.02 }

[[runs]]
file = "slew.csv"
""",
        "utf-8",
    )
    machine = body(CRANE, rope_m=23.0)
    inputs = dict.fromkeys(machine.ports.external, 0.0)
    del inputs["slew_speed"]
    free = {"swing_damping": (0.0, 0.05), "rope": (5.0, 50.0)}
    free |= dict.fromkeys(("offset load_x", "offset load_y"), (-100.0, 0.0, 100.0, "m"))
    result = identify(tmp_path / "campaign.toml", setup(machine, free, inputs=inputs, each_run=()))
    assert holds(result["hanging.swing_damping"], DAMPING)
    assert holds(result["home.rope"], ROPE)


def test_inputs_and_numbers_of_runs_are_named_rightly(tmp_path):
    machine = body(CRANE)
    file = at_rest(tmp_path, [((3.0, 1.0), (0.0, 1.0))])
    with pytest.raises(InputError, match=r"run0 has no input, .* inputs = \{NAME: VALUE\}"):
        identify(file, ModelSetup(machine, FREE, rate=128.0))
    cases = {
        r"inputs names 'slew_sped' \(did you mean slew_speed\?\)": {"inputs": {"slew_sped": 0.0}},
        "input yaw stays at 'no'": {"inputs": {"yaw": "no"}},
        "release.offset_x of body is in each_run, but is not free": {
            "each_run": ("offset_x",),
            "free": {"rope": (5.0, 50.0)},
        },
        r"Give each_run as \('rope',\)": {"each_run": "rope"},
    }
    for sentence, how in cases.items():
        with pytest.raises(InputError, match=sentence):
            setup(machine, **how)


def test_a_campaign_without_an_input(tmp_path):
    file = at_rest(tmp_path, [((3.0, 1.0), (0.0, 1.0))])
    campaign = Campaign.from_toml(file)
    (run,) = campaign
    assert run.input.kind == "none"
    assert not run.input.values.any()
    assert run["side_lead"].unit == "rad"
    assert run["side_lead"].noise == pytest.approx(np.radians(0.1))
    assert run.maneuver == "unnamed motion"
    assert not campaign_findings(campaign)
    text = file.read_text("utf-8").replace('{ kind = "none" }', '{ kind = "voltage" }')
    file.write_text(text, "utf-8")
    with pytest.raises(ParameterError, match="kind = 'none'"):
        Campaign.from_toml(file)


def slew_log(folder, name, maneuver, *, stiffness, inertia, leakage, friction):
    """A slew whose line and viscous friction SciPy integrates behind the package's stiff drive."""
    run = Drive.preset("slew").simulate(maneuver.sample(512.0))
    time = np.arange(0.0, run.time[-1], 0.01)

    def motion(t, state):
        torque, speed = state
        flow = np.interp(t, run.time, run.shaft_speed)
        return [
            stiffness * (flow - speed - leakage * torque),
            (torque - friction * speed) / inertia,
        ]

    speed = solve_ivp(
        motion, (0.0, time[-1]), [0.0, 0.0], t_eval=time, rtol=1e-7, atol=1e-9, max_step=0.02
    ).y[1]
    noise = 2e-5 * np.random.default_rng(len(name)).standard_normal(time.size)
    volts = np.interp(time, run.time, run.voltage)
    written(folder, f"{name}.csv", {"time": time, "voltage": volts, "speed": speed + noise})


@pytest.mark.slow
def test_friction_of_the_slew_is_found_as_leakage(tmp_path):
    """A viscous friction b damps the slew on its oil as a leakage of b/(J k) does."""
    true = {"stiffness": 2e8, "inertia": 5e6, "leakage": 3e-9, "friction": 3.3e6}
    text = """
[axes.slew]
drive = "slew"
time = { column = "time", unit = "s" }
input = { kind = "voltage", column = "voltage", unit = "V" }
channels.speed = { kind = "shaft_speed", column = "speed", unit = "rad/s" }
"""
    tests = {
        "up": maneuvers.step(4.0),
        "down": maneuvers.step(-6.0),
        "sine": maneuvers.sine(5.0, 0.1),
    }
    for name, maneuver in tests.items():
        slew_log(tmp_path, name, maneuver, **true)
        text += f'\n[[runs]]\nfile = "{name}.csv"\n'
    (tmp_path / "campaign.toml").write_text(text, "utf-8")
    slew = Drive.preset("slew").replace(
        line_stiffness=true["stiffness"], load_inertia=true["inertia"], motor_leakage=3e-9
    )
    free = {"motor_leakage": (0.1, 10.0), "line_stiffness": (0.8, 1.25), "Z10": (0.8, 1.25)}
    result = identify(tmp_path / "campaign.toml", slew, free)
    # from J W'' + (J k K + b) W' + k (1 + K b) W = k W_0 beside the same without b
    lost = 1.0 + true["leakage"] * true["friction"]
    damping = true["stiffness"] * true["leakage"] + true["friction"] / true["inertia"]
    assert holds(result["line_stiffness"], true["stiffness"] * lost)
    assert holds(result["motor_leakage"], damping / (true["stiffness"] * lost))
    assert holds(result["Z10"], Drive.preset("slew")["Z10"].value / lost)
    assert result["motor_leakage"].lower > 2.0 * true["leakage"]
