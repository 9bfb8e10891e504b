"""Which further test would tell most."""

import numpy as np
import pytest

from swashplate.errors import InputError
from swashplate.identification.experiment_design import Candidate, advise
from swashplate.identification.unknowns import Unknowns

AB = Unknowns.of("ab", np.ones(2))


def diagonal(*errors: float) -> np.ndarray:
    """Rows that leave standard errors as given."""
    return np.diag([0.0 if np.isinf(each) else 1.0 / each for each in errors])


def test_gains_by_hand() -> None:
    """Errors 0.1 and 0.2; a candidate that alone would give a an error of 0.1."""
    (found,) = advise(diagonal(0.1, 0.2), [Candidate("step", diagonal(0.1, np.inf))], AB)
    a, b = found.gains
    assert (a.before, a.after) == pytest.approx((0.1, 0.1 / np.sqrt(2.0)))
    assert (b.before, b.after) == pytest.approx((0.2, 0.2))
    # information doubles along one of two directions: 2^(1/4) on the mean error
    assert found.d_gain == pytest.approx(2.0**0.25)
    assert found.best is not None
    assert found.best.name == "a"
    assert "tell most of a: its standard error would shrink to 71 %" in found.sentence
    assert "1.19 times better" in found.sentence


def test_what_was_unknown_comes_first() -> None:
    present = diagonal(0.1, np.inf)
    found = advise(
        present,
        [
            Candidate("more of the same", diagonal(0.001, np.inf)),
            Candidate("new", diagonal(9, 0.5)),
        ],
        AB,
    )
    assert [each.candidate for each in found] == ["new", "more of the same"]
    assert found[0].newly_determined == ("b",)
    assert found[0].ranks == 1
    assert found[0].gains[1].before == np.inf
    assert found[0].gains[1].after == pytest.approx(0.5)
    assert "first to determine b" in found[0].sentence


def test_an_error_above_100_per_cent_is_not_determined() -> None:
    (found,) = advise(diagonal(0.1, np.inf), [Candidate("weak", diagonal(np.inf, 3.0))], AB)
    assert found.ranks == 1
    assert found.newly_determined == ()
    assert found.sentence == "weak would tell next to nothing new."


def test_a_candidate_that_mixes_known_and_unknown_tells_of_the_unknown_alone() -> None:
    """It measures a + b: b becomes known as well as a, a no better than before."""
    (found,) = advise(diagonal(0.1, np.inf), [Candidate("sum", np.array([[1e3, 1e3]]))], AB)
    assert found.newly_determined == ("b",)
    assert found.gains[0].after == pytest.approx(0.1)
    assert found.gains[1].after == pytest.approx(0.1, rel=1e-3)
    assert found.d_gain == pytest.approx(1.0)


def test_the_order_is_that_of_determinants_computed_apart() -> None:
    rng = np.random.default_rng(8)
    variables = Unknowns.of("abcd", np.ones(4))
    present = rng.normal(size=(30, 4))
    candidates = [Candidate(f"c{k}", rng.normal(size=(20, 4)) * (k + 1)) for k in range(5)]
    gains = {
        each.name: np.linalg.slogdet(
            np.eye(4) + np.linalg.solve(present.T @ present, each.derivatives.T @ each.derivatives)
        )[1]
        for each in candidates
    }
    found = advise(present, candidates, variables)
    assert [each.candidate for each in found] == sorted(gains, key=lambda name: -gains[name])
    for each in found:
        assert np.log(each.d_gain) * 8.0 == pytest.approx(gains[each.candidate])


def test_from_nothing() -> None:
    (found,) = advise(np.zeros((0, 2)), [Candidate("first", diagonal(0.1, 0.2))], AB)
    assert found.newly_determined == ("a", "b")
    assert found.sentence == "first would be the first to determine a, b."


def test_an_unknown_at_its_bound_counts_as_known() -> None:
    variables = Unknowns.of("ab", np.ones(2), at_bound=[1, 0])
    (found,) = advise(np.zeros((0, 2)), [Candidate("sum", np.array([[1.0, 4.0]]))], variables)
    assert [gain.name for gain in found.gains] == ["b"]
    assert found.gains[0].after == pytest.approx(0.25)


def test_a_candidate_that_moves_nothing() -> None:
    (found,) = advise(diagonal(0.1, 0.1), [Candidate("rest", np.zeros((5, 2)))], AB)
    assert found.sentence == "rest would tell next to nothing new."
    assert found.d_gain == 1.0


@pytest.mark.parametrize(
    ("candidates", "said"),
    [
        ([], "no candidate"),
        ([Candidate("c", np.ones((2, 3)))], "c: 2 unknowns need as many columns"),
        ([Candidate("c", np.full((2, 2), np.nan))], "c: the derivatives must be finite"),
    ],
)
def test_wrong_candidates_are_refused(candidates: list, said: str) -> None:
    with pytest.raises(InputError, match=said):
        advise(np.eye(2), candidates, AB)
