"""Linear drives as SciPy's and python-control's objects."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from swashplate.errors import InputError
from swashplate.linear.transfer import (
    StateSpaceMatrices,
    pade_polynomials,
    pade_states,
    polynomials,
)

if TYPE_CHECKING:
    from swashplate.linear.model import LinearDrive

Array = NDArray[np.float64]


def with_delay(model: LinearDrive, order: int | None) -> tuple[StateSpaceMatrices, tuple[str, ...]]:
    """Matrices and names of the states, with the delay inside.

    Parameters
    ----------
    model : LinearDrive
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
        whole = round(model.delay / model.sample_time)
        names = tuple(f"{model.input}_{k}" for k in range(1, whole + 1))
        return (matrices if whole == 0 else _in_series(_line(whole), matrices)), (
            *names,
            *model.states,
        )
    if model.delay == 0.0 or order == 0:
        return matrices, model.states
    if order is None:
        raise InputError(
            f"The model has a delay of {model.delay:g} s, which no state space holds exactly; say "
            "pade=2 for an approximant of that order, or pade=0 to leave the delay out."
        )
    names = tuple(f"delay_{k}" for k in range(1, order + 1))
    return _in_series(pade_states(model.delay, order), matrices), (*names, *model.states)


def to_scipy(model: LinearDrive, order: int | None) -> Any:
    """See `LinearDrive.to_scipy`."""
    from scipy.signal import StateSpace

    matrices, _ = with_delay(model, order)
    if model.sample_time is None:
        return StateSpace(*matrices)
    return StateSpace(*matrices, dt=model.sample_time)


def to_control(
    model: LinearDrive, form: Literal["state_space", "transfer_function"], order: int | None
) -> Any:
    """See `LinearDrive.to_control`."""
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
    signals = {"inputs": [model.input], "outputs": list(model.outputs), "name": model.name}
    if form == "state_space":
        return control.ss(*matrices, dt, states=list(states), **signals)
    numerators, denominators = [], []
    before, after = _delay_polynomials(model, order)
    for output in model.outputs:
        numerator, denominator = polynomials(model, output)
        numerators.append([np.polymul(numerator, before)])
        denominators.append([np.polymul(denominator, after)])
    return control.tf(numerators, denominators, dt, **signals)


def _delay_polynomials(model: LinearDrive, order: int | None) -> tuple[Array, Array]:
    """Numerator and denominator of the delay as `with_delay` has it."""
    one = np.ones(1)
    if model.sample_time is not None:
        return one, np.eye(1, round(model.delay / model.sample_time) + 1)[0]
    if model.delay == 0.0 or not order:
        return one, one
    return pade_polynomials(model.delay, order)


def _line(whole: int) -> StateSpaceMatrices:
    """A delay line of whole samples."""
    A = np.eye(whole, k=-1)
    return A, np.eye(whole, 1), np.eye(1, whole, whole - 1), np.zeros((1, 1))


def _in_series(first: StateSpaceMatrices, second: StateSpaceMatrices) -> StateSpaceMatrices:
    """One single-input system behind another."""
    A1, B1, C1, D1 = first
    A2, B2, C2, D2 = second
    A = np.block([[A1, np.zeros((A1.shape[0], A2.shape[0]))], [B2 @ C1, A2]])
    return A, np.vstack((B1, B2 @ D1)), np.hstack((D2 @ C1, C2)), D2 @ D1
