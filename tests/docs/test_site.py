"""The documentation builds without a warning, and leaves out nothing that it should have."""

import ast
import importlib
import os
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterable
from inspect import ismodule
from pathlib import Path
from types import ModuleType

import pytest
import typer.main

import swashplate
from swashplate import Limit
from swashplate.analysis import DESIGN_VARIABLES, OUTCOMES
from swashplate.campaign import CHANNEL_KINDS
from swashplate.cli import app
from swashplate.drive import SIGNALS
from swashplate.logs import SUFFIXES
from swashplate.parameters import CATALOGUE, REFINEMENTS

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
PAGES = [ROOT / "README.md", *DOCS.glob("*.md"), *DOCS.glob("*/*.md")]
OBJECTS = [
    name
    for page in tomllib.loads((DOCS / "api.toml").read_text("utf-8"))["page"]
    for name in page["objects"]
]
KEYS = {
    "campaign-file": "counts_per_turn",
    "parameter-file": "pump_motor",
    "fit-setup-file": "tied",
}


@pytest.fixture
def scripts(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """The importer of docs/generate.py and docs/figures.py."""
    monkeypatch.syspath_prepend(str(DOCS))
    return importlib


def test_the_site_builds(tmp_path: Path) -> None:
    """A broken link, a page that none leads to, a wrong docstring: each is a warning, and fails.

    In a plain theme: that of the site draws all pages' tree on each page, half of the time.
    """
    options = ["-q", "-W", "--keep-going", "-b", "html", "-D", "html_theme=basic"]
    done = subprocess.run(
        [sys.executable, "-m", "sphinx", *options, DOCS, tmp_path],
        env={**os.environ, "PYTHONWARNINGS": "default"},  # what Sphinx's parts warn themselves of
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    theory = (tmp_path / "theory" / "motor.html").read_text("utf-8")
    # equations need no network
    (script,) = set(re.findall(r'src="([^"]*mathjax[^"?]*)', theory))
    assert not script.startswith("http")
    assert (tmp_path / "theory" / script).resolve().exists()
    page = (tmp_path / "generated" / "command-line.html").read_text("utf-8")
    for name in typer.main.get_command(app).commands:
        assert f'id="swashplate-{name}' in page, name
    for name, key in KEYS.items():
        assert f">{key}<" in (tmp_path / "generated" / f"{name}.html").read_text("utf-8")
    pages = sorted(tmp_path.rglob("*.html"))
    assert len(pages) > 80
    for path in pages:
        assert left_raw(path.read_text("utf-8")) == [], path
    page = (tmp_path / "how-to" / "export.html").read_text("utf-8")
    assert re.search(r'href="[^"]*api-drive.html#swashplate.Drive.stepper"[^>]*><code', page)


def left_raw(html: str) -> list[str]:
    """Paragraphs with markup that was not turned into what it stands for."""
    prose = re.sub(r"<(pre|code|script|style)\b.*?</\1>", "code", html, flags=re.DOTALL)
    paragraphs = re.findall(r"<(?:p|h\d)\b[^>]*>(.*?)</(?:p|h\d)>", prose, re.DOTALL)
    raw = re.compile(
        r"^: |^:::|```|\*\*\w[^*\n]*\*\*|\]\(|\{[a-z-]+\}`|^\|.*\|$|^#+ ", re.MULTILINE
    )
    return [text for text in paragraphs if raw.search(text)]


def test_code_that_several_objects_could_be_is_no_link(scripts: ModuleType) -> None:
    links = scripts.import_module("code_links")
    names = ["a.Drive.step", "a.fit", "a.Drive", "b.Model", "c.Model"]
    endings = links.objects_by_ending(tuple((name, None) for name in names))
    assert {ending: name for ending, (name, _) in endings.items()} == {
        "a.Drive.step": "a.Drive.step",
        "Drive.step": "a.Drive.step",
        "a.fit": "a.fit",
        "a.Drive": "a.Drive",
        "Drive": "a.Drive",
        "b.Model": "b.Model",
        "c.Model": "c.Model",
    }


def test_raw_markup_is_seen() -> None:
    rendered = "<p><code>z</code>: <b>bold</b>, **kwargs</p><pre>: kept\n```</pre>"
    assert left_raw(rendered) == []
    for text in ("Inputs\n: voltage", "```text", "**bold**", "[Start](start.md)", "{ref}`x`"):
        assert left_raw(f"<section><p>{text}</p></section>") == [text]


def test_the_reference_has_all_that_the_package_exports() -> None:
    names = (name for name in swashplate.__all__ if not ismodule(getattr(swashplate, name)))
    exported = {f"swashplate.{name}" for name in names}
    assert exported - set(OBJECTS) == {"swashplate.__version__"}
    assert len(OBJECTS) == len(set(OBJECTS))


@pytest.mark.parametrize("module", ["swashplate.maneuvers", "swashplate.report.figures"])
def test_the_reference_has_whole_modules(module: str) -> None:
    found = importlib.import_module(module)
    names = getattr(found, "__all__", vars(found))
    public = {name for name in names if callable(getattr(found, name)) and name[0] != "_"}
    assert public == {
        name.rpartition(".")[2] for name in OBJECTS if name.rpartition(".")[0] == module
    }


def test_the_tables_of_the_nomenclature_are_those_of_the_definitions(scripts: ModuleType) -> None:
    """``python docs/generate.py`` writes them anew."""
    page = (DOCS / "nomenclature.md").read_text("utf-8")
    assert scripts.import_module("generate").nomenclature(page) == page
    for definition in (*CATALOGUE.values(), *REFINEMENTS.values()):
        assert page.count(f"\n| {definition.symbol} | {definition.name} |") == 1


BOTH_WAYS = [name for name in DESIGN_VARIABLES if not name.endswith(("_plus", "_minus"))]


@pytest.mark.parametrize(
    ("page", "names"),
    [
        ("nomenclature.md", [*SIGNALS, *(limit.name for limit in Limit)]),
        ("refinements.md", REFINEMENTS),
        ("what-if.md", [*BOTH_WAYS, *OUTCOMES]),
        ("campaign.md", CHANNEL_KINDS),
    ],
)
def test_a_page_names_all_of_them(page: str, names: Iterable[str]) -> None:
    text = (DOCS / page).read_text("utf-8")
    for name in names:
        assert f"`{name}`" in text, name


def test_every_ending_of_a_log_is_named() -> None:
    text = (DOCS / "campaign.md").read_text("utf-8")
    for suffix in SUFFIXES:
        assert re.search(rf"{re.escape(suffix)}\b", text), suffix


EXAMPLES = (
    r"\.\.\.|[;:,±%()'\"]|\bZ\w+|\bcounts\b|\bstep4\b|\b(?:upper|lower)\b|to ±"
    r"|[-\d.]*\d[-\d.]*(?: (?:s|V|deg/s|times)\b)?"
)
"""What is not the same in each message: numbers with units, and example names."""


def messages_of(package: str) -> list[str]:
    """Texts in a package's code; what is put into them stands as a line's end."""
    return [
        "".join(str(part.value) if isinstance(part, ast.Constant) else "\n" for part in parts)
        for path in (ROOT / "src" / "swashplate" / package).rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text("utf-8")))
        for parts in [node.values if isinstance(node, ast.JoinedStr) else [node]]
        if isinstance(parts[0], (ast.Constant, ast.FormattedValue))
    ]


def test_notes_of_a_fit_are_worded_as_they_are_printed() -> None:
    """What stands between numbers, names and ``...`` in a note is within a message."""
    folders = ("identification", "campaign", "drafting")
    messages = "\n".join(said for folder in folders for said in messages_of(folder))
    page = (DOCS / "how-to" / "fit-notes.md").read_text("utf-8")
    notes = re.findall(r"^\| (?!note|-)(.+?) \|", page, re.MULTILINE)
    assert len(notes) > 20
    for note in notes:
        assert re.match(r"[\w']", note), f"does not begin as on the screen: {note}"
        for piece in filter(None, (each.strip() for each in re.split(EXAMPLES, note))):
            assert piece in messages, (note, piece)


def test_every_figure_can_be_made_again(scripts: ModuleType) -> None:
    figures = scripts.import_module("figures")
    shown = {
        Path(target).name
        for page in PAGES
        if "_build" not in page.parts
        for target in re.findall(r"!\[[^\]]*\]\(([^)]+)\)", page.read_text("utf-8"))
    }
    drawn = {each.name for each in (DOCS / "static").glob("*.svg")}  # by hand
    assert shown == set(figures.FIGURES) | drawn
    assert {each.name for each in figures.IMAGES.iterdir()} == set(figures.FIGURES)


# --- theory: what is said to be checked is, and every erratum has a test --------------------------


THEORY = DOCS / "theory"
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


# --- lists that stand in two places ---------------------------------------------------------------


def table_below(page: str, head: str) -> list[str]:
    """First cells of the table whose first heading is `head`."""
    rows = re.search(rf"^\| {head} \|.*\n\|[-|: ]+\n((?:\|.*\n)+)", page, re.MULTILINE)
    assert rows, head
    return re.findall(r"^\| (.*?) \|", rows[1], re.MULTILINE)


def libraries(requirements: Iterable[str]) -> set[str]:
    """Names of libraries as an index spells them, without versions and markers."""
    return {re.match(r"[\w.-]+", text)[0].lower().replace("_", "-") for text in requirements}


def named(cells: Iterable[str]) -> set[str]:
    """Libraries that cells name, spelt likewise: notes in brackets left out."""
    texts = [re.sub(r"\(.*?\)", "", cell) for cell in cells]
    return {name.strip().lower() for text in texts for name in text.split(",")}


def test_the_decision_on_dependencies_names_those_of_the_project() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    extras = dict(project["optional-dependencies"])
    tools = libraries(extras.pop("dev"))
    page = (DOCS / "decisions" / "0001-dependencies.md").read_text("utf-8")
    assert named(table_below(page, "at run time")) == libraries(project["dependencies"])
    cells = table_below(page, "as an extra")
    assert named(cells) == libraries(text for texts in extras.values() for text in texts)
    assert {name for cell in cells for name in re.findall(r"`(\w+)`", cell)} == set(extras)
    # what runs an extra in a test is explained with the extra
    assert named(table_below(page, "for development")) == tools - named(cells)


def test_the_layout_names_folders_and_modules_of_the_package() -> None:
    source = ROOT / "src" / "swashplate"
    cells = table_below((ROOT / "CONTRIBUTING.md").read_text("utf-8"), "where")
    cells = [cell for cell in cells if "beside `src/`" not in cell]
    names = {name for cell in cells for name in re.findall(r"`([\w./]+)`", cell)}
    folders = {f"{path.parent.name}/" for path in source.glob("*/__init__.py")}
    modules = {path.name for path in source.glob("*.py") if not path.name.startswith("__")}
    assert names >= folders | modules
    for name in names:
        assert (source / name).exists(), name


def test_the_extras_of_the_installation_page_are_those_of_the_project() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    cells = table_below((DOCS / "installation.md").read_text("utf-8"), "extra")
    assert {cell.strip("`") for cell in cells} == set(project["optional-dependencies"]) - {"dev"}
