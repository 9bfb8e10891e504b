"""Known drives are found again from clean virtual tests, in whole and in part."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pytest
from tests.identification.given import determined_of, run_of, virtual

from swashplate import Campaign, DomainError, Drive, FullOrderDrive, ParameterError, maneuvers
from swashplate.campaign import ChannelKind, Experiment
from swashplate.identification import (
    Fit,
    FitSetup,
    Linearised,
    Problem,
    Unknown,
    Unknowns,
    drawn_drive,
    fit,
    linearised_fit,
    solve,
    uncertainty,
)
from swashplate.identification.estimation.setup import Free
from swashplate.parameters import OPTIONS, REFINEMENTS

AXES = ("hoist", "slew", "luff")


def measured(axis: str, truth: Drive, path: Path) -> Campaign:
    channels = ("rectified_current", "shaft_speed")
    return virtual(path, axis, severity="clean", truth=truth, channels=channels)


def found(result: Fit) -> dict[str, float]:
    return {name: value for name, value in result.values.items() if "(" not in name}


def determined(result: Fit) -> list[str]:
    names = np.array(result.linearised.variables.names)
    return list(names[result.linearised.determined])


@pytest.mark.slow
@pytest.mark.parametrize(("part", "seed"), [("card", 0), ("pump", 0), ("chain", 0), ("chain", 4)])
@pytest.mark.parametrize("axis", AXES)
def test_the_truth_is_recovered(axis: str, seed: int, part: str, tmp_path: Path) -> None:
    setup = determined_of(axis, part)
    truth = drawn_drive(Drive.preset(axis).at_every_rate(), setup, seed)
    campaign = measured(axis, truth, tmp_path)
    # at 1e-14 the cost of slew, seed 4, 6e-15 already, creeps on along a stop that is not reached
    result = fit(campaign.drive(axis).parameters, campaign.experiments, setup, tolerance=1e-12)
    expected = dict(truth.parameters.numbers)
    if setup.forces is not None:
        expected |= setup.forces.values(truth.parameters)
    told = determined(result)
    # with seed 4 the slew drive does not reach its stop downwards, and the fit says so
    assert len(told) >= len(found(result)) - (1 if (axis, seed) == ("slew", 4) else 0)
    # the small card sticks in its Coulomb band, where a search that follows derivatives ends early:
    # how early hangs on last bits, C of slew, seed 4, within 3e-6 with one kernel of the linear
    # algebra and 1.2e-3 with another
    near = 1e-6 if axis == "hoist" else 5e-4
    for name in told:
        rough = axis != "hoist" and name.startswith("C_")
        tolerance = 3e-3 if rough else near
        assert found(result)[name] == pytest.approx(expected[name], rel=tolerance), name
    assert result.solution.converged


@pytest.mark.slow
def test_counts_and_noise_leave_small_errors(tmp_path: Path) -> None:
    setup = determined_of("hoist")
    truth = drawn_drive(Drive.preset("hoist"), setup, seed=5)
    campaign = virtual(tmp_path, "hoist", severity="realistic", truth=truth, seed=2)
    result = fit(campaign.drive("hoist").parameters, campaign.select(role="fit"), setup)
    fitted, true = Drive(result.parameters), truth
    for volts in (-9.0, -6.5, -2.0, 2.0, 4.0, 9.0):
        assert fitted.steady_speed(volts) == pytest.approx(true.steady_speed(volts), rel=2e-3)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 39, 77])
def test_a_stop_that_the_search_loses_is_found_again(seed: int, tmp_path: Path) -> None:
    """From the published values a descent leaves these machines' stop, and finds none back."""
    axis, setup = "slew", determined_of("slew")
    truth = drawn_drive(Drive.preset(axis), setup, seed)
    campaign = virtual(tmp_path, axis, severity="realistic", truth=truth, seed=seed)
    values = fit(Drive.preset(axis), campaign, setup, threads=1).values
    for name in ("Z13_plus", "Z13_minus"):
        assert values[name] == pytest.approx(truth.parameters.numbers[name], rel=2e-3)


# --- masses of the five-state drive ---------------------------------------------------------------


Array = np.ndarray

NOISE = {"shaft_speed": np.radians(0.3), "stroker_pressure": 1e3}
"""White, at 512 Hz. [rad/s], [Pa]"""
MASSES = {"spool_mass": 1.6, "swash_inertia": 0.93}
"""What is looked for, and how far from the truth the fit begins."""
BESIDE = {"spool_damping": 0.7, "piston_damping": 1.4, "valve_flow_gain": 0.95, "oil_volume": 1.02}
"""What is not known either."""


class FiveStates:
    """The drive behind a fit, with the exact derivatives of its discrete map."""

    substeps = 20

    def __init__(self, nominal: FullOrderDrive) -> None:
        self.nominal = nominal

    def at(self, values: Mapping[str, float]) -> FullOrderDrive:
        try:
            return self.nominal.replace(**values)
        except ParameterError as error:
            raise DomainError(str(error)) from None

    def simulate(self, values: Mapping[str, float], experiment: Experiment) -> dict[str, Array]:
        run = self.at(values).simulate(experiment.input.values, substeps=self.substeps)
        return {name: getattr(run, name) for name in experiment.channels}

    def linearise(
        self, values: Mapping[str, float], experiment: Experiment, names: Sequence[str]
    ) -> dict[str, Linearised]:
        full, command = self.at(values), experiment.input.values
        found = full.simulate(command, substeps=self.substeps)
        by = full.sensitivities(command, parameters=names, substeps=self.substeps)
        return {name: Linearised(getattr(found, name), by[name]) for name in experiment.channels}


@pytest.mark.slow
def test_two_most_visible_masses_are_found() -> None:
    """From steps back and forth, three a second, by two noisy sensors; in the logarithm."""
    truth = FullOrderDrive.preset("hoist")
    known = truth.physical
    time = np.arange(3072) / 512.0
    command = 5.0 * np.sign(np.sin(2.0 * np.pi * 1.5 * time))
    run = truth.simulate(command, substeps=20)
    noise = dict(zip(NOISE, np.random.default_rng(5).normal(size=(2, time.size)), strict=True))
    read = {name: getattr(run, name) + NOISE[name] * noise[name] for name in NOISE}
    unknowns = Unknowns(
        tuple(
            Unknown(name, factor * value, 0.1 * value, 10.0 * value, known[name].unit, log=True)
            for name, factor in {**MASSES, **BESIDE}.items()
            for value in [known.numbers[name]]
        )
    )
    problem = Problem(
        FiveStates(truth),
        [run_of("square", command, read, hold="previous")],
        unknowns,
        channels=tuple(NOISE),
        scales=NOISE,
    )
    found = solve(problem)
    values = problem.unknowns.values(found.vector)
    for each in uncertainty(linearised_fit(problem, found.vector)).estimates:
        right = known.numbers[each.name]
        if each.name in MASSES:
            assert each.lower < right < each.upper, each.name
        assert values[each.name] == pytest.approx(right, rel=0.03), each.name
    # nothing but noise is left: 6144 samples of unit variance
    assert 2.0 * found.cost == pytest.approx(6144.0, rel=0.08)


# --- refinements ----------------------------------------------------------------------------------


STICTION = {"spool_friction": 0.115, "spool_presliding": 5e-5, "dither_time": 0.6}
LOAD = {"load_torque": 3e4, "load_inertia": 5e3, "motor_leakage": 1e-6}
LATE = {"solenoid_delay": 0.04, "solenoid_lag": 0.015}
CAM = {"cam_ripple": 0.02, "cam_cycles": 5.5, "cam_phase": 0.7}
ALL = {
    **STICTION,
    **LOAD,
    **CAM,
    **LATE,
    "solenoid_hysteresis": 0.01,
    "swash_damping": 0.03,
    "line_stiffness": 1e6,
}
WITHOUT_LINE = {**LOAD, **LATE, "solenoid_hysteresis": 0.01, "cam_ripple_per_torque": 1e-6}
"""A leakage that goes with the flow's acceleration, and a ripple that goes with the load."""
OFF = {"cam_cycles": 1.01}
"""How far off a fit starts: 15 %, but no more than a quarter turn of the ring's phase in a run."""
REACH = {
    "load_inertia": (1e3, 2e4),
    "motor_leakage": (0.0, 1e-5),
    "solenoid_delay": (0.0, 0.2),
    "solenoid_lag": (0.0, 0.2),
    "solenoid_hysteresis": (0.0, 0.05),
    "cam_ripple_per_torque": (0.0, 1e-5),
}


SWITCHED = (*LATE, "solenoid_hysteresis", "cam_ripple_per_torque")


def recorded(truth: Drive, path: Path, channel: ChannelKind) -> Campaign:
    tests = [maneuvers.step(4.0, stop=3.0, length=5.0), maneuvers.sine(4.0, 0.3, length=7.0)]
    return virtual(path, "hoist", tests, severity="clean", truth=truth, channels=(channel,))


def fitted(campaign: Campaign, start: Drive, setup: FitSetup) -> Fit:
    found = fit(start.parameters, campaign.experiments, setup, tolerance=1e-12)
    assert found.solution.converged
    return found


@pytest.mark.slow
def test_all_refinements_are_recovered_at_once(tmp_path: Path) -> None:
    """Friction, lateness, hysteresis, damping, ring, leakage, line, with Z1, from a position."""
    truth = Drive.preset("hoist").replace(**ALL)
    names = ["Z1", *(name for name in ALL if name != "load_torque")]
    start = truth.scale(**{name: OFF.get(name, 1.15) for name in names})
    free = {name: Free(relative=(0.5, 2.0), log=True) for name in names}
    found = fitted(recorded(truth, tmp_path, "position"), start, FitSetup(free=free))
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
    on = {"leakage"} if begin == "switched off" else {"leakage", "late", "hysteresis", "ripple"}
    assert start.parameters.options == on
    found = fitted(recorded(truth, tmp_path, "shaft_speed"), start, without_line())
    for name in REACH:
        assert found.values[name] == pytest.approx(WITHOUT_LINE[name], rel=1e-6), name


@pytest.mark.slow
def test_what_is_not_there_goes_to_next_to_nothing(tmp_path: Path) -> None:
    """It stays on, at the least that its equations take: what is off has no derivative."""
    truth = Drive.preset("hoist").replace(**LOAD)
    changes = WITHOUT_LINE | dict.fromkeys(LATE, 0.0)
    start = Drive.preset("hoist").replace(**changes).scale(Z1=1.05, motor_leakage=1.15)
    setup = without_line()
    for name in LATE:  # it is like what leaks while the load accelerates, but for the last digits
        del setup.free[name]
    found = fitted(recorded(truth, tmp_path, "shaft_speed"), start, setup)
    for name in ("solenoid_hysteresis", "cam_ripple_per_torque"):
        least = REFINEMENTS[name].least
        assert least is not None
        assert least <= found.values[name] < 1e-5 * WITHOUT_LINE[name], name
    assert found.parameters.options == {"leakage", "hysteresis", "ripple"}
    # the hysteresis that is left, 1e-8 A, shows in the sixth digit of the others
    for name in ("Z1", "motor_leakage", "load_inertia"):
        assert found.values[name] == pytest.approx(truth[name].value, rel=1e-5), name


@pytest.mark.parametrize("delay", [0.0, 0.04])
def test_how_late_a_drive_is_behind_its_current(delay: float, tmp_path: Path) -> None:
    """With the amplifier's delay, from an ammeter and an encoder; nothing is invented."""
    truth = Drive.preset("hoist").replace(solenoid_delay=delay, solenoid_lag=0.375 * delay)
    start = Drive.preset("hoist").replace(solenoid_delay=0.03, solenoid_lag=0.01).scale(Z1=1.05)
    tests = [
        *(maneuvers.step(volts, stop=3.0, length=5.0) for volts in (4.0, -6.0)),
        *(maneuvers.sine(volts, f, length=7.0) for volts, f in ((4.0, 0.3), (6.0, 1.0))),
    ]
    channels = ("rectified_current", "encoder_counts")
    campaign = virtual(
        tmp_path, "hoist", tests, severity="realistic", truth=truth, channels=channels
    )
    free = {name: Free(bounds=(0.0, 0.2)) for name in (*LATE, "tau")}
    free |= {name: Free(relative=(0.5, 2.0), log=True) for name in ("Z1", "Z8")}
    found = fit(start.parameters, campaign.experiments, FitSetup(free=free))
    assert found.values["solenoid_delay"] == pytest.approx(delay, abs=5e-4)
    assert found.values["solenoid_lag"] == pytest.approx(0.375 * delay, abs=1e-3)
    assert found.values["tau"] == pytest.approx(truth["tau"].value, abs=1e-3)
    gain, known = (drive.linearize(4.0).largest_gain for drive in (found.drive, truth))
    assert gain == pytest.approx(known, rel=0.03)


def without_line() -> FitSetup:
    free = {name: Free(bounds=bounds) for name, bounds in REACH.items()}
    free["Z1"] = Free(relative=(0.5, 2.0), log=True)
    return FitSetup(part="pump", free=free)
