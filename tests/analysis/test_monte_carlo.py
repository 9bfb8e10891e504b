"""Draws from a covariance made by hand, and from a fit of a virtual hoist."""

import json
from operator import attrgetter
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from swashplate import Drive, InputError, ParameterError, maneuvers, rig
from swashplate.analysis import (
    Draws,
    Trial,
    bands,
    drawn_drives,
    find_outcomes,
    stored_draws,
    trial_of,
)
from swashplate.campaign import Campaign
from swashplate.identification import (
    DriveModel,
    Fit,
    FitSetup,
    Identification,
    Unknown,
    Unknowns,
    fit,
    uncertainty_of,
)
from swashplate.identification.estimation.setup import Free
from swashplate.maneuvers import source_tests

VOLTAGE = maneuvers.step(9.0, stop=4.0, length=5.0).sample()


@pytest.fixture
def given_uncertainty(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a fit the Monte Carlo takes an uncertainty that the test gives."""
    for module in ("monte_carlo", "propagation"):
        monkeypatch.setattr(
            f"swashplate.analysis.{module}.uncertainty_of", attrgetter("uncertainty")
        )


@pytest.mark.slow
@pytest.mark.usefixtures("given_uncertainty")
def test_draws_outside_the_bounds_are_drawn_again(hoist):
    """A normal deviation of 2 % above a bound 2 % away: one in six is outside."""
    unknowns = Unknowns(
        (Unknown("Z10", 12.396, 12.396 * 0.98, 24.0), Unknown("Z18", 2.1667e-5, 0.0, 1e-4))
    )
    model = DriveModel(hoist.parameters)

    def drawn(variance: float, count: int) -> Draws:
        """From what the Monte Carlo reads of a fit; Z18 is not determined."""
        own = SimpleNamespace(matrix=np.diag([variance, 0.0]), determined=np.array([True, False]))
        problem = SimpleNamespace(unknowns=unknowns, model=model, uncertain=())
        solution = SimpleNamespace(vector=unknowns.start)
        known = SimpleNamespace(own=own, systematic={})
        one = SimpleNamespace(problem=problem, solution=solution, uncertainty=known)
        return drawn_drives(one, count, seed=1)

    found = drawn(4e-4, 300)
    assert found.columns["Z10"].min() >= 12.396 * 0.98
    assert found.redrawn / (300 + found.redrawn) == pytest.approx(0.159, abs=0.06)
    assert found.fixed == ("Z18",)
    assert (found.columns["Z18"] == 2.1667e-5).all()
    kept, redrawn = found.sentences()
    assert "Not varied, with the fitted value in all drives: Z18" in kept
    share = 100.0 * found.redrawn / (300 + found.redrawn)
    assert f"too narrow: {share:.0f} %" in redrawn
    assert "Widen the bounds in the fit setup" in redrawn
    # of one in a thousand nobody decides anything
    assert len(drawn(4e-5, 300).sentences()) == 1
    with pytest.raises(InputError, match=r"Of \d+ draws .*Monte Carlo"):
        drawn(1e10, 10)
    with pytest.raises(InputError, match="draw, .* 0"):
        drawn(1e-4, 0)


@pytest.mark.usefixtures("given_uncertainty")
def test_no_draws_of_a_pump_that_is_hardly_known_at_its_bound(hoist):
    unknowns = Unknowns((Unknown("Z10", 12.396, 12.396, 24.0),))
    own = SimpleNamespace(matrix=np.diag([1e4]), determined=np.array([True]))
    hardly_known = SimpleNamespace(
        problem=SimpleNamespace(
            unknowns=unknowns, model=DriveModel(hoist.parameters), uncertain=()
        ),
        solution=SimpleNamespace(vector=unknowns.start),
        uncertainty=SimpleNamespace(own=own, systematic={}),
        drive=hoist,
    )

    with pytest.raises(InputError, match=r"Of \d+ draws .*Monte Carlo"):
        drawn_drives(hardly_known, 10)


def pumps(drive: Drive, error: float, count: int) -> Draws:
    """Drives whose pumps differ."""
    normal = np.random.default_rng(1).normal(size=count)
    return Draws(tuple(drive.replace(Z10=12.396 + error * each) for each in normal), 0)


def test_a_band_by_hand(hoist):
    """The speed at the stop goes with the pump: its band is that of the drawn factors."""
    drawn = pumps(hoist, 0.3, 101)
    command = trial_of(hoist, VOLTAGE)
    band = bands(drawn, command, find_outcomes(["final_speed"]), level=0.9)
    held = int(3.9 * 512)
    angle = hoist.parameters.numbers["Z13_plus"]
    ordered = np.sort(drawn.columns["Z10"]) * angle
    # of 101 values the quantiles 0.05, 0.5 and 0.95 are the 6th, 51st and 96th
    found = [band.lower[held], band.median[held], band.upper[held]]
    np.testing.assert_allclose(found, ordered[[5, 50, 95]], rtol=1e-9)
    width, when = band.widest
    assert width == pytest.approx(ordered[95] - ordered[5], rel=1e-6)
    assert 2.0 < when < 4.2
    assert (band.level, band.draws, band.time[-1]) == (0.9, 101, 5.0)
    with pytest.raises(InputError, match="level 1 of a band"):
        bands(drawn, command, level=1.0)
    endless = np.broadcast_to(0.0, 100_000_000)
    with pytest.raises(InputError, match="memory: .* 1 drives"):
        bands(drawn, Trial(endless, 512.0, endless))
    # of the speed limits each way and of the final speed
    down = hoist.parameters.numbers["Z13_minus"] / angle
    half = 0.5 * (ordered[95] - ordered[5])
    np.testing.assert_allclose(band.half_widths, half * np.array([1.0, down, 1.0]), rtol=1e-9)


def small_setup() -> FitSetup:
    """A card's jump and gain and a pump's size are free.

    The angle at the stops, which is fixed, may be off by about as much as the pump's estimate. The
    current has no hysteresis, which would hide how the estimates follow each other.
    """
    return FitSetup(
        free=dict.fromkeys(("J", "G1", "Z10"), Free(relative=(0.5, 2.0))),
        current_hysteresis=0.0,
        standard_uncertainty={"Z13": "0.008 %"},
    )


@pytest.fixture(scope="module")
def fit_and_folder(tmp_path_factory: pytest.TempPathFactory) -> tuple[Fit, Path]:
    """A fit, and a folder as `swashplate fit` writes it, with its virtual campaign beside it."""
    place = tmp_path_factory.mktemp("fit")
    tests = source_tests("hoist")
    names = ("step +4 V", "step -4 V", "step +9 V")
    virtual = rig.run("hoist", {name: tests[name] for name in names}, seed=3)
    path = rig.write(virtual, place / "virtual")
    campaign = Campaign.from_toml(path)
    result = fit(Drive.preset("hoist").parameters, campaign.experiments, small_setup())
    Identification(campaign, result).save(place)
    return result, place


@pytest.mark.slow
def test_a_stored_fit_gives_drives_of_its_quoted_errors(fit_and_folder):
    result, fitted = fit_and_folder
    drawn = stored_draws(fitted, draws=400, seed=1)
    columns = drawn.columns
    again, other = (stored_draws(fitted, draws=2, seed=seed).columns["Z10"] for seed in (1, 2))
    np.testing.assert_array_equal(again, columns["Z10"][:2])
    assert (other != again).all()
    known = uncertainty_of(result)
    for estimate in known.estimates:
        if estimate.name in columns:
            assert estimate.standard_error is not None
            # 400 draws are good to 4/√800 of a standard error
            assert columns[estimate.name].std() == pytest.approx(estimate.standard_error, rel=0.15)
            assert columns[estimate.name].mean() == pytest.approx(
                estimate.value, abs=0.25 * estimate.standard_error
            )
    stop = columns["Z13_plus"]  # drawn as it was stated, and the pump follows it
    assert stop.std() == pytest.approx(8e-5 * result.drive["Z13"].value.plus, rel=0.15)
    assert np.corrcoef(columns["Z10"], stop)[0, 1] < -0.5
    # errors go together as they are quoted
    names = ["J_plus", "J_minus", "G1_plus", "G1_minus", "Z10"]
    places = [known.own.variables.index(name) for name in names]
    quoted = known.quoted.correlation[np.ix_(places, places)]
    drawn_correlations = np.corrcoef([columns[name] for name in names])
    np.testing.assert_allclose(drawn_correlations, quoted, atol=0.12)
    # more than 400 draws would show by chance
    assert np.abs(quoted[-1, :-1]).max() > 0.25


@pytest.mark.slow
def test_the_campaign_may_have_moved(fit_and_folder, tmp_path):
    fitted = fit_and_folder[1]
    content = json.loads((fitted / "fit.json").read_text("utf-8"))
    old = fitted / "virtual" / "campaign.toml"
    assert content["campaign"] == "virtual/campaign.toml"
    content["campaign"] = "elsewhere.toml"
    (tmp_path / "fit.json").write_text(json.dumps(content), "utf-8")
    with pytest.raises(FileNotFoundError, match=r"elsewhere\.toml"):
        stored_draws(tmp_path)
    drawn = stored_draws(tmp_path, campaign=old, draws=2)
    assert len(drawn.drives) == 2
    with pytest.raises(InputError, match="another drive .* differ"):
        stored_draws(tmp_path, campaign=old, drive=Drive.preset("luff"))
    with pytest.raises(FileNotFoundError, match="fit.json in .*virtual: .* folder"):
        stored_draws(tmp_path / "virtual")
    (tmp_path / "fit.json").write_text("{}", "utf-8")
    with pytest.raises(ParameterError, match="fit.json: .* entry"):
        stored_draws(tmp_path)
