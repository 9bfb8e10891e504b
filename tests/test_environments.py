"""What pyproject.toml states, constraints.txt pins and docs/environments.md says fit together."""

import re
import tomllib
from importlib import metadata
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from swashplate import __version__

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
STATED = [
    Requirement(line)
    for lines in (PROJECT["dependencies"], *PROJECT["optional-dependencies"].values())
    for line in lines
]
PYTHONS = ("3.11", "3.12", "3.13")


def pins(python: str) -> dict[str, str]:
    """Version of each library that constraints.txt pins for a Python."""
    found: dict[str, str] = {}
    for line in (ROOT / "constraints.txt").read_text("utf-8").splitlines():
        if line.startswith("#"):
            continue
        requirement = Requirement(line)
        name = canonicalize_name(requirement.name)
        if requirement.marker and not requirement.marker.evaluate({"python_version": python}):
            continue
        assert name not in found, f"{name} is pinned twice for Python {python}"
        (pin,) = requirement.specifier
        assert pin.operator == "=="
        found[name] = pin.version
    return found


@pytest.mark.parametrize("python", PYTHONS)
def test_every_dependency_is_pinned_within_its_bound(python: str) -> None:
    pinned = pins(python)
    for requirement in STATED:
        version = pinned[canonicalize_name(requirement.name)]
        assert requirement.specifier.contains(version), f"{requirement} but {version} is pinned"


def test_what_is_installed_is_within_the_bounds() -> None:
    for line in PROJECT["dependencies"]:
        requirement = Requirement(line)
        version = metadata.version(requirement.name)
        assert requirement.specifier.contains(version), f"{requirement} but {version} is installed"


def test_the_pythons_are_the_same_wherever_they_are_named() -> None:
    prefix = "Programming Language :: Python :: "
    named = {each.removeprefix(prefix) for each in PROJECT["classifiers"] if prefix in each}
    assert {each for each in named if re.fullmatch(r"3\.\d+", each)} == set(PYTHONS)
    assert PROJECT["requires-python"] == f">={PYTHONS[0]}"
    workflow = (ROOT / ".github" / "workflows" / "ci.yml").read_text("utf-8")
    assert workflow.count(f"python: {list(PYTHONS)}".replace("'", '"')) == 2


def test_a_citation_names_the_version() -> None:
    text = (ROOT / "CITATION.cff").read_text("utf-8")
    assert re.findall(r"^version: (.*)$", text, re.MULTILINE) == [__version__]


def test_the_page_gives_the_bounds_that_are_stated() -> None:
    """Those with a reason of their own."""
    page = (ROOT / "docs" / "environments.md").read_text("utf-8")
    bounds = {canonicalize_name(each.name): str(each.specifier)[2:] for each in STATED}
    for name in ("SciPy", "Pint", "Polars", "pydantic", "Rich", "Matplotlib", "npTDMS", "asammdf"):
        assert re.search(rf"{name} {re.escape(bounds[canonicalize_name(name)])}\b", page), name
