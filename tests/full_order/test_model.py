"""The five-state drive as a model of the engine: derivatives of its discrete map, and fits."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

from swashplate import DomainError, FullOrderDrive, PhysicalSet
from swashplate.machine import Machine
from swashplate.machine.marching import (
    Observation,
    ObservedRecord,
    jacobian,
    record_of,
    residuals,
)
from swashplate.models.displacement_control import Solenoids
from swashplate.models.machine import ATMOSPHERE, Hydrostat, mixture_modulus, oil_modulus

Array = np.ndarray

STEPS = 16
"""Sub-steps of all runs that are compared."""
QUANTITIES = [*Hydrostat._fields, *Solenoids._fields, "omega_plus", "G1_plus", "tau"]
TIME = np.arange(256) / 512.0
CALM = 2.0 + 0.3 * np.sin(2.0 * np.pi * 4.0 * TIME)
"""About an operating point: no orifice limits, no stop is near, one solenoid pulls."""
STOPS = np.concatenate([np.full(500, 9.5), np.full(300, -9.5)])
"""Through both solenoids and orifices, against the spool's stroke, the relief valve and a stop."""


@pytest.fixture(scope="module")
def hoist() -> FullOrderDrive:
    """With everything on that a parameter needs to count."""
    full = FullOrderDrive.preset("hoist").replace(
        load_torque=2e3, motor_leakage=1e-6, piston_leakage=2e-12, air_fraction=0.01
    )
    return FullOrderDrive(full.drive.replace(Z20=2.0, Z21=1.5, Z22=1.0), full.physical)


@pytest.fixture(scope="module")
def limited(hoist: FullOrderDrive) -> FullOrderDrive:
    """Whose limits a short command reaches."""
    return hoist.replace(
        spool_stroke=1.6e-4,
        orifice_opening=(1.2e-4, 1.3e-4),
        swash_stop=(0.03, 0.04),
        plussing=1e-5,
    )


def simulated(full: FullOrderDrive, command: Array, start: Any = "rest") -> Array:
    return full.simulate(command, start=start, substeps=STEPS).shaft_speed


# --- the discrete map -----------------------------------------------------------------------------


def test_behind_a_voltage_it_is_the_same_to_the_last_bit(hoist: FullOrderDrive) -> None:
    """Card and machine in one march, and the machine over the card's current."""
    record = record_of(STOPS, 512.0, what="voltage")
    speed = Observation("shaft_speed", record.time, np.zeros(STOPS.size))
    joined = residuals(hoist.at_substeps(STEPS), ObservedRecord(record, [speed]))
    assert np.array_equal(joined, simulated(hoist, STOPS))


def richardson(full: FullOrderDrive, name: str, command: Array, start: Any, step: float) -> Array:
    """Derivative by differences of fourth order, `step` in parts of the value."""
    size = abs(value_of(full, name))

    def central(step: float) -> Array:
        ahead, behind = (
            simulated(changed(full, name, sign * step * size), command, start)
            for sign in (1.0, -1.0)
        )
        return (ahead - behind) / (2.0 * step * size)

    return (4.0 * central(step) - central(2.0 * step)) / 3.0


@pytest.fixture(scope="module")
def calm(hoist: FullOrderDrive) -> Mapping[str, Array]:
    by = hoist.sensitivities(CALM, parameters=QUANTITIES, start="steady", substeps=STEPS)
    return dict(zip(by.names, by["shaft_speed"].T, strict=True))


IDLE = (
    *("spool_stroke", "orifice_opening_plus", "orifice_opening_minus", "swash_stop_plus"),
    *("swash_stop_minus", "relief_pressure"),
    *(name for name in Solenoids._fields if name.endswith("_minus")),
)
"""What does not matter to the calm record."""


@pytest.mark.slow
@pytest.mark.parametrize("name", QUANTITIES)
def test_derivatives_are_exact_where_nothing_switches(
    hoist: FullOrderDrive, name: str, calm: Mapping[str, Array]
) -> None:
    """By every quantity, its settled start included, to what differences can tell."""
    if name in IDLE:
        assert not calm[name].any()
        return
    off = []
    for step in (1e-2, 2e-3):
        expected = richardson(hoist, name, CALM, "steady", step)
        off.append(np.abs(calm[name] - expected).max())
    size = abs(value_of(hoist, name))
    noise = 3e-12 / size  # rounding of a thousand sub-steps, over the difference
    assert np.abs(calm[name]).max() > 10.0 * noise
    assert min(off) < 1e-8 * np.abs(calm[name]).max() + noise


@pytest.fixture(scope="module")
def stops(limited: FullOrderDrive) -> Mapping[str, Array]:
    found = limited.sensitivities(STOPS, parameters=QUANTITIES, substeps=STEPS)["shaft_speed"]
    return dict(zip(QUANTITIES, found.T, strict=True))


@pytest.mark.slow
@pytest.mark.parametrize("name", QUANTITIES)
def test_derivatives_pass_through_limits(
    limited: FullOrderDrive, name: str, stops: Mapping[str, Array]
) -> None:
    """Where limits take hold and let go within the record, at every sample of it."""
    off = []
    for step in (1e-4, 1e-5):  # the longer one may meet a kink
        expected = richardson(limited, name, STOPS, "rest", step)
        off.append(np.abs(stops[name] - expected).max())
    noise = 1e-9 / abs(value_of(limited, name))
    assert min(off) < 1e-6 * np.abs(stops[name]).max() + noise
    assert name == "relief_pressure" or np.abs(stops[name]).max() > 10.0 * noise


@pytest.mark.slow
def test_that_record_meets_every_limit(limited: FullOrderDrive) -> None:
    run = limited.simulate(STOPS, substeps=STEPS)
    for hold in (run.spool_hold, run.relief_hold, run.plate_hold):
        assert {*hold} == {-1, 0, 1}


def value_of(full: FullOrderDrive, name: str) -> float:
    known: Mapping[str, float] = {**full.drive.parameters.numbers, **full.physical.numbers}
    return known[name]


def changed(full: FullOrderDrive, name: str, by: float) -> FullOrderDrive:
    value = value_of(full, name) + by
    if name in full.drive.parameters.numbers:
        return FullOrderDrive(full.drive.replace(**{name: value}), full.physical)
    symbol, _, side = name.rpartition("_")
    if side not in ("plus", "minus"):
        return full.replace(**{name: value})
    pair: Any = full.physical[symbol].value
    return full.replace(**{symbol: tuple(pair._replace(**{side: value}))})


def test_masses_that_make_the_march_unstable_are_told(hoist: FullOrderDrive) -> None:
    """Sub-steps are fixed over a fit: a step of it to a lighter plate is taken back."""
    instance = hoist.at_substeps(8)
    light = hoist.replace(swash_inertia=2e-3, piston_mass=0.1)
    parts = (instance.parts[0], light.at_substeps(8).parts[1])
    record = record_of(CALM, 512.0, what="voltage")
    observed = ObservedRecord(record, [Observation("shaft_speed", TIME, np.zeros(TIME.size))])
    with pytest.raises(DomainError, match=r"2\.\d+ rad in a sub-step, .* 2"):
        jacobian(Machine.of_parts(instance.model, parts, instance.name), observed, ())


def test_air_makes_the_oil_soft_by_hand() -> None:
    # 1 % of air at 1.01325 MPa is 0.1 % of the oil's volume; 1/B_e = (1/1 GPa + 0.001/1.01325 MPa)
    # over 1.001: 1.987e-9/Pa
    oil = PhysicalSet.preset("hoist").machine._replace(bulk_modulus=1e9, air_fraction=0.01)
    mixture, modulus = mixture_modulus, oil_modulus
    compressed = (1e-9 + 1e-3 / (10.0 * ATMOSPHERE)) / 1.001
    assert mixture(10.0 * ATMOSPHERE, oil) == pytest.approx(1.0 / compressed, rel=1e-14)
    assert mixture(1e12, oil) == pytest.approx(1e9, rel=1e-6)
    assert mixture(ATMOSPHERE, oil._replace(air_fraction=1.0)) == pytest.approx(
        2.0 * ATMOSPHERE, rel=1e-3
    )
    # the mean of both ends of the cylinder, the same for both signs
    valve = oil._replace(supply_pressure=8e6)
    ends = [mixture(4e6 + half + ATMOSPHERE, valve) for half in (1e6, -1e6)]
    assert modulus(2e6, valve, True) == pytest.approx(sum(ends) / 2.0, rel=1e-14)
    assert modulus(-2e6, valve, True) == modulus(2e6, valve, True)
    assert modulus(2e6, valve, None) == 1e9
    # ends cannot fall below the reservoir
    assert modulus(9e6, valve, True) > mixture(ATMOSPHERE, valve) / 2.0
