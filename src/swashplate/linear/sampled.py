"""The linear model at a sample time: the recurrences of the march, linearised."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from swashplate.errors import InputError
from swashplate.linear.continuous import card_at, channel_side, output_rows, slopes_at
from swashplate.linear.model import Coulomb, LinearDrive
from swashplate.linear.operating_point import Input, OperatingPoint
from swashplate.parameters.parameter_set import ParameterSet
from swashplate.simulation.build import build_delay, check_filter_stability
from swashplate.simulation.record import Interpolation, least_substeps

Array = NDArray[np.float64]
Matrices = tuple[Array, Array, Array, Array]


def sampled(
    parameters: ParameterSet,
    point: OperatingPoint,
    input: Input,
    outputs: tuple[str, ...],
    coulomb: Coulomb,
    sample_time: float,
    interpolation: Interpolation,
) -> LinearDrive:
    """Linear model at a sample time; see `LinearDrive.discrete`.

    Raises
    ------
    InputError
        For a sample time outside 10 µs to 0.1 s, or one at which the card's filter is unstable.
    """
    if interpolation not in ("linear", "previous"):
        raise InputError(f"interpolation is '{interpolation}'; it is 'linear' or 'previous'.")
    if not sample_time > 0.0:
        raise InputError(f"The sample time is {sample_time:g} s, but must be above 0.")
    rate = 1.0 / sample_time
    substeps = least_substeps(round(rate) if abs(rate - round(rate)) < 1e-9 * rate else rate)
    step = sample_time / substeps
    if input == "voltage":
        matrices, states, whole = _drive(parameters, point, outputs, coulomb, step)
    else:
        matrices, states, whole = _pump(parameters, point, input, outputs, step)
    delay = whole * step
    if substeps > 1:
        matrices, states = _with_line(matrices, states, whole)
        matrices = _lifted(*matrices, substeps, interpolation)
        states, delay = (*states, "voltage_last" if input == "voltage" else f"{input}_last"), 0.0
    return LinearDrive(
        *matrices, states, outputs, input, delay, sample_time, point, coulomb, parameters
    )


def _pump(
    parameters: ParameterSet,
    point: OperatingPoint,
    input: Input,
    outputs: tuple[str, ...],
    step: float,
) -> tuple[Matrices, tuple[str, ...], int]:
    slopes, force_slope = slopes_at(parameters, point, step)
    by_input = 1.0 if input == "solenoid_force" else force_slope
    rows = output_rows(outputs, slopes, by_input)
    A = np.array([[slopes.next_by_pressure]])
    B = np.array([[slopes.next_by_force * by_input]])
    return (A, B, rows[:, :1], rows[:, 1:]), ("stroker_pressure",), 0


def _drive(
    parameters: ParameterSet,
    point: OperatingPoint,
    outputs: tuple[str, ...],
    coulomb: Coulomb,
    step: float,
) -> tuple[Matrices, tuple[str, ...], int]:
    """One step of the march behind the whole samples of the delay.

    States: the command one sample ago (the delay's fraction lies between it and the present one),
    I* one sample ago, I* now, δP now.
    """
    numbers = parameters.numbers
    side = channel_side(point)
    check_filter_stability(
        parameters.name, numbers[f"zeta_{side}"], numbers[f"omega_{side}"], side, step
    )
    slopes, force_slope = slopes_at(parameters, point, step)
    card = card_at(parameters, point, coulomb, step)
    delay = build_delay(numbers["tau"], step)
    by_command = card.next_by_steady * card.steady_by_voltage
    A = np.zeros((4, 4))
    B = np.zeros((4, 1))
    B[0, 0] = 1.0
    A[1, 2] = 1.0
    A[2] = [delay.fraction * by_command, card.next_by_before, card.next_by_current, 0.0]
    B[2, 0] = (1.0 - delay.fraction) * by_command
    A[3, 2:] = [slopes.next_by_force * force_slope, slopes.next_by_pressure]
    rows = output_rows(outputs, slopes, force_slope)
    C = np.zeros((len(outputs), 4))
    C[:, 2:] = rows[:, ::-1]
    states = ("voltage_before", "current_before", "current", "stroker_pressure")
    return (A, B, C, np.zeros((len(outputs), 1))), states, delay.whole


def _with_line(
    matrices: Matrices, states: tuple[str, ...], whole: int
) -> tuple[Matrices, tuple[str, ...]]:
    """The same with the whole samples of a delay as states, oldest last."""
    if whole == 0:
        return matrices, states
    A, B, C, D = matrices
    n = A.shape[0]
    longer = np.zeros((whole + n, whole + n))
    longer[1:whole, : whole - 1] = np.eye(whole - 1)
    longer[whole:, whole - 1] = B[:, 0]
    longer[whole:, whole:] = A
    into = np.zeros((whole + n, 1))
    into[0, 0] = 1.0
    out = np.hstack((np.zeros((C.shape[0], whole)), C))
    out[:, whole - 1] = D[:, 0]
    line = tuple(f"voltage_{k}" for k in range(1, whole + 1))
    return (longer, into, out, np.zeros_like(D)), (*line, *states)


def _lifted(
    A: Array, B: Array, C: Array, D: Array, substeps: int, interpolation: Interpolation
) -> Matrices:
    """Several steps as one sample.

    The state is that of the step after the sample before, together with the input at that sample:
    from there on the steps up to this sample know their inputs.
    """
    n = A.shape[0]
    # columns: the state, the last input, the present one
    z = np.eye(n, n + 2)
    y = np.empty(0)
    for j in range(1, substeps + 1):
        rise = j / substeps if interpolation == "linear" else float(j == substeps)
        u = np.zeros((1, n + 2))
        u[0, n:] = [1.0 - rise, rise]
        y = C @ z + D @ u
        z = A @ z + B @ u
    longer = np.zeros((n + 1, n + 1))
    longer[:n] = z[:, : n + 1]
    into = np.vstack((z[:, n + 1 :], [[1.0]]))
    return longer, into, y[:, : n + 1], y[:, n + 1 :]
