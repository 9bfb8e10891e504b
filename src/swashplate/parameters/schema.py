"""Schema of a parameter set's TOML file."""

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, PositiveFloat

from swashplate.parameters.parameter_set import CardSwitch, CoulombSign, PressureRoot, Status

TwoNumbers = Annotated[list[float], Field(min_length=2, max_length=2)]


class Entry(BaseModel):
    """One parameter: ``Z16 = { value = [1.2e-4, 1.5e-4], unit = "m", source = "table 7.2" }``."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    value: float | TwoNumbers
    unit: str
    source: str = ""
    status: Status = "user"
    bounds: TwoNumbers | None = None


class ModelOptions(BaseModel):
    """Variants of the equations; the defaults are those the published values belong to."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    pressure_root: PressureRoot = "published"
    coulomb_sign: CoulombSign = "smooth"
    card_switch: CardSwitch = "sampled"
    rate: PositiveFloat | None = None
    """Samples a second that the recursion of the card's filter belongs to; none is the filter's
    differential equation, for any rate."""
    options: list[str] | None = None
    """Terms of the pump that count; where they are not given, those whose parameters are not 0."""


class CardFile(BaseModel):
    """A control card by itself, so that several sets can use it."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    format: Literal[1] = 1
    name: str
    title: str = ""
    rate: PositiveFloat | None = None
    """Of the recursion that its filter belongs to."""
    control_card: dict[str, Entry]


class SetFile(BaseModel):
    """A whole drive; `control_card` is the name of a packaged card or the card's own table."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    format: Literal[1] = 1
    name: str
    title: str = ""
    control_card: str | dict[str, Entry]
    card: str = ""
    """Name of a card that is given by its own table."""
    pump_motor: dict[str, Entry]
    model: ModelOptions = ModelOptions()
    refinements: dict[str, Entry] = {}
    """What goes beyond the source's equations; all of it is off where it is not given."""
