"""Steppers: a crane with its options, sample by sample or for a whole run."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from math import degrees
from typing import Any, Literal, NamedTuple, Unpack, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.crane.axes import AXES, RATE, check_names
from swashplate.crane.closed_loop.joined import (
    NOISE,
    SHIP,
    STICK,
    VOLTAGES,
    ControlLoop,
    closed_loop,
)
from swashplate.crane.closed_loop.signals import (
    ABSENT,
    ROWS,
    SINGLES,
    THREES,
    Columns,
    Signals,
    columns_of,
)
from swashplate.crane.control import GIVES, Control, Settings, stages_of
from swashplate.crane.crane import Crane
from swashplate.crane.kinematics import Geometry, Home
from swashplate.crane.machines import SPEED, Placing, body_numbers, carries_load, own_drives
from swashplate.crane.motion import Body
from swashplate.crane.rope import Hanging, swing_of, too_fast_sentence
from swashplate.crane.stages.seeing import ROUNDING
from swashplate.errors import DomainError, InputError
from swashplate.machine import Machine
from swashplate.machine.marching import (
    CompiledStep,
    SignalId,
    StepContext,
    bound_step,
    stored_of,
    unchecked_march,
)
from swashplate.parameters import FULL_VOLTAGE

Array = NDArray[np.float64]
Actuation = Literal["ideal", "volts", "inverse", "direct"]
ACTUATIONS: tuple[str, ...] = get_args(Actuation)
NO_NUMBER, ROPE_OUT, BOOM_OUT, TOO_FAST = "number", "rope", "boom", "fast"
"""What stops a run; of two at one sample the first."""


class RunOptions(Placing, total=False):
    """Options of a run: keywords of `simulate`, `controlled` and `CraneStepper`, each optional.

    Those of `Placing` say where the crane begins and what hangs on it; these what moves it.

    Parameters
    ----------
    control : Control, default None
        Of `swashplate.crane.control`; by default the stick's commands as they are.
    actuation : {"inverse", "volts", "ideal", "direct"}, default "inverse"
        What turns reference speeds into speeds: the real drives after their inverse maps, or
        after 10 V for full speed (``"volts"``); or drives that follow instantaneously within their
        limits of speed (``"ideal"``). A stepper also takes voltages (``"direct"``).
    loaded : bool, default whether a real drive of the crane feels a load
        Whether the rope loads the drives: its tension is a torque on each shaft, by virtual work,
        which they take a sample later as their ``load_torque``. Drives feel it by their
        ``motor_leakage`` and ``line_stiffness``, which the packaged ones do not have: their tests
        were without load. What the boom weighs is not in it.
    brake : bool, default True
        Whether a brake holds the hoist 0.3 s after its voltage has come into the dead zone. A
        voltage at its edge keeps the brake open.
    """

    control: Control | None
    actuation: Actuation
    loaded: bool | None
    brake: bool


class Fixed(NamedTuple):
    """Quantities that stay constant during a run."""

    geometry: Geometry
    home: Home
    settings: Settings
    actuation: str
    boom: tuple[float, float]
    """Sines of the boom's limits."""
    ropes: tuple[float, float]
    """Limits of the rope. [m]"""
    mass: float
    """Of load and hook. [kg]"""
    hanging: Hanging
    loaded: bool
    """Whether the rope's tension loads the drives."""
    columns: Columns


class _Stepped(NamedTuple):
    """A compiled step under way."""

    step: CompiledStep
    context: StepContext
    advance: Callable[[], None]
    noise: np.random.Generator
    """Of the sensors, one stream for the whole run."""


class CraneStepper:
    """A crane that takes commands and gives signals, the same numbers as `simulate`.

    Parameters
    ----------
    crane : Crane
        The crane with its drives.
    **options
        Where it begins, what controls it, what hangs on it: see `RunOptions`.

    Examples
    --------
    >>> from swashplate.crane import Crane, CraneStepper
    >>> stepper = CraneStepper(Crane.preset("tg3637"))
    >>> stepper.step([0.0, 0.0, 0.0])["rope"]
    20.0
    """

    def __init__(self, crane: Crane, **options: Unpack[RunOptions]) -> None:
        prepared = _prepared_of(crane, dict(options))
        self._crane = crane
        self.fixed, self._machine, self._outputs, self._given, self._seed = prepared
        self._direct = self.fixed.actuation == "direct"
        self._stepped: _Stepped | None = None
        self._samples = 0

    def step(
        self, command: tuple[float, float, float], ship: ArrayLike | None = None
    ) -> dict[str, float]:
        """Advance by one sample; the first call gives the sample at time zero.

        Parameters
        ----------
        command : (float, float, float)
            Of hoist, slew and luff, -1 to 1, or voltages with direct actuation. [V]
        ship : (6,) array_like, optional
            Surge, sway, heave [m], roll, pitch, yaw [rad].

        Returns
        -------
        dict
            Signals by name as of `CraneRun.rows`, and the angle ``swing``, SI.

        Raises
        ------
        InputError
            For a command beyond its bounds, or a ship's motion that is not six finite numbers.
        DomainError
            As of `simulate`.

        Examples
        --------
        >>> from swashplate.crane import Crane, CraneStepper
        >>> stepper = CraneStepper(Crane.preset("tg3637"))
        >>> stepper.step((0.0, 1.0, 0.0))["rope"]
        20.0
        """
        most = FULL_VOLTAGE if self._direct else 1.0
        commands = np.array([command], dtype=np.float64)
        if commands.shape != (1, 3) or not (np.abs(commands) <= most).all():
            raise InputError(f"A crane takes three commands of at most ±{most:g}.")
        motion = np.zeros((1, 1)) if ship is None else np.array([ship], dtype=np.float64)
        if motion.shape not in ((1, 1), (1, 6)) or not np.isfinite(motion).all():
            raise InputError("The ship's motion is six finite numbers.")
        return self.named(self.take(commands, motion)[0])

    def named(self, row: Array) -> dict[str, float]:
        """Signals of a row that `take` returns, by name, and the swing."""
        signals = dict(zip(ROWS, row.tolist(), strict=True))
        load = np.array([signals[f"load_{axis}"] for axis in "xyz"])
        tip = np.array([signals[f"tip_{axis}"] for axis in "xyz"])
        return signals | {"swing": float(swing_of(load, tip))}

    def take(self, commands: Array, ship: Array) -> Array:
        """Advance by many samples: a row for each, a column for each of `step`'s signals.

        Commands are (n, 3), the ship's motion (n, 6), or (n, 1) if it does not move.
        """
        if self._stepped is None:
            self._stepped = self._start()
        step, context, advance, noise = self._stepped
        moved = np.broadcast_to(ship, (len(commands), len(SHIP)))
        given = np.hstack([commands, moved, self._noise(len(commands), noise)])
        table, margins = np.empty((len(commands), len(self._outputs))), np.empty(len(commands))
        inputs, outputs, margin = context.inputs, context.outputs, context.margin
        for n, row in enumerate(given):
            inputs[:] = row
            advance()
            table[n] = outputs
            margins[n] = margin[0]
        self._refuse(table.T, self._samples)
        step.check(context, float(margins.min()), "command")
        self._samples += len(commands)
        table = table.T
        return Signals(self._stored(table, commands), self.fixed.columns).table()

    def _noise(self, count: int, noise: np.random.Generator) -> Array:
        """(count, 4) noise of the sensors in the next samples; without sensors (count, 0)."""
        sensing = self.fixed.settings.sensing
        if sensing is None:
            return np.empty((count, 0))
        measures = _measures(self._samples + np.arange(count), sensing.rate)
        drawn = np.zeros((count, len(NOISE)))
        drawn[measures] = noise.standard_normal((measures.sum(), len(NOISE)))
        return drawn

    def run(self, commands: Array, ship: Array) -> Array:
        """March a complete run and return its stored signals, by `Fixed.columns`."""
        inputs = self._inputs(commands, ship)
        start = self._machine.start(dict.fromkeys(inputs, 0.0), 1.0 / RATE, "rest")
        table, check = unchecked_march(
            self._machine, inputs, 1.0 / RATE, start, self._outputs, "command"
        )
        self._refuse(table, 0)
        check()
        return self._stored(table, commands)

    def _start(self) -> _Stepped:
        """The compiled step before its first sample."""
        names = VOLTAGES + SHIP if self._direct else STICK + SHIP
        names += NOISE if self.fixed.settings.sensing is not None else ()
        step = CompiledStep(self._machine, names, self._outputs, 1.0 / RATE)
        context = step.context()
        return _Stepped(step, context, bound_step(context), np.random.default_rng(self._seed))

    def _inputs(self, commands: Array, ship: Array) -> dict[str, Array]:
        """What the machine of a complete run is given; a ship at rest is left out."""
        given = dict(zip(VOLTAGES if self._direct else STICK, commands.T, strict=True))
        if ship.shape[1] > 1:
            given |= zip(SHIP, ship.T, strict=True)
        noise = self._noise(len(commands), np.random.default_rng(self._seed))
        given |= zip(NOISE, noise.T, strict=False)
        return {name: np.ascontiguousarray(column) for name, column in given.items()}

    def _stored(self, table: Array, commands: Array) -> Array:
        """What is stored of a run, by `Fixed.columns`, of the machine's outputs, a row each."""
        first = self.fixed.columns.voltage
        if self._direct:
            table = np.concatenate([table[:first], commands.T, table[first:]])
        return table[: self.fixed.columns.width].T

    def _refuse(self, table: Array, samples: int) -> None:
        """Refuse a run that meets an end of travel, or control that gives no numbers.

        `samples` are those before the table's first. Whatever comes after is no motion of a crane.
        """
        fixed = self.fixed
        pull, rope, cosine, sine = table[3 * len(THREES) :][: len(SINGLES)]
        given = table[len(table) - self._given :]
        inside = fixed.ropes[0] <= rope.min() and rope.max() <= fixed.ropes[1]
        inside &= fixed.boom[0] <= sine.min() and sine.max() <= fixed.boom[1]
        if inside and cosine.min() > 0.0 <= pull.min() and np.isfinite(given).all():
            return
        wrong = {
            NO_NUMBER: ~np.isfinite(given).all(axis=0),
            ROPE_OUT: ~((fixed.ropes[0] <= rope) & (rope <= fixed.ropes[1])),
            BOOM_OUT: ~((fixed.boom[0] <= sine) & (sine <= fixed.boom[1]) & (cosine > 0.0)),
            TOO_FAST: pull < 0.0,
        }
        first = {reason: int(np.argmax(found)) for reason, found in wrong.items() if found.any()}
        if not first:
            return
        reason = min(first, key=lambda each: first[each])
        raise self._stopped(reason, samples + first[reason], float(rope[first[reason]]))

    def _stopped(self, reason: str, sample: int, rope: float) -> Exception:
        """The error to raise for what has stopped a run at a sample."""
        crane = self._crane
        time = sample / RATE
        if reason == TOO_FAST:
            return InputError(too_fast_sentence(rope, time, RATE))
        short, long = crane.rope_limits
        low, high = map(degrees, crane.boom_limits)
        reasons = {
            NO_NUMBER: "the controller gives an offset of the tip that is not a finite "
            "number; check it for a division by zero or a root of a negative number in it",
            ROPE_OUT: f"the rope is {rope:.2f} m long, but can be {short:g} to {long:g} m; "
            "hoist or lower less, or start elsewhere",
            BOOM_OUT: f"the boom meets the limits of its travel, {low:g} to {high:g} deg; "
            "luff less, or start elsewhere",
        }
        return DomainError(f"{crane.name}: at {time:.2f} s {reasons[reason]}.")


def controlled(crane: Crane, **options: Unpack[RunOptions]) -> Machine:
    """A crane under control as a machine: what `simulate` marches, from the stick on.

    Parameters
    ----------
    crane : Crane
        The crane with its drives.
    **options
        Where it begins, what controls it, what hangs on it: see `RunOptions`.

    Returns
    -------
    Machine
        Inputs are ``stick.hoist``, ``stick.slew``, ``stick.luff``, -1 to 1, or the voltages of the
        drives with direct actuation; the ship's motion, ``body.surge`` [m] to ``body.yaw`` [rad],
        which may be left out; and with sensors ``sensors.noise_x`` and others, white noise of root
        mean square 1 at each measurement, or 0. Signals are those of control, drives and `body`.
        Ends of travel and a slack rope, which stop a run, are limits of the body.

    Raises
    ------
    InputError
        As of `simulate`.

    Examples
    --------
    >>> from swashplate.crane import Crane, control, controlled
    >>> damped = controlled(Crane.preset("tg3637"), control=control.DelayedFeedback(0.2))
    >>> [name for name in damped.ports.external if name.startswith("stick.")]
    ['stick.hoist', 'stick.slew', 'stick.luff']
    """
    return _prepared_of(crane, dict(options)).machine


def _prepared_of(crane: Crane, options: dict[str, Any]) -> _Prepared:
    """What runs with these options share, found again if it was asked for before."""
    check_names("A crane's run has no", options, RunOptions.__annotations__, "it has")
    try:
        return _prepared(crane, tuple(options.items()))
    except TypeError:  # a list, or another option without a hash
        prepared: _Prepared = _prepared.__wrapped__(crane, tuple(options.items()))
        return prepared


class _Prepared(NamedTuple):
    """What runs of a crane with the same options share."""

    fixed: Fixed
    machine: Machine
    outputs: tuple[SignalId, ...]
    given: int
    """How many of them are a user-defined controller's."""
    seed: int
    """Of the sensors."""


@lru_cache(maxsize=32)
def _prepared(crane: Crane, options: tuple[tuple[str, Any], ...]) -> _Prepared:
    """Check the options of a run, `RunOptions`, and join its machine."""
    keywords = dict(options)
    control = keywords.pop("control", None)
    settings, controller, sensors = stages_of(control)
    if not settings.path:  # nothing looks through the sensors
        settings = settings._replace(sensing=None)
    brake = bool(keywords.pop("brake", True))
    numbers, fixed = _fixed(crane, settings, **keywords)
    if fixed.actuation == "direct" and control is not None:
        raise InputError("With direct actuation the voltages are given: leave control out.")
    loop = ControlLoop(settings, controller, fixed.actuation, fixed.loaded, brake)
    machine = closed_loop(crane, numbers, loop)
    return _Prepared(
        fixed=fixed,
        machine=machine,
        outputs=stored_of(machine.model, _outputs(fixed, loop)),
        given=len(GIVES) if controller is not None else 0,
        seed=0 if sensors is None else sensors.seed,
    )


def _measures(samples: Any, rate: float) -> Any:
    """Whether sensors measure at samples, of which the first is number 0."""
    now = np.floor(samples * rate + ROUNDING)
    before = np.floor((samples - 1) * rate + ROUNDING)
    return (samples == 0) | (np.maximum(now, 0.0) > np.maximum(before, 0.0))


def _outputs(fixed: Fixed, loop: ControlLoop) -> list[str]:
    """Signals of the joined machine in the order of `Fixed.columns`, then the controller's."""
    speeds = [f"{axis}.{SPEED}" for axis in AXES]
    ideal = fixed.actuation == "ideal"
    if loop.brake and not ideal:
        speeds[0] = "brake.braked_speed"
    outputs = [*speeds, *(f"body.shaft_{axis}" for axis in AXES)]
    outputs += [f"body.{point}_{axis}" for point in ("tip", "load") for axis in "xyz"]
    outputs += [f"body.{name}" for name in SINGLES]
    if not ideal:
        outputs += [f"{axis}.limits" for axis in AXES]
        if fixed.actuation != "direct":
            outputs += [f"{axis}_command.command" for axis in AXES]
    if fixed.columns.hook != ABSENT:
        outputs += [f"body.hook_{axis}" for axis in "xyz"]
    if fixed.loaded:
        outputs += [f"carried.load_torque_{axis}" for axis in AXES]
    if loop.controller is not None:
        outputs += [f"controller.{name}" for name in GIVES]
    return outputs


def _fixed(
    crane: Crane,
    settings: Any,
    *,
    actuation: Actuation = "inverse",
    loaded: bool | None = None,
    **placing: Unpack[Placing],
) -> tuple[Body, Fixed]:
    """Check the options of a run, `RunOptions`: where it begins, and its constants."""
    if actuation not in ACTUATIONS:
        raise InputError(f"actuation is '{actuation}'; it is {', '.join(ACTUATIONS[:-1])}.")
    numbers = body_numbers(crane, **placing)
    if actuation == "ideal":
        if loaded:
            raise InputError(
                "Ideal drives follow instantaneously, whatever the load: leave out 'loaded'."
            )
        loaded = False
    loaded = carries_load(crane, own_drives(crane), numbers, loaded)
    travel = numbers.travel
    return numbers, Fixed(
        geometry=numbers.geometry,
        home=numbers.home,
        settings=settings,
        actuation=actuation,
        boom=(travel.lowest, travel.highest),
        ropes=(travel.shortest, travel.longest),
        mass=numbers.mass,
        hanging=numbers.hanging,
        loaded=loaded,
        columns=columns_of(
            ideal=actuation == "ideal",
            hooked=numbers.hanging.sling > 0.0,
            loaded=loaded,
        ),
    )
