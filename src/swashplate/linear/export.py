"""Linear models for other tools: polynomials, SciPy's and python-control's objects, files."""

from __future__ import annotations

from dataclasses import asdict
from importlib import import_module
from math import comb, factorial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from swashplate.errors import InputError
from swashplate.linear.model import LinearDrive, LinearModel
from swashplate.tables import Form, ending, write_text

if TYPE_CHECKING:
    from scipy.signal import StateSpace

Array = NDArray[np.float64]
Matrices = tuple[Array, Array, Array, Array]

UNITS = {
    "voltage": "V",
    "current": "A",
    "current_rate": "A/s",
    "solenoid_force": "N",
    "spool_position": "m",
    "spool_deflection": "m",
    "orifice_opening": "m",
    "stroker_pressure": "Pa",
    "plate_pressure": "Pa",
    "swash_angle": "rad",
    "shaft_speed": "rad/s",
    "motor_torque": "N m",
    "motor_pressure_drop": "Pa",
    "load_torque": "N m",
    "pump_speed": "1",
    "supply_pressure": "Pa",
}
"""SI unit of each input, output and state of a drive's continuous model."""
HIGHEST_PADE = 8
"""Above, the approximant's coefficients span more decades than double precision has digits."""
LINEAR_MODEL = Form("a linear model", (".toml", ".json"))


# --- polynomials ----------------------------------------------------------------------------------


def polynomials(model: LinearModel, output: str, input: str | None = None) -> tuple[Array, Array]:
    """Numerator and denominator of one output, highest power first; see `LinearModel`.

    Raises
    ------
    InputError
        If the model has no such output or input.

    Notes
    -----
    With the Markov parameters m₀ = D, mₖ = C Aᵏ⁻¹ B the numerator is the polynomial part of
    denominator · Σ mₖ s⁻ᵏ. Those that the structure makes zero are exactly zero, so no leading
    coefficients are left by rounding.
    """
    if output not in model.outputs:
        raise InputError(
            f"The model of {model.name} has no output '{output}'; it has "
            f"{', '.join(model.outputs)}."
        )
    row, column = model.outputs.index(output), model.index_of_input(input)
    n = model.A.shape[0]
    denominator = np.zeros(n + 1)
    moving = np.real(np.poly(model.poles))
    denominator[: moving.size] = moving
    markov = np.empty(n + 1)
    markov[0] = model.D[row, column]
    into = model.B[:, column]
    for k in range(1, n + 1):
        markov[k] = model.C[row] @ into
        into = model.A @ into
    numerator = np.convolve(denominator, markov)[: n + 1]
    first = int(np.argmax(numerator != 0.0)) if numerator.any() else n
    return numerator[first:], denominator


def pade_polynomials(delay: float, order: int) -> tuple[Array, Array]:
    """Numerator and denominator of the Padé approximant of e^(-s delay), highest power first.

    Parameters
    ----------
    delay : float
        [s]
    order : int
        Degree of both, 1 to 8.
    """
    powers = np.arange(order, -1, -1)
    denominator = _pade_coefficients(order)[::-1] * delay**powers
    return denominator * (-1.0) ** powers, denominator


def _pade_states(delay: float, order: int) -> Matrices:
    """The same as a state space, its states scaled so that the coefficients are of one size."""
    coefficients = _pade_coefficients(order)
    sign = (-1.0) ** np.arange(order + 1)
    through = sign[-1]
    A = np.eye(order, k=1)
    A[-1] = -coefficients[:-1]
    B = np.zeros((order, 1))
    B[-1, 0] = 1.0
    C = ((sign - through) * coefficients)[np.newaxis, :-1]
    return A / delay, B / delay, C, np.array([[through]])


def _pade_coefficients(order: int) -> Array:
    """Coefficients of the denominator in p = s delay, lowest first, the highest being 1."""
    if not 1 <= order <= HIGHEST_PADE:
        raise InputError(
            f"The order of a Padé approximant is {order}, but must be 1 to {HIGHEST_PADE}, or 0 "
            "to leave the delay out."
        )
    return np.array(
        [comb(order, k) * factorial(2 * order - k) / factorial(order) for k in range(order + 1)]
    )


# --- objects --------------------------------------------------------------------------------------


def with_delay(model: LinearModel, order: int | None) -> tuple[Matrices, tuple[str, ...]]:
    """Matrices and names of the states, with the delay inside.

    Parameters
    ----------
    model : LinearModel
        Continuous or sampled.
    order : int or None
        Padé order of a continuous model's delay, 0 to leave it out.

    Raises
    ------
    InputError
        If there is a delay and nobody said what to do with it, or an order for a sampled model,
        whose delay is exact.
    """
    matrices = model.A, model.B, model.C, model.D
    if model.sample_time is not None:
        if order is not None:
            raise InputError("A sampled model has its delay exactly, as states; leave pade out.")
        return with_line(matrices, model.states, model.input, _whole(model))
    if model.delay == 0.0 or order == 0:
        return matrices, model.states
    if order is None:
        raise InputError(
            f"The model has a delay of {model.delay:g} s, which no state space holds exactly; say "
            "pade=2 for an approximant of that order, or pade=0 to leave the delay out."
        )
    names = tuple(f"delay_{k}" for k in range(1, order + 1))
    return _in_series(_pade_states(model.delay, order), matrices), (*names, *model.states)


def with_line(
    matrices: Matrices, states: tuple[str, ...], input: str, whole: int
) -> tuple[Matrices, tuple[str, ...]]:
    """Matrices and names of the states with whole samples of delay before the first input."""
    if whole == 0:
        return matrices, states
    A = np.eye(whole, k=-1)
    line = A, np.eye(whole, 1), np.eye(1, whole, whole - 1), np.zeros((1, 1))
    names = tuple(f"{input}_{k}" for k in range(1, whole + 1))
    return _in_series(line, matrices), (*names, *states)


def _whole(model: LinearModel) -> int:
    assert model.sample_time is not None
    return round(model.delay / model.sample_time)


def _in_series(first: Matrices, second: Matrices) -> Matrices:
    """A single-input system before the first input of another one."""
    A1, B1, C1, D1 = first
    A2, B2, C2, D2 = second
    n, others = A1.shape[0], np.zeros((A1.shape[0], B2.shape[1] - 1))
    A = np.block([[A1, np.zeros((n, A2.shape[0]))], [B2[:, :1] @ C1, A2]])
    B = np.block([[B1, others], [B2[:, :1] @ D1, B2[:, 1:]]])
    return A, B, np.hstack((D2[:, :1] @ C1, C2)), np.hstack((D2[:, :1] @ D1, D2[:, 1:]))


def to_scipy(model: LinearModel, order: int | None) -> StateSpace:
    """See `LinearModel.to_scipy`."""
    from scipy.signal import StateSpace

    matrices, _ = with_delay(model, order)
    if model.sample_time is None:
        return StateSpace(*matrices)
    return StateSpace(*matrices, dt=model.sample_time)


def to_control(
    model: LinearModel, form: Literal["state_space", "transfer_function"], order: int | None
) -> Any:
    """See `LinearModel.to_control`."""
    if form not in ("state_space", "transfer_function"):
        raise InputError(f"form is '{form}'; it is 'state_space' or 'transfer_function'.")
    matrices, states = with_delay(model, order)
    try:
        control = import_module("control")
    except ImportError:
        raise InputError(
            "python-control is not installed: pip install swashplate[control]; to_scipy needs "
            "nothing more."
        ) from None
    dt = 0 if model.sample_time is None else model.sample_time
    signals = {"inputs": list(model.inputs), "outputs": list(model.outputs), "name": model.name}
    if form == "state_space":
        return control.ss(*matrices, dt, states=list(states), **signals)
    numerators, denominators = [], []
    one = np.ones(1)
    delays = {model.input: _delay_polynomials(model, order)}
    for output in model.outputs:
        made = [
            (polynomials(model, output, input), delays.get(input, (one, one)))
            for input in model.inputs
        ]
        numerators.append([np.polymul(own[0], before) for own, (before, _) in made])
        denominators.append([np.polymul(own[1], after) for own, (_, after) in made])
    return control.tf(numerators, denominators, dt, **signals)


def _delay_polynomials(model: LinearModel, order: int | None) -> tuple[Array, Array]:
    """Numerator and denominator of the delay as `with_delay` has it."""
    one = np.ones(1)
    if model.sample_time is not None:
        return one, np.eye(1, _whole(model) + 1)[0]
    if model.delay == 0.0 or not order:
        return one, one
    return pade_polynomials(model.delay, order)


# --- files ----------------------------------------------------------------------------------------


def content(model: LinearModel) -> dict[str, Any]:
    """What is written of a model, as plain numbers, strings and lists; SI."""
    drive, time = {}, {"delay": model.delay}
    if model.sample_time is not None:
        time["sample_time"] = model.sample_time
    one_sided: dict[str, Any] = {}
    point: dict[str, Any] = {}
    if isinstance(model, LinearDrive):
        found = asdict(model.operating_point)
        drive = {"coulomb": model.coulomb}
        one_sided = {"one_sided": list(found.pop("one_sided"))}
        point = {"operating_point": {k: v for k, v in found.items() if v is not None}}
    return {
        "format": 1,
        "drive": model.name,
        "kind": "continuous" if model.sample_time is None else "sampled",
        **drive,
        **time,
        "input": model.input,
        "inputs": list(model.inputs),
        "outputs": list(model.outputs),
        "states": list(model.states),
        "input_unit": UNITS.get(model.input, ""),
        "input_units": [UNITS.get(name, "") for name in model.inputs],
        "output_units": [UNITS.get(name, "") for name in model.outputs],
        **one_sided,
        "A": model.A.tolist(),
        "B": model.B.tolist(),
        "C": model.C.tolist(),
        "D": model.D.tolist(),
        **point,
    }


def write_model(model: LinearModel, path: str | Path) -> None:
    """Write a model as .toml or .json; see `LinearModel.write`."""
    if ending(path, LINEAR_MODEL) == ".json":
        from json import dumps as dump_json

        write_text(dump_json(content(model), indent=1) + "\n", path)
    else:
        from tomlkit import dumps as dump_toml

        write_text(dump_toml(content(model)), path)
