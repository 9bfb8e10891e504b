"""The pages on theory: what is said to be checked is, and every erratum has a test."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
THEORY = ROOT / "docs" / "theory"
EQUATIONS = {
    f"{chapter}.{number}"
    for chapter, first, last in ((3, 1, 9), (4, 10, 10), (6, 11, 74), (7, 1, 14), (8, 1, 13))
    for number in range(first, last + 1)
}
"""Every number that Kruse (2001) gives to an equation of chapters 3 to 9."""
TESTS = [
    name
    for path in (ROOT / "tests" / "thesis").glob("test_*.py")
    for name in re.findall(r'(?:def test_|")((?:eq|erratum)_\w+)', path.read_text("utf-8"))
]
"""Names of tests, and of rows of the tables of tests, that say which statements they check."""


def equations_of(test: str) -> set[str]:
    """Numbers of the equations that a name speaks of."""
    found: set[str] = set()
    last = 0
    for word, chapter, number in re.findall(r"(?<![a-z])(eq|to|and|from)_(\d)_(\d+)", test):
        first = last if word == "to" else int(number)
        found |= {f"{chapter}.{k}" for k in range(first, int(number) + 1)}
        last = int(number)
    return found


def test_every_equation_has_a_test() -> None:
    assert set().union(*map(equations_of, TESTS)) == EQUATIONS


def test_every_erratum_has_its_row_and_a_test() -> None:
    rows = re.findall(r"^\| (\d+) \|", (THEORY / "errata.md").read_text("utf-8"), re.MULTILINE)
    assert list(map(int, rows)) == list(range(1, 34))
    tested = {int(each) for name in TESTS for each in re.findall(r"erratum_(\d\d)", name)}
    assert tested == set(range(1, 34))


def test_the_index_links_every_page() -> None:
    index = (THEORY / "index.md").read_text("utf-8")
    for path in THEORY.glob("*.md"):
        assert path.stem == "index" or f"({path.name})" in index
