"""Limits of a drive, and what each of them costs a command."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from math import inf
from typing import TYPE_CHECKING, Unpack, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.analysis.capability import farthest_stop
from swashplate.analysis.outcomes import checked_speed, rms_difference
from swashplate.drive import Drive, Given
from swashplate.equations.marching.record import SOURCE_RATE
from swashplate.equations.marching.run import Start
from swashplate.errors import DomainError, ParameterError, SwashplateError
from swashplate.parameters.definitions import columns_of
from swashplate.parameters.parameter_set import Change
from swashplate.results import Result, Tabular, figures
from swashplate.simulation.result import Limit, Simulation
from swashplate.simulation.run import simulate_drive
from swashplate.tables import Column, Table, listed, quantity, share_cell

if TYPE_CHECKING:
    import polars

    from swashplate.results import Figure

Array = NDArray[np.float64]

# --- limits that can be taken away ----------------------------------------------------------------


@dataclass(frozen=True)
class Removal(Result):
    """A limit, the component behind it, and the changes that take it away."""

    limit: str  # In words.
    component: str  # What would have to change in the machine.
    flag: Limit | None  # How a simulation marks it, None for what acts always or is not marked.
    changes: dict[str, Change]  # What takes it away, SI.
    # Measured input without which it is away.
    signal: str = field(default="", kw_only=True)


MEASURED = (
    Removal("pump speed", "prime mover: less droop (pump_speed)", None, {}, signal="pump_speed"),
    Removal(
        "supply", "charge pump: less sag (supply_pressure)", None, {}, signal="supply_pressure"
    ),
)
"""What measured inputs take away from a drive; a load is not the machine's."""


def removals(drive: Drive) -> list[Removal]:
    """What can be taken away from a drive, in the order of the chain, where that alters anything.

    The plussing, which no force limits, because the creep that it makes is an error, too.
    """
    numbers = drive.parameters.numbers
    # with the card's jump left as it is, a solenoid's dead zone beyond it would stay
    jump = min(numbers["Z17"], numbers["J_plus"], numbers["J_minus"])
    plate = farthest_stop(drive)
    stops = {name: max(plate, numbers[name]) for name in ("Z13_plus", "Z13_minus")}
    larger = "pump: larger, or a smaller motor (Z10, Z13)"
    orifice = "in-line orifice: larger bore (Z16)"
    if drive.parameters["Z4"].status == "assumed":  # a guessed machine may have no orifice
        orifice = "what limits the acceleration, in the model an in-line orifice (Z16)"
    compensated = "card: dead-zone compensation (V_dz, or an inverse map)"
    ramp = {"lim1": inf, "lim2": inf}
    known = (
        Removal("dead zone", compensated, Limit.DEAD_ZONE, {"V_dz": 0.0, "Z17": jump}),
        Removal("current rate", "card: faster ramp (lim1, lim2)", Limit.CURRENT_RATE, {**ramp}),
        Removal("final decay", "card: no decay of the current (I_t2)", None, {"I_t2": 0.0}),
        Removal("delay", "card: shorter delay (tau)", None, {"tau": 0.0}),
        Removal("orifice", orifice, Limit.ORIFICE, {"Z16": inf}),
        Removal("spool stop", "spool: longer stroke (Z14)", Limit.SPOOL, {"Z14": inf}),
        Removal("swash stop", larger, Limit.SWASH_STOP, {**stops}),
        Removal("relief valve", "relief valve: higher setting (Z15)", Limit.RELIEF, {"Z15": inf}),
        Removal("plussing", "spool: centred at rest (Z18)", None, {"Z18": 0.0}),
    )

    def altered(changes: dict[str, Change]) -> dict[str, Change]:
        pairs = changes.items()
        return {k: v for k, v in pairs if any(numbers[c] != v for c in columns_of([k]))}

    made = [replace(each, changes=altered(each.changes)) for each in known]
    return [each for each in made if each.changes]


# --- what each of them costs ----------------------------------------------------------------------


@dataclass(frozen=True)
class LimitShare(Removal):
    """What one limit costs."""

    time_share: float | None
    """Share of the record's samples at which it acts, of the dead zone only those with a command
    other than 0 V; None for what no flag marks."""
    error: float | None
    """Rms tracking error without it; None where there is none to be had, see `failure`. [rad/s]"""
    error_share: float | None
    """By how much of itself the rms error falls without it; negative if it grows. [1]"""
    alone: float | None  # Rms tracking error with this limit and none of the others. [rad/s]
    failure: str = ""  # Why a drive without it cannot be simulated.


@dataclass(frozen=True, eq=False)
class LimitShares(Tabular):
    """What each limit of a drive costs under one command, the costliest first.

    The shares need not add up to 1: where one limit hides another, taking either away alone helps
    little, and where they take turns each helps on its own.
    """

    name: str
    """Name of the drive."""
    run: Simulation
    """The drive as it is."""
    wanted: Array
    """Wanted speed, (n,). [rad/s]"""
    error: float
    """Rms tracking error of the drive as it is. [rad/s]"""
    shares: tuple[LimitShare, ...]
    reference: str = "a drive without limits"
    """What is compared with, in words."""
    unseen: tuple[str, ...] = ()
    """Columns of limits that act here and that no test of the drive reached."""

    @property
    def first(self) -> LimitShare | None:
        """The limit to change first; None if no single change makes the error smaller."""
        return next((each for each in self.shares[:1] if (each.error_share or 0.0) > 0.0), None)

    def sentences(self) -> list[str]:
        """What to change first, and what cannot be left out."""
        first, said = self.first, ["No single change makes the error smaller."]
        if first is not None and first.error is not None:
            share = 1.0 - first.error / self.error
            said = [
                f"Change first: {first.component}. Without this limit the rms error of the "
                f"speed, against {self.reference}, falls by {100.0 * share:.1f} % to "
                f"{quantity(first.error, 'rad/s', spec='.3f')}."
            ]
        if self.unseen:
            said.append(
                f"No test reached {listed(self.unseen)}: what is said of it here is no more than "
                "where the tests ended."
            )
        failed = (each for each in self.shares if each.failure)
        return said + [f"Not without the {each.limit}: {each.failure}" for each in failed]

    def table(self, *, acting: bool = False) -> Table:
        """What each limit costs, the costliest first; or only those that do something here."""
        errors = ("rad/s", "none")
        columns = (
            Column("Limit", key="limit"),
            *(Column(name, of="f") for name in ("component", "failure")),
            Column("share of time", ".1%", key="time_share"),
            Column("error without it\n", ".3f", *errors, key="error"),
            Column("share of error", "z.1%", key="error_share"),
            Column("error if alone\n", ".3f", *errors, key="alone"),
        )
        made = Table("", columns)
        for each in self.shares:
            if acting and not (each.time_share or each.error_share or each.failure or each.alone):
                continue
            words = each.limit, each.component, each.failure
            time = share_cell(each.time_share)
            made.add(*words, time, each.error, each.error_share, each.alone)
        return made

    def plot(self, *, title: str | None = None) -> Figure:
        """Figure of command and speed, beside the wanted speed, and of when each limit acts."""
        draw = figures().plot_limit_timeline
        return cast("Figure", draw(self.run, wanted=self.wanted, title=title))

    def to_polars(self) -> polars.DataFrame:
        """Table of the shares, SI, the costliest first."""
        return self.table().to_polars()


def limit_shares(
    drive: Drive,
    voltage: ArrayLike,
    rate: float = SOURCE_RATE,
    *,
    start: Start = "rest",
    wanted: ArrayLike | None = None,
    **given: Unpack[Given],
) -> LimitShares:
    """Share of time and of error due to each limit of a drive under a command, ranked.

    Parameters
    ----------
    drive : Drive
        The drive.
    voltage, rate, start, **given :
        The command and what was measured beside it, as in `Drive.simulate`.
    wanted : (n,) array_like, optional
        Speed that was wanted at the samples; by default what the drive would do without any of its
        limits. [rad/s]

    Returns
    -------
    LimitShares
        For each limit that the drive has: how often it acts, and by how much the rms error falls
        without it.

    Raises
    ------
    InputError
        For a record that cannot be simulated, or a wanted speed that is not as long.
    DomainError
        If the drive as it is leaves the model's domain, or the one without any limits does and no
        speed is given as wanted. A limit whose removal breaks a rule of the parameters has a share
        with a `failure`, and stays where all others are taken away.

    Notes
    -----
    A counterfactual: one limit is taken away (the dead zone's V_dz and as much of Z17 as the card's
    jump does not cover, lim1 and lim2, I_t2, tau, Z16, Z14, Z13, Z15, Z18), the command is
    simulated again and compared with the same wanted speed. That, by default, still has the lags of
    the card's filter and of the valve, so that only the limits make an error. A measured pump speed
    or supply pressure is a limit, too: away, the set's own stands in its place.
    """
    return shares_of(drive, drive.simulate(voltage, rate, start=start, **given), wanted)


def shares_of(drive: Drive, run: Simulation, wanted: ArrayLike | None = None) -> LimitShares:
    """Shares of each limit in a run of a drive; see `limit_shares`."""

    def speed_without(*limits: Removal) -> Array | str:
        """Speed over the same command, or why there is none."""
        changes = {name: value for each in limits for name, value in each.changes.items()}
        left = {each.signal for each in limits}
        records = {name: each for name, each in run.records.items() if name not in left}
        try:
            other = drive.parameters.with_numbers(changes)
            return simulate_drive(other, records, run.start).shaft_speed
        except SwashplateError as refusal:
            return str(refusal)

    present = removals(drive) + [each for each in MEASURED if each.signal in run.records]
    removed, unlimited = list[Removal](), drive
    for each in present:  # as many at once as the model's domain allows
        try:
            unlimited = Drive(unlimited.parameters.with_numbers(each.changes))
        except ParameterError:
            continue
        removed.append(each)
    free = speed_without(*removed)
    if wanted is None and isinstance(free, str):
        raise DomainError(
            "Without its limits the drive cannot be simulated, so that there is no speed to "
            f"compare with; give the one that is wanted ({free.rstrip('.')})."
        )
    asked = checked_speed(free if wanted is None else wanted, run.shaft_speed.size)

    def error_of(speed: Array | str) -> float | None:
        return None if isinstance(speed, str) else rms_difference(speed, asked)

    error, shares = rms_difference(run.shaft_speed, asked), []
    for each in present:
        speed = speed_without(each)
        without = error_of(speed)
        shares.append(
            LimitShare(
                **vars(each),
                time_share=None if each.flag is None else run.time_share(each.flag),
                error=without,
                error_share=None if without is None else 1.0 - without / error if error else 0.0,
                alone=error_of(speed_without(*(one for one in removed if one is not each))),
                failure=speed if isinstance(speed, str) else "",
            )
        )
    shares.sort(key=lambda each: inf if each.error is None else each.error)
    acting = {column for each in shares if each.time_share for column in each.changes}
    unseen = tuple(column for column in drive.parameters.unreached if column in acting)
    made = LimitShares(drive.name, run, asked, error, tuple(shares), unseen=unseen)
    return made if wanted is None else replace(made, reference="the wanted speed")
