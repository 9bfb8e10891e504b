"""Refinements are found again from clean virtual tests, by a fit with exact derivatives."""

from pathlib import Path

import pytest

from swashplate import Drive, maneuvers
from swashplate.campaign import rig
from swashplate.campaign.campaign import Campaign
from swashplate.campaign.kinds import ChannelKind
from swashplate.identification.fit import Fit, fit
from swashplate.identification.setup import Free, Setup, Stage

STICTION = {"spool_friction": 0.115, "spool_presliding": 5e-5, "dither_time": 0.6}
LOAD = {"load_torque": 3e4, "load_inertia": 5e3, "motor_leakage": 1e-6}
CAM = {"cam_ripple": 0.02, "cam_cycles": 5.5, "cam_phase": 0.7}
LOADED_CAM = {"cam_ripple_per_torque": 1e-6, "load_torque": 2e4}
LINE = {"line_stiffness": 1e6, "motor_leakage": 1e-6}

CASES = {
    "stiction": (STICTION, tuple(STICTION)),
    "hysteresis": ({"solenoid_hysteresis": 0.01}, ("solenoid_hysteresis",)),
    "leakage": (LOAD, ("motor_leakage", "load_inertia")),
    "cam ring": (CAM, tuple(CAM)),
    "cam ring under load": (CAM | LOADED_CAM, ("cam_ripple_per_torque", "cam_phase")),
    "swash damping": ({"swash_damping": 0.03}, ("swash_damping",)),
    "line": (LOAD | LINE, ("line_stiffness", "motor_leakage", "load_inertia")),
}
"""What is on, and what of it is to be found, beside Z1."""
OFF = {"cam_cycles": 1.01}
"""How far off a fit starts: 15 %, but no more than a quarter turn of the ring's phase in a run."""


def measured(truth: Drive, path: Path, channel: ChannelKind = "shaft_speed") -> Campaign:
    tests = rig.run(
        "hoist",
        [maneuvers.step(4.0), maneuvers.sine(4.0, 0.3)],
        severity="clean",
        truth=truth,
        channels=(channel,),
    )
    return Campaign.from_toml(rig.write(tests, path))


def fitted(campaign: Campaign, start: Drive, free: dict[str, Free]) -> Fit:
    free = {"Z1": Free(relative=(0.5, 2.0), log=True), **free}
    stage = Stage(name="drive", part="chain", free=free)
    return fit(campaign.experiments, start.parameters, Setup(stages=(stage,)), tolerance=1e-12)


@pytest.mark.parametrize("case", CASES)
def test_a_refinement_is_recovered(case: str, tmp_path: Path) -> None:
    on, names = CASES[case]
    truth = Drive.preset("hoist").replace(**on)
    start = truth.scale(Z1=1.05, **{name: OFF.get(name, 1.15) for name in names})
    free = {name: Free(relative=(0.5, 2.0), log=True) for name in names}
    result = fitted(measured(truth, tmp_path / "virtual"), start, free)
    (stage,) = result.stages
    assert stage.solution.converged
    for name, value in stage.values.items():
        assert value == pytest.approx(truth[name].values[0], rel=1e-6), name
    assert result.parameters.refinements == truth.parameters.refinements


@pytest.mark.parametrize(
    ("name", "value", "channel"),
    [("solenoid_hysteresis", 0.01, "shaft_speed"), ("cam_ripple", 0.02, "position")],
)
def test_one_that_was_off_comes_on(
    name: str, value: float, channel: ChannelKind, tmp_path: Path
) -> None:
    """From 0, where the difference is one-sided; the position's zero is free as well."""
    campaign = measured(Drive.preset("hoist").replace(**{name: value}), tmp_path / "v", channel)
    result = fitted(campaign, Drive.preset("hoist"), {name: Free(bounds=(0.0, 0.05))})
    assert result.parameters[name].values[0] == pytest.approx(value, rel=1e-5)
    assert result.parameters.refinements == (name,)


def test_one_that_is_not_there_stays_off(tmp_path: Path) -> None:
    campaign = measured(Drive.preset("hoist"), tmp_path / "virtual")
    start = Drive.preset("hoist").replace(solenoid_hysteresis=0.004)
    result = fitted(campaign, start, {"solenoid_hysteresis": Free(bounds=(0.0, 0.05))})
    assert abs(result.parameters["solenoid_hysteresis"].values[0]) < 1e-7
