"""Inverse maps as TOML files, for controllers and back."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, FiniteFloat, model_validator

from swashplate.analysis.compensation import FEWEST, MOST
from swashplate.analysis.inverse import Branch, InverseMap
from swashplate.documents import parse_toml, read_text, validated
from swashplate.parameters.rules import FULL_VOLTAGE

COMMENTS = (
    "swashplate inverse steady-state map: the voltage for a wanted speed; SI units",
    "plus and minus: straight lines between the points; beyond their ends hold the end",
    "between minus and plus: the nearest of minus' last point, rest and plus' first point",
)


def _rising(values: list[float]) -> list[float]:
    if any(later <= earlier for earlier, later in pairwise(values)):
        raise ValueError("the numbers must rise from each to the next.")
    return values


Column = Annotated[
    list[FiniteFloat], Field(min_length=FEWEST, max_length=MOST), AfterValidator(_rising)
]
Positive = Annotated[FiniteFloat, Field(ge=0.0)]


class BranchFile(BaseModel):
    """Points of one way, both columns rising."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    speed: Column
    voltage: Column

    @model_validator(mode="after")
    def _fits(self) -> BranchFile:
        if len(self.speed) != len(self.voltage):
            raise ValueError(
                f"speed has {len(self.speed)} numbers and voltage {len(self.voltage)}; give as "
                "many of both."
            )
        if max(abs(self.voltage[0]), abs(self.voltage[-1])) > FULL_VOLTAGE:
            raise ValueError(f"the voltage must stay within ±{FULL_VOLTAGE:g} V.")
        return self


class RestFile(BaseModel):
    """What happens at 0 V."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    speed: FiniteFloat


class MapFile(BaseModel):
    """An inverse map."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    format: Literal[1] = 1
    drive: str
    speed_unit: Literal["rad/s"] = "rad/s"
    voltage_unit: Literal["V"] = "V"
    acceleration: Annotated[list[Positive], Field(min_length=2, max_length=2)]
    lag: Positive
    error: Positive
    minus: BranchFile
    rest: RestFile
    plus: BranchFile

    @model_validator(mode="after")
    def _ordered(self) -> MapFile:
        if not self.minus.speed[-1] <= self.rest.speed <= self.plus.speed[0]:
            raise ValueError("the speed at rest must lie between those of minus and plus.")
        if not self.minus.voltage[-1] <= 0.0 <= self.plus.voltage[0]:
            raise ValueError("minus needs voltages of at most 0 V, plus of at least 0 V.")
        return self


def dump_map(inverse: InverseMap) -> str:
    """An inverse map as TOML text; every number comes back to the last bit."""
    from tomlkit import comment, document, dumps, item, table

    text = document()
    for line in COMMENTS:
        text.add(comment(line))
    text.add("format", item(1))
    text.add("drive", item(inverse.name))
    text.add("speed_unit", item("rad/s"))
    text.add("voltage_unit", item("V"))
    text.add("acceleration", item(list(inverse.acceleration)))
    text.add("lag", item(inverse.lag))
    text.add("error", item(inverse.error))
    for name, branch in (("minus", inverse.minus), ("rest", None), ("plus", inverse.plus)):
        part = table()
        if branch is None:
            part.add("speed", item(inverse.creep))
        else:
            part.add("speed", item(branch.speed.tolist()))
            part.add("voltage", item(branch.voltage.tolist()))
        text.add(name, part)
    return dumps(text)


def load_map(path: str | Path) -> InverseMap:
    """An inverse map from a TOML file; see `InverseMap.from_toml`."""
    content = validated(parse_toml(read_text(path), str(path)), MapFile, str(path))
    minus, plus = (
        Branch(np.array(each.speed), np.array(each.voltage))
        for each in (content.minus, content.plus)
    )
    plus_acceleration, minus_acceleration = content.acceleration
    return InverseMap(
        content.drive,
        minus,
        plus,
        content.rest.speed,
        (plus_acceleration, minus_acceleration),
        content.lag,
        content.error,
    )
