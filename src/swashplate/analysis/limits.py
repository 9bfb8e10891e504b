"""Limits: which acts when, and what each of them costs a command."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from math import atan, inf
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.analysis.tracking import tracking_error
from swashplate.analysis.whatif import pulled
from swashplate.drive import Drive
from swashplate.equations.marching.record import SOURCE_RATE, Interpolation
from swashplate.equations.marching.run import Start
from swashplate.errors import DomainError, SwashplateError
from swashplate.parameters.parameter_set import Change
from swashplate.simulation.result import Limit, Simulation
from swashplate.simulation.run import simulate_drive
from swashplate.tables import Cell, Column, Table, quantity

if TYPE_CHECKING:
    import polars

# --- limit timeline -------------------------------------------------------------------------------


Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class LimitTimeline:
    """Stretches of time in which limits act; several can act at once."""

    limits: tuple[Limit, ...]
    """Those that act anywhere, in the order of the chain."""
    spans: tuple[Array, ...]
    """For each of them beginning and end of every stretch, (m, 2). [s]"""
    shares: tuple[float, ...]
    """For each of them the share of the samples at which it acts."""
    free: float
    """Share of the samples at which none acts."""

    def to_polars(self) -> polars.DataFrame:
        """Table of the stretches by their beginning: ``limit``, ``begin`` [s], ``end`` [s]."""
        import polars as pl

        rows = [
            (str(limit.name).lower(), *span)
            for limit, spans in zip(self.limits, self.spans, strict=True)
            for span in spans.tolist()
        ]
        schema = {"limit": pl.String, "begin": pl.Float64, "end": pl.Float64}
        return pl.DataFrame(rows, schema=schema, orient="row").sort("begin", maintain_order=True)


def limit_timeline(run: Simulation) -> LimitTimeline:
    """Which limit acts when in a simulation.

    Parameters
    ----------
    run : Simulation
        Whose flags are read.

    Returns
    -------
    LimitTimeline
        A sample stands for the time up to half way to its neighbours, the first and the last for
        half as much.
    """
    acting = [limit for limit in Limit if run.active(limit).any()]
    return LimitTimeline(
        tuple(acting),
        tuple(_spans(run.active(limit), run.time) for limit in acting),
        tuple(float(run.active(limit).mean()) for limit in acting),
        float((run.limits == 0).mean()),
    )


def _spans(active: NDArray[np.bool_], time: Array) -> Array:
    turns = np.flatnonzero(np.diff(active, prepend=False, append=False))
    middles = np.concatenate((time[:1], 0.5 * (time[1:] + time[:-1]), time[-1:]))
    return np.stack((middles[turns[::2]], middles[turns[1::2]]), axis=1)


# --- removals -------------------------------------------------------------------------------------


FEEDBACK_ARM = 0.98
"""Sine of the feedback arm's angle at which a plate without a stop is still held: at 1 the closed
form of the spool ends."""
WIDEST = 1.5
"""Largest angle of a plate without a stop; the model ends at a right angle. [rad]"""


@dataclass(frozen=True)
class Removal:
    """A limit, the component behind it, and the changes that take it away."""

    limit: str
    """In words."""
    component: str
    """What would have to change in the machine."""
    changes: Callable[[Drive], Mapping[str, Change]]
    eased_by: Callable[[Drive], Mapping[str, float]]
    """Factors on levers that ease the limit under the same command; none where that needs another
    command as well."""
    flag: Limit | None = None
    """How a simulation marks it, None for what acts always or is not marked."""

    def of(self, drive: Drive) -> dict[str, Change]:
        """The changes that alter anything in this drive; none if it has no such limit."""
        numbers = drive.parameters.numbers
        made = {}
        for name, value in self.changes(drive).items():
            both = drive[name].values if name in drive.parameters else (numbers[name],)
            if any(value != old for old in both):
                made[name] = value
        return made


def _covered(drive: Drive) -> float:
    """Dead zone of the solenoids that the card's jump covers both ways. [A]"""
    numbers = drive.parameters.numbers
    return min(numbers["Z17"], numbers["J_plus"], numbers["J_minus"])


def _dead_zone(drive: Drive) -> dict[str, Change]:
    # with the card's jump left as it is, a solenoid's dead zone beyond it would stay
    return {"V_dz": 0.0, "Z17": _covered(drive)}


def _less_dead_zone(drive: Drive) -> dict[str, float]:
    left = drive.parameters.numbers["Z17"]
    covered = _covered(drive)
    return {"dead_zone": 0.0} if covered == left else {"dead_zone": 0.0, "Z17": covered / left}


def _swash_stop(drive: Drive) -> dict[str, Change]:
    widest = min(atan(FEEDBACK_ARM / drive.parameters.numbers["Z3"]), WIDEST)
    return {
        f"Z13_{side}": max(widest, drive.parameters.numbers[f"Z13_{side}"])
        for side in ("plus", "minus")
    }


REMOVALS = (
    Removal(
        "dead zone",
        "card: dead-zone compensation (V_dz, or an inverse map)",
        _dead_zone,
        _less_dead_zone,
        Limit.DEAD_ZONE,
    ),
    Removal(
        "current rate",
        "card: faster ramp (lim1, lim2)",
        lambda _: {"lim1": inf, "lim2": inf},
        lambda _: {"rate_limits": 1.5},
        Limit.CURRENT_RATE,
    ),
    Removal(
        "final decay",
        "card: no decay of the current (I_t2)",
        lambda _: {"I_t2": 0.0},
        lambda _: {"I_t2": 0.5},
    ),
    Removal(
        "delay",
        "card: shorter delay (tau)",
        lambda _: {"tau": 0.0},
        lambda _: {"tau": 0.5},
    ),
    Removal(
        "orifice",
        "in-line orifice: larger bore (Z16)",
        lambda _: {"Z16": inf},
        lambda _: {"orifice": 1.5},
        Limit.ORIFICE,
    ),
    Removal(
        "spool stop",
        "spool: longer stroke (Z14)",
        lambda _: {"Z14": inf},
        lambda _: {"spool_stroke": 1.5},
        Limit.SPOOL,
    ),
    Removal(
        "swash stop",
        "pump: larger, or a smaller motor (Z10, Z13)",
        _swash_stop,
        lambda _: {},
        Limit.SWASH_STOP,
    ),
    Removal(
        "relief valve",
        "relief valve: higher setting (Z15)",
        lambda _: {"Z15": inf},
        lambda _: {"relief": 1.5},
        Limit.RELIEF,
    ),
    Removal(
        "plussing",
        "spool: centred at rest (Z18)",
        lambda _: {"Z18": 0.0},
        lambda _: {"plussing": 0.0},
    ),
)
"""What can be taken away, in the order of the chain; the plussing, which no force limits, because
the creep that it makes is an error, too."""


# --- limits ---------------------------------------------------------------------------------------


@dataclass(frozen=True)
class LimitShare:
    """What one limit costs."""

    limit: str
    """In words."""
    component: str
    """What would have to change in the machine."""
    changes: dict[str, Change]
    """The changes that took it away, SI."""
    time_share: float | None
    """Share of the record's samples at which it acts, of the dead zone only those with a command
    other than 0 V; None for what no flag marks."""
    error: float | None
    """Rms tracking error without it; None where there is none to be had, see `failure`. [rad/s]"""
    error_share: float | None
    """By how much of itself the rms error falls without it; negative if it grows. [1]"""
    alone: float | None
    """Rms tracking error with this limit and none of the others. [rad/s]"""
    eased_by: Mapping[str, float]
    """Factors on levers (`levers`) that ease it, to try; none where that needs another command."""
    eased_error: float | None
    """Rms tracking error with these; None without any. [rad/s]"""
    failure: str = ""
    """Why a drive without it cannot be simulated."""


@dataclass(frozen=True, eq=False)
class LimitShares:
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

    def eased_sentence(self) -> str:
        """What a change of the first limit buys, where it can be eased."""
        first = self.first
        assert first is not None
        assert first.eased_error is not None
        named = " and ".join(f"{name} x {factor:.4g}" for name, factor in first.eased_by.items())
        fall = 100.0 * (1.0 - first.eased_error / self.error)
        return (
            f"With {named} it {'falls' if fall >= 0.0 else 'grows'} by {abs(fall):.1f} % to "
            f"{quantity(first.eased_error, 'rad/s', spec='.3f')} rms."
        )

    def to_polars(self) -> polars.DataFrame:
        """Table of the shares, SI, the costliest first."""
        import polars as pl

        floats = ("time_share", "error", "error_share", "alone", "eased_error")
        words = ("limit", "component", "failure")
        return pl.DataFrame(
            {name: [getattr(each, name) for each in self.shares] for name in (*words, *floats)},
            schema=dict.fromkeys(words, pl.String) | dict.fromkeys(floats, pl.Float64),
        )

    def write(self, path: str | Path) -> None:
        """Write the table of `to_polars` as CSV or Parquet, by the path's ending."""
        from swashplate.tables import write_table

        write_table(self.to_polars(), path)


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
        For a record that cannot be simulated.
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
    removals = {each: each.of(drive) for each in REMOVALS}
    present = {each: changes for each, changes in removals.items() if changes}
    built = {each: _replaced(drive, changes) for each, changes in present.items()}
    unlimited, removed = _unlimited(drive, built, present)
    asked = np.array(
        _free_speed(unlimited, run, start) if wanted is None else wanted, dtype=np.float64
    )
    error = tracking_error(run.shaft_speed, asked).rms

    def error_of(other: Drive | str) -> tuple[float | None, str]:
        """Its error over the same command, or why there is none."""
        if isinstance(other, str):
            return None, other
        try:
            again = simulate_drive(other.parameters, run.record, start)
        except SwashplateError as refusal:
            return None, str(refusal)
        return tracking_error(again.shaft_speed, asked).rms, ""

    shares = []
    for removal, changes in present.items():
        without, failure = error_of(built[removal])
        others = [present[each] for each in removed if each is not removal]
        alone, _ = error_of(_replaced(drive, _joined(others)))
        eased_by = removal.eased_by(drive)
        shares.append(
            LimitShare(
                removal.limit,
                removal.component,
                changes,
                None if removal.flag is None else time_share(run, removal.flag),
                without,
                None if without is None else _fall(error, without),
                alone,
                eased_by,
                error_of(_eased(drive, eased_by))[0],
                failure,
            )
        )
    shares.sort(key=lambda each: inf if each.error is None else each.error)
    return LimitShares(drive.name, run, asked, error, error_of(unlimited)[0], tuple(shares))


def time_share(run: Simulation, limit: Limit) -> float:
    """Share of a record's samples at which a limit acts, 0 to 1.

    Parameters
    ----------
    run : Simulation
        By voltage or by current.
    limit : Limit
        Of the dead zone only samples with a command other than 0 count: at rest nothing is asked
        that it could hold back.
    """
    acts = run.active(limit)
    if limit == Limit.DEAD_ZONE:
        command = run.current if run.voltage is None else run.voltage
        acts = acts & (command != 0.0)
    return float(acts.mean())


def _fall(before: float, after: float) -> float:
    """By which part of itself an error falls; 0 where there was none."""
    return (before - after) / before if before > 0.0 else 0.0


def _joined(changes: Iterable[Mapping[str, Change]]) -> dict[str, Change]:
    return {name: value for each in changes for name, value in each.items()}


def _eased(drive: Drive, factors: Mapping[str, float]) -> Drive | str:
    """The drive with its levers moved, or why there is none."""
    if not factors:
        return "No lever eases it under the same command."
    try:
        return pulled(drive, factors)
    except SwashplateError as refusal:
        return str(refusal)


def _replaced(drive: Drive, changes: Mapping[str, Change]) -> Drive | str:
    """The drive with changes, or why there is none such."""
    try:
        return drive.replace(**changes)
    except SwashplateError as refusal:
        return str(refusal)


def _unlimited(
    drive: Drive, built: Mapping[Removal, Drive | str], present: Mapping[Removal, dict[str, Change]]
) -> tuple[Drive, list[Removal]]:
    """The drive with as many limits taken away at once as the model's domain allows, and those."""
    found, removed = drive, []
    for removal, each in built.items():
        if isinstance(each, str):
            continue
        more = _replaced(found, present[removal])
        if not isinstance(more, str):
            found = more
            removed.append(removal)
    return found, removed


def _free_speed(unlimited: Drive, run: Simulation, start: Start) -> Array:
    try:
        return simulate_drive(unlimited.parameters, run.record, start).shaft_speed
    except SwashplateError as refusal:
        raise DomainError(
            f"Without its limits the drive cannot be simulated, so that there is no speed to "
            f"compare with; give the one that is wanted ({str(refusal).rstrip('.')})."
        ) from None


def share_table(found: LimitShares) -> Table:
    """What each limit costs that does anything, the costliest first."""
    made = Table(
        "",
        (
            Column("Limit"),
            Column("share of time", ".1%"),
            Column("error without it\n", ".3f", "rad/s", none="none"),
            Column("share of error", "z.1%"),
            Column("error if alone\n", ".3f", "rad/s", none="none"),
        ),
    )
    for each in found.shares:
        if not (each.time_share or each.error_share or each.failure or each.alone):
            continue  # it does nothing here
        time = Cell(0.0, "never") if each.time_share == 0.0 else each.time_share
        made.add(each.limit, time, each.error, each.error_share, each.alone)
    return made
