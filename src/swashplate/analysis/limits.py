"""Limits of a drive, and what each of them costs a command."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from math import inf
from typing import TYPE_CHECKING, Unpack, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.analysis.capability import farthest_stop
from swashplate.analysis.outcomes import checked_speed, rms_difference
from swashplate.drive import Drive, Limit, RunKeywords, Simulation, simulate_drive
from swashplate.errors import DomainError, ParameterError, SwashplateError
from swashplate.machine.marching import SOURCE_RATE, Start
from swashplate.parameters import Change
from swashplate.results import Result, Tabular, figures
from swashplate.tables import Column, Table, listed, quantity, share_cell

if TYPE_CHECKING:
    import polars

    from swashplate.results import Figure

Array = NDArray[np.float64]

# --- limits that can be taken away ----------------------------------------------------------------


@dataclass(frozen=True)
class Removal(Result):
    """A limit, the component that sets it, and the changes that remove it."""

    limit: str
    """Its name with spaces."""
    component: str
    """Component of the machine to change."""
    flag: Limit | None
    """Flag of a simulation that marks it; None if it acts always or is not marked."""
    changes: dict[str, Change]
    """Parameters that take it away, SI."""
    signal: str = field(default="", kw_only=True)
    """Measured input without which it is away."""


MEASURED = (
    Removal("pump speed", "prime mover: less droop (pump_speed)", None, {}, signal="pump_speed"),
    Removal(
        "supply", "charge pump: less sag (supply_pressure)", None, {}, signal="supply_pressure"
    ),
)
"""Limits that measured inputs show; a load does not belong to the machine."""


def removals(drive: Drive) -> list[Removal]:
    """Limits of a drive that can be taken away, in the order of the chain.

    Only those whose removal changes a parameter. The spool offset is among them, although it limits
    nothing: the creep that it causes is an error, too.
    """
    numbers = drive.parameters.numbers
    definitions = drive.parameters.definitions
    # with the card's jump left as it is, a solenoid's dead zone beyond it would stay
    jump = min(numbers["Z17"], numbers["J_plus"], numbers["J_minus"])
    plate = farthest_stop(drive)
    stops = {name: max(plate, numbers[name]) for name in ("Z13_plus", "Z13_minus")}
    larger = "pump: larger, or a smaller motor (Z10, Z13)"
    orifice = "in-line orifice: larger bore (Z16)"
    if drive.parameters["Z4"].status == "assumed":  # a guessed machine may have no orifice
        orifice = "limit of the acceleration, modelled as an in-line orifice (Z16)"
    compensated = "card: dead-zone compensation (V_dz, or an inverse map)"
    no_ramp: dict[str, Change] = {"lim1": inf, "lim2": inf}
    candidates = (
        Removal("dead zone", compensated, Limit.DEAD_ZONE, {"V_dz": 0.0, "Z17": jump}),
        Removal("current rate", "card: faster ramp (lim1, lim2)", Limit.CURRENT_RATE, no_ramp),
        Removal("final decay", "card: no decay of the current (I_t2)", None, {"I_t2": 0.0}),
        Removal("delay", "card: shorter delay (tau)", None, {"tau": 0.0}),
        Removal("orifice", orifice, Limit.ORIFICE, {"Z16": inf}),
        Removal("spool stop", "spool: longer stroke (Z14)", Limit.SPOOL, {"Z14": inf}),
        Removal("swash stop", larger, Limit.SWASH_STOP, {**stops}),
        Removal("relief valve", "relief valve: higher setting (Z15)", Limit.RELIEF, {"Z15": inf}),
        Removal("spool offset", "spool: centred at rest (Z18)", None, {"Z18": 0.0}),
    )

    present = []
    for removal in candidates:
        changes = {
            name: value
            for name, value in removal.changes.items()
            if any(numbers[column] != value for column in definitions.columns_of([name]))
        }
        if changes:
            present.append(replace(removal, changes=changes))
    return present


# --- what each of them costs ----------------------------------------------------------------------


@dataclass(frozen=True)
class LimitShare(Removal):
    """Cost of one limit: how much smaller the tracking error is without it."""

    time_share: float | None
    """Share of the record's samples at which it acts, of the dead zone only those with a command
    other than 0 V; None for what no flag marks."""
    error: float | None
    """Rms tracking error without it; None if there is none, see `failure`. [rad/s]"""
    error_share: float | None
    """By how much of itself the rms error falls without it; negative if it grows. [1]"""
    error_as_only_limit: float | None
    """Rms tracking error with this limit and none of the others. [rad/s]"""
    failure: str = ""
    """Why a drive without it cannot be simulated."""
    unreached: bool = False
    """Whether no test of the drive reached it, so that its value only marks how far the tests
    went."""


@dataclass(frozen=True, eq=False)
class LimitShares(Tabular):
    """Costs of the limits of a drive under one command, the costliest first.

    The shares need not add up to 1: if one limit hides another, the removal of either by itself
    helps little; if they take turns, the removal of each helps.
    """

    name: str
    """Name of the drive."""
    run: Simulation
    """The drive as it is."""
    reference: Array
    """Required speed, (n,). [rad/s]"""
    error: float
    """Rms tracking error of the drive as it is. [rad/s]"""
    shares: tuple[LimitShare, ...]
    compared_with: str = "a drive without limits"
    """Name of the drive or speed that the drive is compared with."""
    unreached: tuple[str, ...] = ()
    """Columns of limits that act here and that no test of the drive reached."""

    @property
    def first(self) -> LimitShare | None:
        """The limit to change first; None if no single change makes the error smaller.

        None that no test reached: nobody knows where it lies.
        """
        reached = [share for share in self.shares if not share.unreached]
        costliest = reached[0] if reached else None
        if costliest is None or (costliest.error_share or 0.0) <= 0.0:
            return None
        return costliest

    def sentences(self) -> list[str]:
        """Name the limit to change first, and those that cannot be removed."""
        first = self.first
        sentences = ["No single change makes the error smaller."]
        if first is not None and first.error is not None:
            reduction = 1.0 - first.error / self.error
            sentences = [
                f"Change first: {first.component}. Without this limit the rms error of the "
                f"speed, against {self.compared_with}, falls by {100.0 * reduction:.1f} % to "
                f"{quantity(first.error, 'rad/s', spec='.3f')}."
            ]
        if self.unreached:
            sentences.append(
                f"No test reached {listed(self.unreached)}: its value only marks how far the "
                "tests went."
            )
        for share in self.shares:
            if share.failure:
                sentences.append(f"Not computed without the {share.limit}: {share.failure}")
        return sentences

    def table(self, *, acting: bool = False) -> Table:
        """Tabulate the costs of all limits, the costliest first; or only of those that act here."""
        columns = (
            Column("Limit", key="limit"),
            Column("component", of="f"),
            Column("failure", of="f"),
            Column("share of time", ".1%", key="time_share"),
            Column("error without it\n", ".3f", "rad/s", "none", key="error"),
            Column("share of error", "z.1%", key="error_share"),
            Column("error if alone\n", ".3f", "rad/s", "none", key="alone"),
        )
        table = Table("", columns)
        for share in self.shares:
            has_effect = share.error_share or share.error_as_only_limit
            if acting and not (share.time_share or has_effect or share.failure):
                continue
            table.add(
                share.limit,
                share.component,
                share.failure,
                share_cell(share.time_share),
                share.error,
                share.error_share,
                share.error_as_only_limit,
            )
        return table

    def plot(self, *, title: str | None = None) -> Figure:
        """Figure of command, speed and reference speed, and of when each limit acts."""
        draw = figures().plot_limit_timeline
        return cast("Figure", draw(self.run, reference=self.reference, title=title))

    def to_polars(self) -> polars.DataFrame:
        """Table of the shares, SI, the costliest first."""
        return self.table().to_polars()


def limit_shares(
    drive: Drive,
    voltage: ArrayLike,
    rate: float = SOURCE_RATE,
    *,
    start: Start = "rest",
    reference: ArrayLike | None = None,
    **keywords: Unpack[RunKeywords],
) -> LimitShares:
    """Share of time and of error due to each limit of a drive under a command, ranked.

    Parameters
    ----------
    drive : Drive
        The drive.
    voltage, rate, start, **keywords :
        The command and the signals measured with it, as in `Drive.simulate`.
    reference : (n,) array_like, optional
        Reference speed at the samples; by default what the drive would do without any of its
        limits. [rad/s]

    Returns
    -------
    LimitShares
        For each limit that the drive has: how often it acts, and by how much the rms error falls
        without it.

    Raises
    ------
    InputError
        For a record that cannot be simulated, or a reference speed that is not as long.
    DomainError
        If the drive as it is leaves the model's domain, or the one without any limits does and no
        reference speed is given. A limit whose removal breaks a rule of the parameters has a share
        with a `failure`, and is kept when all limits are removed.

    Notes
    -----
    A counterfactual: one limit is removed (the dead zone's V_dz and as much of Z17 as the card's
    jump does not cover, lim1 and lim2, I_t2, tau, Z16, Z14, Z13, Z15, Z18), the command is
    simulated again and compared with the same reference speed. By default that speed still has the
    lags of the card's filter and of the valve, so that the error is due only to the limits. A
    measured pump speed or supply pressure is a limit, too: without it the value of the parameter
    set counts.

    Examples
    --------
    >>> from swashplate import Drive, analysis, maneuvers
    >>> hoist = Drive.preset("hoist")
    >>> shares = analysis.limit_shares(hoist, maneuvers.sine(9.0, 0.2, length=12.5))
    >>> shares.shares[0].limit
    'orifice'
    """
    return shares_of(drive, drive.simulate(voltage, rate, start=start, **keywords), reference)


def shares_of(drive: Drive, run: Simulation, reference: ArrayLike | None = None) -> LimitShares:
    """Shares of each limit in a run of a drive; see `limit_shares`."""

    def speed_without(removed: Sequence[Removal]) -> Array | str:
        """Speed under the same command without some limits, or why it cannot be simulated."""
        changes: dict[str, Change] = {}
        for removal in removed:
            changes |= removal.changes
        signals = {removal.signal for removal in removed}
        records = {name: record for name, record in run.records.items() if name not in signals}
        try:
            parameters = drive.parameters.with_numbers(changes)
            return simulate_drive(parameters, records, run.start).shaft_speed
        except SwashplateError as error:
            return str(error)

    present = removals(drive)
    present += [removal for removal in MEASURED if removal.signal in run.records]
    removable = _removable_together(drive, present)
    unlimited = speed_without(removable)
    if reference is not None:
        reference_speed = checked_speed(reference, run.shaft_speed.size)
    elif isinstance(unlimited, str):
        raise DomainError(
            "Without its limits the drive cannot be simulated, so there is no speed to compare "
            f"with; give a reference speed ({unlimited.rstrip('.')})."
        )
    else:
        reference_speed = checked_speed(unlimited, run.shaft_speed.size)

    def error_of(speed: Array | str) -> float | None:
        return None if isinstance(speed, str) else rms_difference(speed, reference_speed)

    error = rms_difference(run.shaft_speed, reference_speed)
    shares = []
    unseen = drive.parameters.unreached.keys()
    for removal in present:
        speed = speed_without([removal])
        error_without = error_of(speed)
        error_share = None
        if error_without is not None:
            error_share = 1.0 - error_without / error if error else 0.0
        others = [other for other in removable if other is not removal]
        columns = drive.parameters.definitions.columns_of(removal.changes)
        shares.append(
            LimitShare(
                **vars(removal),
                time_share=None if removal.flag is None else run.time_share(removal.flag),
                error=error_without,
                error_share=error_share,
                error_as_only_limit=error_of(speed_without(others)),
                failure=speed if isinstance(speed, str) else "",
                unreached=bool(columns) and set(columns) <= unseen,
            )
        )
    shares.sort(key=lambda share: inf if share.error is None else share.error)
    acting_columns = set[str]()
    for share in shares:
        if share.time_share:
            acting_columns.update(drive.parameters.definitions.columns_of(share.changes))
    unreached = [column for column in unseen if column in acting_columns]
    result = LimitShares(
        name=drive.name,
        run=run,
        reference=reference_speed,
        error=error,
        shares=tuple(shares),
        unreached=tuple(unreached),
    )
    return result if reference is None else replace(result, compared_with="the reference speed")


def _removable_together(drive: Drive, present: Sequence[Removal]) -> list[Removal]:
    """As many limits as can be removed at the same time within the model's domain."""
    removable = []
    unlimited = drive.parameters
    for removal in present:
        try:
            unlimited = unlimited.with_numbers(removal.changes)
        except ParameterError:
            continue
        removable.append(removal)
    return removable
