"""The sampled model against small motions of the simulation itself, sample for sample."""

from dataclasses import replace

import numpy as np
import pytest

from swashplate import Drive, InputError
from swashplate.linear import LinearDrive


def marched(model: LinearDrive, u: np.ndarray) -> np.ndarray:
    """Answer of a sampled model at rest to an input, the delay taken as whole samples."""
    assert model.sample_time is not None
    whole = round(model.delay / model.sample_time)
    late = np.concatenate((np.zeros(whole), u))[: u.size]
    x = np.zeros((model.A.shape[0], 1))
    y = np.empty((u.size, len(model.outputs)))
    for n, value in enumerate(late):
        y[n] = (model.C @ x + model.D * value)[:, 0]
        x = model.A @ x + model.B * value
    return y


def motion(size: int) -> np.ndarray:
    """A smooth random motion of size 1 that starts at 0."""
    noise = np.random.default_rng(5).standard_normal(size)
    smooth = np.convolve(noise, np.hanning(15), mode="same") * np.minimum(np.arange(size) / 20, 1)
    return smooth / np.abs(smooth).max()


VARIANTS = {
    "published": ({}, {}),
    "leaky": ({"Z7": 0.8}, {}),
    "loaded": ({"Z12": 0.2, "Z11": 0.05}, {}),
    "no delay": ({"tau": 0.0}, {}),
    "short delay": ({"tau": 0.0007}, {}),
    "whole delay": ({"tau": 7.0 / 512.0}, {}),
    "Coulomb": ({"C": 3.0}, {}),
    "split switches": ({}, {"card_switch": "split"}),
}
OUTPUTS = ("shaft_speed", "stroker_pressure", "orifice_opening", "current")


@pytest.mark.parametrize("at", [-3.0, 4.0])
@pytest.mark.parametrize("rate", [100.0, 512.0, 1000.0])
@pytest.mark.parametrize(("changes", "forms"), VARIANTS.values(), ids=VARIANTS.keys())
def test_small_motions_of_the_simulation(
    hoist: Drive, changes: dict, forms: dict, rate: float, at: float
) -> None:
    drive = hoist.replace(**changes)
    drive = Drive(replace(drive.parameters, **forms))
    model = drive.linearize(at, outputs=OUTPUTS, coulomb="tangent").discrete(1.0 / rate)
    u = 1e-5 * motion(300)
    run = drive.simulate(at + u, rate, start="steady")
    expected = marched(model, u)
    for k, name in enumerate(OUTPUTS):
        moved = getattr(run, name) - getattr(run, name)[0]
        # curvature of the maps: 1e-5 of the motion; rounding: 1e-9 of it
        assert np.abs(moved - expected[:, k]).max() < 3e-5 * np.abs(moved).max(), name


@pytest.mark.parametrize("rate", [49.0, 512.0])
def test_a_held_input(hoist: Drive, rate: float) -> None:
    u = 1e-5 * motion(300)
    run = hoist.simulate(4.0 + u, rate, interpolation="previous", start="steady")
    model = hoist.linearize(4.0).discrete(1.0 / rate, "previous")
    moved = run.shaft_speed - run.shaft_speed[0]
    assert np.abs(moved - marched(model, u)[:, 0]).max() < 3e-5 * np.abs(moved).max()


@pytest.mark.parametrize("rate", [60.0, 512.0])
def test_the_pump_alone(axis: Drive, rate: float) -> None:
    at = axis.steady_current(2.0)
    u = 1e-7 * motion(300)
    run = axis.simulate_current(at + u, rate, start="steady")
    moved = run.shaft_speed - run.shaft_speed[0]
    model = axis.linearize(current=at).discrete(1.0 / rate)
    assert np.abs(moved - marched(model, u)[:, 0]).max() < 3e-5 * np.abs(moved).max()


@pytest.mark.parametrize("form", ["published", "symmetric"])
def test_the_stepper_and_the_side_of_the_root(hoist: Drive, form: str) -> None:
    # a rise opens the valve to the positive side only, which is the side that is declared
    drive = Drive(replace(hoist.parameters, pressure_root=form))
    u = 1e-5 * np.minimum(np.arange(200) / 100.0, 1.0)
    stepper = drive.stepper(start="steady")
    speed = np.array([stepper.step(-3.0 + v).shaft_speed for v in u])
    moved = speed - speed[0]
    model = drive.linearize(-3.0).discrete(1.0 / 512.0)
    assert np.abs(moved - marched(model, u)[:, 0]).max() < 3e-5 * np.abs(moved).max()


def test_steady_gain_and_lag_do_not_depend_on_the_sample_time(axis: Drive) -> None:
    model = axis.linearize(2.0)
    for h in (0.05, 1.0 / 512.0, 1e-4):
        sampled = model.discrete(h)
        assert sampled.gain == pytest.approx(model.gain, rel=1e-9)
        # the march is an explicit step: its lag is shorter by half a step of it, h²/τ² apart
        step = min(h, 1.0 / 512.0)
        late = sampled.time_constant + 0.5 * step
        assert late == pytest.approx(model.time_constant, rel=2e-4)


def test_small_steps_lead_to_the_continuous_model(hoist: Drive) -> None:
    model = hoist.linearize(4.0)
    f = np.array([0.1, 0.3, 1.0, 5.0])
    errors = [
        np.abs(model.discrete(h).response(f) / model.response(f) - 1.0).max()
        for h in (4e-5, 2e-5, 1e-5)
    ]
    assert errors[0] < 3e-3
    np.testing.assert_allclose(np.divide(errors[:-1], errors[1:]), 2.0, rtol=0.01)


def test_poles_of_several_steps_are_powers(hoist: Drive) -> None:
    model = hoist.linearize(4.0)
    fine, coarse = model.discrete(1.0 / 600.0), model.discrete(1.0 / 100.0)
    np.testing.assert_allclose(coarse.poles, fine.poles**6, rtol=1e-9)
    assert coarse.is_stable


@pytest.mark.parametrize(
    ("sample_time", "interpolation", "said"),
    [
        (0.0, "linear", "must be above 0"),
        (-1.0, "linear", "must be above 0"),
        (float("nan"), "linear", "must be above 0"),
        (1.0, "linear", "between 10 and 100000 Hz"),
        (1e-6, "linear", "between 10 and 100000 Hz"),
        (0.01, "cubic", "interpolation is 'cubic'"),
    ],
)
def test_refusals(hoist: Drive, sample_time: float, interpolation: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        hoist.linearize(4.0).discrete(sample_time, interpolation)


def test_an_unstable_filter_is_refused() -> None:
    quick = Drive.preset("slew").scale(zeta=2.0, omega=2.0)
    with pytest.raises(InputError, match="is unstable at a step"):
        quick.linearize(2.0).discrete(1.0 / 512.0)


def test_a_lag_shorter_than_the_step_is_told() -> None:
    quick = (
        Drive.preset("neutral").replace(Z8=700.0 * 1e6 / 4.8).linearize(1.0).discrete(1.0 / 512.0)
    )
    with pytest.raises(ValueError, match="no lag's; take a smaller sample time"):
        print(quick.time_constant)
    assert (np.abs(quick.poles) < 1.0).all()
