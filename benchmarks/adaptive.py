"""The pump by SciPy's adaptive integrator, on the package's own compiled equations."""

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from swashplate.models.displacement_control import (
    PressureLimits,
    Pump,
    Stroking,
    arm_sine,
    orifice_opening,
    plate_motion,
    pressure_limits,
    pressure_rate,
    solenoid_force,
    spool_balance,
    swash_angle,
    swash_tangent,
)
from swashplate.models.pump import shaft_speed

Array = NDArray[np.float64]

SETUP = "RK45, rtol 1e-6, atol 1 Pa"
RTOL, ATOL = 1e-6, 1.0


@njit(error_model="numpy")
def slope(
    t: float, state: Array, current: Array, h: float, pump: Pump, limits: PressureLimits
) -> float:
    """Rate of the pressure at any time; the current is a straight line between samples. [Pa/s]"""
    at = min(max(t / h, 0.0), current.size - 1.0)
    n = min(int(at), current.size - 2)
    i = current[n] + (at - n) * (current[n + 1] - current[n])
    p = min(max(state[0], limits.lower), limits.upper)
    free = spool_balance(solenoid_force(i, pump), arm_sine(p, pump), pump)
    opening = orifice_opening(free, pump)
    Z6 = plate_motion(p, pump)
    rate = pressure_rate(p, opening, Stroking(Z6, pump.Z7, pump.Z8, pump.Z9), None)
    if (p >= limits.upper and rate > 0.0) or (p <= limits.lower and rate < 0.0):
        return 0.0
    return rate


@njit(error_model="numpy")
def speed_of(pressure: Array, pump: Pump) -> Array:
    """Shaft speed of every pressure. [rad/s]"""
    speed = np.empty_like(pressure)
    for n in range(pressure.size):
        angle = swash_angle(swash_tangent(pressure[n], pump), pump, None)
        speed[n] = shaft_speed(angle, 0.0, pump.Z10, pump.Z11)
    return speed


def integrate(current: Array, h: float, pump: Pump, longest: float) -> Array:
    """Shaft speed over a signed current. [rad/s]

    Parameters
    ----------
    longest : float
        Longest step. With h no kink of the current or of the equations is stepped over unseen,
        and the integrator never gets to use its order; with `inf` it does. [s]
    """
    limits = pressure_limits(pump)
    time = h * np.arange(current.size)
    solution = solve_ivp(
        slope,
        (0.0, time[-1]),
        [pump.Z2 / pump.Z1],
        method="RK45",
        t_eval=time,
        args=(current, h, pump, limits),
        rtol=RTOL,
        atol=ATOL,
        max_step=longest,
    )
    if not solution.success:
        raise RuntimeError(solution.message)
    return speed_of(np.clip(solution.y[0], limits.lower, limits.upper), pump)
