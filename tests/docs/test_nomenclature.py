"""The nomenclature page says of every parameter what the catalogue says."""

from pathlib import Path

import pytest

from swashplate import Limit
from swashplate.parameters.catalogue import CATALOGUE, Definition
from swashplate.parameters.refinements import REFINEMENTS, Refinement
from swashplate.simulation.result import SIGNALS

PAGE = (Path(__file__).parents[2] / "docs" / "nomenclature.md").read_text("utf-8")
ROWS = [[cell.strip() for cell in row.strip("|").split("|")] for row in PAGE.splitlines()]


@pytest.mark.parametrize("definition", CATALOGUE.values(), ids=CATALOGUE.keys())
def test_every_parameter_has_its_row(definition: Definition) -> None:
    (row,) = [row for row in ROWS if row[0] == definition.symbol]
    each_way = "yes" if definition.directional else "no"
    assert row[1:5] == [definition.name, definition.unit, each_way, definition.range]


@pytest.mark.parametrize("definition", REFINEMENTS.values(), ids=REFINEMENTS.keys())
def test_every_refinement_has_its_row(definition: Refinement) -> None:
    (row,) = [row for row in ROWS if row[0] == definition.symbol]
    assert row[1:5] == [definition.name, definition.unit, "no", definition.range]
    assert row[5:7] == [f"{definition.default:g}", "yes" if definition.switch else "no"]


def test_every_signal_and_limit_is_named() -> None:
    for name in (*SIGNALS, *(limit.name for limit in Limit)):
        assert f"`{name}`" in PAGE
