"""A drive with all five states, its natural modes, and whether one state is enough for it.

A physical set is downstream of the card and solenoids of a drive.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import ceil, floor
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate import maneuvers
from swashplate.drive import (
    UNITS,
    Drive,
    drive_records,
)
from swashplate.errors import DomainError, InputError
from swashplate.full_order.physical_set import QUANTITIES, PhysicalSet, from_lumped
from swashplate.machine import Machine, Run, Sensitivities
from swashplate.machine.linear import linearize
from swashplate.machine.marching import (
    SOURCE_RATE,
    BoundModel,
    Interpolation,
    PartNumbers,
    Start,
    least_substeps,
    read_only,
)
from swashplate.models import full_order as model
from swashplate.models.displacement_control import Solenoids
from swashplate.models.drive import Source as CurrentSource
from swashplate.models.full_order import MOST_SUBSTEPS, STABLE, PlantOptions, enough_substeps
from swashplate.models.machine import fastest_rate, relief_pressures
from swashplate.parameters import CATALOGUE, DEFINITIONS, Change, Definition, Definitions
from swashplate.results import Named, Result, Tabular, figures
from swashplate.tables import UNIT, Cell, Column, Table
from swashplate.units import PLATE_RATE, SHAFT_ANGLE

if TYPE_CHECKING:
    import polars

    from swashplate.drive import Simulation
    from swashplate.maneuvers import Maneuver
    from swashplate.results import Figure

Array = NDArray[np.float64]
Flags = NDArray[np.int8]


def _definitions() -> Definitions:
    """Parameters of the drive with five states: the card's, the solenoids', the machine's."""
    by_symbol = dict[str, Definition]()
    paths = dict[str, str]()
    for symbol, definition in CATALOGUE.items():
        if definition.block == "control_card":
            by_symbol[symbol] = definition
            paths |= {column: DEFINITIONS.paths[column] for column in definition.columns}
        elif set(definition.columns) <= set(Solenoids._fields):
            by_symbol[symbol] = definition
            paths |= {column: f"plant.solenoids.{column}" for column in definition.columns}
    for symbol, definition in QUANTITIES.items():
        by_symbol[symbol] = definition
        columns = zip(definition.columns, definition.fields, strict=True)
        paths |= {column: f"plant.machine.{path}" for column, path in columns}
    return Definitions(by_symbol, paths)


FULL_ORDER_DEFINITIONS = _definitions()
"""What a drive with five states can be differentiated by."""


class FullOrderSimulation(Run, Tabular):
    """Signals of one record, read-only arrays of the record's length, all SI.

    Signs are those of `swashplate.Simulation`. The record is the signed current. The motor's
    pressure drop is positive where the load resists positive speed.
    """

    shown = (
        "current",
        "spool_position",
        "stroker_pressure",
        "swash_angle",
        "shaft_speed",
        "motor_pressure_drop",
    )

    @property
    def plant(self) -> model.Plant:
        """The machine and its solenoids."""
        plant: model.Plant = self.instance.parts[1].p
        return plant

    @cached_property
    def names(self) -> tuple[str, ...]:
        """The signals that it has: ``"time"`` and `SIGNALS`."""
        return ("time", *SIGNALS)

    current = Named()
    """Signed current. [A]"""
    solenoid_force = Named()
    """Net force of both solenoids on the spool. [N]"""
    spool_position = Named()
    """Displacement of the spool. [m]"""
    spool_velocity = Named()
    """Velocity of the spool. [m/s]"""
    orifice_opening = Named()
    """Effective opening, what the orifices leave of the spool's displacement. [m]"""
    valve_flow = Named()
    """Flow through the valve towards the stroking piston. [m³/s]"""
    stroker_pressure = Named()
    """Stroking pressure δP about the one that holds the load at rest. [Pa]"""
    swash_angle = Named()
    """Angle of the swash plate. [rad]"""
    swash_rate = Named()
    """Rate of the swash plate. [rad/s]"""
    shaft_speed = Named()
    """Speed of the shaft, of the turret for slew. [rad/s]"""
    shaft_position = Named()
    """Angle of the shaft, zero at the start: the trapezoidal integral of its speed. [rad]"""
    motor_pressure_drop = Named()
    """Pressure drop across the motor, P_hi - P_lo, under load inertia and gravity. [Pa]"""
    pump_flow = Named()
    """Flow of the pump to the motor. [m³/s]"""

    def table(self) -> Table:
        """Lowest, highest and last value of each signal."""
        numbers = (Column(heading, "z.4g") for heading in ("lowest", "highest", "at the end"))
        table = Table("", (Column("Signal"), *numbers, UNIT))
        for name in SIGNALS:
            values = self[name]
            low, high, last = float(values.min()), float(values.max()), float(values[-1])
            table.add(name.replace("_", " "), low, high, last, unit=SIGNAL_UNITS[name])
        return table

    @property
    def spool_hold(self) -> Flags:
        """1 or -1 while the spool is at its stroke."""
        stroke = self.plant.machine.spool_stroke
        return _beyond(self.spool_position, -stroke, stroke)

    @property
    def relief_hold(self) -> Flags:
        """1 or -1 while the relief valve holds the stroker pressure."""
        pressure = self.sampled(self.fine("piston_pressure"))
        return _beyond(pressure, *relief_pressures(self.plant.machine))

    @property
    def plate_hold(self) -> Flags:
        """1 or -1 while the swash plate rests on a stop."""
        m = self.plant.machine
        return _beyond(self.swash_angle, -m.swash_stop_minus, m.swash_stop_plus)

    def columns(self) -> dict[str, NDArray[Any]]:
        """Time, all signals and the limits that hold, by name."""
        return {name: getattr(self, name) for name in (*self.names, *HOLDS)}


SIGNAL_UNITS = {
    **UNITS,
    "shaft_position": SHAFT_ANGLE,
    "spool_velocity": "m/s",
    "swash_rate": PLATE_RATE,
    "valve_flow": "m^3/s",
    "pump_flow": "m^3/s",
}
"""Unit of each signal of a run, reduced or of full order, as of `display_unit`."""
SIGNALS = tuple(n for n, each in vars(FullOrderSimulation).items() if isinstance(each, Named))
"""Signals in the order of the chain."""
HOLDS = ("spool_hold", "relief_hold", "plate_hold")  # Limits that can hold.


def _beyond(values: Array, lower: float, upper: float) -> Flags:
    return (values >= upper).astype(np.int8) - (values <= lower).astype(np.int8)


class FullOrderDrive(Machine):
    """A drive whose spool and swash plate have mass. Immutable.

    It is a `Machine`, which all verbs take. Refinements, which the five states do not know, are
    refused in an `InputError`.

    Examples
    --------
    >>> from swashplate import FullOrderDrive, maneuvers
    >>> run = FullOrderDrive.preset("hoist").simulate(maneuvers.step(9.0).sample(512.0))
    >>> round(float(run.shaft_speed.max()), 1)
    3.4
    """

    drive: Drive
    """Card and solenoids, and the form of the valve's root."""
    physical: PhysicalSet
    """Everything downstream of the solenoids."""

    def __init__(self, drive: Drive, physical: PhysicalSet) -> None:
        if drive.parameters.refinements:
            listed = ", ".join(drive.parameters.refinements)
            raise InputError(
                f"{drive.name}: the five-state model has no refinements, but this drive has "
                f"{listed}; use it without them (its .plain)."
            )
        object.__setattr__(self, "drive", drive)
        object.__setattr__(self, "physical", physical)
        self._set(model.full_drive, (drive.parts[0], self._plant_numbers(None)), physical.name)

    def __reduce__(self) -> tuple[type[FullOrderDrive], tuple[Drive, PhysicalSet]]:
        return FullOrderDrive, (self.drive, self.physical)

    def __eq__(self, other: object) -> bool:
        return (
            isinstance(other, FullOrderDrive)
            and self.drive == other.drive
            and self.physical == other.physical
        )

    def __hash__(self) -> int:
        return hash((self.drive, self.name))

    def __repr__(self) -> str:
        return f"FullOrderDrive({self.drive!r}, {self.physical!r})"

    @classmethod
    def preset(cls, name: str) -> FullOrderDrive:
        """One of Kruse's drives with its assumed physical set.

        Parameters
        ----------
        name : {"hoist", "slew", "luff"}
            The axis.

        Returns
        -------
        FullOrderDrive
            The packaged drive of that name and `PhysicalSet.preset` of it.

        Raises
        ------
        ParameterError
            For another name; the sentence lists those that there are.

        Examples
        --------
        >>> from swashplate import FullOrderDrive
        >>> FullOrderDrive.preset("hoist").physical
        PhysicalSet('hoist', 31 quantities)
        """
        physical = PhysicalSet.preset(name)
        return cls(Drive.preset(name), physical)

    @classmethod
    def from_drive(
        cls, drive: Drive, like: str | None = None, **quantities: Change
    ) -> FullOrderDrive:
        """A full-order drive for any parameters, a fitted set's for example.

        The drive gives card, solenoids and the lumps that the machine shall have, Z6 apart; the
        physical set is completed from them and from `quantities` in SI, e.g. ``oil_volume=1e-4``;
        see `swashplate.full_order.from_lumped`.

        Raises
        ------
        ParameterError
            For an unknown name, or if lumps contradict each other or a choice.
        """
        return cls(drive, from_lumped(drive.parameters, like, **quantities))

    def replace(
        self, changes: Mapping[str, Change] | None = None, /, **by_name: Change
    ) -> FullOrderDrive:
        """A drive with other physical values.

        Parameters
        ----------
        changes : mapping, optional
            The same as keywords.
        **by_name : float, Pint quantity, or a pair of them
            By name of the quantity, in SI or with a unit: ``load_torque=2e3``.

        Returns
        -------
        FullOrderDrive
            A new drive; this one stays as it is.

        Raises
        ------
        UnknownParameterError
            For a name that no quantity has.
        ParameterError
            For a value out of its plausible range, or that breaks a rule.

        Examples
        --------
        >>> from swashplate import FullOrderDrive
        >>> loaded = FullOrderDrive.preset("hoist").replace(load_torque=2e3)
        >>> loaded.physical["load_torque"].value
        2000.0
        """
        return FullOrderDrive(self.drive, self.physical.replace(**(changes or {}), **by_name))

    @property
    def reduced(self) -> Drive:
        """The one-state drive with the lumps of the physical set, at the drive's own Z6."""
        Z6 = self.drive.parameters.numbers["Z6"]
        return Drive(self.drive.parameters.with_numbers(self.physical.to_lumped(Z6)))

    @cached_property
    def plant(self) -> model.Plant:
        """Hydrostat and solenoids, as the equations take them."""
        numbers = self.drive.parameters.numbers
        return model.Plant(
            self.physical.machine, Solenoids(*(numbers[name] for name in Solenoids._fields))
        )

    @property
    def by_current(self) -> Machine:
        """The machine alone, behind a signed current in place of the card."""
        return self.at_substeps(None, card=False)

    def _plant_numbers(self, substeps: int | None) -> PartNumbers:
        """Numbers of the machine and its solenoids."""
        symmetric = self.drive.parameters.pressure_root == "symmetric"
        options = PlantOptions(symmetric or None, self.physical.air)
        return PartNumbers(self.plant, options, model.Substeps(float(substeps or 0)))

    def at_substeps(self, substeps: int | None, *, card: bool = True) -> Machine:
        """The machine with so many sub-steps a sample, by voltage or, without `card`, current.

        None takes as many as the fastest mode needs.
        """
        plant = self._plant_numbers(substeps)
        if card:
            return Machine.of_parts(self.model, (self.parts[0], plant), self.name)
        source = PartNumbers(CurrentSource())
        return Machine.of_parts(model.full_machine, (source, plant), self.name)

    def substeps(self, step: float, requested: int | None = None) -> int:
        """Sub-steps that a step [s] of the record takes.

        By default 8, or so many that the fastest mode takes six a turn.

        Raises
        ------
        DomainError
            If the machine is too stiff for the march.
        InputError
            If so few are requested that the march would be unstable.
        """
        fastest = float(fastest_rate(self.physical.machine))
        needed = int(enough_substeps(self.physical.machine, step))
        if requested is not None:
            least = floor(fastest * step / STABLE) + 1
            if requested < least:
                raise InputError(
                    f"substeps is {requested}, but the fastest mode, at {fastest:.3g} rad/s, needs "
                    f"at least {least} to be stable and {needed} to be followed."
                )
            return requested
        if needed > MOST_SUBSTEPS:
            raise DomainError(
                f"{self.physical.name}: the fastest mode, at {fastest:.3g} rad/s, would take "
                f"{needed} steps a sample, more than {MOST_SUBSTEPS:.0f}; use a larger mass or "
                "oil_volume."
            )
        return needed

    def simulate(
        self,
        voltage: ArrayLike,
        rate: float = SOURCE_RATE,
        *,
        time: ArrayLike | None = None,
        interpolation: Interpolation | None = None,
        start: Start = "rest",
        clip: bool = False,
        substeps: int | None = None,
    ) -> FullOrderSimulation:
        """Simulate card and machine over a command.

        The card's current at its own steps drives the machine, a straight line between them.

        Parameters
        ----------
        voltage : (n,) array_like
            Command. [V]
        rate, time, interpolation, start, clip :
            As in `Drive.simulate`.
        substeps : int, optional
            As in `follow`.

        Returns
        -------
        FullOrderSimulation
            All signals of the chain.

        Raises
        ------
        InputError
            For a record or option that cannot be simulated.
        DomainError
            If the machine is too stiff for the march, or the solenoid overpowers the feedback
            spring.

        Notes
        -----
        Kruse (2001), chapter 6, as of `swashplate.models.machine`.

        Examples
        --------
        >>> from swashplate import FullOrderDrive, maneuvers
        >>> run = FullOrderDrive.preset("hoist").simulate(maneuvers.step(9.0).sample(512.0))
        >>> run.shaft_speed.shape
        (5121,)
        """
        records = drive_records(
            self, voltage, rate, time=time, interpolation=interpolation, clip=clip
        )
        self.substeps(records["voltage"].step, substeps)  # refuses too few, or a stiff machine
        return FullOrderSimulation(self.at_substeps(substeps), records, start).marched()

    def follow(
        self, run: Simulation, *, start: Start = "rest", substeps: int | None = None
    ) -> FullOrderSimulation:
        """Simulate the machine over the current of an earlier run.

        Parameters
        ----------
        run : Simulation
            By voltage or by current; its current at the march's own steps counts, a straight line
            between them.
        start : {"rest", "steady"}
            Of the machine.
        substeps : int, optional
            Sub-steps of the march a sample, at least 512 samples a second; by default 8, or so
            many that the fastest mode takes six steps a turn.

        Returns
        -------
        FullOrderSimulation
            All signals of the chain, at the samples of the earlier run.

        Raises
        ------
        InputError
            For an option that cannot be simulated.
        DomainError
            If the machine is too stiff for the march.
        """
        record = replace(run.record, values=run.fine("current"))
        self.substeps(record.step, substeps)
        machine = self.at_substeps(substeps, card=False)
        return FullOrderSimulation(machine, {"current": record}, start).marched()

    def modes(self, current: float = 0.0) -> Modes:
        """Natural modes about the equilibrium under a constant signed current, no limit holding.

        The slow pole is the eigenvalue nearest zero. The spool's mode is the one in which position
        and velocity of the spool take the largest part, by the product of left and right
        eigenvectors.

        Parameters
        ----------
        current : float
            Signed current. [A]

        Returns
        -------
        Modes
            Five eigenvalues, and which of them are slow, the spool's and the swash plate's. [1/s]

        Raises
        ------
        InputError
            If the current is not finite.

        Examples
        --------
        >>> from swashplate import FullOrderDrive
        >>> round(FullOrderDrive.preset("hoist").modes().slow.real, 2)
        -8.39
        """
        if not np.isfinite(current):
            raise InputError(f"The current is {current}, but must be a finite number of amperes.")
        instance = self.by_current
        at = {"current": float(current)}
        motion = instance.start(at, 1.0 / SOURCE_RATE, "steady").states[1].motion
        flowing = Machine.of_parts(
            model.flowing_plant, (PartNumbers(self.plant, instance.options[1]),), self.physical.name
        )
        matrix = linearize(flowing, at, None, states=(motion,), outputs=("swash_angle",)).A
        values, right = np.linalg.eig(matrix)
        parts = np.abs(np.linalg.inv(right).T * right)  # (state, mode), free of the states' units
        slow = int(np.argmin(np.abs(values)))
        others = [k for k in range(5) if k != slow]
        by_spool = sorted(others, key=lambda k: -float(parts[:2, k].sum() / parts[:, k].sum()))
        return Modes(
            eigenvalues=values.astype(np.complex128),
            slow=complex(values[slow]),
            spool=_upper(values[by_spool[:2]]),
            swash=_upper(values[by_spool[2:]]),
            swash_at_held_pressure=_upper(np.linalg.eigvals(matrix[3:, 3:])),
        )

    def sensitivities(
        self,
        voltage: ArrayLike,
        rate: float = SOURCE_RATE,
        *,
        parameters: Sequence[str],
        start: Start = "rest",
        substeps: int | None = None,
    ) -> Sensitivities[FullOrderSimulation]:
        """Simulate with exact derivatives of any signal, those of the march's own steps.

        Parameters
        ----------
        voltage, rate, start, substeps :
            As in `simulate`.
        parameters : sequence of str
            Symbols (``"Z19"`` stands for both directions) or columns (``"Z19_plus"``): of physical
            quantities (``"swash_inertia"``), of the solenoids, and of the card (``"omega"``,
            ``"tau"``).

        Returns
        -------
        Sensitivities
            Derivatives by signal, ``by["shaft_speed"]``, (n, k), with the columns' names and the
            run.

        Raises
        ------
        UnknownParameterError
            If there is no quantity or parameter of a name.
        InputError
            As in `simulate`.
        """
        records = drive_records(self, voltage, rate)
        self.substeps(records["voltage"].step, substeps)
        instance = self.at_substeps(substeps)
        names = tuple(FULL_ORDER_DEFINITIONS.columns_of(parameters))
        paths = [FULL_ORDER_DEFINITIONS.path_of(name) for name in names]
        bound = BoundModel(instance, paths=paths)
        return Sensitivities(FullOrderSimulation(instance, records, start), names, bound)


# --- natural modes --------------------------------------------------------------------------------


@dataclass(frozen=True)
class Modes(Result):
    """Eigenvalues of the linearised model, told apart by the states that take part in them."""

    eigenvalues: NDArray[np.complex128]
    """All five. [rad/s]"""
    slow: complex
    """The pole that the reduced model keeps, -1/τ. [rad/s]"""
    spool: complex
    """Spool on the feedback spring, the upper of a pair. [rad/s]"""
    swash: complex
    """Swash plate on its return spring and the oil trapped by the closed valve. [rad/s]"""
    swash_at_held_pressure: complex
    """Swash plate on its return spring alone, Kruse's reckoning. [rad/s]"""

    @staticmethod
    def frequency_hz(mode: complex) -> float:
        """Undamped natural frequency. [Hz]"""
        return abs(mode) / (2.0 * np.pi)

    @staticmethod
    def damping_ratio(mode: complex) -> float:
        """Damping ratio. [1]"""
        return -mode.real / abs(mode)

    def table(self) -> Table:
        """Frequency and damping ratio of each mode."""
        heads = (Column("Mode"), Column("Hz", ".4g"), Column("damping", ".3f"), Column(""))
        table = Table("Modes at rest", heads)
        slow = f"τ = {-1.0 / self.slow.real:.4g} s, " if self.slow.real < 0.0 else ""
        for name, mode, heading in (
            ("spool", self.spool, "on its feedback spring"),
            ("swash plate", self.swash, "on its spring and the trapped oil"),
            ("swash plate, held pressure", self.swash_at_held_pressure, "on its spring alone"),
            ("slow pole", self.slow, f"{slow}which one state keeps"),
        ):
            table.add(name, self.frequency_hz(mode), self.damping_ratio(mode), heading)
        return table


def _upper(pair: NDArray[np.number]) -> complex:
    """The one with positive imaginary part, or the slower of two real ones."""
    best = np.argmax(pair.imag) if (pair.imag > 0.0).any() else np.argmin(np.abs(pair))
    return complex(pair[int(best)])


# --- one state against five -----------------------------------------------------------------------

FINE_STEPS = 64  # Steps a sample at 512 Hz of the reduced model, whose march is of first order.
LEAST_FINE_STEPS = 4
MOST_STEPS = 20_000_000
"""Steps of a whole record, beyond which a sample gets fewer than `FINE_STEPS`."""
STILL = 1e-6  # Top speed up to which a drive does not move. [rad/s]
ENOUGH = 0.01  # Largest difference over the largest speed up to which one state is enough.
TABLE_MANEUVERS: tuple[tuple[str, Maneuver], ...] = (
    *((f"step {v:g} V", maneuvers.step(v, length=10.0)) for v in (1.0, 2.0, 4.0, 9.0, -9.0)),
    ("ramp 1 V/s", maneuvers.ramp(1.0)),
    *(
        (
            f"sine 6.5 V {f:g} Hz",
            maneuvers.sine(6.5, f, settle=None, length=max(10.0, ceil(4.0 + 2.0 / f))),
        )
        for f in (0.05, 0.1, 0.3, 1.0, 3.0)
    ),
)
"""Maneuvers of `validity`."""


@dataclass(frozen=True, eq=False)
class OrderComparison(Tabular):
    """Both models over one command, driven by the same current.

    The reduced one is marched in fine steps, so that what is compared are the equations.
    """

    full: FullOrderSimulation
    reduced_speed: Array
    """Shaft speed of the reduced model. [rad/s]"""
    voltage: Array | None
    """Command; None if a current was given instead. [V]"""

    @property
    def time(self) -> Array:
        """Time stamps. [s]"""
        return self.full.time

    @property
    def error(self) -> Array:
        """Speed of the reduced model less that of the full-order one. [rad/s]"""
        return self.reduced_speed - self.full.shaft_speed

    @property
    def top_speed(self) -> float:
        """Largest speed of the full-order model. [rad/s]"""
        return float(np.abs(self.full.shaft_speed).max())

    @property
    def moves(self) -> bool:
        """Whether the full-order model moves at all."""
        return self.top_speed > STILL

    @property
    def relative(self) -> tuple[float, float]:
        """Largest and rms difference over the top speed, NaN without motion. [1]"""
        top = self.top_speed if self.moves else float("nan")
        return float(np.abs(self.error).max() / top), float(np.sqrt(np.mean(self.error**2)) / top)

    def table(self) -> Table:
        """Top speed, and the largest and the rms difference of the reduced model."""
        columns = (Column("Shaft speed"), Column("", ".4g"), UNIT, Column("share", ".2%"))
        table = Table("", columns)
        largest = float(np.abs(self.error).max())
        rms = float(np.sqrt(np.mean(self.error**2)))
        relative = self.relative  # NaN, shown as nothing, if it does not move
        table.add("top speed, five states", self.top_speed, None, unit="rad/s")
        table.add("largest difference", largest, relative[0], unit="rad/s")
        table.add("rms difference", rms, relative[1], unit="rad/s")
        return table

    def plot(self, *, title: str | None = None) -> Figure:
        """Figure of both speeds, their difference, and what lies between command and speed."""
        return cast("Figure", figures().plot_full_order(self, title=title))

    def to_polars(self) -> polars.DataFrame:
        """Table of the full-order model's signals, with command and reduced model's speed.

        The full-order model is marched again for signals that were not computed so far.
        """
        import polars as pl

        speed = pl.Series("reduced_shaft_speed", self.reduced_speed)
        frame = self.full.to_polars().with_columns(speed)
        if self.voltage is not None:
            frame.insert_column(1, pl.Series("voltage", self.voltage))
        return frame


def compare(full: FullOrderDrive, run: Simulation, *, start: Start = "rest") -> OrderComparison:
    """Simulate both models over the current of a run of ``full.drive``.

    The reduced model has the lumps of the full-order one; `start` as in `FullOrderDrive.follow`.

    Examples
    --------
    >>> from swashplate import FullOrderDrive, full_order, maneuvers
    >>> full = FullOrderDrive.preset("hoist")
    >>> comparison = full_order.compare(full, full.drive.simulate(maneuvers.step(9.0)))
    >>> comparison.full.shaft_speed.shape == comparison.reduced_speed.shape
    True
    """
    followed = full.follow(run, start=start)
    record = followed.record
    rate = record.rate * record.substeps
    steps = min(ceil(FINE_STEPS * SOURCE_RATE / rate), MOST_STEPS // record.values.size)
    fine = full.reduced.simulate_current(
        record.values,
        rate,
        start=start,
        substeps=max(steps, LEAST_FINE_STEPS, least_substeps(rate)),
    )
    speed = np.ascontiguousarray(fine.shaft_speed[:: record.substeps])
    return OrderComparison(followed, read_only(speed), run.voltage)


def validity(full: FullOrderDrive, rate: float = SOURCE_RATE) -> Table:
    """For which of `TABLE_MANEUVERS` one state is enough, as `validity_table` has it."""
    runs = (
        (name, full.drive.simulate(maneuver.sample(rate), rate))
        for name, maneuver in TABLE_MANEUVERS
    )
    return validity_table(full.physical.name, ((name, compare(full, run)) for name, run in runs))


def validity_table(axis: str, compared: Iterable[tuple[str, OrderComparison]]) -> Table:
    """Differences in shaft speed under some commands, and whether one state is enough for them.

    A row for each command: top speed, largest and rms difference in per cent of it, and whether the
    largest difference is within 1 %; none without motion.
    """
    table = Table(
        "Reduced model less full-order one, in % of the top speed",
        (
            Column("axis", of="f"),
            Column("Maneuver", key="maneuver"),
            Column("top", ".2f", "rad/s", key="top_speed"),
            Column("largest", ".2f", key="largest_percent"),
            Column("rms", ".2f", key="rms_percent"),
            Column("within 1 %", key="within_1_percent"),
        ),
    )
    for name, comparison in compared:
        if comparison.moves:
            largest, rms = comparison.relative
            enough = largest <= ENOUGH
            cell = Cell(enough, "yes" if enough else "no")
            table.add(axis, name, comparison.top_speed, 100.0 * largest, 100.0 * rms, cell)
        else:
            table.add(axis, name, comparison.top_speed, None, None, Cell(None, "does not move"))
    return table


def validity_verdict(table: Table) -> str:
    """For which commands of a `validity_table` one state is enough, in a sentence."""
    comparisons = table.to_polars()
    moving = comparisons.filter(comparisons["within_1_percent"].is_not_null())
    if not moving.height:
        return "The shaft does not move, so the one-state model cannot be assessed."
    beyond = moving.filter(~moving["within_1_percent"])["maneuver"].to_list()
    within = moving.height - len(beyond)
    if not beyond:
        return "One state is enough, to 1 % of the top speed."
    if not within:
        return "One state is not enough, to 1 % of the top speed."
    listed = ", ".join(beyond)
    return f"One state is enough for {within} of {moving.height}, to 1 %; not for {listed}."
