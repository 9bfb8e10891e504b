"""The pages on theory: links lead somewhere, named tests and code exist, nothing is left out."""

import ast
import importlib
import re
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
THEORY = ROOT / "docs" / "theory"
PAGES = sorted(THEORY.glob("*.md"))
CHECKED = (THEORY / "checked.md").read_text("utf-8")
ERRATA = (THEORY / "errata.md").read_text("utf-8")

EQUATIONS = [
    *(f"3.{n}" for n in range(1, 10)),
    "4.10",
    *(f"6.{n}" for n in range(11, 75)),
    *(f"7.{n}" for n in range(1, 15)),
    *(f"8.{n}" for n in range(1, 14)),
]
"""Every number that the source gives to an equation of chapters 3 to 9."""
TABLES = ["4.1", "4.2", "4.3", "4.4", "4.5", "4.6", "6.1", *(f"7.{n}" for n in range(1, 7))]
TABLES += ["8.1", "8.2", "8.3"]

page = pytest.mark.parametrize("path", PAGES, ids=lambda path: path.stem)


def cited_tests(text: str) -> list[tuple[Path, str]]:
    """Tests that a page names: file and function; without a folder they are in tests/thesis."""
    found = re.findall(r"`([\w/]*?)(test_\w+\.py)::(test_\w+)`", text)
    return [(ROOT / (folder or "tests/thesis/") / file, name) for folder, file, name in found]


@cache
def functions_of(path: Path) -> frozenset[str]:
    tree = ast.parse(path.read_text("utf-8"))
    return frozenset(each.name for each in tree.body if isinstance(each, ast.FunctionDef))


def rows(text: str) -> list[list[str]]:
    """Cells of all tables of a page, headings and rules left out."""
    lines = [each for each in text.splitlines() if each.startswith("| ")]
    cells = [[cell.strip() for cell in re.split(r"(?<!\\)\|", each)[1:-1]] for each in lines]
    return [each for each in cells if each[0] not in ("source", "no.")]


def expanded(cell: str) -> set[str]:
    """Numbers of tables such as "4.1 to 4.4"; a plain number stands for itself."""
    found = set(re.findall(r"\d\.\d+", cell))
    for first, last in re.findall(r"(\d\.\d+) to (\d\.\d+)", cell):
        chapter = first.split(".")[0]
        low, high = int(first.split(".")[1]), int(last.split(".")[1])
        found |= {f"{chapter}.{n}" for n in range(low, high + 1)}
    return found


@page
def test_links_lead_somewhere(path: Path) -> None:
    links = re.findall(r"\]\(([^)#]+)(#[^)]*)?\)", path.read_text("utf-8"))
    for target, _ in links:
        assert (path.parent / target).resolve().exists(), target


@page
def test_named_tests_exist(path: Path) -> None:
    for file, name in cited_tests(path.read_text("utf-8")):
        assert file.exists(), file
        assert name in functions_of(file), f"{file.name}::{name}"


@page
def test_named_code_exists(path: Path) -> None:
    for dotted in set(re.findall(r"`(swashplate(?:\.\w+)+)`", path.read_text("utf-8"))):
        parts = dotted.split(".")
        try:
            importlib.import_module(dotted)
        except ModuleNotFoundError:
            module = importlib.import_module(".".join(parts[:-1]))
            assert hasattr(module, parts[-1]), dotted


@page
def test_page_ends_with_where_it_lives_and_a_test(path: Path) -> None:
    text = path.read_text("utf-8")
    last = text.rsplit("\n## ", 1)[1]
    assert last.startswith("Where it lives")
    assert cited_tests(last)
    assert text.startswith("# ")


@page
def test_mathematics_is_closed(path: Path) -> None:
    text = re.sub(r"```.*?```|`[^`]*`", "", path.read_text("utf-8"), flags=re.DOTALL)
    blocks = text.split("$$")
    assert len(blocks) % 2 == 1
    for block in blocks[1::2]:
        assert block.count("{") == block.count("}")
        assert re.findall(r"\\begin\{(\w+)\}", block) == re.findall(r"\\end\{(\w+)\}", block)
    for paragraph in "\n\n".join(blocks[::2]).split("\n\n"):
        assert paragraph.count("$") % 2 == 0, paragraph


@page
def test_the_python_prints_what_the_page_says(
    path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = path.read_text("utf-8")
    names: dict[str, object] = {}
    for block, printed in re.findall(
        r"```python\n(.*?)```\n(?:\n```text\n(.*?)```)?", text, re.DOTALL
    ):
        exec(compile(block, path.name, "exec"), names)
        assert capsys.readouterr().out == printed


def test_the_index_links_every_page() -> None:
    index = (THEORY / "index.md").read_text("utf-8")
    for path in PAGES:
        assert path.stem == "index" or f"({path.name})" in index


def test_every_equation_stands_on_the_page_of_checks() -> None:
    cells = [each[0] for each in rows(CHECKED)]
    equations = {
        number
        for cell in cells
        if not re.match(r"(tables?|figures?|sections?|chapter) ", cell)
        for number in re.findall(r"\d\.\d+", re.sub(r"tables? .*", "", cell))
    }
    assert equations == set(EQUATIONS)
    tables = set()
    for cell in cells:
        named = re.search(r"tables? (.*)", cell)
        tables |= expanded(named.group(1)) if named else set()
    assert tables == {*TABLES, "1.1"}


def test_every_row_of_the_page_of_checks_has_a_test_or_a_reason() -> None:
    for source, _, by in rows(CHECKED):
        assert cited_tests(by) or by.startswith(("cannot be:", "not checked:")), source


def test_every_test_of_the_source_stands_on_a_page() -> None:
    cited = set(cited_tests(CHECKED + ERRATA))
    for path in (ROOT / "tests" / "thesis").glob("test_*.py"):
        for name in functions_of(path):
            assert not name.startswith("test_") or (path, name) in cited, f"{path.name}::{name}"


def test_every_erratum_has_its_row_and_a_test() -> None:
    assert [int(each[0]) for each in rows(ERRATA)] == list(range(1, 34))
    shown = dict(re.findall(r"^- \*\*(\d+):\*\* (.*?)$(?=\n(?:- |\n|\Z))", ERRATA, re.M | re.S))
    assert [int(each) for each in shown] == list(range(1, 34))
    for number, by in shown.items():
        names = [name for _, name in cited_tests(by)]
        assert any(f"erratum_{int(number):02d}" in name for name in names), number
