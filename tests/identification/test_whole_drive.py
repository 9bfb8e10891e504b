"""Without a current every number of the named drive is estimated at once, near what it was."""

import re
from dataclasses import replace

import numpy as np
import pytest
from tests.identification.given import TIME, run_of, virtual

from swashplate import Campaign, Drive, ParameterError, identify
from swashplate.identification import (
    FitSetup,
    drawn_drive,
    fit,
    load_setup,
    prior_information,
    whole_drive,
)
from swashplate.identification.estimation.between_samples import joined, settle
from swashplate.identification.estimation.fit_problem import (
    problem_of,
    setup_of,
    smooth,
)
from swashplate.identification.estimation.setup import setup_text
from swashplate.maneuvers import parse
from swashplate.parameters import DEFINITIONS

HOIST = Drive.preset("hoist").parameters
SPEED = run_of("a", np.sin(TIME), {"shaft_speed": np.sin(TIME)}, time=TIME)


def unknowns_of(setup: FitSetup, drive: Drive | None = None) -> dict:
    parameters = HOIST if drive is None else drive.parameters
    problem = problem_of(setup, parameters, [SPEED])
    return {unknown.name: unknown for unknown in problem.unknowns if unknown.run is None}


def free(**entries: object) -> FitSetup:
    return FitSetup.model_validate({"free": entries})


def test_every_number_that_is_not_off_is_near_its_nominal_value() -> None:
    unknowns = unknowns_of(whole_drive(HOIST))
    expected = {name for name, n in HOIST.numbers.items() if n != 0.0 and np.isfinite(n)}
    assert set(unknowns) == expected
    assert {"V_dz_minus", "Z4", "Z9", "Z22_minus", "tau"} <= expected
    for name, unknown in unknowns.items():
        nominal = HOIST.numbers[name]
        assert unknown.prior.mean == unknown.start == nominal
        assert unknown.log == (nominal > 0.0)
        size = 1.0 if unknown.log else abs(nominal)
        assert unknown.prior.deviation == pytest.approx(0.3 * size)
        definition = DEFINITIONS.find(name)
        assert definition.holds(unknown.low)
        assert definition.holds(unknown.high) or unknown.high == definition.upper
        assert unknown.low < nominal < unknown.high


def test_refinements_were_stated_and_stay() -> None:
    stated = HOIST.with_numbers({"load_inertia": 2.0}, HOIST.options)
    assert set(unknowns_of(whole_drive(stated))) == set(unknowns_of(whole_drive(HOIST)))


def test_a_spread_may_have_bounds_of_its_own() -> None:
    unknowns = unknowns_of(free(Z10={"spread": 0.1, "relative": (0.5, 2.0)}))
    unknown = unknowns["Z10"]
    assert (unknown.low, unknown.high) == pytest.approx((0.5 * unknown.start, 2.0 * unknown.start))
    assert unknown.prior.deviation == 0.1


@pytest.mark.parametrize(
    ("entry", "said"),
    [
        ({}, "relative bounds or bounds, or a spread"),
        ({"spread": 0.3, "prior": {"mean": 1.0, "deviation": 0.1}}, "a prior or a spread"),
        ({"spread": 0.0}, "Z10"),
        (
            {"spread": 0.3, "bounds": (1.0, 2.0), "relative": (0.5, 2.0)},
            "either relative",
        ),
    ],
)
def test_an_entry_says_one_thing(entry: dict, said: str) -> None:
    with pytest.raises((ParameterError, ValueError), match=said):
        free(Z10=entry)


def test_no_share_of_nothing() -> None:
    with pytest.raises(ParameterError, match="C_plus is nominally 0, and no spread"):
        unknowns_of(free(C_plus={"spread": 0.3}))


def test_it_is_stored_as_it_was(tmp_path) -> None:
    file = tmp_path / "setup.toml"
    setup = whole_drive(HOIST, 0.5)
    file.write_text(setup_text(setup), "utf-8")
    assert load_setup(file) == setup


def test_the_finest_encoder_counts_no_more_than_the_model_is_worth() -> None:
    step = {"bounds": (9.0, 16.0)}
    fine = run_of("a", np.sin(TIME), {"shaft_speed": np.sin(TIME)}, time=TIME, noise=1e-6)
    for entry, unit in ((step, 1e-6), ({"spread": 0.3}, 0.01 * np.ptp(np.sin(TIME)))):
        problem = problem_of(free(Z10=entry), HOIST, [fine])
        assert problem.scales["shaft_speed"] == pytest.approx(unit)


def test_what_is_known_beforehand_counts_once_not_once_a_test() -> None:
    known = prior_information(HOIST, whole_drive(HOIST))
    told = np.linalg.norm(known.candidate(parse("step:2")).derivatives, axis=0)
    beforehand = np.linalg.norm(known.present, axis=0)
    names = list(known.variables.names)
    assert told[names.index("Z15")] == 0.0
    assert told[names.index("V_dz_plus")] > 0.0
    assert (beforehand > 0.0).all()


MANEUVERS = [
    *(parse(f"step:{volts},length=8") for volts in (9, -9, 4, -4, 2, -2)),
    parse("sine:9,0.1,length=20"),
    parse("sine:6,0.3,length=10"),
    parse("sine:2,0.2,length=10"),
]


@pytest.fixture(scope="module")
def truth() -> Drive:
    """A hoist none of whose numbers is the packaged one."""
    hoist = Drive.preset("hoist")
    return drawn_drive(hoist, whole_drive(HOIST), seed=3, spread=0.1)


@pytest.fixture(scope="module")
def campaign(tmp_path_factory: pytest.TempPathFactory, truth: Drive) -> Campaign:
    folder = tmp_path_factory.mktemp("no-ammeter")
    return virtual(
        folder, "hoist", MANEUVERS, truth=truth, seed=3, channels=("encoder_counts",), validate=()
    )


def test_without_a_current_it_is_what_is_estimated(campaign: Campaign) -> None:
    axis = next(iter(campaign.axes))
    assert setup_of(campaign, axis, HOIST) == whole_drive(HOIST)
    neutral = Drive.preset("neutral").parameters
    of_no_machine = with_drive(campaign, "neutral")
    of_any = setup_of(of_no_machine, axis, neutral)
    assert of_any.part == "chain"
    assert of_any.free.keys() == {"V_dz", "G1", "Z8", "tau"}
    assert not any(entry.spread or entry.prior for entry in of_any.free.values())
    assert set(of_any.channels) == {"shaft_speed", "position", "encoder_counts"}


def with_drive(campaign: Campaign, name: str) -> Campaign:
    """The campaign with another drive named in its file."""
    file = campaign.path.with_name("other.toml")
    text = campaign.path.read_text("utf-8")
    file.write_text(re.sub(r'drive = "\w+"', f'drive = "{name}"', text), "utf-8")
    return Campaign.from_toml(file)


@pytest.mark.slow
def test_a_hoist_is_predicted_and_its_numbers_lie_in_their_intervals(
    campaign: Campaign, truth: Drive
) -> None:
    result = identify(campaign)
    assert result.verdict.usable
    for name in ("step:1", "step:-1", "sine:5,0.5", "ramp:2,length=6"):
        command = parse(name)
        expected = truth.simulate(command).shaft_speed
        error = result.drive.simulate(command).shaft_speed - expected
        assert np.sqrt(np.mean(error**2)) < 0.02 * np.ptp(expected), name
    held = [
        estimate.lower <= truth.parameters.numbers[name] <= estimate.upper
        for name, estimate in result.fit.estimates.items()
        if name in truth.parameters.numbers and estimate.lower is not None
    ]
    assert len(held) > 40
    assert sum(held) >= 0.9 * len(held)
    said = " ".join(result.fit.sentences)
    assert "cannot tell the amplifier's numbers from the solenoids'" in said
    assert "the tests narrow" in said


@pytest.mark.slow
def test_a_machine_that_is_not_like_the_named_drive_is_said_to_be_none(tmp_path) -> None:
    thrice = Drive.preset("hoist").scale(Z10=3.0)
    tests = virtual(
        tmp_path, "hoist", MANEUVERS[:4], truth=thrice, seed=5, channels=("encoder_counts",)
    )
    said = " ".join(fit(Drive.preset("hoist"), tests, whole_drive(HOIST)).doubts)
    assert re.search(
        r"not like hoist, from whose numbers differ .*Z10 3\.\d deviations above", said
    )
    assert "swashplate guess" in said


@pytest.mark.slow
def test_a_command_that_jumps_between_slow_samples_has_instants_one_way_and_none_another() -> None:
    command = parse("step:6,length=7").sample(50.0)
    time = np.arange(command.size) / 50.0
    run = (
        Drive.preset("hoist")
        .at_every_rate()
        .simulate(command, 8192.0, time=time, interpolation="previous")
    )
    speed = np.interp(time, run.time, run.shaft_speed)
    logged = run_of("a", command, {"shaft_speed": speed}, time=time, noise=0.01)
    logged = replace(logged, input=replace(logged.input, settled=False))
    ways = ("linear", "previous", "jumps")
    counts = {
        len(problem_of(whole_drive(HOIST), HOIST, joined([logged], way)).unknowns) for way in ways
    }
    assert len(counts) > 1
    found = settle([logged], smooth(HOIST), whole_drive(HOIST))
    (settled,) = found.runs
    assert settled.input.interpolation in ways
    assert settled.input.settled
    assert found.sentences
    # the fit itself begins there
    assert found.near["Z10"] == pytest.approx(HOIST.numbers["Z10"], rel=0.3)
