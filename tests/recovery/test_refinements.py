"""Refinements are found again from clean virtual tests, by a fit with exact derivatives.

Many at once: a combination that was not used before is compiled for some fifteen seconds, whether
it has one refinement or all.
"""

from pathlib import Path

import pytest
from tests.identification.given import virtual

from swashplate import Campaign, Drive, maneuvers
from swashplate.campaign import ChannelKind
from swashplate.identification.fitting import StageFit, fit
from swashplate.identification.setup import Free, Setup, Stage
from swashplate.parameters import OPTIONS, REFINEMENTS

STICTION = {"spool_friction": 0.115, "spool_presliding": 5e-5, "dither_time": 0.6}
LOAD = {"load_torque": 3e4, "load_inertia": 5e3, "motor_leakage": 1e-6}
CAM = {"cam_ripple": 0.02, "cam_cycles": 5.5, "cam_phase": 0.7}
ALL = {
    **STICTION,
    **LOAD,
    **CAM,
    "solenoid_hysteresis": 0.01,
    "swash_damping": 0.03,
    "line_stiffness": 1e6,
}
WITHOUT_LINE = {**LOAD, "solenoid_hysteresis": 0.01, "cam_ripple_per_torque": 1e-6}
"""A leakage that goes with the flow's acceleration, and a ripple that goes with the load."""
OFF = {"cam_cycles": 1.01}
"""How far off a fit starts: 15 %, but no more than a quarter turn of the ring's phase in a run."""
REACH = {
    "load_inertia": (1e3, 2e4),
    "motor_leakage": (0.0, 1e-5),
    "solenoid_hysteresis": (0.0, 0.05),
    "cam_ripple_per_torque": (0.0, 1e-5),
}


SWITCHED = ("solenoid_hysteresis", "cam_ripple_per_torque")


def measured(truth: Drive, path: Path, channel: ChannelKind) -> Campaign:
    tests = [maneuvers.step(4.0, stop=3.0, length=5.0), maneuvers.sine(4.0, 0.3, length=7.0)]
    return virtual(path, "hoist", tests, severity="clean", truth=truth, channels=(channel,))


def fitted(campaign: Campaign, start: Drive, stage: Stage) -> StageFit:
    setup = Setup(stages=(stage,))
    (found,) = fit(start.parameters, campaign.experiments, setup, tolerance=1e-12).stages
    assert found.solution.converged
    return found


@pytest.mark.slow
def test_all_refinements_are_recovered_at_once(tmp_path: Path) -> None:
    """Friction, hysteresis, damping, cam ring, leakage and line, with Z1, from a position alone."""
    truth = Drive.preset("hoist").replace(**ALL)
    names = ["Z1", *(name for name in ALL if name != "load_torque")]
    start = truth.scale(**{name: OFF.get(name, 1.15) for name in names})
    free = {name: Free(relative=(0.5, 2.0), log=True) for name in names}
    stage = Stage(name="drive", part="chain", free=free)
    found = fitted(measured(truth, tmp_path, "position"), start, stage)
    for name in names:
        assert found.values[name] == pytest.approx(truth[name].values[0], rel=1e-6), name
    assert found.parameters.refinements == truth.parameters.refinements
    assert found.parameters.options == set(OPTIONS) - {"leaky", "loaded"}


@pytest.mark.slow
@pytest.mark.parametrize("begin", ["15 % off", "switched off"])
def test_what_is_on_is_found_from_beside_it_and_from_nothing(begin: str, tmp_path: Path) -> None:
    """From off, where the difference is one-sided."""
    truth = Drive.preset("hoist").replace(**WITHOUT_LINE)
    changes = {name: 1.15 * WITHOUT_LINE[name] for name in REACH}
    if begin == "switched off":
        changes |= dict.fromkeys(SWITCHED, 0.0)
    start = truth.replace(**changes).scale(Z1=1.05)
    on = {"leakage"} if begin == "switched off" else {"leakage", "hysteresis", "ripple"}
    assert start.parameters.options == on
    found = fitted(measured(truth, tmp_path, "shaft_speed"), start, without_line())
    for name in REACH:
        assert found.values[name] == pytest.approx(WITHOUT_LINE[name], rel=1e-6), name


@pytest.mark.slow
def test_what_is_not_there_goes_to_next_to_nothing(tmp_path: Path) -> None:
    """It stays on, at the least that its equations take: what is off has no derivative."""
    truth = Drive.preset("hoist").replace(**LOAD)
    start = Drive.preset("hoist").replace(**WITHOUT_LINE).scale(Z1=1.05, motor_leakage=1.15)
    found = fitted(measured(truth, tmp_path, "shaft_speed"), start, without_line())
    for name in SWITCHED:
        least = REFINEMENTS[name].least
        assert least is not None
        assert least <= found.values[name] < 1e-5 * WITHOUT_LINE[name], name
    assert found.parameters.options == {"leakage", "hysteresis", "ripple"}
    # the hysteresis that is left, 1e-8 A, shows in the sixth digit of the others
    for name in ("Z1", "motor_leakage", "load_inertia"):
        assert found.values[name] == pytest.approx(truth[name].value, rel=1e-5), name


def without_line() -> Stage:
    free = {name: Free(bounds=bounds) for name, bounds in REACH.items()}
    free["Z1"] = Free(relative=(0.5, 2.0), log=True)
    return Stage(name="drive", part="pump", free=free)
