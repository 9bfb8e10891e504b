"""March, stepper, sensitivities and side-by-side march give the same bits."""

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.drive.experiments import ALL, LOAD, RIPPLE, jacobian, residuals

from swashplate import Drive, Simulation, maneuvers
from swashplate.machine.marching import Observation, ObservedRecord, record_of

SIGNALS = (
    "current_positive",
    "current_negative",
    "current",
    "solenoid_force",
    "spool_position",
    "orifice_opening",
    "stroker_pressure",
    "swash_angle",
    "shaft_speed",
    "shaft_position",
)


def command(rate: float = 512.0) -> np.ndarray:
    """Four seconds that meet every limit of the hoist drive."""
    whole = maneuvers.step(9.0, start=0.1, stop=1.6, length=2.0) + maneuvers.sine(
        8.0, 0.6, start=0.0, length=2.0, settle=0.3
    )
    return whole.sample(rate)


FORMS = {
    "published": {},
    "physical root": {"pressure_root": "symmetric"},
    "literal sign": {"coulomb_sign": "literal"},
    "split steps": {"card_switch": "split"},
    "physical root, split": {"pressure_root": "symmetric", "card_switch": "split"},
    "equation": {"rate": None},
}
TERMS = {"Z7": 0.4, "Z12": 0.2, "Z11": 0.05, "Z2": 0.01, "Z13": 0.6, "C": 5.0}
EVERYTHING = {**ALL, "Z7": 0.4, "Z13": 0.6}
CASES = {
    "published": ({}, "published"),
    "rough card": ({"C": 5.0, "tau": 0.0}, "published"),
    "short delay": ({"tau": 0.0007}, "published"),
    "all terms": (TERMS, "published"),
    "all terms, other forms": (TERMS, "physical root, split"),
    "literal sign": ({"C": 5.0}, "literal sign"),
    "the filter's equation": ({"C": 3.0}, "equation"),
    "everything": (EVERYTHING, "published"),
    "no line, physical root": ({**RIPPLE, **LOAD, "swash_damping": 0.02}, "physical root"),
}
"""Every option of card, pump and refinements, alone or together, and without the line."""
RICHEST = (
    *("all terms, other forms", "everything", "no line, physical root"),
    "the filter's equation",
)
"""Those that have all options between them; plain drives' residuals are in test_residuals."""
RICH = (*RICHEST, "all terms")
"""Cases that take seconds to compile."""


@pytest.fixture(
    params=[
        pytest.param(case, id=name, marks=[pytest.mark.slow] if name in RICH else [])
        for name, case in CASES.items()
    ]
)
def drive(request: pytest.FixtureRequest, hoist: Drive) -> Drive:
    changes, form = request.param
    return variant(hoist.replace(**changes), form)


def variant(drive: Drive, form: str) -> Drive:
    return Drive(replace(drive.parameters, **FORMS[form]))


def stepped(drive: Drive, voltage: np.ndarray, rate: float, **options: str) -> dict:
    stepper = drive.stepper(rate, **options)
    samples = [stepper.step(v) for v in voltage]
    return {name: np.array([getattr(s, name) for s in samples]) for name in SIGNALS}


def same(found: dict, run: Simulation) -> None:
    for name, values in found.items():
        assert np.array_equal(values, run[name]), name


@pytest.mark.interpreted
def test_stepper_gives_the_same_bits(drive: Drive) -> None:
    for rate, start, held in ((512.0, "rest", "linear"), (200.0, "steady", "previous")):
        voltage = command(rate)[:700] + (0.5 if start == "steady" else 0.0)
        run = drive.simulate(voltage, rate, start=start, interpolation=held)
        same(stepped(drive, voltage, rate, start=start, interpolation=held), run)


def test_side_by_side_gives_the_same_bits(drive: Drive) -> None:
    voltage = command()
    factors = np.linspace(0.8, 1.2, 21)  # more than one block, the last one not full
    changes = {"Z16_plus": 1.2e-4 * factors, "G1": 0.05 * factors, "Z10": 12.0 * factors}
    batch = drive.simulate_many(changes, voltage=voltage, output="shaft_position")
    assert not batch.failures
    for i in (0, 7, 16, 20):
        one = drive.replace(**{name: float(values[i]) for name, values in changes.items()})
        assert np.array_equal(batch.output[i], one.simulate(voltage).shaft_position)


@pytest.mark.slow
@pytest.mark.parametrize("drive", [CASES[name] for name in RICHEST], ids=RICHEST, indirect=True)
def test_residuals_carry_the_same_bits(drive: Drive) -> None:
    voltage, seen = command()[:900], ("shaft_speed", "shaft_position", "current")
    time, run = np.arange(900) / 512.0, drive.simulate(voltage)
    observed = ObservedRecord(
        record_of(voltage, 512.0, what="voltage"),
        [Observation(name, time, np.zeros(900)) for name in seen],
    )
    for found in (
        residuals(drive.parameters, observed),
        jacobian(drive.parameters, observed, ["Z8", "Z10", "tau"]).residuals,
    ):
        same({name: found[observed.rows_of(k)] for k, name in enumerate(seen)}, run)


@pytest.mark.slow
def test_stamps_and_a_measured_load_count_everywhere(hoist: Drive) -> None:
    """In a batch and in derivatives as in a simulation, at the command's stamps."""
    drive = hoist.replace(**LOAD)
    given = {"time": np.cumsum(0.003 + 0.001 * np.sin(np.arange(500)))}
    given |= {"interpolation": "linear", "load_torque": 3e4 * np.sin(np.arange(500) / 60.0)}
    voltage = 6.0 * np.sin(np.arange(500) / 80.0)
    ends = [1.02 * drive["Z8"].value, 0.98 * drive["Z8"].value]
    runs = [drive.replace(Z8=each).simulate(voltage, 256.0, **given) for each in ends]
    batch = drive.simulate_many({"Z8": ends}, voltage=voltage, rate=256.0, **given)
    for row, run in zip(batch.output, runs, strict=True):
        assert np.array_equal(row, run.shaft_speed)
    still = drive.simulate(voltage, 256.0, **{**given, "load_torque": 0.0})
    assert np.abs(still.shaft_speed - runs[0].shaft_speed).max() > 0.01
    by = drive.sensitivities(voltage, 256.0, parameters=["Z8"], **given)["swash_angle"][:, 0]
    slope = (runs[0].swash_angle - runs[1].swash_angle) / (ends[0] - ends[1])
    assert np.abs(by - slope).max() < 0.01 * np.abs(by).max()


@pytest.mark.slow
def test_a_refinement_comes_on_in_some_sets_of_a_batch(hoist: Drive) -> None:
    voltage = command()[:900]
    changes = {"swash_damping": [0.0, 0.02, 0.0, 0.04], "cam_ripple": [0.0, 0.0, 0.01, 0.02]}
    batch = hoist.simulate_many(changes, voltage=voltage)
    for i in range(4):
        one = hoist.replace(**{name: values[i] for name, values in changes.items()})
        assert np.array_equal(batch.output[i], one.simulate(voltage).shaft_speed), i


def test_a_part_of_a_refinement_at_zero_does_not_switch_it_off_in_a_batch(hoist: Drive) -> None:
    voltage = command()[:900]
    drive = hoist.replace(cam_ripple_per_torque=1e-6, load_torque=2e4)
    batch = drive.simulate_many({"cam_ripple": [0.0, 0.01]}, voltage=voltage)
    for i, depth in enumerate((0.0, 0.01)):
        one = drive.replace(cam_ripple=depth).simulate(voltage)
        assert np.array_equal(batch.output[i], one.shaft_speed), i


INTERPRETED = """
import sys
import numpy as np
from swashplate import Drive
voltage = np.load(sys.argv[1])
drive = Drive.preset("slew").replace(Z7=0.3, Z12=0.1)
run = drive.simulate(voltage)
by = drive.sensitivities(voltage, parameters=["Z16", "Z1", "tau", "omega"])
np.savez(sys.argv[2], **{name: getattr(run, name) for name in sys.argv[3:]}, by=by['shaft_speed'])
"""


@pytest.mark.slow
def test_interpreted_run_agrees(tmp_path: Path) -> None:
    """The same sources without the JIT, in a process of their own, within 1e-12."""
    voltage = command()[:1100]
    np.save(tmp_path / "voltage.npy", voltage)
    arguments = [str(tmp_path / "voltage.npy"), str(tmp_path / "out.npz"), *SIGNALS]
    subprocess.run(
        [sys.executable, "-c", INTERPRETED, *arguments],
        check=True,
        env={**os.environ, "SWASHPLATE_COMPILE": "0"},
    )
    interpreted = np.load(tmp_path / "out.npz")
    drive = Drive.preset("slew").replace(Z7=0.3, Z12=0.1)
    run = drive.simulate(voltage)
    for name in SIGNALS:
        compiled = getattr(run, name)
        scale = np.abs(compiled).max()
        np.testing.assert_allclose(interpreted[name], compiled, rtol=1e-12, atol=1e-12 * scale)
    by = drive.sensitivities(voltage, parameters=["Z16", "Z1", "tau", "omega"])["shaft_speed"]
    np.testing.assert_allclose(interpreted["by"], by, rtol=1e-10, atol=1e-12 * np.abs(by).max())


def test_splitting_the_cards_steps_differs_by_little(axis: Drive) -> None:
    voltage = command()
    split = variant(axis, "split steps").simulate(voltage)
    difference = np.abs(split.current - axis.simulate(voltage).current)
    # at most what lim1 rises by in one step; after the way up, what lim2 and the decay differ by
    numbers = axis.parameters.numbers
    rise = max(numbers[f"lim1_{side}"] for side in ("plus", "minus")) / 512.0
    assert 0.0 < difference.max() <= rise < 6e-3


@pytest.mark.slow
def test_only_a_split_step_lets_the_decays_threshold_count(hoist: Drive) -> None:
    voltage, I_t2 = command(), hoist["I_t2"].value.plus
    thresholds = I_t2 * (1.0 + np.linspace(-0.02, 0.02, 201))
    for form, largest in (("published", 0.5e-3), ("split steps", 1e-5)):
        drive = variant(hoist, form)
        runs = [drive.replace(I_t2_plus=each).simulate(voltage).current for each in thresholds]
        jumps = np.abs(np.diff(runs, axis=0)).max(axis=1)
        if form == "published":
            assert (jumps == 0.0).mean() > 0.9
            assert jumps.max() > largest
        else:
            assert (jumps > 0.0).all()
            assert jumps.max() < largest
