"""A parameter set: values with their origin, immutable, always valid."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from itertools import groupby
from types import MappingProxyType
from typing import Literal, NamedTuple, Protocol

from swashplate.equations.replacement import Replacement
from swashplate.errors import ParameterError
from swashplate.parameters.definitions import (
    CATALOGUE,
    OWN,
    REFINEMENTS,
    SWITCHES,
    Definition,
    declare,
    find,
    options_of,
    unknown_parameter,
)
from swashplate.parameters.rules import check_options, check_rules
from swashplate.results import Result
from swashplate.tables import UNIT, Column, Table

PressureRoot = Literal["published", "symmetric"]
CoulombSign = Literal["smooth", "literal"]
CardSwitch = Literal["sampled", "split"]
Motion = Literal["shaft", "rod"]
Status = Literal["fitted", "fixed", "assumed", "approximate", "inactive", "user"]


class Pair(NamedTuple):
    """Values of a directional parameter, both as magnitudes."""

    plus: float
    minus: float


Value = float | Pair
Change = float | tuple[float, float]


@dataclass(frozen=True)
class Parameter(Result):
    """One parameter of a set."""

    definition: Definition
    value: Value
    source: str = ""
    status: Status = "user"
    own_bounds: tuple[float, float] | None = None
    """Bounds that the set's author gives, within the catalogue's; both ends allowed."""

    @property
    def bounds(self) -> tuple[float, float]:
        """Lowest and highest value: the set's own bounds, or else the catalogue's range."""
        if self.own_bounds is not None:
            return self.own_bounds
        return self.definition.lower, self.definition.upper

    @property
    def symbol(self) -> str:
        """Symbol in Kruse (2001), e.g. ``Z16``."""
        return self.definition.symbol

    @property
    def name(self) -> str:
        """What it is, in words."""
        return self.definition.name

    @property
    def unit(self) -> str:
        """SI unit of the value."""
        return self.definition.unit

    @property
    def values(self) -> tuple[float, ...]:
        """Its one or two numbers, in the order of ``definition.columns``."""
        return tuple(self.value) if isinstance(self.value, Pair) else (self.value,)


@dataclass(frozen=True)
class ParameterSet(Mapping[str, Parameter]):
    """All parameters of a drive, by symbol; of the refinements those that are given.

    A refinement that is not given can be asked for by its symbol all the same, and is off.

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
    """One's own equations in the place of the pump's, see `Drive.with_equation`."""
    motion: Motion = "shaft"
    """What its last number moves: a shaft, or a rod, whose position in m then stands in the place
    of the shaft's in rad."""
    numbers: Mapping[str, float] = field(init=False, repr=False, compare=False)
    """Every single value by column, e.g. ``Z16_plus``."""

    def __post_init__(self) -> None:
        kinds = [each.parameters for each in self.equations if each.parameters is not None]
        for kind in kinds:
            declare(kind)
        own = {name for kind in kinds for name in kind._fields}
        strange = [name for name in self.parameters if name in OWN and name not in own]
        if strange:
            raise ParameterError(
                f"{self.name}: {strange[0]} belongs to an equation of your own, which this drive "
                "does not have; see Drive.with_equation."
            )
        missing = [symbol for symbol in CATALOGUE if symbol not in self.parameters]
        if missing:
            raise ParameterError(f"{self.name}: no value for {', '.join(missing)}.")
        ordered = {symbol: self.parameters[symbol] for symbol in CATALOGUE}
        more = [each for each in (*REFINEMENTS, *OWN) if each in self.parameters]
        ordered |= {each: self.parameters[each] for each in more}
        numbers = {}
        for parameter in ordered.values():
            for column, value in zip(parameter.definition.columns, parameter.values, strict=True):
                numbers[column] = value
                if parameter.own_bounds is None:
                    continue
                low, high = parameter.own_bounds
                if not low <= value <= high:
                    raise ParameterError(
                        f"{self.name}: {column} ({parameter.name}) is {value:g} {parameter.unit}, "
                        f"outside its bounds {low:g} to {high:g}."
                    )
        check_rules(self.name, numbers)
        check_options(self.name, self.options, numbers)
        object.__setattr__(self, "parameters", MappingProxyType(ordered))
        object.__setattr__(self, "numbers", MappingProxyType(numbers))

    def __repr__(self) -> str:
        return f"ParameterSet({self.name!r}, {len(self)} parameters)"

    def __getitem__(self, symbol: str) -> Parameter:
        if symbol in self.parameters:
            return self.parameters[symbol]
        definition = REFINEMENTS.get(symbol, OWN.get(symbol))
        if definition is None or definition.default is None:
            raise unknown_parameter(symbol)
        return Parameter(definition, definition.default, status="inactive")

    def __contains__(self, symbol: object) -> bool:
        return symbol in self.parameters

    def __iter__(self) -> Iterator[str]:
        return iter(self.parameters)

    def __len__(self) -> int:
        return len(self.parameters)

    def __hash__(self) -> int:
        return hash((self.name, self.options, self.equations, *self.numbers.values()))

    def __reduce__(self) -> tuple[object, ...]:
        # read-only views cannot be pickled, so a copy in another process is built anew
        given = (getattr(self, each.name) for each in fields(self) if each.init)
        return ParameterSet, tuple(
            dict(each) if isinstance(each, MappingProxyType) else each for each in given
        )

    @property
    def refinements(self) -> tuple[str, ...]:
        """Symbols of the refinements that are on."""
        return tuple(
            symbol
            for symbol, definition in REFINEMENTS.items()
            if definition.switch in self.options and self.numbers.get(symbol, 0.0) != 0.0
        )

    @property
    def plain(self) -> "ParameterSet":
        """The set without refinements, itself if it has none."""
        if REFINEMENTS.keys().isdisjoint(self.parameters) and not self.equations:
            return self
        parameters = {symbol: self.parameters[symbol] for symbol in CATALOGUE}
        own = {SWITCHES[symbol] for symbol in CATALOGUE if symbol in SWITCHES}
        return replace(self, parameters=parameters, options=self.options & own, equations=())

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
        made = []
        for block, title in titles.items():
            columns = (Column("symbol"), Column("name", wrap=True), *numbers)
            table = Table(title, (*columns, UNIT, Column("status")), si=True)
            members = [each for each in self.values() if each.definition.block == block]
            for source, group in groupby(members, key=lambda each: each.source):
                if source:
                    table.add("", f"{source}:", None, None, "", section=True)
                for number, each in enumerate(group):
                    values = (*each.values, None)[:2]
                    start = not source and number == 0
                    cells = (each.symbol, each.name, *values, each.status)
                    table.add(*cells, unit=each.unit, section=start)
            made += [table] if members else []
        return made

    def replace(
        self, changes: Mapping[str, Change], options: frozenset[str] | None = None
    ) -> "ParameterSet":
        """Copy with other values, marked as the user's.

        Parameters
        ----------
        changes : mapping
            Symbol (``Z16``, both directions or a pair) or column (``Z16_plus``) to value, SI.
        options : frozenset of str, optional
            Terms that count then. By default a refinement whose parameters are changed comes on
            where one of them is not 0, and goes off where all are.

        Raises
        ------
        ParameterError
            For an unknown name, a pair for a parameter without directions, or a broken rule.
        """
        parameters = dict(self.parameters)
        for name, change in changes.items():
            definition = find(name)
            old = parameters.get(definition.symbol, self[definition.symbol])
            parameters[definition.symbol] = replace(
                old, value=value_of(name, definition, change, old), source="", status="user"
            )
        if options is None:
            numbers = {symbol: parameters[symbol].values[0] for symbol in parameters}
            touched = {SWITCHES[name] for name in changes if name in SWITCHES}
            options = (self.options - touched) | (options_of(numbers) & touched)
        return replace(self, parameters=parameters, options=options)

    def scale(self, factors: Mapping[str, Change]) -> "ParameterSet":
        """Copy with values multiplied by factors; names as in `replace`."""
        changes: dict[str, Change] = {}
        for name, factor in factors.items():
            old = self[find(name).symbol]
            if name == old.symbol and isinstance(old.value, Pair):
                plus, minus = factor if isinstance(factor, tuple) else (factor, factor)
                changes[name] = Pair(old.value.plus * plus, old.value.minus * minus)
            elif isinstance(factor, tuple):
                raise ParameterError(f"{name} has one value, so it takes one factor, not two.")
            else:
                value = self.numbers[name] if name in self.numbers else old.values[0]
                changes[name] = value * factor
        return self.replace(changes)


def value_of(
    name: str, definition: Definition, change: Change, old: Parameter | None = None
) -> Value:
    """A change in the form that a parameter's value has; of one side beside the old other one."""
    if isinstance(change, tuple) and (not definition.directional or name != definition.symbol):
        raise ParameterError(f"{name} has one value, not a plus and a minus one.")
    if isinstance(change, tuple) and len(change) != 2:
        raise ParameterError(f"{name} takes one value or two (plus, minus), not {len(change)}.")
    try:
        numbers = [float(each) for each in (change if isinstance(change, tuple) else (change,))]
    except (TypeError, ValueError):
        raise ParameterError(
            f"{name} must be a number in {definition.unit}, or a pair of them, not {change!r}."
        ) from None
    if len(numbers) == 2:
        return Pair(*numbers)
    (number,) = numbers
    if not definition.directional:
        return number
    if name == definition.symbol:
        return Pair(number, number)
    assert old is not None
    assert isinstance(old.value, Pair)
    side = name.removeprefix(definition.symbol + "_")
    return old.value._replace(**{side: number})


class HasParameters(Protocol):
    """A drive, or whatever else has a parameter set."""

    @property
    def parameters(self) -> ParameterSet:
        """The set."""
        ...


def set_of(given: ParameterSet | HasParameters) -> ParameterSet:
    """A parameter set as it is, or that of a drive."""
    return given if isinstance(given, ParameterSet) else given.parameters
