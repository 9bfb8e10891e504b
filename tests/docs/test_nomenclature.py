"""The nomenclature page says of every parameter what its definition says."""

import importlib.util
from pathlib import Path

from swashplate import Limit
from swashplate.parameters.definitions import CATALOGUE, REFINEMENTS
from swashplate.simulation.result import SIGNALS

DOCS = Path(__file__).parents[2] / "docs"
PAGE = (DOCS / "nomenclature.md").read_text("utf-8")


def test_the_tables_are_those_of_the_definitions() -> None:
    """``python docs/generate.py`` writes them anew."""
    spec = importlib.util.spec_from_file_location("generate", DOCS / "generate.py")
    assert spec is not None
    assert spec.loader is not None
    generate = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(generate)
    assert generate.nomenclature(PAGE) == PAGE
    for definition in (*CATALOGUE.values(), *REFINEMENTS.values()):
        assert PAGE.count(f"\n| {definition.symbol} | {definition.name} |") == 1


def test_every_signal_and_limit_is_named() -> None:
    for name in (*SIGNALS, *(limit.name for limit in Limit)):
        assert f"`{name}`" in PAGE
