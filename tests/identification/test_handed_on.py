"""What the card's stage does not know, carried into the pump's."""

from dataclasses import replace

import numpy as np
import pytest
from tests.identification.linear import unknowns_of

from swashplate import Drive
from swashplate.campaign import rig
from swashplate.campaign.campaign import Campaign
from swashplate.identification.assessment import assess
from swashplate.identification.drive_model import stage_problem
from swashplate.identification.fitting import Fit, fit
from swashplate.identification.intervals import Handed, slopes_by_earlier, with_handed
from swashplate.identification.noise import Covariance
from swashplate.identification.setup import load_setup
from swashplate.identification.solving import solve
from swashplate.maneuvers import source_tests


@pytest.fixture(scope="module")
def staged(tmp_path_factory: pytest.TempPathFactory) -> tuple[Campaign, Fit]:
    """A hoist from the tests that excite most."""
    names = ("step +4 V", "step -4 V", "step +9 V", "step -9 V", "sine 9 V 0.1 Hz")
    tests = source_tests("hoist")
    virtual = rig.run("hoist", {name: tests[name] for name in names}, seed=3, perturb=0.05)
    campaign = Campaign.from_toml(rig.write(virtual, tmp_path_factory.mktemp("t") / "virtual"))
    return campaign, fit(
        Drive.preset("hoist").parameters, campaign.experiments, load_setup("hoist")
    )


@pytest.mark.parametrize("name", ["J_plus", "omega_minus", "lim2_plus"])
def test_slopes_are_those_of_fitting_again(staged: tuple[Campaign, Fit], name: str) -> None:
    """Move an estimate of the card, fit the pump again, and see how far it follows."""
    campaign, result = staged
    card, pump = assess(result.stages)
    slopes = slopes_by_earlier(pump.stage, card.stage, pump.linearised)
    assert slopes is not None
    unknowns, vector = card.stage.problem.unknowns, card.stage.solution.vector
    index = unknowns.names.index(name)
    step, ends = 3e-4, []
    for sign in (1.0, -1.0):
        moved = vector.copy()
        moved[index] += sign * step
        parameters = card.stage.problem.model.parameters_at(unknowns.targets(moved, ""))
        again = stage_problem(pump.stage.stage, parameters, campaign.experiments)
        ends.append(solve(again, pump.stage.solution.vector).vector)
    told = pump.linearised.determined
    expected = ((ends[0] - ends[1]) / (2.0 * step))[told]
    # Gauss and Newton leave out the residuals' curvature: some per cent of the larger slopes
    np.testing.assert_allclose(
        slopes[told, index], expected, rtol=0.1, atol=0.05 * np.abs(expected).max()
    )


def test_a_measured_current_hands_nothing_on(staged: tuple[Campaign, Fit]) -> None:
    card, pump = assess(staged[1].stages)
    measured = replace(
        pump.stage, stage=pump.stage.stage.model_copy(update={"current": "measured"})
    )
    assert slopes_by_earlier(measured, card.stage, pump.linearised) is None
    assert slopes_by_earlier(card.stage, pump.stage, card.linearised) is None


def test_quoted_intervals_take_it_in(staged: tuple[Campaign, Fit]) -> None:
    _, pump = assess(staged[1].stages)
    found = pump.uncertainty
    told = found.own.determined
    assert (found.quoted.standard_errors[told] >= found.own.standard_errors[told]).all()
    assert any("the uncertainty of earlier stages" in each for each in found.sentences())


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
