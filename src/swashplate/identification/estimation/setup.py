"""Fit setup: what a fit is to find, and which part of the machine is simulated for it.

A drive's is written in TOML, and goes with the numbers of a `ParameterSet`. Of a user-defined model
a `model_setup.ModelSetup` is both, the numbers and what is to be found; its `setup` is the same, so
that all that comes after sees the same two things.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, Field, model_validator

from swashplate.campaign import LARGEST_PRESSURE, ChannelKind, TimeWindow, WeightWindow
from swashplate.documents import parse_toml, read_text, validated
from swashplate.entries import SCHEMA, Document, FileTable, Finite, Flag, NotNegative, Positive
from swashplate.errors import ParameterError
from swashplate.identification.estimation.unknowns import Prior, Unknown
from swashplate.machine.fields import is_real
from swashplate.parameters import SIDES, Definitions, ParameterSet

Array = NDArray[np.float64]
Pair = tuple[Finite, Finite]
StandardUncertainty = Positive | Annotated[str, Field(pattern=r"^\d+(\.\d+)? ?%$")]
"""A standard uncertainty: in SI units, or as "5 %" of the value."""
OUTERMOST = 8.0
"""Factor to the bounds of a number that is known by its spread: far out for the widest in use."""
COEFFICIENTS = ("Z19", "Z20", "Z21", "Z22")
"""Of the solenoids: what forces stand for."""


def rising(pair: tuple[float, float]) -> tuple[float, float]:
    """A pair of bounds; refused, in a ValueError, unless the lower one stands first."""
    if pair[0] < pair[1]:
        return pair
    turned = "is empty: both ends are equal"
    if pair[0] > pair[1]:
        turned = f"must rise: write [{pair[1]:g}, {pair[0]:g}]"
    raise ValueError(f"[{pair[0]:g}, {pair[1]:g}] {turned}")


Bounds = Annotated[Pair, AfterValidator(rising)]


class Free(FileTable):
    """How a parameter is free: both directions apart, unless tied."""

    relative: Bounds | None = Field(None, description="Bounds as factors on the nominal value.")
    bounds: Bounds | None = Field(None, description="Bounds in SI units.")
    log: Flag = Field(False, description="Estimate the logarithm: for positive values.")
    tied: Flag = Field(False, description="One value for both directions.")
    prior: Prior | None = Field(None, description="A normal distribution, of the logarithm if log.")
    spread: Positive | None = Field(
        None,
        description="What is known beforehand instead of a prior: a standard deviation as a share "
        "of the nominal value, of the logarithm of a positive one; bounds may be left out.",
    )

    @model_validator(mode="after")
    def _bounded(self) -> Free:
        if self.relative is not None and self.bounds is not None:
            raise ValueError("give either relative bounds or bounds")
        if self.relative is None and self.bounds is None and self.spread is None:
            raise ValueError("give either relative bounds or bounds, or a spread")
        if self.spread is not None and self.prior is not None:
            raise ValueError("give either a prior or a spread")
        return self

    def about(self, nominal: float) -> Free:
        """The same for a number of this nominal value, not 0: its spread as bounds and a prior."""
        if self.spread is None:
            return self
        log = self.log or nominal > 0.0
        size = abs(nominal)
        bounds = self.bounds
        if bounds is None and self.relative is None:
            bounds = (nominal - OUTERMOST * size, nominal + OUTERMOST * size)
            if log:
                bounds = (nominal / OUTERMOST, nominal * OUTERMOST)
        prior = Prior(nominal, self.spread if log else self.spread * size)
        changes = {"log": log, "prior": prior, "bounds": bounds, "spread": None}
        return self.model_copy(update=changes)


class Forces(FileTable):
    """Forces at four effective currents each way, as magnitudes: unknowns instead of Z19 to Z22.

    ``"force_plus_1"`` is the force at the first of `plus`; the effective current is what is left
    of the current beyond the dead zone Z17.
    """

    plus: tuple[Positive, Positive, Positive, Positive] = Field(
        description="Effective currents of the positive direction, increasing [A]."
    )
    minus: tuple[Positive, Positive, Positive, Positive] = Field(
        description="Of the negative direction, as magnitudes [A]."
    )
    relative: Bounds = Field((0.5, 2.0), description="Bounds as factors on the nominal forces.")

    names: ClassVar = tuple(f"force_{side}_{k}" for side in SIDES for k in (1, 2, 3, 4))
    """Names of the eight forces, in the order of `currents`."""
    columns: ClassVar = tuple(f"{symbol}_{side}" for side in SIDES for symbol in COEFFICIENTS)
    """The parameters that they stand for."""

    @property
    def currents(self) -> dict[str, float]:
        """The effective current of each force by its name, those of `minus` below 0. [A]"""
        currents = [*self.plus, *(-size for size in self.minus)]
        return dict(zip(self.names, currents, strict=True))

    @property
    def _inverse(self) -> Array:
        return _coefficients_of_forces(self.plus, self.minus)

    def values(self, parameters: ParameterSet) -> dict[str, float]:
        """The forces of a parameter set, by name. [N]"""
        coefficients = [parameters.numbers[column] for column in self.columns]
        forces = np.linalg.solve(self._inverse, coefficients)
        return dict(zip(self.names, forces.tolist(), strict=True))

    def coefficients(
        self, values: Mapping[str, float], parameters: ParameterSet
    ) -> dict[str, float]:
        """Coefficients for some forces; those not named are as in the parameter set. [N/Aᵏ]"""
        forces = self.values(parameters)
        changed = np.array([values.get(name, force) for name, force in forces.items()])
        coefficients = self._inverse @ changed
        return dict(zip(self.columns, coefficients.tolist(), strict=True))

    def slopes(self, name: str) -> dict[str, float]:
        """Derivatives by one force of the coefficients of its direction. [1/Aᵏ]"""
        slopes = self._inverse[:, self.names.index(name)].tolist()
        return {column: slope for column, slope in zip(self.columns, slopes, strict=True) if slope}


@cache
def _coefficients_of_forces(
    plus: tuple[float, float, float, float], minus: tuple[float, float, float, float]
) -> Array:
    """(8, 8) map from forces to coefficients, of F = Z19 i + Z20 i² + Z21 i³ + Z22 i⁴."""
    # not kept in the entry itself: entries are compared by all that they hold
    zero, orders = np.zeros((4, 4)), np.arange(1, 5)
    positive = np.power.outer(plus, orders)
    negative = np.power.outer(minus, orders) * (-1.0) ** (orders + 1)
    return np.linalg.inv(np.block([[positive, zero], [zero, negative]]))


class InputWeight(TimeWindow):
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


class FitSetup(Document):
    """A fit: what of a drive is simulated, against which channels, and what is free of it."""

    title: str = ""
    part: Literal["card", "pump", "chain", "model"] = Field(
        "chain",
        description="Simulated part: the control card, pump and motor, the complete chain; 'model' "
        "is for user-defined models, given by --model.",
    )
    current: Literal["simulated", "measured"] = Field(
        "simulated",
        description="Current that drives the pump alone: that of the drive's own card, or the "
        "measured one: the input if it is a current, otherwise the channel of the current, an "
        "ammeter around both leads with the command's sign.",
    )
    current_scale: Positive = Field(1.0, description="Factor on the measured current.")
    current_hysteresis: NotNegative = Field(
        0.0005,
        description="Hysteresis of solenoids and spool that remains with dither, as a full width "
        "of "
        "the current: a standard uncertainty [A] that intervals include, unless the drive models "
        "friction or hysteresis.",
    )
    channels: tuple[ChannelKind, ...] = Field((), description="Kinds to fit; all if empty.")
    free: dict[str, Free] = Field(min_length=1)
    forces: Forces | None = None
    weights: dict[ChannelKind, tuple[WeightWindow, ...]] = Field(
        {}, description="Windows with another weight, in addition to those of the campaign."
    )
    weights_by_input: dict[ChannelKind, tuple[InputWeight, ...]] = Field(
        {}, description="Weights by the size of the command, in addition to those of the campaign."
    )
    start_pressure: Positive | None = Field(
        None,
        le=LARGEST_PRESSURE,
        description="Largest stroking pressure at the first sample, free in each run [Pa]; if "
        "none is given, it is free only in runs with start = 'estimated'.",
    )
    standard_uncertainty: dict[str, StandardUncertainty] = Field(
        {},
        description="Standard uncertainty of fixed parameters, in SI units or as '5 %' of "
        "the value; the intervals of all estimates include it. Both directions of a symbol "
        "deviate together.",
    )
    card_filter: Literal["equation", "recursion"] = Field(
        "equation",
        description="Filter of a card whose set states a recursion for one rate, as the "
        "packaged ones do: the differential equation with the same poles, as real cards have it, "
        "or the recursion, to which published zeta and omega belong.",
    )

    @model_validator(mode="before")
    @classmethod
    def _of_one_stage(cls, content: Any) -> Any:
        """Take what earlier versions wrote: a setup of one stage stood in [[stages]]."""
        if not isinstance(content, Mapping) or "stages" not in content:
            return content
        stages = content["stages"]
        single = stages[0] if isinstance(stages, Sequence) and len(stages) == 1 else None
        if not isinstance(single, Mapping):
            raise ValueError(
                "a fit has no stages any more: write each into a file of its own, without "
                "[[stages]], and fit them one after another, each --from the folder of the one "
                "before; or go without a fit setup, and all numbers are fitted at once"
            )
        others = {key: value for key, value in content.items() if key != "stages"}
        return others | {key: value for key, value in single.items() if key != "name"}

    @model_validator(mode="after")
    def _consistent(self) -> FitSetup:
        if self.current_scale != 1.0 and (self.part, self.current) != ("pump", "measured"):
            raise ValueError("current_scale needs part = 'pump' and current = 'measured'")
        if self.start_pressure is not None and self.part == "card":
            raise ValueError("a card alone has no start_pressure")
        for name in self.standard_uncertainty:
            symbol = _symbol(name)
            free = any(entry in (name, symbol) or _symbol(entry) == name for entry in self.free)
            if free or (self.forces is not None and symbol in COEFFICIENTS):
                raise ValueError(
                    f"{name} is free: only what stays fixed has a standard_uncertainty; for a "
                    "free parameter state a prior"
                )
        return self

    @property
    def has_spreads(self) -> bool:
        """Whether something is known of each number beforehand: see `fit_problem.whole_drive`."""
        entries = self.free.values()
        known = all(entry.spread or entry.prior for entry in entries)
        return self.forces is None and known and any(entry.spread for entry in entries)

    def counts_less(self, kind: ChannelKind) -> bool:
        """Whether channels of a kind count less throughout, as what the model cannot describe."""
        windows = self.weights.get(kind, ())
        whole = [w for w in windows if w.start is None and w.stop is None and w.maneuver is None]
        return any(window.factor < 1.0 for window in whole)

    def beyond(self, unknown: Unknown, side: int, definitions: Definitions) -> str:
        """What to do about an unknown of the machine at its lower (-1) or upper (1) bound.

        `definitions` are those of the drive's parameters.
        """
        name = unknown.name
        if self.part == "model":
            return f"to extend the search, widen '{name}' in free of the model and fit again"
        if self.forces is not None and name in self.forces.names:
            where = "relative under [forces]"
        else:
            limits = definitions.find(name)
            least = limits.lower if limits.least is None else limits.least
            if unknown.high >= limits.upper if side > 0 else unknown.low <= least:
                return f"the {'greatest' if side > 0 else 'least'} value that it may have"
            where = f"{name if name in self.free else _symbol(name)} under [free]"
        return f"to extend the search, widen {where} of the fit setup and fit again"


def _symbol(name: str) -> str:
    return name.removesuffix("_plus").removesuffix("_minus")


def deviation(uncertainty: float | str, value: float) -> float:
    """A standard uncertainty as a number: in the value's unit, or ``"5 %"`` of its size."""
    if isinstance(uncertainty, str):
        return 0.01 * float(uncertainty.removesuffix("%")) * abs(value)
    return float(uncertainty)


def load_setup(path: str | Path) -> FitSetup:
    r"""A fit setup from a TOML file.

    Raises
    ------
    ParameterError
        If an entry is wrong, or the name is not that of a .toml file.
    FileError
        If the file cannot be read.

    Examples
    --------
    >>> from pathlib import Path
    >>> from swashplate.identification import load_setup
    >>> text = 'schema = 1\npart = "pump"\n[free]\nZ8 = { relative = [0.5, 2.0] }\n'
    >>> _ = Path("pump.toml").write_text(text, "utf-8")
    >>> load_setup("pump.toml").free["Z8"].relative
    (0.5, 2.0)
    """
    file = str(path)
    if not file.lower().endswith(".toml"):
        raise ParameterError(
            f"'{file}' is no fit setup: give a .toml file with a table [free], or leave it out, "
            "and every number of the named drive is fitted at once."
        )
    return validated(parse_toml(read_text(path), file), FitSetup, file)


FreeParameters = FitSetup | str | Path | Mapping[str, Any]
"""What a fit is to estimate: a fit setup, its file, or a mapping."""


def free_entries(free: Mapping[str, Any], definitions: Definitions) -> dict[str, Free]:
    """What a mapping frees of a drive, by symbol or column.

    Each value is a pair of factors on the nominal value, ``{"Z8": (0.5, 2)}``, a `Free`, or a
    mapping as in the TOML file, ``{"Z8": {"bounds": [1e5, 9e5]}}``. A `ParameterError` names what
    is wrong.
    """
    entries: dict[str, Free] = {}
    for name, entry in free.items():
        definitions.find(name)
        if isinstance(entry, Free):
            entries[name] = entry
        elif isinstance(entry, Mapping):
            entries[name] = validated(dict(entry), Free, f"free, {name}")
        elif isinstance(entry, Sequence) and len(entry) == 2 and all(map(is_real, entry)):
            entries[name] = validated({"relative": tuple(entry)}, Free, f"free, {name}")
        else:
            raise ParameterError(
                f"{name} is free as {entry!r}: give two factors on its nominal value, (0.5, 2), or "
                "its bounds in SI, {'bounds': (LOW, HIGH)}."
            )
    return entries


def setup_text(setup: FitSetup) -> str:
    """A fit setup as TOML that `load_setup` reads as an equal one."""
    from tomlkit import dumps, inline_table

    content = setup.model_dump(mode="json", by_alias=True, exclude_defaults=True)
    for name, entry in content["free"].items():
        content["free"][name] = inline_table()
        content["free"][name].update(entry)
    return dumps({"schema": SCHEMA} | content)
