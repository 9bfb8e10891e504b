"""The sampled model, of refined drives too, against the simulation itself, sample for sample."""

from dataclasses import replace

import numpy as np
import pytest

from swashplate import DomainError, Drive, InputError
from swashplate.drive import LinearDrive

FRICTION = {"spool_friction": 0.115, "spool_presliding": 5e-5}
LINE = {"line_stiffness": 1e6, "load_inertia": 5e3, "motor_leakage": 1e-6, "load_torque": 3e4}
REFINED = {
    "friction": {**FRICTION, "dither_time": 0.6},
    "friction without dither": FRICTION,
    "delay": {"solenoid_delay": 0.0123},
    "lag": {"solenoid_lag": 0.015},
    "damping": {"swash_damping": 0.02},
    "leakage": {"motor_leakage": 1e-6, "load_torque": 3e4, "load_inertia": 5e3},
    "line": LINE,
    "all": {
        **{**FRICTION, "dither_time": 0.6, "swash_damping": 0.02, **LINE, "Z7": 0.4},
        **{"solenoid_delay": 0.0123, "solenoid_lag": 0.015},
    },
}
VARIANTS = {
    "published": ({}, {}),
    "loaded": ({"Z12": 0.2, "Z11": 0.05}, {}),
    "no delay": ({"tau": 0.0}, {}),
    "short delay": ({"tau": 0.0007}, {}),
    "whole delay": ({"tau": 7.0 / 512.0}, {}),
    "Coulomb": ({"C": 3.0}, {}),
    "split switches": ({}, {"card_switch": "split"}),
    "late": ({"solenoid_delay": 0.0003, "solenoid_lag": 0.02}, {}),
    # together, so that few forms of the march are compiled; each by itself leads to the continuous
    # model below
    **{name: (REFINED[name], {}) for name in ("friction without dither", "leakage", "all")},
}
STEP = 1.0 / 512.0
OUTPUTS = ("shaft_speed", "stroker_pressure", "orifice_opening", "current", "motor_torque")
LATE = tuple(name for name in OUTPUTS if name != "current")
"""Outputs behind the solenoids' delay."""
MEASURED = {"load_torque": 3.0, "pump_speed": 1e-5, "supply_pressure": 10.0}
"""Sizes of small motions."""


def marched(model: LinearDrive, *inputs: np.ndarray) -> np.ndarray:
    """Answer of a sampled model at rest, the first input late by whole samples."""
    assert model.rate is not None
    u = np.column_stack(inputs)
    whole = round(model.delay * model.rate)
    u[:, 0] = np.concatenate((np.zeros(whole), u[:, 0]))[: len(u)]
    x, y = np.zeros(model.A.shape[0]), np.empty((len(u), len(model.outputs)))
    for n, values in enumerate(u):
        y[n] = model.C @ x + model.D @ values
        x = model.A @ x + model.B @ values
    return y


def motion(size: int, seed: int = 5) -> np.ndarray:
    """A smooth random motion of size 1 that starts at 0."""
    noise = np.random.default_rng(seed).standard_normal(size)
    smooth = np.convolve(noise, np.hanning(15), mode="same") * np.minimum(np.arange(size) / 20, 1)
    return smooth / np.abs(smooth).max()


@pytest.mark.parametrize("at", [-3.0, 4.0])
@pytest.mark.parametrize("rate", [100.0, pytest.param(512.0, marks=pytest.mark.slow)])
@pytest.mark.parametrize(("changes", "forms"), VARIANTS.values(), ids=VARIANTS.keys())
def test_small_motions_of_the_simulation(
    hoist: Drive, changes: dict, forms: dict, rate: float, at: float
) -> None:
    drive = hoist.replace(**changes)
    drive = Drive(replace(drive.parameters, **forms))
    outputs = LATE if "solenoid_delay" in changes else OUTPUTS
    model = drive.linearize(at, outputs=outputs, coulomb="tangent").discrete(rate)
    u = 1e-5 * motion(300)
    run = drive.simulate(at + u, rate, start="steady")
    expected = marched(model, u)
    for k, name in enumerate(outputs):
        moved = getattr(run, name) - getattr(run, name)[0]
        # curvature of the maps: 1e-5 of the motion; rounding: 1e-9 of it
        assert np.abs(moved - expected[:, k]).max() <= 5e-5 * np.abs(moved).max(), name
    assert model.operating_point.shaft_speed == drive.steady_speed(at)


@pytest.mark.parametrize("rate", [49.0, 512.0])
def test_a_held_input(hoist: Drive, rate: float) -> None:
    u = 1e-5 * motion(300)
    run = hoist.simulate(4.0 + u, rate, interpolation="previous", start="steady")
    model = hoist.linearize(4.0).discrete(rate, "previous")
    moved = run.shaft_speed - run.shaft_speed[0]
    assert np.abs(moved - marched(model, u)[:, 0]).max() < 3e-5 * np.abs(moved).max()


@pytest.mark.parametrize("form", ["published", "symmetric"])
def test_the_stepper_and_the_side_of_the_root(hoist: Drive, form: str) -> None:
    # a rise opens the valve to the positive side only, which is the side that is declared
    drive = Drive(replace(hoist.parameters, pressure_root=form))
    u = 1e-5 * np.minimum(np.arange(200) / 100.0, 1.0)
    stepper = drive.stepper(start="steady")
    speed = np.array([stepper.step(-3.0 + v).shaft_speed for v in u])
    moved = speed - speed[0]
    model = drive.linearize(-3.0).discrete(512.0)
    assert np.abs(moved - marched(model, u)[:, 0]).max() < 3e-5 * np.abs(moved).max()


def test_steady_gain_and_lag_do_not_depend_on_the_rate(axis: Drive) -> None:
    model = axis.linearize(2.0)
    for rate in (20.0, 512.0, 1e4):
        sampled = model.discrete(rate)
        assert sampled.gain == pytest.approx(model.gain, rel=1e-9)
        # the march is an explicit step: its lag is shorter by half a step of it, h²/τ² apart
        step = min(1.0 / rate, 1.0 / 512.0)
        late = sampled.time_constant + 0.5 * step
        assert late == pytest.approx(model.time_constant, rel=2e-4)


@pytest.mark.parametrize("changes", [{}, *REFINED.values()], ids=["published", *REFINED])
def test_small_steps_lead_to_the_continuous_model(hoist: Drive, changes: dict) -> None:
    outputs = LATE if "solenoid_delay" in changes else OUTPUTS
    model = hoist.replace(**changes).linearize(4.0, outputs=outputs)
    f = np.array([0.1, 0.5, 2.0, 8.0])
    exact = model.response(f)
    errors = []
    for rate in (2.5e4, 5e4, 1e5):
        apart = np.abs(model.discrete(rate).response(f) - exact).max(axis=1)
        errors.append((apart / np.maximum(np.abs(exact).max(axis=1), 1e-9)).max())
    assert errors[0] < 0.01
    np.testing.assert_allclose(np.divide(errors[:-1], errors[1:]), 2.0, rtol=0.05)


def test_refusals(hoist: Drive) -> None:
    model = hoist.linearize(4.0)
    with pytest.raises(InputError, match="rate .* nan Hz, .* 10 and 100000"):
        model.discrete(float("nan"))
    with pytest.raises(InputError, match="10 and 100000 Hz"):
        model.discrete(1.0)
    with pytest.raises(InputError, match="interpolation .*'cubic'"):
        model.discrete(100.0, "cubic")
    with pytest.raises(InputError, match="step of 1/512 s"):
        Drive.preset("slew").scale(zeta=2.0, omega=2.0).linearize(2.0).discrete(512.0)
    with pytest.raises(InputError, match="Frequencies .* row"):
        model.response([[1.0]])
    with pytest.raises(InputError, match="half the rate, 256 Hz"):
        model.discrete(512.0).response(257.0)


@pytest.mark.parametrize(("part", "grows"), [(0.985, False), (1.015, True)])
def test_largest_gain_of_a_loop_that_acts_a_sample_late(
    hoist: Drive, part: float, grows: bool
) -> None:
    model = hoist.linearize(4.0).discrete(512.0, "previous")
    late = model.margins(lambda f: np.exp(-2j * np.pi * f * STEP)).gain_margin
    stepper = hoist.stepper(512.0, interpolation="previous", start="steady")
    sample, change = stepper.step(4.0), np.radians(0.02)
    begun, errors = sample.shaft_speed, []
    for _ in range(12 * 512):
        errors.append(begun + change - sample.shaft_speed)
        sample = stepper.step(4.0 + part * late * errors[-1])
    early, last = np.ptp(errors[1024:1536]), np.ptp(errors[-512:])
    assert (last > early) == grows


# --- refined drives -------------------------------------------------------------------------------


def test_states_of_the_refinements(hoist: Drive) -> None:
    first = ("current_rate", "current", "stroker_pressure")
    added = {
        "friction": ("spool_deflection",),
        "friction without dither": (),
        "delay": (),
        "damping": ("plate_pressure",),
        "leakage": (),
        "line": ("motor_torque", "shaft_speed"),
    }
    for name, states in added.items():
        model = hoist.replace(**REFINED[name]).linearize(4.0)
        assert model.states == (*first, *states)
        assert model.is_stable
        if "friction" not in name:
            assert model.time_constant == pytest.approx(0.12, rel=0.2)
    held = hoist.replace(**FRICTION).linearize(4.0).time_constant
    # the spool moves by x_s/(x_s + w) of its balance, so that the pump is slower by w/x_s
    p = hoist.parameters.numbers
    width = 0.115 * p["Z5"] ** 2 / p["Z4"] ** 0.5
    assert held == pytest.approx(hoist.linearize(4.0).time_constant * (1.0 + width / 5e-5))


def test_the_line_s_resonance(hoist: Drive) -> None:
    model = hoist.replace(**LINE).linearize(4.0)
    line = model.poles[np.argmin(np.abs(np.abs(model.poles) - np.sqrt(1e6 / 5e3)))]
    # T' = k (Ω_0 - Ω - K T), J Ω' = T - C: s² + k K s + k/J
    np.testing.assert_allclose(abs(line) ** 2, 1e6 / 5e3)
    assert line.real == pytest.approx(-0.5 * 1e6 * 1e-6)


def test_where_friction_or_hysteresis_holds(hoist: Drive) -> None:
    lagging = hoist.replace(solenoid_hysteresis=0.008)
    for where in ({"at": 4.0}, {"current": 0.45}):
        with pytest.raises(DomainError, match="hysteresis of ±0.008 A"):
            lagging.linearize(**where)
    force = lagging.linearize(4.0, input="solenoid_force")
    assert force.gain == hoist.linearize(4.0, input="solenoid_force").gain
    with pytest.raises(DomainError, match="spool_friction of 0.1 N .* presliding"):
        hoist.replace(spool_friction=0.1).linearize(4.0)


def test_small_sines_of_a_refined_drive_agree_with_the_linear_model(hoist: Drive) -> None:
    drive = hoist.replace(**REFINED["all"])
    swept = drive.frequency_response([1.0], [1e-3], bias=4.0, tolerance=1e-6)
    exact = drive.linearize(4.0).discrete(512.0).response(1.0)[0]
    assert abs(swept.ratio[0, 0] / exact - 1.0) < 2e-5


# --- what moves beside the command ----------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("name", ["leakage", "all"])
@pytest.mark.parametrize("rate", [100.0, 512.0])
def test_inputs_beside_the_voltage(hoist: Drive, name: str, rate: float) -> None:
    drive = hoist.replace(**REFINED[name])
    outputs = LATE if "solenoid_delay" in REFINED[name] else OUTPUTS
    model = drive.linearize(4.0, input=("voltage", *MEASURED), outputs=outputs)
    moved = {each: size * motion(300, k) for k, (each, size) in enumerate(MEASURED.items())}
    numbers = drive.parameters.numbers
    middle = {"load_torque": numbers["load_torque"], "pump_speed": 1.0}
    middle["supply_pressure"] = numbers["Z9"]
    u = 1e-5 * motion(300)
    given = {each: middle[each] + values for each, values in moved.items()}
    run = drive.simulate(4.0 + u, rate, start="steady", **given)
    expected = marched(model.discrete(rate), u, *moved.values())
    for k, output in enumerate(outputs):
        found = getattr(run, output) - getattr(run, output)[0]
        assert np.abs(found - expected[:, k]).max() <= 1e-4 * np.abs(found).max(), output


def test_each_input_by_itself(hoist: Drive) -> None:
    drive = hoist.replace(**LINE, solenoid_delay=0.04)
    together = drive.linearize(4.0, input=("voltage", *MEASURED))
    for name in MEASURED:
        alone = drive.linearize(4.0, input=name)
        assert alone.inputs == (name,)
        assert alone.delay == 0.0
        np.testing.assert_allclose(
            alone.response([0.1, 3.0])[0], together.response([0.1, 3.0], name)[0], atol=1e-18
        )
    # under a static load the speed lost is what leaks
    assert together.response(0.0, "load_torque")[0] == pytest.approx(-1e-6)
    assert together.response(0.0, "pump_speed")[0] == pytest.approx(
        together.operating_point.shaft_speed + 1e-6 * 3e4
    )


@pytest.mark.parametrize(
    ("inputs", "said"),
    [
        (("load_torque", "voltage"), "first .* command"),
        (("voltage", "voltage"), "different"),
        (("voltage", "wind"), "'wind', .* voltage"),
    ],
)
def test_inputs_that_do_not_go_together(hoist: Drive, inputs: tuple, said: str) -> None:
    with pytest.raises(InputError, match=said):
        hoist.linearize(4.0, input=inputs)
    with pytest.raises(InputError, match="input 'wind'"):
        hoist.linearize(4.0).response(1.0, "wind")
