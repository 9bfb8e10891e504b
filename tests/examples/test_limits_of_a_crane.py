"""examples/limits_of_a_crane.py prints what its page shows, of a set of one's own too."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from swashplate import Drive


@pytest.fixture(scope="module")
def run(run_example: Callable[..., Any]) -> Any:
    return run_example("limits_of_a_crane", "--figure", "limits.png")


def numbers(line: str) -> list[float]:
    return [float(each) for each in re.findall(r"-?\d+\.?\d*", line)]


def test_the_page(run: Any, matches_page: Callable[[str, str], None]) -> None:
    matches_page("limits_of_a_crane", run.printed)


def test_a_set_of_one_s_own(run_example: Callable[..., Any], tmp_path: Path) -> None:
    Drive.preset("slew").to_toml(tmp_path / "mine.toml")
    printed = run_example("limits_of_a_crane", str(tmp_path / "mine.toml")).printed
    assert numbers(printed.splitlines()[0])[1:4] == [5.3, 4.2, 5.8]
    assert "swash stop" in printed
