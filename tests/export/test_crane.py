"""A crane in C and as FMU moves as in a run in open loop."""

import numpy as np
import pytest
from tests.crane.open_loop import SHIP, SIGNALS, command, inputs_of
from tests.export.conftest import InC

from swashplate.crane import (
    AXES,
    Crane,
    CraneStepper,
    Seaway,
    Suspension,
    control,
    controlled,
    plant,
)
from swashplate.crane import simulate as simulate_crane
from swashplate.export import compare, content_of, fmu
from swashplate.export.c_source import interface


@pytest.fixture(scope="module")
def crane():
    return Crane.preset("tg3637")


def test_crane_in_c_has_the_bits_of_a_run(crane, compiled):
    run = simulate_crane(crane, command(2.0), sea=Seaway("ss3", seed=1))
    content = content_of(plant(crane), 1.0 / 512.0, prefix="crane")
    in_c = InC(compiled(interface(content.exported)), "crane", content.values)
    inputs = inputs_of(run)
    names = [f"body.{name}" for name in SIGNALS]
    places = [in_c.number("_output", name) for name in names]
    assert -1 not in places
    moved = {name: in_c.number("_input", name) for name in inputs if name.startswith("body.")}
    assert -1 not in moved.values()
    volts = np.transpose([inputs[name] for name in content.exported.signals])
    for n, row in enumerate(volts.tolist()):
        for name, place in moved.items():
            in_c.set_input(place, float(inputs[name][n]))
        assert in_c.step(*row) == 0
        assert [in_c.output(place) for place in places] == [run[name][n] for name in SIGNALS]


CONTROLS = {
    "delayed feedback": {
        "control": control.Chain(
            (control.DelayedFeedback(0.2), control.ShipCompensation(), control.Clip())
        )
    },
    "sensors": {
        "control": control.Chain(
            (
                control.TipShaper("zvd"),
                control.DelayedFeedback(0.2, 0.25),
                control.ShipCompensation(),
                control.Clip(),
                control.PositionLoop(),
                control.Sensors(),
            )
        )
    },
    "crew": {"control": control.Crew()},
    "ideal drives": {"actuation": "ideal", "control": control.DelayedFeedback(0.3)},
    "hook": {
        "actuation": "volts",
        "suspension": Suspension(stiffness=6e7, hook=3000.0, sling=4.0),
    },
}


@pytest.mark.slow
@pytest.mark.parametrize("name", CONTROLS)
def test_crane_in_closed_loop_in_c_has_the_bits_of_a_run(crane, compiled, name):
    """Longer than the ring of delayed feedback, so that it begins again."""
    options = {"rope_m": 27.0, "load_offset": (0.3, -0.2), **CONTROLS[name]}
    length = 16.0 if name == "delayed feedback" else 3.0
    run = simulate_crane(crane, command(length), sea=Seaway("ss3", seed=1), **options)
    machine = controlled(crane, **options)
    content = content_of(machine, 1.0 / 512.0, prefix="crane")
    in_c = InC(compiled(interface(content.exported)), "crane", content.values)
    inputs = {f"stick.{axis}": run.stick[:, k] for k, axis in enumerate(AXES)}
    inputs |= {f"body.{motion}": run.ship[:, k] for k, motion in enumerate(SHIP)}
    if name == "sensors":
        stepper = CraneStepper(crane, **options)
        noise = stepper._inputs(run.stick, run.ship)
        inputs |= {each: noise[each] for each in noise if each.startswith("sensors.")}
        assert np.ptp(inputs["sensors.noise_x"]) > 1.0
    assert set(inputs) <= {*machine.ports.external}
    moved = {each: in_c.number("_input", each) for each in inputs if each.startswith("body.")}
    commands = np.transpose([inputs[each] for each in content.exported.signals])
    places = [in_c.number("_output", f"body.{signal}") for signal in SIGNALS]
    assert -1 not in {*places, *moved.values()}
    for n, row in enumerate(commands.tolist()):
        for each, place in moved.items():
            in_c.set_input(place, float(inputs[each][n]))
        assert in_c.step(*row) == 0
        assert [in_c.output(place) for place in places] == [run[each][n] for each in SIGNALS]


@pytest.mark.slow
def test_fmu_of_the_crane_has_its_bits_in_fmpy(crane, tmp_path):
    pytest.importorskip("fmpy")
    machine = plant(crane, brake=False)
    path = fmu(machine, tmp_path / "crane.fmu")
    calm = compare(path, machine, inputs_of(simulate_crane(crane, command(2.0), brake=False)))
    assert calm.equal
    assert {"body.load_x", "body.swing", "luff.shaft_speed"} <= set(calm.differences)
    # outputs follow the ship at once, and FMPy extrapolates inputs from the step before: rounding
    run = simulate_crane(crane, command(2.0), sea=Seaway("ss3", seed=1), brake=False)
    at_sea = compare(path, machine, inputs_of(run))
    assert 0.0 < max(at_sea.differences[f"body.{name}"] for name in ("load_x", "tip_x")) < 1e-6
