"""Judgment over seaways, sweeps, and what the axes can follow."""

from dataclasses import replace
from math import pi, radians

import numpy as np
import pytest
from scipy.stats import binomtest

from swashplate import Campaign, Drive
from swashplate.analysis.monte_carlo import Draws, stored_draws
from swashplate.campaign import rig
from swashplate.crane import (
    Crane,
    Stick,
    control,
    drawn_cranes,
    follow,
    judge,
    simulate,
    sweep,
    upgraded,
)
from swashplate.crane.judgment import mean_of, more_seaways, share_of
from swashplate.crane.result import PUMPS
from swashplate.errors import InputError, ParameterError
from swashplate.executors import Processes, Serial, Threads
from swashplate.identification.assessment import Identification
from swashplate.identification.fitting import fit
from swashplate.identification.setup import Free, Setup, load_setup
from swashplate.maneuvers import source_tests

MEANT = control.DelayedFeedback(0.2, 0.2) | control.ShipCompensation() | control.PositionLoop(1.5)
SHORT = {"length": 70.0, "start": 40.0}


@pytest.fixture(scope="module")
def crane():
    return Crane.preset("tg3637")


@pytest.fixture(scope="module")
def judged(crane):
    return judge(crane, MEANT, seeds=range(12), allowed=0.3, **SHORT)


def test_numbers_are_those_of_whole_runs(judged):
    run = judged.run("identified", 3)
    counted = run.swing_deg[round(40.0 * 512) :]
    assert judged.counted("identified")[3] == pytest.approx(radians(run.rms_deg(40.0)), rel=1e-12)
    assert judged.counted("identified", "largest_swing")[3] == pytest.approx(
        radians(counted.max()), rel=1e-12
    )
    # limits: against each drive simulated by itself
    for k, axis in enumerate(("hoist", "slew", "luff")):
        for i, limit in enumerate(PUMPS):
            share = run.drive(axis).active(limit)[round(40.0 * 512) :].mean()
            assert judged.values[3, 2, 3 + 5 * k + i] == pytest.approx(share, abs=1e-12)


@pytest.mark.parametrize(
    "executor",
    [Serial(), Threads(3), pytest.param(Processes(2), marks=pytest.mark.slow)],
    ids=["one", "threads", "processes"],
)
def test_numbers_do_not_depend_on_who_runs_them(crane, judged, executor):
    again = judge(crane, MEANT, seeds=[3, 5], remedies=False, executor=executor, **SHORT)
    np.testing.assert_array_equal(again.values, judged.values[[3, 5]])


def test_control_that_changes_nothing_does_not_pass(crane):
    idle = control.TipShaper("zv")  # there is no stick to shape
    found = judge(crane, idle, seeds=range(3), drives=("ideal",), remedies=False, **SHORT)
    assert not found.passed
    assert "the controller changes nothing: " in found.verdict()


def test_verdict_and_what_would_do(crane, judged):
    assert judged.outcome == "fails"
    assert judged.names == ("no control", "ideal", "identified")
    counted = judged.counted("identified") > judged.counted("no control")
    assert f"in {counted.sum()} of 12 seaways (95 % interval" in judged.verdict()
    assert "luff at its acceleration limit" in judged.verdict()
    factor = next(each for each in judged.remedies if "orifice" in each.what)
    assert f"Luff orifice ×{factor.size:g} would do." in judged.verdict()
    # the remedy, judged by itself, passes
    larger = crane.with_drive(luff=crane.luff.scale(Z16=factor.size))
    how = {"seeds": range(12), "allowed": 0.3, **SHORT}
    upgraded = judge(crane, MEANT, drives={"larger": larger}, **how)
    assert upgraded.passed
    assert upgraded.difference("larger").value < 0.0
    assert upgraded.worse("larger") == factor.worse
    assert "brings the swing from" in upgraded.verdict()
    # what was tried does not pass, and a remedy that is not decided is not promised
    assert "luff orifice ×2" in judged.tried
    clip = judged.remedies[-1]
    assert clip.worse[1:] == (0.0, pytest.approx(1.0 - 0.025 ** (1.0 / 12.0)))
    assert f"{clip.what.capitalize()} would do." in judged.verdict()
    # 12 seaways do not tell it from 20 %, but 1 - 0.025^(1/20) is below that
    verdict = replace(judged, allowed=0.2).verdict()
    assert f"{clip.what.capitalize()} may do: run more seaways (about 20)." in verdict
    rows = {row.cells[0]: row.cells[1:] for row in judged.tables()[1].rows}
    assert rows["identified"] == (counted.sum(), *judged.worse("identified"))


def test_few_seaways_decide_nothing(crane):
    how = {"drives": ("ideal",), **SHORT}
    one = judge(crane, MEANT, seeds=[0], **how)
    assert one.worse("ideal") == (0.0, 0.0, pytest.approx(0.975))
    assert one.outcome == "not decided"
    assert not one.passed
    assert "in 0 of 1 seaway (95 % interval 0.0 to 97.5 %)" in one.verdict()
    assert one.verdict().endswith("the 5 % allowed. Run more seaways (about 75).")
    # 5 of 6 are allowed, and none of 6 is worse
    assert judge(crane, MEANT, seeds=range(6), allowed=0.83, **how).outcome == "works"


@pytest.mark.parametrize(("hits", "seaways"), [(0, 1), (0, 40), (2, 37), (11, 200), (40, 40)])
def test_intervals_of_shares_are_the_exact_ones(hits, seaways):
    expected = binomtest(hits, seaways).proportion_ci(0.95, method="exact")
    found = share_of(hits, seaways)
    assert found == pytest.approx((hits / seaways, expected.low, expected.high), abs=1e-12)


def test_more_seaways_are_those_that_tell_if_the_share_stays():
    """With none worse 72 tell it from 5 %; a share of 5 % itself no number does."""
    assert [more_seaways(share, 20, 0.05) for share in (0.0, 0.05)] == [
        "about 75",
        "200 to begin with",
    ]


def test_differences_are_paired(judged):
    found = judged.difference("identified", "ideal")
    assert found.value == pytest.approx(
        judged.counted("identified").mean() - judged.counted("ideal").mean(), rel=1e-12
    )
    assert found.low < found.value < found.high
    rows = {(row.cells[0], row.cells[1]): row.cells[2] for row in judged.tables()[2].rows}
    assert rows["identified", "ideal"] == found.value
    frame = judged.to_polars()
    assert frame.height == 36
    assert frame.filter(variant="ideal")["rms_swing"].to_numpy() == pytest.approx(
        judged.counted("ideal")
    )


def test_intervals_against_published_tables():
    # Student, 4 degrees of freedom: 2.776; values 1 to 5 have a standard error of √0.5
    found = mean_of(np.array([1.0, 2.0, 3.0, 4.0, 5.0, np.nan]))
    assert found.value == 3.0
    assert found.high - found.value == pytest.approx(2.776 * 0.5**0.5, abs=1e-3)
    # a swing is not below 0
    assert mean_of(np.array([0.0, 1.0]), least=0.0).low == 0.0
    assert np.isnan(mean_of(np.array([1.0]), least=0.0).low)


def test_a_stopped_run_counts_as_worse(crane):
    # lowering while the load is held 3 m above the longest rope ends beyond it
    stick = Stick.trapezoid(hoist=-0.5, duration=30.0, length=40.0)
    found = judge(
        crane, {"none": control.Clip()}, seeds=[0], stick=stick, start=5.0, rope_m=47.0,
        remedies=False,
    )  # fmt: skip
    assert np.isnan(found.counted("no control")).all()
    assert found.tables()[0].rows[0].cells[-1] == 1


def test_axes_follow_what_speed_and_acceleration_allow(crane):
    found = follow(crane, [5.0, 7.5, 60.0], boom_deg=45.0)
    # of an independent model of this crane: tip 0.110 m/s² upwards, 0.454 m/s along the boom
    omega = 2.0 * pi / np.array([5.0, 7.5, 60.0])
    allowed = np.minimum(0.454 / omega, 0.110 / omega**2)
    np.testing.assert_allclose(found.amplitude[:, 2], allowed, rtol=0.01)
    assert found.amplitude[1, 2] == pytest.approx(0.157, abs=1e-3)
    # the hull that rolls at 13 s asks for this much along the boom, of the same model
    asked = [found.seas[each].amplitude[2] for each in ("ss3", "ss3-swell", "ss4")]
    np.testing.assert_allclose(asked, [0.75, 1.65, 2.1], rtol=0.06)


def test_boom_along_the_ship_is_calm_where_the_slew_does_the_work(crane):
    found = sweep(
        crane, "bearing", MEANT, points=[0.0, 90.0], seeds=[0], drives=("identified",), **SHORT
    )
    mean = found.mean()[..., 0]
    assert found.names == ("no control", "identified")
    assert mean[0, 1] < 0.2 * mean[0, 0]
    assert mean[1, 1] > mean[0, 1]


def test_swing_without_control_is_proportional_to_small_waves(crane):
    found = sweep(crane, "height", MEANT, points=[0.05, 0.1], seeds=[0, 1], **SHORT)
    swing = found.values[:, :, 0, 0]
    # what is left is of second order in the height: half a per cent here
    np.testing.assert_allclose(swing[:, 1] / swing[:, 0], 2.0, rtol=1e-2)
    assert found.below(90.0).min() == 1.0


def test_orifice_is_that_of_another_luff_drive(crane):
    found = sweep(crane, "orifice", MEANT, points=[1.0, 3.0], seeds=[1], **SHORT)
    larger = crane.with_drive(luff=crane.luff.scale(Z16=3.0))
    alone = judge(crane, MEANT, seeds=[1], drives={"larger": larger}, remedies=False, **SHORT)
    assert found.values[0, 1, 2, 0] == alone.counted("larger")[0]
    assert found.values[0, 0, 0, 0] == found.values[0, 1, 0, 0] == alone.counted("no control")[0]


# residual swing [deg] of an independent model over the stick: ideal, volts, identified drives, each
# without shaper and with ZV, on real drives with ZVD
SLEWS = {
    0.1: (0.831, 0.014, 2.17, 0.201, 0.218, 0.842, 0.023, 0.292),
    0.2: (1.258, 0.047, 4.44, 0.194, 0.193, 1.243, 0.056, 0.031),
    0.5: (7.03, 0.204, 10.23, 0.799, 0.582, 6.95, 0.198, 0.072),
    0.8: (12.51, 0.788, 14.89, 5.73, 3.81, 12.38, 0.780, 0.101),
    1.0: (7.88, 0.543, 8.95, 11.23, 1.49, 7.75, 0.519, 0.609),
}


def test_residual_swing_over_the_stick_is_that_of_the_independent_crane(crane):
    laws = {"plain": None, "ZV": control.JointShaper("zv"), "ZVD": control.JointShaper("zvd")}
    found = sweep(crane, "stick", laws, points=list(SLEWS))
    names = [
        *("plain, ideal", "ZV, ideal", "plain, volts", "ZV, volts", "ZVD, volts"),
        *("no control", "ZV, identified", "ZVD, identified"),
    ]
    places = [found.names.index(name) for name in names]
    swing, ends = np.degrees(found.values[0][:, places, 1:]).transpose(2, 0, 1)
    # steps of the shaper's delay and order of a sample differ: 1.5 %, or half a unit as printed
    np.testing.assert_allclose(swing, list(SLEWS.values()), rtol=0.015, atol=6e-4)
    # a shaper on the volts is worse than none at full stick, and lands elsewhere
    np.testing.assert_allclose(ends[-1, 2:4], [46.11, 62.02], rtol=0.002)
    with pytest.raises(InputError, match="A sweep over the stick sets sea itself"):
        sweep(crane, "stick", MEANT, sea="ss3")


# --- drives of fits -------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def fitted(tmp_path_factory):
    """The folder of a small fit of a virtual luff drive."""
    place = tmp_path_factory.mktemp("fit")
    names = ("step +4 V", "step +9 V", "sine 4 V 0.1 Hz")
    virtual = rig.run("luff", {name: source_tests("luff")[name] for name in names}, seed=3)
    path = rig.write(virtual, place / "virtual")
    campaign = Campaign.from_toml(path)
    (stage,) = (each for each in load_setup("luff").stages if each.name == "pump")
    free = {"Z16": Free(relative=(0.5, 2.0))}
    setup = Setup(stages=(stage.model_copy(update={"free": free, "forces": None}),))
    result = fit(Drive.preset("luff").parameters, campaign.experiments, setup)
    judged = Identification(campaign, result)
    judged.save(place)
    result.drive.to_toml(place / "drive.toml")
    return place, result, judged.verdict


@pytest.mark.slow
def test_own_logs_lead_to_the_verdict_on_the_own_crane(crane, fitted):
    place, result, verdict = fitted
    own = crane.with_drive(luff=place)
    assert own.luff.parameters.numbers == pytest.approx(result.drive.parameters.numbers, rel=1e-9)
    given = crane.with_drive(luff=result)
    assert given.luff.parameters.numbers == result.drive.parameters.numbers
    assert crane.with_drive(luff="hoist").luff.name == "hoist"
    with pytest.raises(ParameterError, match="slew: the fit has a drive of the luff"):
        crane.with_drive(slew=result)
    drawn = drawn_cranes(own, luff=stored_draws(place, draws=3, seed=1))
    assert len(drawn) == 3
    source = own.sources["luff"]
    assert source.fit == place
    assert (source.judged_usable, source.verdict) == (verdict.usable, verdict.headline)
    assert {each.sources["luff"].verdict for each in drawn} == {verdict.headline}
    assert crane.with_drive(luff=place / "drive.toml").sources["luff"].fit == place
    assert not own.with_drive(luff=crane.luff).sources
    assert {each.luff for each in drawn_cranes(own)} == set(stored_draws(place).drives)
    found = judge(
        own, MEANT, seeds=range(4), drives={"drawn": drawn}, remedies=False, length=30.0, start=10.0
    )
    # the first and the fourth seaway have the first crane
    alone = judge(
        own, MEANT, seeds=[3], drives={"one": drawn[0]}, remedies=False, length=30.0, start=10.0
    )
    assert found.counted("drawn")[3] == alone.counted("one")[0]
    assert found.counted("drawn")[1] != alone.counted("one")[0]


def scaled(drive, factors):
    """Draws that are a drive with other orifices."""
    return Draws(tuple(drive.scale(Z16=each) for each in factors), 0)


def test_cranes_are_drawn_axis_by_axis(crane):
    hoist, luff = scaled(crane.hoist, (0.9, 1.0, 1.1)), scaled(crane.luff, (0.8, 1.2))
    drawn = drawn_cranes(crane, hoist=hoist, luff=luff)
    assert {each.luff for each in drawn} == set(luff.drives)
    assert {each.hoist for each in drawn} < set(hoist.drives)
    assert all(each.slew == crane.slew for each in drawn)
    with pytest.raises(InputError, match="draws of at least one axis"):
        drawn_cranes(crane)


def test_draws_of_two_axes_from_one_seed_are_not_correlated(crane):
    factors = np.random.default_rng(0).uniform(0.9, 1.1, 100)
    drawn = drawn_cranes(crane, luff=scaled(crane.luff, factors), slew=scaled(crane.slew, factors))
    assert len(drawn) == 100
    pairs = [[each.luff["Z16"].numbers["Z16_plus"], each.slew["Z16"].numbers["Z16_plus"]]
             for each in drawn]  # fmt: skip
    # 0.26 is beyond 99 % of independent pairs
    assert abs(np.corrcoef(np.transpose(pairs))[0, 1]) < 0.26


def test_control_does_not_know_the_draw_that_moves_the_crane(crane):
    weaker = crane.slew.scale(Z17=1.05)
    stick = Stick.trapezoid(slew=0.5, until={"slew_deg": 30.0}, length=30.0)
    (drawn,) = drawn_cranes(crane, slew=Draws((weaker,), 0))
    known, unknown = crane.with_drive(slew=weaker), crane.with_drive(slew=weaker, known=False)
    runs = [simulate(each, stick) for each in (crane, drawn, unknown, known)]
    volts, ends = [each.voltage[:, 1] for each in runs], [each.slew_deg[-1] for each in runs]
    # the map of the drive before: the same voltages, and another end
    np.testing.assert_array_equal(volts[1], volts[0])
    np.testing.assert_array_equal(volts[2], volts[0])
    assert ends[1] == ends[2]
    assert abs(ends[1] - ends[0]) > 1.0
    # a drive that the controller knows gets other voltages, and ends where it should
    assert abs(ends[3] - ends[0]) < 0.1
    # the drive that the controller counts on is put back
    assert unknown.known_to_controller == {"slew": crane.slew}
    assert not unknown.with_drive(slew=crane.slew, known=False).known_to_controller
    # what is redesigned is known: the fitted drive moves with the drawn one
    redesigned = upgraded(drawn, "slew", {"orifice": 2.0})
    assert redesigned.slew == weaker.scale(Z16=2.0)
    assert redesigned.controller_drive("slew") == crane.slew.scale(Z16=2.0)


def test_what_makes_no_study_is_said(crane):
    def refuse(message, **how):
        with pytest.raises(InputError, match=message):
            judge(crane, MEANT, **{"seeds": [0], **how})

    refuse("needs a controller, a set of drives and a seed", seeds=[])
    refuse("needs a controller, a set of drives and a seed", drives=())
    refuse(r"drawn. are \[\], but must be a name, a crane or a list", drives={"drawn": []})
    refuse("3. are 3, but must be a name, a crane or a list of cranes", drives=[3])
    refuse("drives is 3, but must be a list of names", drives=3)
    refuse("counts from 40 s on, but a run is 30 s long", length=30.0)
    moving = Stick.record(np.full((51_200, 3), [0.0, 0.1, 0.0]))
    refuse("Ideal drives follow at once, .* put a row of zeros before it", stick=moving)
    refuse("seeds is 3, but must be a sequence, as range", seeds=3)
    refuse("A sea is a name, as 'ss3', or a Spectrum, not of type ndarray", sea=np.zeros((9, 6)))
    refuse("A study has no 'see'; it has seeds, sea, drives, .*, slew_deg", see="ss3")
    refuse("A study has no 'actuation'; it has seeds", actuation="direct")
    with pytest.raises(InputError, match="Periods to follow must be above 0 s"):
        follow(crane, [0.0])
    with pytest.raises(InputError, match="Points of the height must be .* from 0.001 to 30 m"):
        sweep(crane, "height", MEANT, points=[-1.0])
    with pytest.raises(InputError, match="A sweep over the bearing sets slew_deg itself"):
        sweep(crane, "bearing", MEANT, slew_deg=90.0)
