"""What pages and examples tell a user to import is in the reference."""

import ast
import re
import tomllib
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
REFERENCE = {
    name
    for page in tomllib.loads((DOCS / "api.toml").read_text("utf-8"))["page"]
    for name in page["objects"]
}
PAGES = [
    ROOT / "README.md",
    *DOCS.glob("*.md"),
    *DOCS.glob("how-to/*.md"),
    *DOCS.glob("theory/*.md"),
]
EXAMPLES = [*(ROOT / "examples").glob("*.py")]
PYTHON = re.compile(r"^``` *python *\n(.*?)^```", re.MULTILINE | re.DOTALL)


def python_of(path: Path) -> str:
    """The code of an example, or of all Python blocks of a page: they share their names."""
    text = path.read_text("utf-8")
    return text if path.suffix == ".py" else "\n".join(PYTHON.findall(text))


def is_module(name: str) -> bool:
    """Whether a dotted name is that of a module."""
    try:
        return find_spec(name) is not None
    except ModuleNotFoundError:
        return False


def names_used(code: str) -> Iterator[str]:
    """Dotted names of the package that code imports, or takes from a module that it imports."""
    modules: dict[str, str] = {}
    nodes = list(ast.walk(ast.parse(code)))
    for node in nodes:
        if isinstance(node, ast.Import):
            for alias in node.names:
                root = alias.name.partition(".")[0]
                if root == "swashplate":
                    modules[alias.asname or root] = alias.name if alias.asname else root
        elif isinstance(node, ast.ImportFrom):
            for alias in node.names:
                name = f"{node.module}.{alias.name}"
                if name.startswith("swashplate."):
                    if is_module(name):
                        modules[alias.asname or alias.name] = name
                    else:
                        yield name
    for node in nodes:
        if isinstance(node, ast.Attribute):
            root, *attributes = ast.unparse(node).split(".")
            if root in modules and all(map(str.isidentifier, attributes)):
                name = ".".join([modules[root], *attributes])
                # members of an object are on the object's own entry
                if is_module(name.rpartition(".")[0]) and not is_module(name):
                    yield name


def not_in_the_reference(code: str) -> list[str]:
    """Names that code uses and the reference lacks."""
    return sorted(set(names_used(code)) - REFERENCE)


def test_a_missing_name_is_seen() -> None:
    code = """
import swashplate
import swashplate.analysis as study
from swashplate import Drive, rig
from swashplate.analysis import envelope, planted
from swashplate.models import amplifier

swashplate.identify, swashplate.planted, swashplate.rig.planted
rig.run, rig.planted(Drive.planted), amplifier.planted, study.other
"""
    assert not_in_the_reference(code) == [
        "swashplate.analysis.other",
        "swashplate.analysis.planted",
        "swashplate.models.amplifier.planted",
        "swashplate.planted",
        "swashplate.rig.planted",
    ]


@pytest.mark.parametrize("path", [*PAGES, *EXAMPLES], ids=lambda path: str(path.relative_to(ROOT)))
def test_what_is_imported_is_in_the_reference(path: Path) -> None:
    """Add it to ``docs/api.toml``, or use what is there."""
    missing = not_in_the_reference(python_of(path))
    assert not missing, f"{path.relative_to(ROOT)} uses what docs/api.toml lacks: {missing}"


@pytest.mark.parametrize("path", PAGES, ids=lambda path: str(path.relative_to(ROOT)))
def test_what_prose_names_in_full_is_in_the_reference(path: Path) -> None:
    """A module, an object of the reference or one of its members."""
    prose = PYTHON.sub("", path.read_text("utf-8"))
    named = set(re.findall(r"`(swashplate(?:\.\w+)+)[`(]", prose))
    missing = [
        name
        for name in sorted(named - REFERENCE)
        if not is_module(name) and name.rpartition(".")[0] not in REFERENCE
    ]
    assert not missing, f"{path.relative_to(ROOT)} names what docs/api.toml lacks: {missing}"
