"""A drive with all five states: a physical set behind the card and solenoids of a drive."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from math import ceil
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.drive import Drive
from swashplate.equations.record import SOURCE_RATE, Interpolation, Record, record_of
from swashplate.equations.run import Start, check_start
from swashplate.errors import DomainError, InputError
from swashplate.full_order.completion import chosen_over, from_lumped
from swashplate.full_order.equilibrium import fastest_rate, rest_row, steady_row
from swashplate.full_order.files import load_choices, nearest_set
from swashplate.full_order.lumps import static_pressure
from swashplate.full_order.machine import build_machine
from swashplate.full_order.march import N_ROW, march
from swashplate.full_order.modes import Modes, modes_at
from swashplate.full_order.observe import observe_force
from swashplate.full_order.physical_set import PhysicalSet
from swashplate.full_order.result import FullOrderSimulation
from swashplate.full_order.stiff import StiffMethod, solve
from swashplate.parameters.parameter_set import Change
from swashplate.simulation.instance import pump_of

if TYPE_CHECKING:
    from swashplate.full_order.machine import Plate
    from swashplate.models.pump import Pump
    from swashplate.simulation.result import Simulation

Array = NDArray[np.float64]
Method = Literal["march", "radau", "lsoda"]

RESOLUTION = 1.0
"""Largest product of a Runge-Kutta step and the fastest natural frequency."""
STABLE = 2.5
"""The same where the march is still stable, with some reserve: its limit is 2.78."""
LEAST_SUBSTEPS = 8
"""Runge-Kutta steps a sample that kinks of the flow, at the orifices' limits, are worth."""
MOST_SUBSTEPS = 20_000
"""Runge-Kutta steps a sample, beyond which the solvers are the better way."""
LOOSEST = 1e-3
"""Largest relative tolerance."""


@dataclass(frozen=True)
class FullOrderDrive:
    """A drive whose spool and swash plate have mass. Immutable.

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

    @classmethod
    def preset(cls, name: str) -> FullOrderDrive:
        """One of the source's axes with its assumed physical set.

        Raises
        ------
        ParameterError
            For a name other than ``"hoist"``, ``"slew"``, ``"luff"``.
        """
        physical = PhysicalSet.preset(name)
        return cls(Drive.preset(name), physical)

    @classmethod
    def from_drive(cls, drive: Drive, like: str | None = None, **chosen: Change) -> FullOrderDrive:
        """A full-order drive for any parameters, a fitted set's for example.

        Parameters
        ----------
        drive : Drive
            Card, solenoids and the lumps that the machine shall have, Z6 apart.
        like : str, optional
            ``"hoist"``, ``"slew"`` or ``"luff"``: the packaged set whose assumed values count
            where nothing is chosen; by default that of the drive's name, or else ``"hoist"``.
        **chosen : float or (float, float)
            Values in SI, e.g. ``oil_volume=1e-4``, by the names that
            `swashplate.full_order.completion.from_lumped` takes.

        Returns
        -------
        FullOrderDrive
            Its physical set is completed from lumps and choices; what is chosen here is marked as
            the user's, all the rest as assumed.

        Raises
        ------
        ParameterError
            For an unknown name, or if lumps contradict each other or a choice.
        InputError
            If the drive has refinements, which the full-order model does not know.
        """
        drive.parameters.refuse_refinements("Full-order drives")
        assumed = load_choices(nearest_set(drive.name) if like is None else like)
        entries = chosen_over(assumed, chosen)
        title = drive.parameters.title
        return cls(drive, from_lumped(drive.parameters, title=title, entries=entries))

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
    def machine(self) -> Plate:
        """The physical set, ready for compiled code."""
        return build_machine(self.physical, self.drive.parameters.pressure_root)

    @cached_property
    def _pump(self) -> Pump:
        return pump_of(self.drive.parameters)

    def substeps(self, step: float, wanted: int | None = None) -> int:
        """Runge-Kutta steps that a step of the record takes.

        Parameters
        ----------
        step : float
            Step of the record. [s]
        wanted : int, optional
            By default 8, or so many that the fastest mode takes six steps a turn.

        Raises
        ------
        DomainError
            If the machine is too stiff for a fixed step.
        InputError
            If so few are wanted that the march would be unstable.
        """
        fastest = fastest_rate(self.machine)
        needed = max(ceil(fastest * step / RESOLUTION), LEAST_SUBSTEPS)
        if wanted is not None:
            least = ceil(fastest * step / STABLE)
            if wanted < max(least, 1):
                raise InputError(
                    f"substeps is {wanted}, but the fastest mode, at {fastest:.3g} rad/s, needs "
                    f"at least {max(least, 1)} to be stable and {needed} to be followed."
                )
            return wanted
        if needed > MOST_SUBSTEPS:
            raise DomainError(
                f"{self.physical.name}: the fastest mode, at {fastest:.3g} rad/s, would take "
                f"{needed} steps a sample, more than {MOST_SUBSTEPS}; use method='radau', or a "
                "larger mass or oil_volume."
            )
        return needed

    def simulate(
        self,
        voltage: ArrayLike,
        rate: float = SOURCE_RATE,
        *,
        method: Method = "march",
        time: ArrayLike | None = None,
        interpolation: Interpolation | None = None,
        start: Start = "rest",
        clip: bool = False,
        substeps: int | None = None,
        tolerance: float = 1e-6,
    ) -> FullOrderSimulation:
        """Simulate card and machine over a command [V]; arguments as `Drive.simulate`.

        The card's current at its own steps drives the machine, a straight line between them.

        Parameters
        ----------
        method, substeps, tolerance :
            As in `simulate_current`.
        """
        run = self.drive.simulate(
            voltage, rate, time=time, interpolation=interpolation, start=start, clip=clip
        )
        return self.follow(run, method=method, start=start, substeps=substeps, tolerance=tolerance)

    def follow(
        self,
        run: Simulation,
        *,
        method: Method = "march",
        start: Start = "rest",
        substeps: int | None = None,
        tolerance: float = 1e-6,
    ) -> FullOrderSimulation:
        """Simulate the machine over the current of a run that there is.

        Parameters
        ----------
        run : Simulation
            By voltage or by current; its current at the march's own steps counts, a straight line
            between them.
        method, start, substeps, tolerance :
            As in `simulate_current`.
        """
        current = run_current(run)
        record = Record(current, run.record.start, run.record.rate, run.record.substeps)
        return self._integrate(record, False, method, start, substeps, tolerance)

    def simulate_current(
        self,
        current: ArrayLike,
        rate: float = SOURCE_RATE,
        *,
        method: Method = "march",
        time: ArrayLike | None = None,
        interpolation: Interpolation | None = None,
        start: Start = "rest",
        substeps: int | None = None,
        tolerance: float = 1e-6,
    ) -> FullOrderSimulation:
        """Simulate the machine over a signed current.

        Parameters
        ----------
        current : (n,) array_like
            Current, positive towards more speed. [A]
        rate, time, interpolation, start :
            As in `Drive.simulate`.
        method : {"march", "radau", "lsoda"}
            Compiled fixed-step Runge-Kutta march with located events, or one of SciPy's stiff
            solvers, restarted at each event, to check it by.
        substeps : int, optional
            Steps of the march a sample, at least 512 samples a second; by default 8, or so
            many that the fastest mode takes six steps a turn.
        tolerance : float
            Relative tolerance of the solvers.

        Returns
        -------
        FullOrderSimulation
            The five states and all that follows from them.

        Raises
        ------
        InputError
            For a record or option that cannot be simulated.
        DomainError
            If a solver gives up or the machine is too stiff for the march.
        """
        record = record_of(current, rate, what="current", time=time, interpolation=interpolation)
        return self._integrate(
            record, interpolation == "previous", method, start, substeps, tolerance
        )

    def modes(self, current: float = 0.0) -> Modes:
        """Natural modes about the equilibrium under a constant signed current. [A]

        Raises
        ------
        InputError
            If the current is no finite number.
        """
        force = self._force(current)
        row = steady_row(force, self.machine)
        return modes_at(row, float(current), self.machine, self._pump)

    def eigenvalues(self, current: float = 0.0) -> NDArray[np.complex128]:
        """Eigenvalues of the five states about an equilibrium, see `modes`. [rad/s]"""
        return self.modes(current).eigenvalues

    def _force(self, current: float) -> float:
        if not np.isfinite(current):
            raise InputError(f"The current is {current}, but must be a finite number of amperes.")
        force = np.empty(1)
        observe_force(np.array([float(current)]), self._pump, force)
        return float(force[0])

    def _integrate(
        self,
        record: Record,
        held: bool,
        method: Method,
        start: Start,
        substeps: int | None,
        tolerance: float,
    ) -> FullOrderSimulation:
        check_start(start)
        machine, pump = self.machine, self._pump
        current = np.ascontiguousarray(record.values)
        force = np.empty_like(current)
        observe_force(current, pump, force)
        begin = (rest_row if start == "rest" else steady_row)(float(force[0]), machine)
        if method == "march":
            rows = np.empty((current.size, N_ROW))
            rows[0] = begin
            holds, losses = np.zeros((current.size, 3), np.int8), np.zeros((current.size, 2))
            steps = self.substeps(record.step, substeps)
            events = march(current, held, record.step, steps, machine, pump, rows, holds, losses)
            if events < 0:
                at = record.start + (-1 - events) * record.step
                raise DomainError(
                    f"{self.physical.name}: the march breaks down after {at:.6g} s; check the "
                    "physical set, or use method='radau'."
                )
        elif method in ("radau", "lsoda"):
            if not 0.0 < tolerance <= LOOSEST:
                raise InputError(
                    f"tolerance is {tolerance:g}, but must be above 0 and at most {LOOSEST:g}."
                )
            stiff: StiffMethod = method
            rows, holds, losses, events = solve(
                stiff, current, force, held, record.step, machine, pump, begin, tolerance
            )
        else:
            raise InputError(f"method is '{method}'; it is 'march', 'radau' or 'lsoda'.")
        return FullOrderSimulation(
            self.physical.name,
            method,
            record,
            machine,
            force,
            rows,
            holds,
            losses,
            events,
            static_pressure(self.physical.numbers),
        )


def run_current(run: Simulation) -> Array:
    """Signed current of a run on the grid of its march. [A]"""
    return run.fine("current")
