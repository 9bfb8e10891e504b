"""What earlier stages do not know and fixed parameters may be off by, in later intervals."""

import numpy as np
import pytest
from tests.identification.given import unknowns_of, virtual
from tests.identification.test_own_model import NOISE, RANGES, RUNS, servo

from swashplate import Campaign, Drive, ParameterError
from swashplate.identification import ModelSetup, fit
from swashplate.identification.intervals import Handed, with_handed
from swashplate.identification.lack_of_fit import lack_of_fit
from swashplate.identification.noise import Covariance
from swashplate.identification.setup import Setup, load_setup, setup_text
from swashplate.maneuvers import source_tests

DOUBTS = {"Z9": "3 %", "tau": 1e-3}
ONE = {"lag": RANGES["lag"], "start.place": RANGES["start.place"]}


def stated(**doubts: float | str) -> Setup:
    return load_setup("hoist").model_copy(update={"standard_uncertainty": doubts})


@pytest.fixture(scope="module")
def campaign(tmp_path_factory: pytest.TempPathFactory) -> Campaign:
    tests = source_tests("hoist")
    names = ("step +4 V", "step -4 V", "step +9 V", "step -9 V", "sine 9 V 0.1 Hz")
    chosen = {name: tests[name] for name in names}
    return virtual(tmp_path_factory.mktemp("t"), "hoist", chosen, seed=3, perturb=0.05)


@pytest.mark.slow
@pytest.mark.parametrize(("number", "name", "deviation"), [(0, "Z9", 0.03), (1, "tau", 1e-3)])
def test_estimates_follow_a_fixed_number_as_in_a_fit_with_another(
    campaign: Campaign, number: int, name: str, deviation: float
) -> None:
    """Of both stages: tau acts on the pump's by itself and through the card's estimates."""
    published = Drive.preset("hoist")
    found = fit(published, campaign, stated(**DOUBTS)).stages
    value = published.parameters.numbers[name]
    deviation *= value if name == "Z9" else 1.0
    step, ends = 0.05 * deviation, []
    for sign in (1.0, -1.0):
        moved = published.replace(**{name: value + sign * step})
        stages = fit(moved, campaign, load_setup("hoist")).stages
        ends.append([stage.solution.vector for stage in stages])
    for k, each in enumerate(found):
        told = each.uncertainty.own.determined
        expected = ((ends[0][k] - ends[1][k]) * (deviation / (2.0 * step)))[told]
        changes = each.uncertainty.fixed[told, number]
        # Gauss and Newton leave out the residuals' curvature, which moves weak unknowns by parts of
        # their own standard error
        errors = each.uncertainty.own.standard_errors[told]
        assert (np.abs(changes - expected) < 0.1 * np.abs(expected) + 0.5 * errors).all()
        if k == 1:
            assert (np.abs(changes) > 3.0 * errors).sum() >= 2
            assert (each.uncertainty.quoted.standard_errors[told] >= errors).all()
            assert any("earlier stages" in words for words in each.uncertainty.sentences())


def test_what_is_added_to_a_model_of_ones_own_is_that_of_other_fits() -> None:
    bare, doubted = (
        fit(ModelSetup(servo, ONE, noise=NOISE, fixed={"gain": 1.5}, **more), RUNS).stages[0]
        for more in ({}, {"standard_uncertainty": {"gain": "4 %"}})
    )
    up, down = (
        fit(ModelSetup(servo, ONE, noise=NOISE, fixed={"gain": gain}), RUNS).stages[0]
        for gain in (1.506, 1.494)
    )
    (plain, *_), (wide, *_) = bare.uncertainty.estimates, doubted.uncertainty.estimates
    # 4 % of the gain are ten times the change that was tried
    added = 10.0 * (up.values["lag"] - down.values["lag"]) / 2.0
    assert wide.value == plain.value
    assert wide.standard_error**2 == pytest.approx(plain.standard_error**2 + added**2, rel=0.05)
    assert wide.standard_error > 2.0 * plain.standard_error
    (sentence,) = (s for s in doubted.uncertainty.sentences() if "standard uncertainty" in s)
    assert "widens them by a factor of" in sentence


def test_residuals_within_the_doubt_are_no_lack_of_fit() -> None:
    """Runs of a gain of 1.5, fitted with one of 1.54: explained by 4 %, not by 0.01 %."""

    def ratio(**more: dict[str, float | str]) -> float:
        setup = ModelSetup(servo, ONE, noise=NOISE, fixed={"gain": 1.54}, **more)
        return lack_of_fit(fit(setup, RUNS).stages).ratios["place"]

    assert ratio() > 1.2
    assert ratio(standard_uncertainty={"gain": "0.01 %"}) > 1.2
    assert ratio(standard_uncertainty={"gain": "4 %"}) < 1.1


@pytest.mark.parametrize(
    ("name", "doubt", "words"),
    [
        ("Z16_plus", "5 %", "Z16_plus is free in the stage 'pump'"),
        ("Z20", 0.1, "Z20 is free in the stage 'pump'"),
        ("Z9", "5", "standard_uncertainty.Z9"),
        ("Z9", -1.0, "standard_uncertainty.Z9"),
    ],
)
def test_it_is_written_and_read_and_refused_where_it_is_wrong(tmp_path, name, doubt, words) -> None:
    path = tmp_path / "own.toml"
    path.write_text(setup_text(stated(**DOUBTS)), "utf-8")
    assert load_setup(path).standard_uncertainty == DOUBTS
    said = f'"{doubt}"' if isinstance(doubt, str) else doubt
    text = f"standard_uncertainty = {{ {name} = {said} }}\n" + setup_text(load_setup("hoist"))
    path.write_text(text, "utf-8")
    with pytest.raises(ParameterError, match=words):
        load_setup(path)


# --- earlier stages -------------------------------------------------------------------------------


def test_variances_add_up_and_so_do_degrees_of_freedom() -> None:
    """By hand: 4 + (0.5² 9 + 1² 1) = 7.25, each part with 8 degrees of freedom."""
    known = np.ones(1, dtype=bool)
    own = Covariance(unknowns_of(["p"], [1.0]), np.array([[4.0]]), known, np.array([8.0]))
    earlier = Covariance(
        unknowns_of(["a", "b"], [1.0, 1.0]),
        np.diag([9.0, 1.0]),
        np.ones(2, dtype=bool),
        np.array([8.0, 8.0]),
    )
    both = with_handed(own, [Handed(earlier, np.array([[0.5, 1.0]]))])
    assert both.matrix[0, 0] == pytest.approx(7.25)
    spread = (4.0**2 + 2.25**2 + 1.0**2) / 8.0
    assert both.degrees_of_freedom[0] == pytest.approx(7.25**2 / spread)
    assert with_handed(own, []) is own
