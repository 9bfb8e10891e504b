"""What a person sees while waiting."""

import pytest

from swashplate.cli.terminal import long_work, waiting
from swashplate.tables import count


@pytest.mark.parametrize(
    ("seconds", "words"),
    [(None, ""), (0.4, "about 0 s left"), (12.0, "about 12 s left"), (600.0, "about 10 min left")],
)
def test_time_left_in_words(seconds: float | None, words: str) -> None:
    assert waiting(seconds) == words


def test_an_upper_bound_is_called_one() -> None:
    assert waiting(30.0, "at most") == "at most 30 s left"


def test_what_is_count() -> None:
    assert [count(number, "finding", "findings") for number in (0, 1, 2)] == [
        "0 findings",
        "1 finding",
        "2 findings",
    ]


def test_a_pipe_gets_no_bar(capsys: pytest.CaptureFixture[str]) -> None:
    with long_work("Fitting") as shown:
        shown("card: iteration 3, cost 12", 0.5, "about 2 s left")
    assert capsys.readouterr() == ("", "")
