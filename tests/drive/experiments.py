"""Commands, and residuals of a drive under an observed record with their derivatives."""

from collections.abc import Sequence

import numpy as np

from swashplate import ParameterSet, maneuvers
from swashplate.drive import bound_drive, requested_columns
from swashplate.machine.marching import ObservedRecord, RunValues
from swashplate.machine.marching.derivatives import Jacobian, Triangle

NOTHING = RunValues()
RATE = 512.0


def steps(*levels: float) -> np.ndarray:
    """Half a second at each level between slow flanks."""
    t = np.arange(int(0.6 * len(levels) * RATE)) / RATE
    corners = np.concatenate([[0.6 * k, 0.6 * k + 0.1] for k in range(len(levels))])
    return np.interp(t, corners, np.repeat([0.0, *levels], 2)[1:-1])


STICTION = {"spool_friction": 0.115, "spool_presliding": 5e-5, "dither_time": 0.6}
LOAD = {"load_torque": 3e4, "load_inertia": 5e3, "motor_leakage": 1e-6, "motor_constant": 250.0}
RIPPLE = {"cam_ripple": 0.01, "cam_ripple_per_torque": 5e-7, "cam_phase": 0.3}
ALL = {
    **STICTION,
    **LOAD,
    **RIPPLE,
    **{"solenoid_delay": 0.0123, "solenoid_lag": 0.015, "solenoid_hysteresis": 0.005},
    **{"swash_damping": 0.02, "line_stiffness": 1e6},
}
"""Every refinement."""
SWING = maneuvers.sine(3.0, 0.8, start=0.05, length=3.0, settle=0.4).sample(RATE)
HARD = steps(9.0, 9.0, 0.0, -9.0, -9.0, 0.0, 3.0)


def residuals(
    parameters: ParameterSet, observed: ObservedRecord, own: RunValues = NOTHING
) -> np.ndarray:
    return bound_drive(parameters, observed, (), own).residuals(observed)


def jacobian(
    parameters: ParameterSet,
    observed: ObservedRecord,
    columns: Sequence[str],
    own: RunValues = NOTHING,
    out: np.ndarray | None = None,
) -> Jacobian:
    found = bound_drive(parameters, observed, columns, own).jacobian(observed, out)
    return found._replace(
        names=(*requested_columns(parameters.definitions, tuple(columns)), *observed.own_columns)
    )


def triangle(
    parameters: ParameterSet,
    observed: ObservedRecord,
    columns: Sequence[str],
    own: RunValues = NOTHING,
) -> Triangle:
    found = bound_drive(parameters, observed, columns, own).triangle(observed)
    return found._replace(
        names=(*requested_columns(parameters.definitions, tuple(columns)), *observed.own_columns)
    )
