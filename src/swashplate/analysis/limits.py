"""Limits of a drive, and what each of them costs a command."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import atan, inf
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.analysis.outcomes import rms_difference, time_share
from swashplate.drive import Drive
from swashplate.equations.marching.record import SOURCE_RATE, Interpolation
from swashplate.equations.marching.run import Start
from swashplate.errors import DomainError, InputError, SwashplateError
from swashplate.parameters.parameter_set import Change
from swashplate.results import Result, Tabular
from swashplate.simulation.result import Limit, Simulation
from swashplate.simulation.run import simulate_drive
from swashplate.tables import Cell, Column, Table, quantity

if TYPE_CHECKING:
    import polars

Array = NDArray[np.float64]

# --- limits that can be taken away ----------------------------------------------------------------

FEEDBACK_ARM = 0.98
"""Sine of the feedback arm's angle at which a plate without a stop is still held: at 1 the closed
form of the spool ends."""
WIDEST = 1.5  # Largest angle of a plate without a stop; the model ends at a right angle. [rad]


class Removal(NamedTuple):
    """A limit, the component behind it, and the changes that take it away."""

    limit: str  # In words.
    component: str  # What would have to change in the machine.
    flag: Limit | None  # How a simulation marks it, None for what acts always or is not marked.
    changes: Callable[[Mapping[str, float]], Mapping[str, Change]]
    """What takes it away from a drive of these values."""

    def of(self, drive: Drive) -> dict[str, Change]:
        """The changes that alter anything in this drive; none if it has no such limit."""
        numbers, made = drive.parameters.numbers, {}
        for name, value in self.changes(numbers).items():
            both = drive[name].values if name in drive.parameters else (numbers[name],)
            if any(value != old for old in both):
                made[name] = value
        return made


def _dead_zone(numbers: Mapping[str, float]) -> dict[str, Change]:
    # with the card's jump left as it is, a solenoid's dead zone beyond it would stay
    return {"V_dz": 0.0, "Z17": min(numbers["Z17"], numbers["J_plus"], numbers["J_minus"])}


def _swash_stop(numbers: Mapping[str, float]) -> dict[str, Change]:
    widest = min(atan(FEEDBACK_ARM / numbers["Z3"]), WIDEST)
    return {name: max(widest, numbers[name]) for name in ("Z13_plus", "Z13_minus")}


def _to(**changes: Change) -> Callable[[Mapping[str, float]], Mapping[str, Change]]:
    """The same changes for any drive."""
    return lambda _: changes


REMOVALS = (
    Removal(
        *("dead zone", "card: dead-zone compensation (V_dz, or an inverse map)"),
        *(Limit.DEAD_ZONE, _dead_zone),
    ),
    Removal(
        *("current rate", "card: faster ramp (lim1, lim2)", Limit.CURRENT_RATE),
        _to(lim1=inf, lim2=inf),
    ),
    Removal("final decay", "card: no decay of the current (I_t2)", None, _to(I_t2=0.0)),
    Removal("delay", "card: shorter delay (tau)", None, _to(tau=0.0)),
    Removal("orifice", "in-line orifice: larger bore (Z16)", Limit.ORIFICE, _to(Z16=inf)),
    Removal("spool stop", "spool: longer stroke (Z14)", Limit.SPOOL, _to(Z14=inf)),
    Removal(
        *("swash stop", "pump: larger, or a smaller motor (Z10, Z13)"),
        *(Limit.SWASH_STOP, _swash_stop),
    ),
    Removal("relief valve", "relief valve: higher setting (Z15)", Limit.RELIEF, _to(Z15=inf)),
    Removal("plussing", "spool: centred at rest (Z18)", None, _to(Z18=0.0)),
)
"""What can be taken away, in the order of the chain; the plussing, which no force limits, because
the creep that it makes is an error, too."""


# --- what each of them costs ----------------------------------------------------------------------


@dataclass(frozen=True)
class LimitShare(Result):
    """What one limit costs."""

    limit: str  # In words.
    component: str  # What would have to change in the machine.
    changes: dict[str, Change]  # The changes that took it away, SI.
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
    unlimited_error: float | None
    """Rms tracking error with every limit taken away: 0 unless another speed was wanted than that
    drive's. None where it cannot be simulated. [rad/s]"""
    shares: tuple[LimitShare, ...]

    @property
    def first(self) -> LimitShare | None:
        """The limit to change first; None if no single change makes the error smaller."""
        best = self.shares[0] if self.shares else None
        return best if best is not None and (best.error_share or 0.0) > 0.0 else None

    def sentences(self) -> list[str]:
        """What to change first, and what cannot be left out."""
        first = self.first
        if first is None or first.error is None or first.error_share is None:
            said = ["No single change makes the error smaller."]
        else:
            error = quantity(first.error, "rad/s", spec=".3f")
            said = [
                f"Change first: {first.component}. Without this limit the error falls by "
                f"{100.0 * first.error_share:.1f} % to {error} rms."
            ]
        failed = (each for each in self.shares if each.failure)
        return said + [f"Not without the {each.limit}: {each.failure}" for each in failed]

    def table(self) -> Table:
        """What each limit costs, the costliest first."""
        errors = ("rad/s", "none")
        made = Table(
            "",
            (
                Column("Limit", key="limit"),
                *(Column(name, of="f") for name in ("component", "failure")),
                Column("share of time", ".1%", key="time_share"),
                Column("error without it\n", ".3f", *errors, key="error"),
                Column("share of error", "z.1%", key="error_share"),
                Column("error if alone\n", ".3f", *errors, key="alone"),
            ),
        )
        for each in self.shares:
            time = Cell(0.0, "never") if each.time_share == 0.0 else each.time_share
            words = each.limit, each.component, each.failure
            numbers = time, each.error, each.error_share, each.alone
            made.add(*words, *numbers)
        return made

    def acting(self) -> Table:
        """The table without the limits that do nothing here."""
        made, shares = self.table(), self.shares
        does = [s.time_share or s.error_share or s.failure or s.alone for s in shares]
        made.rows = [row for row, each in zip(made.rows, does, strict=True) if each]
        return made

    def to_polars(self) -> polars.DataFrame:
        """Table of the shares, SI, the costliest first."""
        return self.table().to_polars()


def limit_shares(
    drive: Drive,
    voltage: ArrayLike,
    rate: float = SOURCE_RATE,
    *,
    time: ArrayLike | None = None,
    interpolation: Interpolation | None = None,
    start: Start = "rest",
    clip: bool = False,
    wanted: ArrayLike | None = None,
) -> LimitShares:
    """Share of time and of error due to each limit of a drive under a command, ranked.

    Parameters
    ----------
    drive : Drive
        The drive.
    voltage, rate, time, interpolation, start, clip :
        The command, as in `Drive.simulate`.
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
    the card's filter and of the valve, so that only the limits make an error.
    """
    run = drive.simulate(
        voltage, rate, time=time, interpolation=interpolation, start=start, clip=clip
    )
    present = {each: changes for each in REMOVALS if (changes := each.of(drive))}
    built = {each: _changed(drive, changes) for each, changes in present.items()}
    unlimited, removed = drive, dict[Removal, dict[str, Change]]()
    for removal, changes in present.items():  # as many at once as the model's domain allows
        more = _changed(unlimited, changes)
        if not isinstance(built[removal], str) and not isinstance(more, str):
            unlimited, removed[removal] = more, changes
    asked = _free_speed(unlimited, run, start) if wanted is None else np.array(wanted, dtype=float)
    if asked.shape != run.shaft_speed.shape or not np.isfinite(asked).all():
        raise InputError(
            f"The wanted speed must be {run.shaft_speed.size} finite numbers, one a sample."
        )
    error = rms_difference(run.shaft_speed, asked)

    def error_of(other: Drive | str) -> tuple[float | None, str]:
        """Its error over the same command, or why there is none."""
        if isinstance(other, str):
            return None, other
        try:
            again = simulate_drive(other.parameters, run.records, start)
        except SwashplateError as refusal:
            return None, str(refusal)
        return rms_difference(again.shaft_speed, asked), ""

    shares = []
    for removal, changes in present.items():
        without, failure = error_of(built[removal])
        others = {k: v for each, c in removed.items() if each is not removal for k, v in c.items()}
        fall = None
        if without is not None:
            fall = (error - without) / error if error > 0.0 else 0.0
        shares.append(
            LimitShare(
                removal.limit,
                removal.component,
                changes,
                None if removal.flag is None else time_share(run, removal.flag),
                without,
                fall,
                error_of(_changed(drive, others))[0],
                failure,
            )
        )
    shares.sort(key=lambda each: inf if each.error is None else each.error)
    return LimitShares(drive.name, run, asked, error, error_of(unlimited)[0], tuple(shares))


def _changed(drive: Drive, changes: Mapping[str, Change]) -> Drive | str:
    """The drive with changes, or why there is none such."""
    try:
        return drive.replace(**changes)
    except SwashplateError as refusal:
        return str(refusal)


def _free_speed(unlimited: Drive, run: Simulation, start: Start) -> Array:
    try:
        return simulate_drive(unlimited.parameters, run.records, start).shaft_speed
    except SwashplateError as refusal:
        raise DomainError(
            f"Without its limits the drive cannot be simulated, so that there is no speed to "
            f"compare with; give the one that is wanted ({str(refusal).rstrip('.')})."
        ) from None
