"""Steppers: a crane with its options, sample by sample or for a whole run."""

from __future__ import annotations

from functools import lru_cache
from math import degrees, pi, sqrt
from typing import Any, Literal, Unpack, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.analysis import InverseMap
from swashplate.crane.axes import AXES, RATE, check_names
from swashplate.crane.closed_loop import loop
from swashplate.crane.closed_loop.loop import Fixed, Inverse, LoopArrays, State
from swashplate.crane.closed_loop.signals import ROWS, Signals, columns_of
from swashplate.crane.control import GIVES, SEEN, Control, stages_of
from swashplate.crane.crane import Crane
from swashplate.crane.crew import new_memory
from swashplate.crane.kinematics import Shafts, Vector, boom_at, rope_length, shaft_torques, tip_of
from swashplate.crane.machines import Placing, body_numbers
from swashplate.crane.motion import Body, BrakeState
from swashplate.crane.rope import GRAVITY, hanging_load, swing_of, too_fast_sentence
from swashplate.drive import Drive
from swashplate.errors import DomainError, InputError
from swashplate.machine import Machine
from swashplate.machine.marching import CompiledStep, StepContext, compiled_step, marched, stored_of
from swashplate.parameters import FULL_VOLTAGE

Array = NDArray[np.float64]
Actuation = Literal["ideal", "volts", "inverse", "direct"]
ACTUATIONS: tuple[str, ...] = get_args(Actuation)
"""In the order of `loop.IDEAL` and the others."""
OUTPUTS = ("shaft_speed", "limits")
"""Signals of each drive that the loop uses."""
QUICKEST = 0.4
"""Largest part of a rope's pull by which a leaking drive may lower it within a sample: at 0.7 they
would swing against each other from sample to sample."""


class RunOptions(Placing, total=False):
    """Options of a run: keywords of `simulate` and `CraneStepper`, each optional.

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
        keywords: dict[str, Any] = dict(options)
        check_names("A crane's run has no", keywords, RunOptions.__annotations__, "it has")
        control = keywords.pop("control", None)
        settings, controller, sensors = stages_of(control)
        fixed = _fixed(crane, settings, **keywords)
        self._crane = crane
        self.fixed = fixed
        if fixed.actuation == loop.DIRECT and control is not None:
            raise InputError("With direct actuation the voltages are given: leave control out.")
        inputs = ("voltage", "load_torque") if fixed.loaded else ("voltage",)
        compiled = [_compiled(getattr(crane, axis), inputs) for axis in AXES]
        self._steps = [step for step, _ in compiled]
        hoist, slew, luff = (context.copied() for _, context in compiled)
        user = hoist
        picks = np.zeros(0, dtype=np.int64)
        if controller is not None:
            names = controller.model.external
            step = compiled_step(Machine(controller.model, controller.values), names, GIVES, RATE)
            self._steps.append(step)
            user = step.context()
            picks = np.array([SEEN.index(name) for name in names], dtype=np.int64)
        # in open loop nothing acts back on the drives
        self._open = (
            not settings.path
            and settings.crew.gain == 0.0
            and not fixed.loaded
            and fixed.actuation in (loop.VOLTS, loop.INVERSE)
        )
        g = fixed.geometry
        home = fixed.home
        axes = np.zeros((6, 3))
        boom = boom_at(0.0, g, home)
        tip = tip_of(home.slew, boom, g)
        if fixed.loaded:
            weight = fixed.mass * GRAVITY
            axes[loop.TORQUE] = shaft_torques(Vector(0.0, 0.0, -weight), home.slew, boom, weight, g)
        rope = float(rope_length(Shafts(0.0, 0.0, 0.0), g, home))
        start = fixed.start
        hung = hanging_load(tip, start.offset_x, start.offset_y, rope, fixed.hanging)
        self._state = State(0, axes, tip, hung, BrakeState())
        longest = 2.0 * pi * sqrt(fixed.ropes[1] / GRAVITY) * RATE + 4.0
        memory = np.zeros((4, 1 << int(longest).bit_length()))
        memory[loop.PATH : loop.PATH + 2] = [[tip.x], [tip.y]]
        # the load has hung at its initial position
        memory[loop.SWING : loop.SWING + 2] = [[hung.hook.x - tip.x], [hung.hook.y - tip.y]]
        sensing = settings.sensing
        on_their_way = int(sensing.delay * sensing.rate) + 2
        self._noise = np.random.default_rng(0 if sensors is None else sensors.seed)
        self._arrays = LoopArrays(
            drives=(hoist, slew, luff),
            controller=user,
            controlled=controller is not None,
            picks=picks,
            memory=memory,
            readings=np.zeros((1 << on_their_way.bit_length(), loop.READINGS)),
            noise=np.zeros((0, loop.NOISY)),
            crew=new_memory(settings.crew.delay),
            margins=np.full(4, np.inf),
            marched=(np.zeros(0),) * 9,
        )

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
        most = FULL_VOLTAGE if self.fixed.actuation == loop.DIRECT else 1.0
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

    def signals(self, stored: Array) -> Signals:
        """Signals by name, of rows that the loop has stored."""
        return Signals(stored, self.fixed.columns, self.fixed.geometry, self.fixed.home)

    def take(self, commands: Array, ship: Array) -> Array:
        """Advance by many samples: a row for each, a column for each of `step`'s signals.

        Commands are (n, 3), the ship's motion (n, 6), or (n, 1) if it does not move.
        """
        out = np.empty((len(commands), self.fixed.columns.width))
        return self.signals(self._advanced(self.fixed, commands, ship, out)).table()

    def run(self, commands: Array, ship: Array) -> Array:
        """March a complete run and return its stored signals, by `Fixed.columns`.

        As `take`; the stepper cannot be used after it.
        """
        fixed = self.fixed
        out = np.empty((len(commands), fixed.columns.width))
        if self._open:  # the drives by themselves, which is quicker
            self._arrays = self._arrays._replace(marched=self._marched_drives(commands))
            fixed = fixed._replace(actuation=loop.MARCHED)
        return self._advanced(fixed, commands, ship, out)

    def _marched_drives(self, commands: Array) -> tuple[Array, ...]:
        """Voltages, speeds and limits of the three drives, which nothing acts back on."""
        h = 1.0 / RATE
        voltages = []
        speeds = []
        limits = []
        for i, axis in enumerate(AXES):
            stick = np.ascontiguousarray(commands[:, i])
            volts = loop.open_voltages(stick, self.fixed.inverses[i], self.fixed.actuation)
            instance = getattr(self._crane, axis)
            start = instance.start({"voltage": 0.0}, h, "rest")
            outputs = stored_of(instance.model, OUTPUTS)
            rows = marched(instance, {"voltage": volts}, h, start, outputs, "command")
            voltages.append(volts)
            speeds.append(np.ascontiguousarray(rows[0]))
            limits.append(np.ascontiguousarray(rows[1]))
        return (*voltages, *speeds, *limits)

    def _advanced(self, fixed: Fixed, commands: Array, ship: Array, out: Array) -> Array:
        """The rows, filled by the loop; refuses what has stopped it."""
        arrays = self._arrays._replace(noise=self._next_noise(len(commands)))
        self._state, ended = loop.advance_crane(
            1.0 / RATE, fixed, self._state, arrays, commands, ship, out
        )
        if ended != loop.FINE:
            raise self._stopped(ended)
        contexts = (*self._arrays.drives, self._arrays.controller)
        margins = self._arrays.margins.tolist()
        for step, context, worst in zip(self._steps, contexts, margins, strict=False):
            step.check(context, worst, "command")
        return out

    def _next_noise(self, samples: int) -> Array:
        """Noise of the measurements within the next samples, from one stream for the whole run."""
        sample = self._state.sample
        rate = self.fixed.settings.sensing.rate
        if rate == 0.0 or samples == 0:
            return self._arrays.noise
        taken = loop.measurement_at(sample - 1, rate) + 1 if sample > 0 else 0
        due = loop.measurement_at(sample + samples - 1, rate) + 1
        return self._noise.standard_normal((due - taken, loop.NOISY))

    def _stopped(self, ended: int) -> Exception:
        """The error to raise for the reason why the loop has stopped."""
        crane = self._crane
        time = self._state.sample / RATE
        hoist, slew, luff = self._state.axes[loop.ANGLE]
        shafts = Shafts(hoist, slew, luff)
        rope = float(rope_length(shafts, self.fixed.geometry, self.fixed.home))
        if ended == loop.TOO_FAST:
            return InputError(too_fast_sentence(rope, time, RATE))
        short, long = crane.rope_limits
        low, high = map(degrees, crane.boom_limits)
        reasons = {
            loop.NO_NUMBER: "the controller gives an offset of the tip that is not a finite "
            "number; check it for a division by zero or a root of a negative number in it",
            loop.ROPE_OUT: f"the rope is {rope:.2f} m long, but can be {short:g} to {long:g} m; "
            "hoist or lower less, or start elsewhere",
            loop.BOOM_OUT: f"the boom meets the limits of its travel, {low:g} to {high:g} deg; "
            "luff less, or start elsewhere",
        }
        return DomainError(f"{crane.name}: at {time:.2f} s {reasons[ended]}.")


def _fixed(
    crane: Crane,
    settings: Any,
    *,
    actuation: Actuation = "inverse",
    loaded: bool | None = None,
    brake: bool = True,
    **placing: Unpack[Placing],
) -> Fixed:
    """Check the options of a run, `RunOptions`, and make its constants of them."""
    if actuation not in ACTUATIONS:
        raise InputError(f"actuation is '{actuation}'; it is {', '.join(ACTUATIONS[:-1])}.")
    numbers = body_numbers(crane, **placing)
    if loaded is None:
        loaded = actuation != "ideal" and feels_load(crane)
    if loaded:
        _check_loaded(crane, actuation, numbers)
    hoist, slew, luff = (_inverse(crane.inverse(axis)) for axis in AXES)
    travel = numbers.travel
    return Fixed(
        geometry=numbers.geometry,
        home=numbers.home,
        settings=settings,
        actuation=ACTUATIONS.index(actuation),
        brake=bool(brake),
        boom=(travel.lowest, travel.highest),
        ropes=(travel.shortest, travel.longest),
        mass=numbers.mass,
        hanging=numbers.hanging,
        start=numbers.start,
        loaded=bool(loaded),
        inverses=(hoist, slew, luff),
        columns=columns_of(
            ideal=actuation == "ideal",
            hooked=numbers.hanging.sling > 0.0,
            loaded=bool(loaded),
        ),
    )


def _check_loaded(crane: Crane, actuation: str, numbers: Body) -> None:
    """Refuse loads on drives that feel none, or that answer them faster than a sample."""
    if actuation == "ideal":
        raise InputError(
            "Ideal drives follow instantaneously, whatever the load: leave out 'loaded'."
        )
    lost = {axis: _speed_lost(getattr(crane, axis)) for axis in AXES}
    if not feels_load(crane):
        raise InputError(
            f"No drive of {crane.name} feels a load: give one a motor_leakage or a "
            "line_stiffness, as crane.hoist.replace(motor_leakage=1e-6), or leave out 'loaded'."
        )
    for axis, arm in (("hoist", crane.geometry.hoist), ("luff", crane.geometry.luff)):
        gives = 0.5 * RATE * numbers.mass * arm * arm * lost[axis]
        if not numbers.hanging.stiffness > 0.0 and gives > QUICKEST:
            raise InputError(
                f"The {axis} of {crane.name} gives way to {numbers.mass:g} kg on a rigid rope "
                f"within a sample, since its motor_leakage costs {lost[axis]:.3g} rad/s per N m: "
                "use an elastic rope, suspension=Suspension(stiffness=6e7)."
            )


@lru_cache(maxsize=64)
def _compiled(drive: Drive, inputs: tuple[str, ...]) -> tuple[CompiledStep, StepContext]:
    """A drive's step, and its context at the start to copy."""
    step = drive.compiled_step(OUTPUTS, inputs=inputs, rate=RATE)
    return step, step.context()


def feels_load(crane: Crane) -> bool:
    """Whether a drive of a crane turns in another way if its shaft is loaded."""
    drives = [getattr(crane, axis) for axis in AXES]
    return any("line" in drive.parameters.options or _speed_lost(drive) for drive in drives)


@lru_cache(maxsize=64)
def _speed_lost(drive: Drive) -> float:
    """Speed that a drive loses instantaneously for each N m of load. [rad/s/(N m)]"""
    torque = 1e5
    unloaded = drive.simulate([0.0], load_torque=0.0)
    loaded = drive.simulate([0.0], load_torque=torque)
    return float(unloaded.shaft_speed[0] - loaded.shaft_speed[0]) / torque


def _inverse(inverse: InverseMap) -> Inverse:
    """An inverse map as the loop takes it."""
    speed, voltage = np.hstack([inverse.minus, inverse.plus])
    low, high = inverse.limits
    return Inverse(
        speed=speed,
        voltage=voltage,
        gap=inverse.minus.speed.size - 1,
        creep=inverse.creep,
        low=low,
        high=high,
        acceleration=min(inverse.acceleration),
    )
