"""A parameter set: values with their origin, immutable, always valid."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from itertools import groupby
from types import MappingProxyType
from typing import Any, Literal, NamedTuple, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from swashplate.errors import InputError, ParameterError
from swashplate.machine import Replacement
from swashplate.machine.fields import is_real
from swashplate.machine.plausible import check_plausible
from swashplate.machine.rules import refuse
from swashplate.parameters.definitions import (
    CATALOGUE,
    COLUMNS,
    REFINEMENTS,
    SWITCHES,
    Definition,
    Definitions,
    definitions_of,
    options_of,
)
from swashplate.parameters.rules import check_options, check_rules
from swashplate.results import Result
from swashplate.tables import UNIT, Column, Table, listed
from swashplate.units import Quantity, in_si, to_si

PressureRoot = Literal["published", "symmetric"]
CoulombSign = Literal["smooth", "literal"]
CardSwitch = Literal["sampled", "split"]
Motion = Literal["shaft", "rod"]
UNUSABLE = "Not usable"
"""Beginning of the verdict on a fit that is not usable; the title of such a drive has it."""
Status = Literal["fitted", "fixed", "assumed", "approximate", "inactive", "user"]


class LoggedCommand(NamedTuple):
    """How the numbers of a log become the voltage at a drive's card, as in the campaign of its fit.

    The voltage is sign · (scale · number + offset), in a unit.
    """

    column: str
    """Column of the logs."""
    unit: str = ""
    """Of what scale and offset give; if empty, that of the log's header, or V."""
    scale: float = 1.0
    offset: float = 0.0
    sign: int = 1

    @property
    def is_voltage(self) -> bool:
        """Whether the log's numbers are the card's volts as they stand."""
        return self.unit in ("", "V") and self[2:] == (1.0, 0.0, 1)

    def volts(self, numbers: NDArray[np.float64]) -> NDArray[np.float64]:
        """Voltage at the card for numbers of a log. [V]"""
        return self._factor * self.sign * (self.scale * numbers + self.offset)

    def numbers(self, volts: NDArray[np.float64]) -> NDArray[np.float64]:
        """Numbers of a log for voltages at the card [V]."""
        return (self.sign * volts / self._factor - self.offset) / self.scale

    @property
    def _factor(self) -> float:
        return to_si(1.0, self.unit or "V", "V", f"the unit of '{self.column}'")

    @property
    def sentence(self) -> str:
        """How to read a number of the column."""
        number = f"'{self.column}'" if self.scale == 1.0 else f"{self.scale:g} x '{self.column}'"
        if self.offset:
            number += f" {'-' if self.offset < 0.0 else '+'} {abs(self.offset):g}"
        if self.sign < 0:
            number = f"-({number})"
        unit = self.unit or "V"
        return f"As in the campaign of the fit, the voltage at the card is {number} {unit}"


class Pair(NamedTuple):
    """Values of a directional parameter, both as magnitudes."""

    plus: float
    minus: float


Value = float | Pair
Change = float | Quantity | tuple[float | Quantity, float | Quantity]
"""A new value in SI or with a unit, or a pair of them, plus and minus."""


@dataclass(frozen=True)
class Parameter(Result):
    """One parameter of a set.

    Examples
    --------
    >>> from swashplate import Drive
    >>> orifice = Drive.preset("hoist")["Z16_plus"]
    >>> orifice.definition.unit
    'm'
    """

    definition: Definition
    value: Value
    source: str = ""
    status: Status = "user"
    own_bounds: tuple[float, float] | None = None
    """Bounds that the set's author gives, within the catalogue's; both ends allowed."""

    @property
    def symbol(self) -> str:
        """Symbol in Kruse (2001), e.g. ``Z16``."""
        return self.definition.symbol

    @property
    def name(self) -> str:
        """Name in words."""
        return self.definition.name

    @property
    def unit(self) -> str:
        """SI unit of the value."""
        return self.definition.unit

    def table(self) -> Table:
        """Its value with its unit, its status, and its source."""
        columns = (
            Column("symbol"),
            Column("name", wrap=True),
            Column("plus", ".6g"),
            Column("minus", ".6g"),
            UNIT,
            Column("status"),
            Column("source", wrap=True),
        )
        table = Table("", columns, si=True)
        plus, minus = (*self.values, None)[:2]
        table.add(self.symbol, self.name, plus, minus, self.status, self.source, unit=self.unit)
        return table

    @property
    def values(self) -> tuple[float, ...]:
        """Its one or two numbers, in the order of ``definition.columns``."""
        return tuple(self.value) if isinstance(self.value, Pair) else (self.value,)

    @property
    def numbers(self) -> dict[str, float]:
        """The same by column."""
        return dict(zip(self.definition.columns, self.values, strict=True))

    def in_direction(self, column: str) -> Parameter:
        """One direction of a parameter as a parameter with one value: ``Z16_plus`` of ``Z16``."""
        index = self.definition.columns.index(column)
        direction = ("positive", "negative")[index]
        definition = replace(
            self.definition,
            name=f"{self.name}, {direction}",
            symbol=column,
            fields=(self.definition.fields[index],),
        )
        return replace(self, definition=definition, value=self.values[index])


class Entries(Mapping[str, Parameter]):
    """Parameters by symbol, read-only, of a frozen dataclass that has them as `parameters`."""

    parameters: Mapping[str, Parameter]
    numbers: Mapping[str, float]

    def _keep(self, parameters: Mapping[str, Parameter]) -> None:
        """Keep parameters as they are from now on, and all their numbers by column."""
        numbers: dict[str, float] = {}
        for parameter in parameters.values():
            numbers |= parameter.numbers
        object.__setattr__(self, "parameters", MappingProxyType(parameters))
        object.__setattr__(self, "numbers", MappingProxyType(numbers))

    def __getitem__(self, symbol: str) -> Parameter:
        return self.parameters[symbol]

    def __contains__(self, symbol: object) -> bool:
        return symbol in self.parameters

    def __iter__(self) -> Iterator[str]:
        return iter(self.parameters)

    def __len__(self) -> int:
        return len(self.parameters)

    def __reduce__(self) -> tuple[object, ...]:
        # read-only views cannot be pickled, so a copy in another process is built again
        instance: Any = self
        members = [getattr(self, field.name) for field in fields(instance) if field.init]
        return type(self), tuple(
            dict(member) if isinstance(member, MappingProxyType) else member for member in members
        )


@dataclass(frozen=True)
class ParameterSet(Entries):
    """All parameters of a drive, by symbol; of the refinements those that are given.

    One direction has a name of its own: ``parameters["Z16_plus"]``. Iteration and length count
    symbols. A refinement that is not given can be asked for by its symbol all the same, and is off;
    ``in`` is true for what the set gives.

    Raises
    ------
    ParameterError
        On creation, if a parameter is missing or breaks a rule; the sentence names the parameter,
        its value and the rule.
    """

    name: str
    title: str
    card: str
    parameters: Mapping[str, Parameter]
    pressure_root: PressureRoot = "published"
    coulomb_sign: CoulombSign = "smooth"
    card_switch: CardSwitch = "sampled"
    rate: float | None = None
    """Rate that the recursion of the card's filter belongs to, 512 for Kruse's; None is the
    filter's differential equation, whose ζ, ω and C mean the same at every rate. [Hz]"""
    options: frozenset[str] = frozenset()
    """Terms of the pump that count: of `swashplate.parameters.definitions.OPTIONS`."""
    equations: tuple[Replacement, ...] = ()
    """User-defined equations in the place of the pump's, see `Drive.with_equation`."""
    motion: Motion = "shaft"
    """What its last number moves: a shaft, or a rod, whose position in m then stands in the place
    of the shaft's in rad."""
    unreached: Mapping[str, float] = field(default_factory=dict)
    """Limits that the tests of this drive never reached, by column, and how far they went, 0 if
    that is not known: such a limit lies there or beyond, wherever its value stands. [SI]"""
    tested: tuple[float, float] | None = None
    """Largest command each way of the tests of this drive, magnitudes, 0 for a way that none goes;
    None of a drive without tests. [V]"""
    command: LoggedCommand | None = None
    """How logs of this drive hold its command; None if they hold the card's volts."""
    numbers: Mapping[str, float] = field(init=False, repr=False, compare=False)
    """Every single value by column, e.g. ``Z16_plus``."""

    def __post_init__(self) -> None:
        definitions = self.definitions
        by_symbol = definitions.by_symbol
        for name in self.parameters.keys() - by_symbol.keys():
            raise ParameterError(
                f"{self.name}: there is no parameter '{name}'; those of a user-defined equation "
                "belong to a drive that has it, see Drive.with_equation."
            )
        missing = [symbol for symbol in CATALOGUE if symbol not in self.parameters]
        if missing:
            raise ParameterError(f"{self.name}: no value for {', '.join(missing)}.")
        self._keep({name: self.parameters[name] for name in by_symbol if name in self.parameters})
        for parameter in self.values():
            if parameter.own_bounds is None:
                continue
            low, high = parameter.own_bounds
            for column, value in parameter.numbers.items():
                if not low <= value <= high:
                    raise ParameterError(
                        f"{self.name}: {column} ({parameter.name}) is {value:g} {parameter.unit}, "
                        f"outside its bounds {low:g} to {high:g}."
                    )
        numbers = {name: np.array([number]) for name, number in self.numbers.items()}
        refuse(self.name, check_rules(numbers, definitions))
        check_options(self.name, self.options, self.numbers)

    @property
    def definitions(self) -> Definitions:
        """Definitions of all parameters by symbol: the package's, then its user's equations'."""
        kinds = (equation.parameters for equation in self.equations)
        return definitions_of(tuple(kind for kind in kinds if kind is not None))

    def __repr__(self) -> str:
        return f"ParameterSet({self.name!r}, {len(self)} parameters)"

    def __getitem__(self, name: str) -> Parameter:
        """A parameter by its symbol (``Z16``), or one direction of it (``Z16_plus``).

        Raises
        ------
        UnknownParameterError
            If no parameter has the name; it is a ``KeyError`` as well.
        """
        if name in self.parameters:
            return self.parameters[name]
        if name in COLUMNS:
            return self.parameters[COLUMNS[name]].in_direction(name)
        definition = self.definitions.find(name)
        assert definition.default is not None
        return Parameter(definition, definition.default, status="inactive")

    def __contains__(self, name: object) -> bool:
        return name in self.parameters or name in self.numbers

    def __hash__(self) -> int:
        return hash((self.name, self.options, self.equations, *self.numbers.values()))

    @property
    def refinements(self) -> tuple[str, ...]:
        """Symbols of the refinements that are on."""
        return tuple(
            symbol
            for symbol, definition in REFINEMENTS.items()
            if definition.switch in self.options and self.numbers.get(symbol, 0.0) != 0.0
        )

    @property
    def plain(self) -> Self:
        """The set without refinements, itself if it has none."""
        if REFINEMENTS.keys().isdisjoint(self.parameters) and not self.equations:
            return self
        parameters = {symbol: self.parameters[symbol] for symbol in CATALOGUE}
        switches = {SWITCHES[symbol] for symbol in CATALOGUE if symbol in SWITCHES}
        return replace(self, parameters=parameters, options=self.options & switches, equations=())

    @property
    def doubt(self) -> str:
        """The verdict on the fit that it comes from, if that is not usable; else empty.

        Its title has it.
        """
        _, stated, reason = self.title.partition(UNUSABLE)
        return f"{stated}{reason.rstrip('.')}." if stated else ""

    def unreached_sentence(self, drive: str = "this drive") -> str:
        """Say what the tests of a drive left open; empty if nothing. `drive` is its name there."""
        if not self.unreached:
            return ""
        return (
            f"No test of {drive} reached {listed([*self.unreached])}: beyond what was tested it is "
            "extrapolated."
        )

    def tables(self) -> list[Table]:
        """Every parameter with its unit and status, a table for each block that the set has.

        Parameters next to each other stand below the source that they share.
        """
        titles = {
            "control_card": f"Control card {self.card}",
            "pump_motor": "Pump and motor",
            "refinements": "Refinements",
        }
        numbers = (Column("plus", ".6g"), Column("minus", ".6g"))
        tables = []
        for block, title in titles.items():
            columns = (Column("symbol"), Column("name", wrap=True), *numbers)
            table = Table(title, (*columns, UNIT, Column("status")), si=True)
            members = [
                parameter for parameter in self.values() if parameter.definition.block == block
            ]
            for source, group in groupby(members, key=lambda parameter: parameter.source):
                if source:
                    table.add("", f"{source}:", None, None, "", section=True)
                for index, parameter in enumerate(group):
                    values = parameter.values
                    table.add(
                        parameter.symbol,
                        parameter.name,
                        values[0],
                        values[1] if len(values) > 1 else None,
                        parameter.status,
                        unit=parameter.unit,
                        section=not source and index == 0,
                    )
            if members:
                tables.append(table)
        return tables

    def replace(self, changes: Mapping[str, Change]) -> Self:
        """Copy with other values, marked as the user's.

        Parameters
        ----------
        changes : mapping
            Symbol (``Z16``, both directions or a pair) or column (``Z16_plus``) to value: a number
            in SI, or a Pint quantity.

        Returns
        -------
        ParameterSet
            A new set; this one stays as it is.

        Raises
        ------
        ParameterError
            For an unknown name, a pair for a parameter without directions, a value beyond its
            plausible range, or a broken rule.

        Examples
        --------
        >>> from swashplate import Drive
        >>> plain = Drive.preset("hoist").parameters
        >>> plain.replace({"Z16_plus": 1.2e-4})["Z16_plus"].value
        0.00012
        """
        for name, change in changes.items():
            definition = self.definitions.find(name)
            meant_value(name, definition, change, self[definition.symbol])
        return self.with_numbers(changes)

    def with_numbers(
        self, changes: Mapping[str, Change], options: frozenset[str] | None = None
    ) -> Self:
        """As `replace`, for numbers that nobody wrote: of any size that the rules allow.

        Parameters
        ----------
        changes : mapping
            As of `replace`.
        options : frozenset of str, optional
            Terms that count then. By default a refinement whose parameters are changed comes on
            where one of them is not 0, and goes off where all are.

        Raises
        ------
        ParameterError
            As `replace`, but for the plausible ranges.
        """
        parameters = dict(self.parameters)
        for name, change in changes.items():
            definition = self.definitions.find(name)
            old = parameters.get(definition.symbol, self[definition.symbol])
            value = value_of(name, definition, change, old)
            parameters[definition.symbol] = replace(old, value=value, source="", status="user")
        if options is None:
            numbers = {symbol: parameters[symbol].values[0] for symbol in parameters}
            touched = {SWITCHES[name] for name in changes if name in SWITCHES}
            options = (self.options - touched) | (options_of(numbers) & touched)
        # a number that is set is not an end of what the tests reached any more
        columns = self.definitions.columns_of(changes)
        unreached = {k: v for k, v in self.unreached.items() if k not in columns}
        return replace(self, parameters=parameters, options=options, unreached=unreached)

    def scale(self, factors: Mapping[str, Change]) -> Self:
        """Copy with values multiplied by factors; names and errors as of `replace`."""
        changes: dict[str, Change] = {}
        for name, factor in factors.items():
            numbers = self[self.definitions.find(name).symbol].numbers
            columns = self.definitions.columns_of([name])
            column_factors = factor if isinstance(factor, tuple) else (factor,) * len(columns)
            if len(column_factors) != len(columns):
                takes = "one value, so it takes one factor" if len(columns) == 1 else "two values"
                raise ParameterError(f"{name} has {takes}, not {len(column_factors)}.")
            for column, column_factor in zip(columns, column_factors, strict=True):
                if not is_real(column_factor):
                    raise ParameterError(
                        f"The factor of {name} must be a number, not {column_factor!r}."
                    )
                changes[column] = numbers[column] * column_factor
        return self.replace(changes)


def value_of(
    name: str, definition: Definition, change: Change, old: Parameter | None = None
) -> Value:
    """The new value of a parameter from a change; a change of one side keeps the other side."""
    if isinstance(change, tuple) and (not definition.directional or name != definition.symbol):
        raise ParameterError(f"{name} has one value, not a plus and a minus one.")
    if isinstance(change, tuple) and len(change) != 2:
        raise ParameterError(f"{name} takes one value or two (plus, minus), not {len(change)}.")
    stated = change if isinstance(change, tuple) else (change,)
    title = f"{name} ({definition.name})"
    try:
        numbers = [float(in_si(number, definition.unit, title)) for number in stated]
    except InputError as error:
        raise ParameterError(str(error)) from None
    except (TypeError, ValueError):
        raise ParameterError(
            f"{name} must be a number in {definition.unit}, or a pair of them, not {change!r}."
        ) from None
    if not definition.directional:
        return numbers[0]
    if name == definition.symbol:
        return Pair(numbers[0], numbers[-1])
    assert old is not None
    plus, minus = (old.numbers | {name: numbers[0]}).values()
    return Pair(plus, minus)


def meant_value(
    name: str, definition: Definition, change: Change, old: Parameter | None = None
) -> Value:
    """The same as `value_of` of a number that somebody wrote; refuses one that is not plausible."""
    value = value_of(name, definition, change, old)
    numbers = tuple(value) if isinstance(value, Pair) else (value,)
    for column, number in zip(definition.columns, numbers, strict=True):
        if name in (definition.symbol, column):
            check_plausible(column, definition, number)
    return value


class HasParameters(Protocol):
    """A drive, or whatever else has a parameter set."""

    @property
    def parameters(self) -> ParameterSet:
        """The set."""
        ...


def set_of(given: ParameterSet | HasParameters) -> ParameterSet:
    """A parameter set as it is, or that of a drive."""
    return given if isinstance(given, ParameterSet) else given.parameters
