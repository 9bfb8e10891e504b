"""What a fit is to find: stages, free parameters, bounds; read from TOML or packaged."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, PositiveFloat, model_validator

from swashplate.campaign import ChannelKind
from swashplate.campaign.schema import NotNegative, Weight, Window
from swashplate.documents import parse_toml, read_text, validated
from swashplate.errors import ParameterError
from swashplate.results import short

Finite = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[PositiveFloat, Field(allow_inf_nan=False)]
Pair = tuple[Finite, Finite]
StandardUncertainty = (
    Annotated[PositiveFloat, Field(strict=True, allow_inf_nan=False)]
    | Annotated[str, Field(pattern=r"^\d+(\.\d+)? ?%$")]
)
"""A standard uncertainty: in SI units, or as "5 %" of the value."""
COEFFICIENTS = ("Z19", "Z20", "Z21", "Z22")
"""Of the solenoids: what `GivenForces` stand for."""


class Entry(BaseModel):
    """A table of the file; a key that it does not know is refused."""

    model_config = ConfigDict(extra="forbid", frozen=True, populate_by_name=True)


class GivenPrior(Entry):
    """What is known beforehand: mean and standard deviation."""

    mean: Finite
    deviation: PositiveFloat


def check_rising(**pairs: tuple[float, float] | None) -> None:
    """Refuse, in a ValueError, bounds of which the lower one does not stand first."""
    for name, pair in pairs.items():
        if pair is not None and not pair[0] < pair[1]:
            low, high = sorted(pair)
            raise ValueError(
                f"{name} = [{pair[0]:g}, {pair[1]:g}] must rise: write [{low:g}, {high:g}]"
                if low < high
                else f"{name} = [{pair[0]:g}, {pair[1]:g}] leaves nothing between its ends"
            )


class Free(Entry):
    """How a parameter is free: both directions apart, unless tied."""

    relative: Pair | None = Field(None, description="Bounds as factors on the nominal value.")
    bounds: Pair | None = Field(None, description="Bounds in SI units.")
    log: bool = Field(False, description="Move the logarithm: for positive numbers.")
    tied: bool = Field(False, description="One value for both directions.")
    prior: GivenPrior | None = Field(
        None, description="A normal distribution, of the logarithm if log."
    )

    @model_validator(mode="after")
    def _bounded(self) -> Free:
        if (self.relative is None) == (self.bounds is None):
            raise ValueError("give either relative bounds or bounds")
        check_rising(relative=self.relative, bounds=self.bounds)
        return self


class GivenForces(Entry):
    """Effective currents at which the solenoids' forces are the unknowns, instead of Z19 to Z22."""

    plus: tuple[PositiveFloat, PositiveFloat, PositiveFloat, PositiveFloat]
    minus: tuple[PositiveFloat, PositiveFloat, PositiveFloat, PositiveFloat]
    relative: Pair = Field((0.5, 2.0), description="Bounds as factors on the nominal forces.")

    @model_validator(mode="after")
    def _bounded(self) -> GivenForces:
        check_rising(relative=self.relative)
        return self


class InputWeight(Window):
    """A weight that depends on the size of the command."""

    factors: tuple[tuple[NotNegative, NotNegative], ...] = Field(
        min_length=2,
        description="[|input|, factor on the squared error] pairs, a polyline: "
        "[[3, 1], [10, 0.5]].",
    )

    @model_validator(mode="after")
    def _increasing(self) -> InputWeight:
        levels = [level for level, _ in self.factors]
        if levels != sorted(set(levels)):
            raise ValueError("the inputs of factors must increase")
        return self


class Stage(Entry):
    """One fit: a part of the drive against its channels."""

    def __repr__(self) -> str:
        return short(self)

    name: str
    part: Literal["card", "pump", "chain", "model"] = Field(
        description="What is simulated: the control card, pump and motor, the whole chain; 'model' "
        "is for models of one's own, given by --model."
    )
    current: Literal["simulated", "measured"] = Field(
        "simulated",
        description="What drives the pump alone: the fitted card's current, or what was measured: "
        "the input, where that is a current, or else the channel of the current, an ammeter around "
        "both leads with the command's sign.",
    )
    current_scale: Positive = Field(1.0, description="Factor on the measured current.")
    channels: tuple[ChannelKind, ...] = Field((), description="Kinds to fit; all if empty.")
    free: dict[str, Free] = Field(min_length=1)
    forces: GivenForces | None = None
    weights: dict[ChannelKind, tuple[Weight, ...]] = Field(
        {}, description="Windows that count more or less, besides those of the campaign."
    )
    weights_by_input: dict[ChannelKind, tuple[InputWeight, ...]] = Field(
        {}, description="Weights by the size of the command, besides those of the campaign."
    )
    clock_offsets: dict[ChannelKind, Positive] = Field(
        {},
        description="Largest offset of a channel's clock against the input's, free and the same in "
        "all runs [s].",
    )
    start_pressure: Positive | None = Field(
        None,
        description="Largest stroking pressure at the first sample, free in each run [Pa]; where "
        "none is given, it is free in runs with start = 'estimated' alone.",
    )

    @model_validator(mode="after")
    def _consistent(self) -> Stage:
        if self.current_scale != 1.0 and (self.part, self.current) != ("pump", "measured"):
            raise ValueError("current_scale needs part = 'pump' and current = 'measured'")
        if self.start_pressure is not None and self.part == "card":
            raise ValueError("a card alone has no start_pressure")
        return self


class Setup(Entry):
    """A fit in one stage or several, each starting from what the ones before found."""

    def __repr__(self) -> str:
        return short(self)

    title: str = ""
    stages: tuple[Stage, ...] = Field(min_length=1)
    standard_uncertainty: dict[str, StandardUncertainty] = Field(
        {},
        description="Of parameters that stay fixed: a standard deviation of what their values may "
        "be off by, in SI units or as '5 %' of the value; the intervals of all estimates take it "
        "in. Both directions of a symbol are off together.",
    )

    @model_validator(mode="after")
    def _fixed(self) -> Setup:
        for name in self.standard_uncertainty:
            symbol = _symbol(name)
            for stage in self.stages:
                free = any(each in (name, symbol) or _symbol(each) == name for each in stage.free)
                if free or (stage.forces is not None and symbol in COEFFICIENTS):
                    raise ValueError(
                        f"{name} is free in the stage '{stage.name}': only what stays fixed has a "
                        "standard_uncertainty; what is known of a free parameter is its prior"
                    )
        return self

    def joint(self) -> Setup:
        """The same unknowns, all at once through the whole chain.

        Raises
        ------
        ParameterError
            If two stages free the same parameter, or one is driven by a scaled current, which no
            chain makes.
        """
        free: dict[str, Free] = {}
        for stage in self.stages:
            if stage.current_scale != 1.0:
                raise ParameterError(
                    f"The stage '{stage.name}' is driven by {stage.current_scale:g} times the "
                    "measured current, so no joint fit through the card can stand for it."
                )
            twice = sorted(set(free) & set(stage.free))
            if twice:
                raise ParameterError(f"{twice[0]} is free in two stages; a joint fit needs one.")
            free |= stage.free
        forces = next((each.forces for each in self.stages if each.forces is not None), None)
        pressures = [each.start_pressure for each in self.stages if each.start_pressure is not None]
        stage = Stage(
            name="chain",
            part="chain",
            free=free,
            forces=forces,
            weights={kind: w for each in self.stages for kind, w in each.weights.items()},
            weights_by_input={
                kind: w for each in self.stages for kind, w in each.weights_by_input.items()
            },
            clock_offsets={
                kind: most for each in self.stages for kind, most in each.clock_offsets.items()
            },
            start_pressure=max(pressures, default=None),
        )
        return self.model_copy(update={"stages": (stage,)})


def _symbol(name: str) -> str:
    return name.removesuffix("_plus").removesuffix("_minus")


def deviation(uncertainty: float | str, value: float) -> float:
    """A standard uncertainty as a number: in the value's unit, or ``"5 %"`` of its size."""
    if isinstance(uncertainty, str):
        return 0.01 * float(uncertainty.removesuffix("%")) * abs(value)
    return float(uncertainty)


def setup_names() -> tuple[str, ...]:
    """Names of the packaged set-ups."""
    folder = files("swashplate.identification").joinpath("setups")
    return tuple(
        sorted(
            each.name.removesuffix(".toml")
            for each in folder.iterdir()
            if each.name.endswith(".toml")
        )
    )


def load_setup(name: str | Path) -> Setup:
    """A packaged set-up by name, or one's own from a TOML file.

    Raises
    ------
    ParameterError
        If there is none of that name, or an entry is wrong.
    FileError
        If the file cannot be read.
    """
    if str(name).lower().endswith(".toml"):
        return validated(parse_toml(read_text(name), str(name)), Setup, str(name))
    if name not in setup_names():
        raise ParameterError(
            f"There is no packaged fit configuration '{name}'; there are "
            f"{', '.join(setup_names())}, or give "
            "a .toml file."
        )
    text = files("swashplate.identification").joinpath("setups", f"{name}.toml").read_text("utf-8")
    return validated(parse_toml(text, f"{name}.toml"), Setup, f"{name}.toml")


def setup_text(setup: Setup) -> str:
    """A fit configuration as TOML that `load_setup` reads as an equal one."""
    from tomlkit import dumps, inline_table

    content = setup.model_dump(mode="json", by_alias=True, exclude_defaults=True)
    for stage in content["stages"]:
        for name, entry in stage["free"].items():
            stage["free"][name] = inline_table()
            stage["free"][name].update(entry)
    return dumps(content)
