"""A drive: a parameter set that can simulate itself, settle, be changed and be stored."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, Unpack, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.drive.equilibrium import steady_states
from swashplate.drive.instance import at_every_rate, drive_instance, with_equation
from swashplate.drive.march import Sample, drive_stepper, simulate_drive
from swashplate.drive.records import RunKeywords, drive_inputs, drive_records
from swashplate.drive.signals import check_output
from swashplate.drive.simulation import Simulation
from swashplate.errors import InputError
from swashplate.machine import Equation, Machine, Replacement, Stepper
from swashplate.machine.marching import (
    SOURCE_RATE,
    Interpolation,
    Start,
)
from swashplate.maneuvers import Maneuver
from swashplate.parameters import (
    FULL_VOLTAGE,
    Change,
    Parameter,
    ParameterSet,
    dump_set,
    load_preset,
    load_set,
    preset_names,
)
from swashplate.results import Result
from swashplate.units import in_si

if TYPE_CHECKING:
    from swashplate.drive.linear_drive import LinearDrive
    from swashplate.drive.small_motion import Coulomb, Input
    from swashplate.executors import Executor
    from swashplate.machine import Batch, Sensitivities, SquaredError
    from swashplate.machine.linear import FrequencyResponse
    from swashplate.tables import Table

Array = NDArray[np.float64]


class Drive(Result, Machine, Mapping[str, Parameter]):
    """A hydrostatic drive from joystick voltage to shaft speed. Immutable.

    It is a `Machine`, which all verbs take: `swashplate.join` joins drives with a load,
    `swashplate.export` writes them, `swashplate.linearize` linearises them. And it is a mapping of
    its parameters by symbol: ``drive["Z16"]``, or ``drive["Z16_plus"]`` for one direction.

    Examples
    --------
    >>> from swashplate import Drive, maneuvers
    >>> hoist = Drive.preset("hoist")
    >>> run = hoist.simulate(maneuvers.step(9.0))
    >>> round(float(run.shaft_speed.max()), 2)
    3.42
    """

    parameters: ParameterSet
    """Value, unit, bounds, source and status of every parameter, by symbol."""

    def __init__(self, parameters: ParameterSet) -> None:
        if not isinstance(parameters, ParameterSet):
            raise InputError(f"A Drive cannot be made from {parameters!r}: {_way(parameters)}.")
        machine = drive_instance(parameters, by_voltage=True)
        self._set(machine.model, machine.parts, machine.name, machine.rules)
        object.__setattr__(self, "parameters", parameters)

    def __reduce__(self) -> tuple[type[Drive], tuple[ParameterSet]]:
        return Drive, (self.parameters,)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Drive) and self.parameters == other.parameters

    def __hash__(self) -> int:
        return hash(self.parameters)

    @classmethod
    def preset(cls, name: str) -> Drive:
        """A packaged drive by its name.

        Parameters
        ----------
        name : {"hoist", "slew", "luff", "neutral"}
            One of Kruse's three axes, or a straight line without limits to begin another machine
            with.

        Returns
        -------
        Drive
            With the values, bounds and sources of its parameter file.

        Raises
        ------
        ParameterError
            For another name; the sentence lists those that there are.

        Examples
        --------
        >>> from swashplate import Drive
        >>> Drive.preset("hoist")
        Drive('hoist', card 'rexroth_mdsd_1k_2x_2')
        """
        return cls(load_preset(name))

    @classmethod
    def from_toml(cls, path: str | Path) -> Drive:
        """A drive from a parameter file, or from the folder of a fit.

        Parameters
        ----------
        path : path
            The file, or a folder that `Identification.save` or ``swashplate fit`` wrote, of which
            ``drive.toml`` is read.

        Returns
        -------
        Drive
            With the file's parameters; of a folder those that the fit found.

        Raises
        ------
        FileError
            If there is no such file, or the folder does not hold a drive.
        ParameterError
            If an entry is wrong; the sentence names file, parameter and rule.

        Examples
        --------
        >>> from swashplate import Drive
        >>> Drive.preset("hoist").replace(Z16_plus=1.2e-4).to_toml("hoist.toml")
        >>> Drive.from_toml("hoist.toml")["Z16_plus"].value
        0.00012
        """
        return cls(load_set(path))

    def to_toml(self, path: str | Path) -> None:
        """Store the parameters; `from_toml` gives an equal drive back.

        Parameters
        ----------
        path : path
            The file to write. An older one is replaced as a whole.

        Raises
        ------
        FileError
            If the file cannot be written; an older one stays as it was.

        Examples
        --------
        >>> from swashplate import Drive
        >>> hoist = Drive.preset("hoist")
        >>> hoist.to_toml("hoist.toml")
        >>> Drive.from_toml("hoist.toml") == hoist
        True
        """
        from swashplate.tables import write_text

        write_text(dump_set(self.parameters), path)

    def tables(self) -> list[Table]:
        """Every parameter with its unit and status."""
        return self.parameters.tables()

    def __repr__(self) -> str:
        return f"Drive({self.name!r}, card {self.parameters.card!r})"

    @property
    def title(self) -> str:
        """Title of the parameter set."""
        return self.parameters.title

    def __getitem__(self, name: str) -> Parameter:
        """A parameter by its symbol, ``drive["Z16"].value.plus``, or ``drive["Z16_plus"].value``.

        Raises
        ------
        UnknownParameterError
            If no parameter has the name; it is a ``KeyError`` as well.
        """
        return self.parameters[name]

    def __contains__(self, name: object) -> bool:
        return name in self.parameters

    def __iter__(self) -> Iterator[str]:
        return iter(self.parameters)

    def __len__(self) -> int:
        return len(self.parameters)

    def replace(self, changes: Mapping[str, Change] | None = None, /, **by_name: Change) -> Drive:
        """A drive with other values.

        Parameters
        ----------
        changes : mapping, optional
            The same as keywords, also by path: ``{"pump.Z16_plus": 1.2e-4}``.
        **by_name : float, Pint quantity, or a pair of them
            By symbol (``Z16=1.2e-4`` both ways, ``Z16=(1.2e-4, 1.5e-4)`` plus and minus) or by one
            direction (``Z16_plus=1.2e-4``), in SI or with a unit (``Z16=0.12 * ureg.mm``).

        Returns
        -------
        Drive
            A new drive, whose changed parameters have the status ``"user"``. This one stays as it
            is.

        Raises
        ------
        ParameterError
            For an unknown name or a value that breaks a rule.

        Examples
        --------
        >>> from swashplate import Drive
        >>> wider = Drive.preset("hoist").replace(Z16=(1.2e-4, 1.6e-4))
        >>> wider["Z16"].value
        Pair(plus=0.00012, minus=0.00016)
        """
        columns = {path: column for column, path in self.parameters.definitions.paths.items()}
        given = {**(changes or {}), **by_name}
        named = {columns.get(name, name): change for name, change in given.items()}
        return Drive(self.parameters.replace(named))

    def scale(self, **factors: Change) -> Drive:
        """A drive with values multiplied.

        Parameters
        ----------
        **factors : float, or a pair of them
            By symbol (``Z16=1.5`` both ways, ``Z16=(1.5, 1.2)`` plus and minus) or by one direction
            (``Z16_plus=1.5``). [1]

        Returns
        -------
        Drive
            A new drive, as of `replace`.

        Raises
        ------
        ParameterError
            For an unknown name, or a product that breaks a rule.

        Examples
        --------
        >>> from swashplate import Drive
        >>> hoist = Drive.preset("hoist")
        >>> twice = hoist.scale(Z10=2.0)
        >>> twice["Z10"].value / hoist["Z10"].value
        2.0
        """
        return Drive(self.parameters.scale(factors))

    def with_equation(
        self, old: Equation, new: Equation, parameters: type[NamedTuple] | None = None
    ) -> Drive:
        """A drive with a user-defined equation in the place of one of the card's or the pump's.

        Parameters
        ----------
        old : equation
            Of `swashplate.models.amplifier`, `swashplate.models.pump`,
            `swashplate.models.displacement_control` or `swashplate.models.refinements`.
        new : equation
            The same arguments, and after them, by name, any of `parameters`.
        parameters : class of named tuples, optional
            What the equation brings along, each a float with its `Definition` and a default. They
            are parameters of the drive from then on: ``drive.replace(seal_drag=1e-5)``, a fit's
            unknowns, columns of `sensitivities`. Only the pump's equations can have some.

        Returns
        -------
        Drive
            A new drive; this one stays as it is.

        Raises
        ------
        InputError
            If the drive does not use the equation, or the arguments do not fit.
        ParameterError
            If a parameter has no definition, or the name of another one.
        """
        return Drive(with_equation(self.parameters, Replacement(old, new, parameters)))

    def renamed(self, name: str, title: str | None = None) -> Drive:
        """The same drive under another name, and perhaps another title.

        Parameters
        ----------
        name : str
            Not empty.
        title : str, optional
            By default the title stays.

        Returns
        -------
        Drive
            A new drive with the same numbers.

        Raises
        ------
        InputError
            If the name is empty.

        Examples
        --------
        >>> from swashplate import Drive
        >>> Drive.preset("hoist").renamed("winch").name
        'winch'
        """
        if not str(name or "").strip():
            raise InputError(f"A drive's name is text, not {name!r}.")
        if title is None:
            title = self.parameters.title
        return Drive(replace(self.parameters, name=name, title=title))

    @property
    def by_current(self) -> Machine:
        """Pump and motor alone, behind a signed current in place of the card."""
        return drive_instance(self.parameters, by_voltage=False)

    @property
    def plain(self) -> Drive:
        """The drive without refinements, itself if it has none."""
        plain = self.parameters.plain
        return self if plain is self.parameters else Drive(plain)

    def at_step(self, h: float) -> Drive:
        """The drive whose filter means the same at a step [s]: itself, or `at_every_rate`."""
        rate = self.parameters.rate
        return self if rate is None or abs(rate * h - 1.0) <= 1e-9 else self.at_every_rate()

    def at_every_rate(self) -> Drive:
        """The drive with a card's filter that means the same at every rate.

        Kruse's filter is a recursion at 512 Hz (`ParameterSet.rate`): marched at another rate
        it is another filter. In its place comes the differential equation with the same poles.

        Raises
        ------
        InputError
            If there is none, because the recursion changes its sign from sample to sample.
        """
        return Drive(at_every_rate(self.parameters))

    def simulate(
        self,
        voltage: ArrayLike | Maneuver,
        rate: float = SOURCE_RATE,
        *,
        start: Start = "rest",
        **keywords: Unpack[RunKeywords],
    ) -> Simulation:
        """Simulate the whole drive over a command.

        Parameters
        ----------
        voltage : (n,) array_like, Pint quantity or Maneuver
            Command; a maneuver is sampled at `rate`. [V]
        rate : float
            Samples a second, 10 Hz to 100 kHz; with `time`, rate of the result's grid. [Hz]
        start : {"rest", "steady"}
            From rest at 0 V, or settled at the first command.
        time : (n,) array_like, optional
            Increasing time stamps in any distances; `interpolation` must then be given. [s]
        interpolation : {"linear", "previous"}, optional
            What the command is between samples: a straight line (default) or held.
        clip : bool
            Clip a command beyond ±10 V instead of refusing it.
        substeps : int, optional
            Steps of the march a sample; by default so many that h ≤ 1/512 s.
        load_torque, pump_speed, supply_pressure : (n,) array_like or float, optional
            Measured in addition to the command, at its stamps: torque of the load at the shaft,
            positive against positive speed [N m]; speed of the prime mover over that which Z10
            belongs to [1]; supply pressure less static pressure, in place of Z9 [Pa]. By default
            the parameters count.

        Returns
        -------
        Simulation
            All signals, the motor's torque and pressure drop included.

        Raises
        ------
        InputError
            For a record or option that cannot be simulated.
        DomainError
            If the solenoid overpowers the feedback spring.

        Notes
        -----
        Control card: Kruse (2001), eqs. 3.1-3.9. Pump and motor: eqs. 6.55-6.71 and 8.9.

        Examples
        --------
        >>> from swashplate import Drive, maneuvers
        >>> run = Drive.preset("hoist").simulate(maneuvers.step(9.0), 512.0)
        >>> run.shaft_speed.shape
        (5121,)
        >>> round(float(run.shaft_speed.max()), 2)
        3.42
        """
        records = drive_records(self, voltage, rate, **keywords)
        return simulate_drive(self.parameters, records, start)

    def simulate_current(
        self,
        current: ArrayLike,
        rate: float = SOURCE_RATE,
        *,
        start: Start = "rest",
        **keywords: Unpack[RunKeywords],
    ) -> Simulation:
        """Simulate pump and motor alone over a signed current.

        Parameters
        ----------
        current : (n,) array_like
            Signed current. [A]
        rate, start, **keywords :
            As in `simulate`.

        Returns
        -------
        Simulation
            Of which `Simulation.voltage` is None.

        Raises
        ------
        InputError, DomainError
            As in `simulate`.

        Examples
        --------
        >>> import numpy as np
        >>> from swashplate import Drive
        >>> run = Drive.preset("hoist").simulate_current(np.full(1024, 0.7))
        >>> run.shaft_speed.shape
        (1024,)
        >>> run.voltage is None
        True
        """
        records = drive_records(self.by_current, current, rate, **keywords)
        return simulate_drive(self.parameters, records, start)

    def sensitivities(
        self,
        voltage: ArrayLike | Maneuver,
        rate: float = SOURCE_RATE,
        *,
        parameters: Sequence[str] | None = None,
        start: Start = "rest",
        **keywords: Unpack[RunKeywords],
    ) -> Sensitivities[Simulation]:
        """Simulate with exact derivatives of any signal.

        Parameters
        ----------
        voltage, rate, start, **keywords :
            As in `simulate`.
        parameters : sequence of str, optional
            Symbols (``"Z16"`` stands for both directions) or columns (``"Z16_plus"``) to
            differentiate by; by default all of card, pump and motor, refinements apart.

        Returns
        -------
        Sensitivities
            Derivatives by signal, ``by["shaft_speed"]``, (n, k), with the columns' names and the
            run.

        Raises
        ------
        UnknownParameterError
            If no parameter has a name.
        InputError
            As in `simulate`.

        Examples
        --------
        >>> from swashplate import Drive, maneuvers
        >>> hoist = Drive.preset("hoist")
        >>> by = hoist.sensitivities(maneuvers.step(9.0), parameters=["Z16"])
        >>> by.names
        ('Z16_plus', 'Z16_minus')
        >>> by["shaft_speed"].shape
        (5121, 2)
        """
        from swashplate.drive.derivatives import drive_sensitivities

        records = drive_records(self, voltage, rate, **keywords)
        return drive_sensitivities(self.parameters, records, start, parameters)

    def sensitivities_current(
        self,
        current: ArrayLike,
        rate: float = SOURCE_RATE,
        *,
        parameters: Sequence[str] | None = None,
        start: Start = "rest",
        **keywords: Unpack[RunKeywords],
    ) -> Sensitivities[Simulation]:
        """The same for pump and motor alone over a signed current.

        Parameters
        ----------
        current : (n,) array_like
            Signed current. [A]
        rate, parameters, start, **keywords :
            As in `sensitivities`; by default all parameters of pump and motor.

        Returns
        -------
        Sensitivities
            As of `sensitivities`.

        Raises
        ------
        InputError
            As in `sensitivities`, and for a parameter of the card.
        """
        from swashplate.drive.derivatives import drive_sensitivities

        records = drive_records(self.by_current, current, rate, **keywords)
        return drive_sensitivities(self.parameters, records, start, parameters)

    def simulate_many(
        self,
        changes: Mapping[str, ArrayLike],
        *,
        voltage: ArrayLike | Maneuver | None = None,
        current: ArrayLike | None = None,
        rate: float = SOURCE_RATE,
        cost: SquaredError | None = None,
        output: str = "shaft_speed",
        to: str | Path | None = None,
        executor: Executor | None = None,
        **keywords: Unpack[RunKeywords],
    ) -> Batch:
        """Simulate many parameter sets over one record, from rest, on all cores.

        Parameters
        ----------
        changes : mapping
            Symbol or column to (m,) values, one for each set; other parameters are this drive's.
        voltage, current : (n,) array_like
            The record, one of the two. [V or A]
        rate, **keywords :
            As in `simulate`.
        output : str
            Without `cost`: the signal to return, such as ``"shaft_speed"`` or ``"current"``.
        cost, to, executor :
            As in `swashplate.simulate_many`.

        Returns
        -------
        Batch
            (m,) costs or (m, n) outputs in the order of the sets, and why a set has none.

        Raises
        ------
        UnknownParameterError
            If no parameter has a name.
        InputError, FileError
            As in `swashplate.simulate_many`.

        Examples
        --------
        >>> from swashplate import Drive, maneuvers
        >>> hoist = Drive.preset("hoist")
        >>> batch = hoist.simulate_many({"Z10": [11.0, 12.0, 13.0]}, voltage=maneuvers.step(9.0))
        >>> batch.output.shape
        (3, 5121)
        """
        from swashplate.machine import simulate_many

        commands = {"voltage": voltage, "current": current}
        given = {driver: record for driver, record in commands.items() if record is not None}
        if len(given) != 1:
            raise InputError("A batch needs either a voltage or a current.")
        ((driver, command),) = given.items()
        machine = self if driver == "voltage" else self.by_current
        inputs, sampling = drive_inputs(machine, command, **keywords)
        check_output(cost.output if cost else output)
        return simulate_many(
            machine,
            changes,
            inputs,
            rate,
            output=output,
            cost=cost,
            to=to,
            executor=executor,
            **sampling,
        )

    def stepper(
        self,
        rate: float = SOURCE_RATE,
        *,
        interpolation: Interpolation = "linear",
        start: Start = "rest",
        measured: Sequence[str] = (),
    ) -> Stepper[Sample]:
        """The drive one sample at a time: command in, sample out, numbers as in `simulate`.

        Parameters
        ----------
        rate : float
            Samples a second, 10 Hz to 100 kHz. [Hz]
        interpolation, start :
            As in `simulate`.
        measured : sequence of str
            Of ``"load_torque"``, ``"pump_speed"`` and ``"supply_pressure"`` what each step takes a
            number of, after the voltage.

        Returns
        -------
        Stepper
            Its ``step(voltage, *measured)`` returns a `Sample`.

        Raises
        ------
        InputError
            For a rate or option that there is not, and a rate at which the card's filter is
            unstable.

        Examples
        --------
        >>> from swashplate import Drive
        >>> stepper = Drive.preset("hoist").stepper(512.0)
        >>> for _ in range(2560):
        ...     sample = stepper.step(9.0)
        >>> round(sample.shaft_speed, 2)
        3.42
        """
        rate = in_si(rate, "Hz", "The rate")
        return drive_stepper(self.parameters, rate, interpolation, start, measured)

    def linearize(
        self,
        at: float | None = None,
        *,
        current: float | None = None,
        input: Input | Sequence[Input] | None = None,
        outputs: Sequence[str] = ("shaft_speed",),
        coulomb: Coulomb = "ignored",
    ) -> LinearDrive:
        """Linear model of small motions about a steady state, from the exact partial derivatives.

        Refinements count: friction as presliding, with the state ``"spool_deflection"``; damping
        and the line with their states; the cam ring's ripple with its mean over a turn, zero.
        Within the solenoids' hysteresis a current moves nothing: only the force, or what is
        measured in addition to the command, has a model there.

        Parameters
        ----------
        at, current : float
            Where, one of the two: a constant voltage [V], or a constant signed current [A].
        input : str or sequence of str, optional
            What moves the model: ``"voltage"``, ``"current"``, ``"solenoid_force"``; by default the
            voltage, or the current if one is given. With another than the voltage it is the pump
            and motor alone. Behind a command, or by themselves, ``"load_torque"``,
            ``"pump_speed"`` and ``"supply_pressure"``, which move about the drive's parameters.
        outputs : sequence of str
            ``"shaft_speed"``, ``"swash_angle"``, ``"stroker_pressure"``, ``"orifice_opening"``,
            ``"spool_position"``, ``"solenoid_force"``, ``"current"``, ``"motor_torque"``,
            ``"motor_pressure_drop"``.
        coulomb : {"ignored", "tangent"}
            The card's Coulomb term: left out, which suits motions whose current moves much faster
            than 0.01 A/s, or with the slope of its smooth sign, exact for those that are slower.

        Returns
        -------
        LinearDrive
            Continuous, with its delay apart; `LinearDrive.discrete` samples it. The card's rate
            limits are taken as not active.

        Raises
        ------
        InputError
            For a point or option that there is not.
        DomainError
            Where the gain is 0: in a dead zone, within the hysteresis, at a stop, or with a
            friction that has no presliding.

        Notes
        -----
        The pump's lag of small motions: Kruse (2001), eqs. 6.72-6.74.

        Examples
        --------
        >>> from swashplate import Drive
        >>> linear = Drive.preset("hoist").linearize(5.0)
        >>> linear
        LinearDrive('hoist', voltage to shaft_speed, continuous)
        >>> round(linear.gain, 3)
        0.447
        """
        from swashplate.drive.linearisation import linearize_drive

        at = in_si(at, "V", "The voltage")
        current = in_si(current, "A", "The current")
        return linearize_drive(self.parameters, at, current, input, outputs, coulomb)

    def frequency_response(
        self,
        frequencies: ArrayLike,
        amplitudes: ArrayLike,
        *,
        bias: float = 0.0,
        input: str = "voltage",
        output: str = "shaft_speed",
        rate: float = SOURCE_RATE,
        tolerance: float = 1e-4,
    ) -> FrequencyResponse:
        """Gain and phase under sines of any size: the describing function, by simulation.

        Refinements count, but for the cam ring's ripple: it does not repeat itself with the sine,
        and the mean of a turn is without it.

        Parameters
        ----------
        frequencies : (f,) array_like
            Rising, from 1 mHz to an eighth of the rate. [Hz]
        amplitudes : (a,) array_like
            Of the sine about the bias. [V or A]
        bias : float
            Mean of the input. [V or A]
        input : {"voltage", "current"}
            Whole drive, or pump and motor alone.
        output : str
            A signal as in `linearize`, the motor's torque and pressure drop apart.
        rate : float
            Steps a second, at least 512. At each frequency the step is shortened a little, so that
            a cycle has a whole number of them and its harmonics are exact. [Hz]
        tolerance : float
            Relative change of the first harmonic, from the middle of a simulation to its end, below
            which the drive repeats itself.

        Returns
        -------
        FrequencyResponse
            First harmonic of the output by that of the input, complex, with distortion and mean
            of the output; each (a, f).

        Raises
        ------
        InputError
            For frequencies, amplitudes or options out of range.
        DomainError
            If nothing moves at all, or the answer does not come to repeat itself.

        Examples
        --------
        >>> from swashplate import Drive
        >>> response = Drive.preset("hoist").frequency_response([0.5, 1.0], [1.0], bias=4.0)
        >>> round(float(abs(response.gain[0, 0])), 2)
        0.42
        """
        from swashplate.drive.frequency_response import sweep_drive

        return sweep_drive(
            self.parameters,
            frequencies,
            amplitudes,
            bias=bias,
            input=input,
            output=output,
            rate=rate,
            tolerance=tolerance,
        )

    @overload
    def steady_speed(self, voltage: float) -> float: ...
    @overload
    def steady_speed(self, voltage: Sequence[float] | Array) -> Array: ...
    def steady_speed(self, voltage: float | Sequence[float] | Array) -> float | Array:
        """Speed that the drive settles at under constant commands.

        With refinements it is the mean of a turn, in the middle of what friction and hysteresis
        leave open, under the load.

        Parameters
        ----------
        voltage : float or array_like of any shape
            Constant commands within ±10 V. [V]

        Returns
        -------
        float or array of the same shape
            Shaft speeds. [rad/s]

        Raises
        ------
        InputError
            For a command that is not finite or beyond ±10 V.

        Examples
        --------
        >>> from swashplate import Drive
        >>> Drive.preset("hoist").steady_speed([-9.0, 0.0, 9.0]).round(2).tolist()
        [-3.23, 0.05, 3.42]
        """
        return self._steady(voltage)[1]

    @overload
    def steady_current(self, voltage: float) -> float: ...
    @overload
    def steady_current(self, voltage: Sequence[float] | Array) -> Array: ...
    def steady_current(self, voltage: float | Sequence[float] | Array) -> float | Array:
        """Signed current that the card settles at under constant commands.

        Parameters
        ----------
        voltage : float or array_like of any shape
            Constant commands within ±10 V. [V]

        Returns
        -------
        float or array of the same shape
            Signed currents. [A]

        Raises
        ------
        InputError
            For a command that is not finite or beyond ±10 V.

        Examples
        --------
        >>> from swashplate import Drive
        >>> round(Drive.preset("hoist").steady_current(9.0), 3)
        0.745
        """
        return self._steady(voltage)[0]

    def _steady(self, voltage: float | Sequence[float] | Array) -> tuple[float | Array, ...]:
        """Steady current [A] and speed [rad/s] at a voltage [V], each in the voltage's shape."""
        voltage = in_si(voltage, "V", "The voltage")
        try:
            voltages = np.atleast_1d(np.array(voltage, dtype=np.float64))
        except (TypeError, ValueError):
            voltages = np.array([np.nan])  # refused below
        if not (np.abs(voltages) <= FULL_VOLTAGE).all():
            raise InputError("A steady state needs finite commands within ±10 V.")
        current, speed = steady_states(self.parameters, voltages.reshape(-1))
        if np.ndim(voltage) == 0:
            return float(current[0]), float(speed[0])
        return current.reshape(voltages.shape), speed.reshape(voltages.shape)


def _way(parameters: object) -> str:
    """The call that makes a drive of what is not a parameter set."""
    if isinstance(parameters, str) and parameters in preset_names():
        return f'the packaged drive is Drive.preset("{parameters}")'
    if isinstance(parameters, str | Path):
        return f'a parameter file is read with Drive.from_toml("{parameters}")'
    return "Drive(parameters) takes a ParameterSet"
