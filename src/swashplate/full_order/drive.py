"""A drive with all five states: a physical set behind the card and solenoids of a drive."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import ceil, floor
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.drive import Drive
from swashplate.equations.equation import interpreted
from swashplate.equations.marching.jacobian import jacobian
from swashplate.equations.marching.observation import Observation, ObservedRecord
from swashplate.equations.marching.part import Stored
from swashplate.equations.marching.record import SOURCE_RATE, Interpolation, Record, record_of
from swashplate.equations.marching.run import Instance, Part, Start, check_start, marched
from swashplate.errors import DomainError, InputError
from swashplate.full_order.modes import Modes, modes_of, state_matrix
from swashplate.full_order.physical_set import PhysicalSet, from_lumped
from swashplate.models import full_order as model
from swashplate.models.displacement_control import Solenoids, solenoid_force
from swashplate.models.drive import Source
from swashplate.models.full_order import PlantConstants, PlantSignals
from swashplate.models.machine import Machine, fastest_rate
from swashplate.parameters.parameter_set import Change
from swashplate.simulation.instance import PATHS, card_of, card_options, check_filter_stability
from swashplate.simulation.result import Named, Signals, signal

if TYPE_CHECKING:
    import polars

    from swashplate.simulation.result import Simulation

Array = NDArray[np.float64]
Flags = NDArray[np.int8]

RESOLUTION = 1.0  # Largest product of a sub-step and the fastest natural frequency.
STABLE = 2.0  # The same where the march is no longer stable.
LEAST_SUBSTEPS = 8  # Sub-steps a sample that kinks of the flow, at the orifices' limits, are worth.
MOST_SUBSTEPS = 20_000  # Sub-steps a sample, beyond which the machine is too stiff for the march.


KEPT = tuple(Stored(1, "signals", name) for name in PlantSignals._fields)


def path_of(name: str) -> str:
    """Path in the model of a quantity, or of a parameter of card or solenoids, by its column."""
    if name in Machine._fields:
        return f"plant.machine.{name}"
    if name in Solenoids._fields:
        return f"plant.solenoids.{name}"
    if PATHS.get(name, "").startswith("card."):
        return PATHS[name]
    raise InputError(
        f"A drive with five states has no parameter '{name}'; it has those of the card, "
        f"{', '.join((*Solenoids._fields, *Machine._fields))}."
    )


SIGNALS = (
    "current",
    "solenoid_force",
    "spool_position",
    "spool_velocity",
    "orifice_opening",
    "valve_flow",
    "stroker_pressure",
    "swash_angle",
    "swash_rate",
    "shaft_speed",
    "shaft_position",
    "motor_pressure_drop",
    "pump_flow",
)
"""Signals in the order of the chain."""


@dataclass(frozen=True, eq=False)
class FullOrderSimulation(Signals):
    """Signals of one record, read-only arrays of the record's length, all SI.

    Signs are those of `swashplate.Simulation`. The record is the signed current. The motor's
    pressure drop is positive where the load resists positive speed.
    """

    plant: model.Plant
    """The machine and its solenoids."""
    constants: PlantConstants
    """What follows from these alone."""
    marched: Array
    """(k, n) signals of `swashplate.models.full_order.PlantSignals` on the march's grid."""

    @property
    def names(self) -> tuple[str, ...]:
        """The signals that it has: ``"time"`` and `SIGNALS`."""
        return ("time", *SIGNALS)

    def __repr__(self) -> str:
        return f"FullOrderSimulation({self.name!r}, {self.time.size} samples)"

    @cached_property
    def _fine(self) -> dict[str, Array]:
        """All signals on the grid that was marched."""
        found = zip(PlantSignals._fields, self.marched, strict=True)
        return {"current": self.record.values, **dict(found)}

    def fine(self, signal: str) -> Array:
        """A signal on the march's grid: one of `SIGNALS`, or the ``"piston_pressure"``."""
        return self.turned() if signal == "shaft_position" else self._fine[signal]

    current = Named(signal)
    """Signed current. [A]"""
    solenoid_force = Named(signal)
    """Net force of both solenoids on the spool. [N]"""
    spool_position = Named(signal)
    """Displacement of the spool. [m]"""
    spool_velocity = Named(signal)
    """Velocity of the spool. [m/s]"""
    orifice_opening = Named(signal)
    """Effective opening, what the orifices leave of the spool's displacement. [m]"""
    valve_flow = Named(signal)
    """Flow through the valve towards the stroking piston. [m³/s]"""
    stroker_pressure = Named(signal)
    """Stroking pressure δP about the one that holds the load at rest. [Pa]"""
    swash_angle = Named(signal)
    """Angle of the swash plate. [rad]"""
    swash_rate = Named(signal)
    """Rate of the swash plate. [rad/s]"""
    shaft_speed = Named(signal)
    """Speed of the shaft, of the turret for slew. [rad/s]"""
    shaft_position = Named(signal)
    """Angle of the shaft, zero at the start: the trapezoidal integral of its speed. [rad]"""
    motor_pressure_drop = Named(signal)
    """Pressure drop across the motor, P_hi - P_lo, under load inertia and gravity. [Pa]"""
    pump_flow = Named(signal)
    """Flow of the pump to the motor. [m³/s]"""

    @property
    def spool_hold(self) -> Flags:
        """1 or -1 where the spool is at its stroke."""
        stroke = self.plant.machine.spool_stroke
        return _beyond(self.spool_position, -stroke, stroke)

    @property
    def relief_hold(self) -> Flags:
        """1 or -1 where the relief valve holds the stroker pressure."""
        pressure = self.sampled(self.fine("piston_pressure"))
        return _beyond(pressure, self.constants.lower, self.constants.upper)

    @property
    def plate_hold(self) -> Flags:
        """1 or -1 where the swash plate rests on a stop."""
        m = self.plant.machine
        return _beyond(self.swash_angle, -m.swash_stop_minus, m.swash_stop_plus)

    def to_polars(self) -> polars.DataFrame:
        """Table of time, all signals and the limits that hold."""
        import polars as pl

        columns: dict[str, NDArray[np.generic]] = {"time": self.time}
        columns.update((signal, getattr(self, signal)) for signal in SIGNALS)
        columns.update((limit, getattr(self, limit)) for limit in HOLDS)
        return pl.DataFrame(columns)


HOLDS = ("spool_hold", "relief_hold", "plate_hold")  # Limits that can hold.


def _beyond(values: Array, lower: float, upper: float) -> Flags:
    return (values >= upper).astype(np.int8) - (values <= lower).astype(np.int8)


@dataclass(frozen=True)
class FullOrderDrive:
    """A drive whose spool and swash plate have mass. Immutable.

    One with refinements, which the five states do not know, is refused in an `InputError`.

    Examples
    --------
    >>> hoist = FullOrderDrive.preset("hoist")
    >>> run = hoist.simulate(maneuvers.step(9.0).sample(512.0))
    >>> run.motor_pressure_drop.max()
    """

    drive: Drive
    """Card and solenoids, and the form of the valve's root."""
    physical: PhysicalSet
    """Everything behind the solenoids."""

    def __post_init__(self) -> None:
        self.drive.parameters.refuse_refinements("Full-order drives")

    @classmethod
    def preset(cls, name: str) -> FullOrderDrive:
        """Kruse's ``"hoist"``, ``"slew"`` or ``"luff"`` drive with its assumed physical set."""
        physical = PhysicalSet.preset(name)
        return cls(Drive.preset(name), physical)

    @classmethod
    def from_drive(cls, drive: Drive, like: str | None = None, **chosen: Change) -> FullOrderDrive:
        """A full-order drive for any parameters, a fitted set's for example.

        The drive gives card, solenoids and the lumps that the machine shall have, Z6 apart; the
        physical set is completed from them and what is chosen in SI, e.g. ``oil_volume=1e-4``, as
        `swashplate.full_order.from_lumped` says.

        Raises
        ------
        ParameterError
            For an unknown name, or if lumps contradict each other or a choice.
        """
        title = drive.parameters.title
        return cls(drive, from_lumped(drive.parameters, like, title=title, entries=chosen))

    def replace(self, **changes: Change) -> FullOrderDrive:
        """With other physical values in SI, e.g. ``replace(load_torque=2e3)``."""
        return replace(self, physical=self.physical.replace(**changes))

    def scaled(self, epsilon: float) -> FullOrderDrive:
        """With inertias times ε and dampings times √ε; see `PhysicalSet.scaled`."""
        return replace(self, physical=self.physical.scaled(epsilon))

    @property
    def reduced(self) -> Drive:
        """The one-state drive with the lumps of the physical set, at the drive's own Z6."""
        Z6 = self.drive.parameters.numbers["Z6"]
        return self.drive.replace(**self.physical.to_lumped(Z6))

    @cached_property
    def plant(self) -> model.Plant:
        """Machine and solenoids, as the equations take them."""
        numbers = self.drive.parameters.numbers
        return model.Plant(
            self.physical.machine, Solenoids(*(numbers[name] for name in Solenoids._fields))
        )

    def options(self, *, held: bool = False) -> model.PlantOptions:
        """Forms of the equations; with `held` the current keeps its value between samples."""
        symmetric = self.drive.parameters.pressure_root == "symmetric"
        return model.PlantOptions(
            True if symmetric else None, self.physical.air, True if held else None
        )

    def instance(
        self, step: float, *, substeps: int | None = None, card: bool = True, held: bool = False
    ) -> Instance:
        """The model with numbers, for the engine: behind a voltage, or without a card a current.

        At a distance of the samples [s]; `substeps` as in `simulate_current`, `held` in `options`.
        """
        behind = self._machine(self.substeps(step, substeps), held)
        if not card:
            return behind
        parameters = self.drive.parameters
        check_filter_stability(parameters, step)
        front = Part(card_of(parameters), card_options(parameters))
        return Instance(model.full_drive, (front, behind.parts[1]), self.physical.name)

    def _machine(self, substeps: int, held: bool = False) -> Instance:
        given = model.Substeps(float(substeps))
        plant = Part(self.plant, self.options(held=held), given)
        return Instance(model.full_machine, (Part(Source()), plant), self.physical.name)

    def substeps(self, step: float, wanted: int | None = None) -> int:
        """Sub-steps that a step [s] of the record takes.

        By default 8, or so many that the fastest mode takes six a turn.

        Raises
        ------
        DomainError
            If the machine is too stiff for the march.
        InputError
            If so few are wanted that the march would be unstable.
        """
        fastest = float(interpreted(fastest_rate)(self.physical.machine))
        needed = max(ceil(fastest * step / RESOLUTION), LEAST_SUBSTEPS)
        if wanted is not None:
            least = floor(fastest * step / STABLE) + 1
            if wanted < least:
                raise InputError(
                    f"substeps is {wanted}, but the fastest mode, at {fastest:.3g} rad/s, needs "
                    f"at least {least} to be stable and {needed} to be followed."
                )
            return wanted
        if needed > MOST_SUBSTEPS:
            raise DomainError(
                f"{self.physical.name}: the fastest mode, at {fastest:.3g} rad/s, would take "
                f"{needed} steps a sample, more than {MOST_SUBSTEPS}; take a larger mass or "
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
        """Simulate card and machine over a command [V]; arguments as `Drive.simulate`.

        The card's current at its own steps drives the machine, a straight line between them.
        `substeps` as in `simulate_current`.
        """
        run = self.drive.simulate(
            voltage, rate, time=time, interpolation=interpolation, start=start, clip=clip
        )
        return self.follow(run, start=start, substeps=substeps)

    def follow(
        self, run: Simulation, *, start: Start = "rest", substeps: int | None = None
    ) -> FullOrderSimulation:
        """Simulate the machine over the current of a run that there is.

        The run is by voltage or by current; its current at the march's own steps counts, a
        straight line between them. Other arguments as in `simulate_current`.
        """
        record = Record(run.fine("current"), run.record.start, run.record.rate, run.record.substeps)
        return self._integrate(record, False, start, substeps)

    def simulate_current(
        self,
        current: ArrayLike,
        rate: float = SOURCE_RATE,
        *,
        time: ArrayLike | None = None,
        interpolation: Interpolation | None = None,
        start: Start = "rest",
        substeps: int | None = None,
    ) -> FullOrderSimulation:
        """Simulate the machine over a signed current.

        Parameters
        ----------
        current : (n,) array_like
            Current, positive towards more speed. [A]
        rate, time, interpolation, start :
            As in `Drive.simulate`.
        substeps : int, optional
            Sub-steps of the march a sample, at least 512 samples a second; by default 8, or so
            many that the fastest mode takes six steps a turn.

        Raises
        ------
        InputError
            For a record or option that cannot be simulated.
        DomainError
            If the machine is too stiff for the march.
        """
        record = record_of(current, rate, what="current", time=time, interpolation=interpolation)
        return self._integrate(record, interpolation == "previous", start, substeps)

    def modes(self, current: float = 0.0) -> Modes:
        """Natural modes about the equilibrium under a constant signed current. [A]"""
        if not np.isfinite(current):
            raise InputError(f"The current is {current}, but must be a finite number of amperes.")
        first = {"current": float(current)}
        state = self._machine(1).start(first, 1.0 / SOURCE_RATE, "steady").states[1]
        force = float(interpreted(solenoid_force)(float(current), self.plant.solenoids))
        at = np.array(state.motion)
        return modes_of(state_matrix(at, force, self.plant.machine, self.options()))

    def sensitivities(
        self,
        voltage: ArrayLike,
        rate: float = SOURCE_RATE,
        *,
        parameters: Sequence[str],
        signal: str = "shaft_speed",
        start: Start = "rest",
        substeps: int | None = None,
    ) -> Array:
        """(n, k) exact derivatives of a signal by parameters, those of the march's own steps.

        Parameters are columns of physical quantities (``"swash_inertia"``, ``"swash_stop_plus"``),
        of the solenoids (``"Z19_plus"``) and of the card (``"omega_plus"``, ``"tau"``); the signal
        is of `swashplate.models.full_order.PlantSignals`, ``"shaft_position"`` or a current. Other
        arguments as in `simulate`.
        """
        record = record_of(voltage, rate, what="voltage")
        columns = [path_of(name) for name in parameters]
        zeros = np.zeros(record.time.size)
        observed = ObservedRecord(
            record, [Observation(signal, record.time, zeros)], "voltage", start
        )
        return jacobian(self.instance(record.step, substeps=substeps), observed, columns).columns

    def _integrate(
        self, record: Record, held: bool, start: Start, substeps: int | None
    ) -> FullOrderSimulation:
        check_start(start)
        step, records = record.step, {"current": np.ascontiguousarray(record.values)}
        instance = self._machine(self.substeps(step, substeps), held)
        started = instance.start({"current": float(record.values[0])}, step, start)
        out = marched(instance, records, step, started, KEPT, "current")
        constants = started.arguments[1]["k"]
        return FullOrderSimulation(self.physical.name, record, self.plant, constants, out)
