"""A whole run of a crane under the operator's stick."""

from __future__ import annotations

from typing import NamedTuple, Unpack

from numpy.typing import ArrayLike

from swashplate.crane.axes import RATE
from swashplate.crane.closed_loop.operator_command import Array, OperatorCommand
from swashplate.crane.closed_loop.result import CraneRun
from swashplate.crane.closed_loop.stepper import CraneStepper, RunOptions
from swashplate.crane.crane import Crane
from swashplate.crane.sea.seaway import Seaway, ship_motion_of
from swashplate.errors import InputError


def simulate(
    crane: Crane,
    command: OperatorCommand,
    *,
    sea: Seaway | ArrayLike | None = None,
    **options: Unpack[RunOptions],
) -> CraneRun:
    """Simulate a whole crane.

    Parameters
    ----------
    crane : Crane
        The crane with its drives.
    command : OperatorCommand
        What the operator asks for; its length is that of the run.
    sea : Seaway or (n, 6) array_like, optional
        A seaway, or the ship's motion at 512 Hz: surge, sway, heave [m], roll, pitch, yaw [rad], as
        `ship_motion` reads it from a log; by default the ship is at rest.
    **options
        Where it begins, what controls it, what hangs on it: see `RunOptions`.

    Returns
    -------
    CraneRun
        All signals of drives, tip and load at 512 Hz.

    Raises
    ------
    InputError
        For a start beyond the crane's limits, a stick longer than the ship's motion, one that does
        not return, or that begins at full speed on ideal drives, direct actuation, and a tip too
        fast for the rope.
    DomainError
        If boom or rope meet a limit, or a drive leaves its domain.

    Examples
    --------
    >>> from swashplate.crane import Crane, OperatorCommand, control, simulate
    >>> crane = Crane.preset("tg3637")
    >>> command = OperatorCommand.trapezoid(slew=1.0, until={"slew_deg": 45.0})
    >>> round(simulate(crane, command).residual_deg, 1)
    7.4
    >>> round(simulate(crane, command, control=control.TipShaper("zv")).residual_deg, 1)
    1.0
    """
    prepared = prepare(crane, command, options)
    ship = ship_motion_of(sea, len(prepared.commands), RATE)
    return CraneRun(
        crane=crane,
        stick=prepared.commands,
        ship=ship,
        stored=prepared.stepper.run(prepared.commands, ship),
        fixed=prepared.stepper.fixed,
        stick_end=prepared.end,
    )


class PreparedRun(NamedTuple):
    """A run before its first sample."""

    stepper: CraneStepper
    commands: Array
    """(n, 3) of hoist, slew and luff, -1 to 1."""
    end: float
    """When the last command has returned to zero. [s]"""


def prepare(crane: Crane, command: OperatorCommand, options: RunOptions) -> PreparedRun:
    """A run before its first sample; it refuses what `simulate` refuses of crane and command."""
    stepper = CraneStepper(crane, **options)
    if stepper.fixed.actuation == "direct":
        raise InputError(
            "With direct actuation commands are voltages, but a stick gives fractions of full "
            "speed: use a CraneStepper, or actuation='volts'."
        )
    if not isinstance(command, OperatorCommand):
        raise InputError(
            f"The command is {command!r}, but must be an OperatorCommand, as "
            "OperatorCommand.rest(60)."
        )
    commands, end = command.sample(crane, stepper.fixed.home, RATE)
    if stepper.fixed.actuation == "ideal" and commands[0].any():
        raise InputError(
            "Ideal drives follow instantaneously, and the crane starts at rest: a recorded stick "
            "must begin at zero, so put a row of zeros before it."
        )
    return PreparedRun(stepper, commands, end)
