"""Verdicts on what tests can tell."""

import numpy as np
import pytest

from swashplate import Drive
from swashplate.errors import InputError
from swashplate.identification.identifiability import Identifiability, identifiability
from swashplate.identification.unknowns import Unknowns
from swashplate.maneuvers import sine, step

RNG = np.random.default_rng(4)
PUMP = [f"Z{k}" for k in range(1, 23)]


def columns(*null: tuple[float, ...], rows: int = 50) -> np.ndarray:
    """Derivatives that vanish along given directions."""
    count = len(null[0])
    basis = np.linalg.qr(np.array(null).T, mode="complete")[0][:, len(null) :]
    return RNG.normal(size=(rows, count - len(null))) @ basis.T


def judged(derivatives: np.ndarray, names: str | list[str], **more: object) -> Identifiability:
    return identifiability(derivatives, Unknowns.of(list(names), np.ones(len(names))), **more)


@pytest.fixture(scope="module")
def hoist_columns() -> tuple[list[str], np.ndarray, np.ndarray]:
    drive = Drive.preset("hoist")
    voltages = [step(9.0), step(-6.5), sine(9.0, 0.1, length=20.0)]
    found = [drive.sensitivities(each.sample(128.0), 128.0, parameters=PUMP) for each in voltages]
    names = list(found[0].names)
    values = np.array([drive.parameters.numbers[name] for name in names])
    return names, values, np.vstack([each.shaft_speed for each in found])


def hoist(parts: tuple, leave: set[str], **more: object) -> Identifiability:
    names, values, derivatives = parts
    kept = [k for k, name in enumerate(names) if name not in leave]
    scales = np.where(values == 0.0, 1.0, np.abs(values))[kept]
    variables = Unknowns.of([names[k] for k in kept], values[kept], scales=scales)
    return identifiability(derivatives[:, kept] * scales, variables, **more)


def test_a_full_set_is_called_so() -> None:
    found = judged(RNG.normal(size=(50, 3)), "abc")
    assert found.complete
    assert found.rank == 3
    assert found.to_hold == ()
    assert found.sentences()[0].startswith("The tests determine all 3 free unknowns")


def test_sensitivities_are_per_cent() -> None:
    found = judged(np.array([[3.0, 0.0], [4.0, 2.0]]), "ab")
    np.testing.assert_allclose(found.sensitivity, [0.05, 0.02])


def test_the_triangle_says_the_same_as_the_derivatives() -> None:
    derivatives = columns((1.0, -1.0, 0.0, 0.5))
    whole = judged(derivatives, "abcd")
    reduced = judged(np.linalg.qr(derivatives, mode="r"), "abcd")
    np.testing.assert_allclose(whole.singular_values[:3], reduced.singular_values[:3], rtol=1e-10)
    assert whole.sentences()[1] == reduced.sentences()[1]


def test_a_null_direction_is_written_by_name() -> None:
    found = judged(columns((0.0, -0.7, 0.0, 0.7)), ["Z1", "Z3", "Z8", "Z9"])
    (direction,) = found.null
    assert direction.changes["Z3"] == pytest.approx(-direction.changes["Z9"])
    assert set(direction.changes) == {"Z3", "Z9"}
    assert "together change nothing. Hold Z" in direction.sentence
    assert direction.gauge is None
    assert found.rank == 3


def test_two_null_directions_come_apart() -> None:
    """Any mixture of two null directions is null too: the sparse ones are wanted."""
    found = judged(columns((1.0, 1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0, -2.0)), "abcde")
    assert {frozenset(each.changes) for each in found.null} == {
        frozenset("ab"),
        frozenset("de"),
    }
    assert len({each.hold for each in found.null}) == 2


def test_holding_what_is_offered_determines_the_rest() -> None:
    derivatives = columns((1.0, 1.0, 1.0, 0.0), (0.0, 1.0, 2.0, 0.5))
    found = judged(derivatives, "abcd")
    kept = [k for k, name in enumerate("abcd") if name not in found.to_hold]
    again = judged(derivatives[:, kept], [*"abcd"][: len(kept)])
    assert again.complete
    assert len(kept) == 2


def test_an_unexcited_unknown_is_named() -> None:
    derivatives = RNG.normal(size=(20, 3))
    derivatives[:, 1] = 0.0
    found = judged(derivatives, ["Z13", "Z14", "Z15"])
    assert found.unexcited == ("Z14",)
    assert found.to_hold == ("Z14",)
    assert "No test exercises Z14: hold it, or add a test that does." in found.sentences()


def test_nothing_at_all_is_a_verdict() -> None:
    found = judged(np.zeros((5, 2)), "ab")
    assert found.rank == 0
    assert found.sentences()[0] == "The tests determine none of the unknowns."


def test_all_at_bounds_is_a_verdict() -> None:
    variables = Unknowns.of("ab", np.ones(2), at_bound=[1, -1])
    found = identifiability(RNG.normal(size=(5, 2)), variables)
    assert found.sentences()[0].startswith("All unknowns stand at a bound")


def test_one_sample_is_a_verdict() -> None:
    found = judged(np.array([[1.0, 2.0, 3.0]]), "abc")
    assert found.rank == 1
    assert len(found.null) == 2
    assert found.sentences()[0].startswith("The tests determine 1 combination of 3 free unknowns")


def test_a_faint_direction_and_a_correlation() -> None:
    base = RNG.normal(size=(100, 3))
    base[:, 1] = base[:, 0] + 1e-5 * base[:, 1]
    found = judged(base, "abc")
    assert found.complete
    (direction,) = found.faint
    assert direction.hold in "ab"
    assert set(direction.changes) == {"a", "b"}
    assert 1e-6 < direction.sharpness < 1e-4
    assert "times less than the clearest direction" in direction.sentence


def test_correlations_are_listed_strongest_first() -> None:
    base = RNG.normal(size=(1000, 3))
    base[:, 1] = base[:, 0] + 0.1 * base[:, 1]
    found = judged(base, "abc")
    # two regressors with correlation ρ give estimates with correlation -ρ: -1/√1.01
    (pair,) = found.correlated
    assert (pair.first, pair.second) == ("a", "b")
    assert pair.correlation == pytest.approx(-0.995, abs=0.002)
    assert "Strongly correlated estimates: a and b -0.99" in found.sentences()[-1]


def test_correlations_of_a_given_covariance() -> None:
    given = np.array([[4.0, 1.98], [1.98, 1.0]])
    found = judged(RNG.normal(size=(10, 2)), "ab", covariance=given)
    assert found.correlated[0].correlation == pytest.approx(0.99)


def test_an_unknown_at_its_bound_is_flagged_and_held() -> None:
    variables = Unknowns.of(["Z17", "Z18"], [0.25, 1.0], at_bound=[-1, 0])
    found = identifiability(np.ones((5, 2)), variables)
    assert found.at_bounds == {"Z17": "lower"}
    assert found.complete  # the two columns are alike, but one is held
    assert any("Z17 = 0.25 stands at its lower bound" in each for each in found.sentences())


def test_the_gauges_of_the_hoist(hoist_columns: tuple) -> None:
    found = hoist(hoist_columns, set())
    assert found.unexcited == ("Z14", "Z15")
    names = [each.gauge.name for each in found.null if each.gauge]
    assert names == [
        "scale of pressure",
        "zero of pressure",
        "scale of spool travel",
        "scale of force",
    ]
    assert len(found.null) == 4
    assert found.to_hold == ("Z14", "Z15", "Z1", "Z2", "Z5", "Z4")
    said = found.sentences()
    assert any("Z8/(1+Z6) is determined; hold one of them only if you" in each for each in said)


def test_a_held_member_ends_a_gauge(hoist_columns: tuple) -> None:
    """With Z8 and Z5 held the pressure's scale and the spool's are gone, the force's is not."""
    found = hoist(hoist_columns, {"Z14", "Z15", "Z2", "Z7", "Z11", "Z12", "Z8", "Z5"})
    assert [each.hold for each in found.null] == ["Z4"]


def test_two_gauges_tied_by_a_held_member_are_one_direction(hoist_columns: tuple) -> None:
    """With Z8 held, pressure and spool travel can only scale together."""
    found = hoist(hoist_columns, {"Z14", "Z15", "Z2", "Z7", "Z11", "Z12", "Z8", "Z4"})
    (direction,) = [each for each in found.null if each.gauge is None]
    assert {"Z1", "Z5", "Z9", "Z16_plus", "Z16_minus", "Z18"} <= set(direction.changes)
    assert direction.changes["Z1"] / direction.changes["Z5"] == pytest.approx(-2.0, rel=1e-6)


def test_the_default_set_without_gauges_is_complete(hoist_columns: tuple) -> None:
    gone = {"Z14", "Z15", "Z1", "Z2", "Z4", "Z5", "Z6"}
    assert hoist(hoist_columns, gone).complete


@pytest.mark.parametrize(
    ("derivatives", "said"),
    [
        (np.ones((3, 3)), "2 unknowns need as many columns"),
        (np.array([[1.0, np.nan]]), "derivatives by b are not all finite"),
    ],
)
def test_wrong_derivatives_are_refused(derivatives: np.ndarray, said: str) -> None:
    with pytest.raises(InputError, match=said):
        judged(derivatives, "ab")
