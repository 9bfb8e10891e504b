"""A machine without equations: a program that simulates, behind the names of a machine."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swashplate.errors import DomainError, InputError, ParameterError, UnknownParameterError
from swashplate.machine.fields import Definition, check_mapping, is_real
from swashplate.machine.marching.record import Record
from swashplate.machine.marching.run import Machine, Start
from swashplate.machine.model import Model, full_name, near_names
from swashplate.machine.ports import StatedPorts
from swashplate.units import in_si

Array = NDArray[np.float64]
Function = Callable[[Array, Mapping[str, Array], Mapping[str, float]], Mapping[str, ArrayLike]]
"""Outputs by name, of time, inputs by name and numbers by name."""


class BlackBox(Machine):
    """A machine that is simulated by a program: it can be compared and fitted, and no more.

    For code that already simulates your machine, or one that cannot be written as equations. All
    else (stepping, linear models, exact derivatives, export) takes the equations of a `Model`.

    Parameters
    ----------
    name : str
        For tables, figures and messages.
    function : callable
        ``function(time, inputs, numbers)``, which returns the outputs by name. `time` is (n,) [s],
        increasing; `inputs` has (n,) samples of each input, read-only, and `numbers` a float for
        each number. Each output is (n,) real numbers. It may raise a `DomainError` if it does not
        hold for these numbers: a fit then takes the step back.
    inputs, outputs : sequence of str
        Names of what it takes and gives.
    numbers : mapping of str to float
        Its parameters. One called ``start.NAME`` is where a run begins: free, it is estimated for
        each run by itself.
    definitions : mapping of str to Definition, optional
        Meaning, unit and range of inputs, outputs and numbers.

    Raises
    ------
    InputError
        If a name is no text or there twice, or a number is none.
    ParameterError
        If a number lies beyond the range of its `Definition`.

    Examples
    --------
    >>> import numpy as np
    >>> from swashplate import BlackBox, simulate
    >>> def lagging(time, inputs, numbers):
    ...     level = np.zeros(time.size)
    ...     share = 1.0 - np.exp(-np.diff(time) / numbers["lag"])
    ...     for k, part in enumerate(share):
    ...         level[k + 1] = level[k] + part * (inputs["valve"][k] - level[k])
    ...     return {"level": level}
    >>> tank = BlackBox(
    ...     "tank", lagging, inputs=("valve",), outputs=("level",), numbers={"lag": 0.5}
    ... )
    >>> run = simulate(tank, {"valve": np.ones(101)}, 100.0)
    >>> round(float(run["level"][-1]), 3)
    0.865
    """

    def __init__(
        self,
        name: str,
        function: Function,
        *,
        inputs: Sequence[str],
        outputs: Sequence[str],
        numbers: Mapping[str, float],
        definitions: Mapping[str, Definition] | None = None,
    ) -> None:
        if not callable(function):
            raise InputError(
                f"{name}: {function!r} cannot be called; give a function of time, inputs and "
                "numbers that returns the outputs by name."
            )
        names = {"inputs": _names(name, "inputs", inputs)}
        names["outputs"] = _names(name, "outputs", outputs)
        check_mapping("numbers", numbers)
        names["numbers"] = tuple(numbers)
        stated = definitions or {}
        check_mapping("definitions", stated)
        known = [each for group in names.values() for each in group]
        twice = [each for k, each in enumerate(known) if each in (*known[:k], "time")]
        if twice:
            raise InputError(
                f"{name}: '{twice[0]}' stands for two things; each input, output and number needs "
                "a name of its own, other than time."
            )
        for each in stated:
            if each not in known:
                raise InputError(
                    f"{name} has no input, output or number {near_names(each, known)}."
                )
        self._keep(
            function,
            StatedPorts(name, names["inputs"], names["outputs"], names["numbers"], dict(stated)),
            numbers,
        )

    def _keep(self, function: Function, ports: StatedPorts, numbers: Mapping[str, float]) -> None:
        for number_name, number in numbers.items():
            if not is_real(number) or not np.isfinite(number):
                raise InputError(
                    f"{ports.name}: {number_name} is {number!r}, but must be a finite number."
                )
            definition = ports.stated.get(number_name)
            if definition is not None and not definition.holds(number):
                raise ParameterError(f"{ports.name}: {definition.broken(number_name, number)}.")
        kept = {"function": function, "_ports": ports, "parts": (), "name": ports.name, "rules": ()}
        kept["_numbers"] = {each: float(number) for each, number in numbers.items()}
        for word, value in kept.items():
            object.__setattr__(self, word, value)

    function: Function
    """What simulates it."""
    _ports: StatedPorts
    _numbers: Mapping[str, float]

    def __repr__(self) -> str:
        numbers = ", ".join(f"{name}={value:.6g}" for name, value in self._numbers.items())
        ports = f"{', '.join(self._ports.external)} to {', '.join(self._ports.every_signal)}"
        return f"BlackBox({self.name!r}, {ports}, {numbers})"

    __eq__ = object.__eq__
    __hash__ = object.__hash__

    @property
    def model(self) -> Model:
        """There is none, which what needs equations comes to know here.

        Raises
        ------
        InputError
            Always.
        """
        raise InputError(
            f"{self.name} is a black box: it is simulated, compared and fitted; for anything else "
            "write its equations as a Model."
        )

    @property
    def ports(self) -> StatedPorts:
        """What it takes, gives and is set by, by name."""
        return self._ports

    @property
    def numbers(self) -> Mapping[str, float]:
        """Its parameters by name."""
        return self._numbers

    @property
    def params(self) -> Array:
        """(k,) its parameters."""
        return np.array([*self._numbers.values()])

    def replace(self, changes: Mapping[str, Any] | None = None, /, **by_name: Any) -> BlackBox:
        """A black box with other numbers; this one stays as it is.

        Parameters
        ----------
        changes : mapping, optional
            Numbers by name.
        **by_name : float or Pint quantity
            The same.

        Raises
        ------
        InputError
            For a name that no number has, or a value that is none.
        ParameterError
            For a number beyond the range of its `Definition`.
        """
        numbers = dict(self._numbers)
        for name, value in {**(changes or {}), **by_name}.items():
            full = full_name(name, numbers)
            if full not in numbers:
                raise UnknownParameterError(
                    f"{self.name} has no parameter {near_names(name, numbers)}."
                )
            unit = self._ports.parameter_definitions[full].unit
            numbers[full] = in_si(value, unit, full) if unit else value
        changed = object.__new__(BlackBox)
        changed._keep(self.function, self._ports, numbers)
        return changed

    def check_inputs(self, signals: Collection[str]) -> None:
        """Refuse inputs that it does not know, and the lack of those it needs."""
        self._check_known(signals)
        for name in self._ports.external:
            if name not in signals:
                raise InputError(f"{self.name} needs the signal '{name}'.")

    def signals_under(
        self,
        records: Mapping[str, Record],
        start: Start,
        begin: Mapping[str, float],
        *,
        first: tuple[str, ...] = (),
        states: bool = True,
        everything: bool = False,
    ) -> dict[str, Array]:
        """Outputs under inputs, (n,) each on their grid, by name; see `Machine`."""
        del first, states, everything
        record = next(iter(records.values()))
        if start != "rest" or begin:
            raise InputError(
                f"{self.name} is a black box, which begins as its numbers say: leave out "
                f"{'begin' if begin else 'start'}."
            )
        if record.substeps > 1:
            raise InputError(
                f"{self.name} is a black box, which takes steps of its own: leave out substeps."
            )
        return self.outputs(record.points, {name: each.values for name, each in records.items()})

    def outputs(self, time: Array, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """What the function gives, (n,) each by name, checked.

        Raises
        ------
        InputError
            If it returns anything but real numbers by the names of the outputs, one for each stamp.
        DomainError
            If one of them is not finite, or arithmetic fails.
        """
        given = {name: _read_only(values) for name, values in inputs.items()}
        try:
            returned = self.function(_read_only(time), given, dict(self._numbers))
        except ArithmeticError as error:
            raise DomainError(
                f"{self.name} cannot be computed for these numbers ({error})."
            ) from error
        return self._checked(returned, time)

    def _checked(self, returned: object, time: Array) -> dict[str, Array]:
        """What the function returned, refused unless it is what was asked for."""
        names = self._ports.every_signal
        if not isinstance(returned, Mapping):
            kind = (
                "nothing (is a return missing?)"
                if returned is None
                else repr(type(returned).__name__)
            )
            raise InputError(
                f"{self.name}: its function returns {kind}, but must return a mapping of "
                f"{', '.join(names)} to arrays."
            )
        if set(returned) != set(names):
            raise InputError(
                f"{self.name}: its function returns {', '.join(map(str, returned)) or 'no output'},"
                f" but its outputs are {', '.join(names)}."
            )
        outputs = dict[str, Array]()
        for name in names:
            values = np.asarray(returned[name])
            if values.dtype.kind not in "fiu":
                raise InputError(
                    f"{self.name}: its function returns an array of {values.dtype.name} for "
                    f"{name}, but must return real numbers."
                )
            if values.shape != time.shape:
                raise InputError(
                    f"{self.name}: its function returns an array of shape {values.shape} for "
                    f"{name}, but must return {time.shape}: a number for each stamp of time."
                )
            bad = ~np.isfinite(values)
            if bad.any():
                row = int(np.argmax(bad))
                raise DomainError(
                    f"{self.name}: its function gives {values[row]} for {name} at {time[row]:g} s; "
                    "check its numbers, and what it does with these inputs."
                )
            outputs[name] = np.array(values, dtype=np.float64)
        return outputs


def _names(machine: str, what: str, names: Sequence[Any]) -> tuple[str, ...]:
    """Names of inputs or outputs, at least one."""
    if isinstance(names, str):
        raise InputError(f"{machine}: give its {what} as ('{names}',).")
    if not names or not all(isinstance(name, str) and name for name in names):
        raise InputError(f"{machine}: its {what} are {names!r}, but must be one name or more.")
    return tuple(names)


def _read_only(values: Array) -> Array:
    view = values.view()
    view.flags.writeable = False
    return view
