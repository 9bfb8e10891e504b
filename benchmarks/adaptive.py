"""The pump by SciPy's adaptive integrator, on the package's own compiled equations."""

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from swashplate.physics.spool import orifice_opening
from swashplate.physics.stroker import pressure_rate
from swashplate.simulation.chain import plate_motion, pump_force, pump_spool
from swashplate.simulation.constants import Pump
from swashplate.simulation.march import observe_speed

Array = NDArray[np.float64]

SETUP = "RK45, rtol 1e-6, atol 1 Pa"
RTOL, ATOL = 1e-6, 1.0


@njit(error_model="numpy")
def slope(t: float, state: Array, current: Array, h: float, pump: Pump) -> float:
    """Rate of the pressure at any time; the current is a straight line between samples. [Pa/s]"""
    at = min(max(t / h, 0.0), current.size - 1.0)
    n = min(int(at), current.size - 2)
    i = current[n] + (at - n) * (current[n + 1] - current[n])
    p = min(max(state[0], pump.lower), pump.upper)
    free = pump_spool(pump_force(i, pump), p, pump)
    opening = orifice_opening(free, pump.Z14, pump.Z16_plus, pump.Z16_minus)
    Z6 = plate_motion(p, pump)
    rate = pressure_rate(p, opening, Z6, pump.Z7, pump.Z8, pump.Z9, pump.symmetric)
    if (p >= pump.upper and rate > 0.0) or (p <= pump.lower and rate < 0.0):
        return 0.0
    return rate


def integrate(current: Array, h: float, pump: Pump, longest: float) -> Array:
    """Shaft speed over a signed current. [rad/s]

    Parameters
    ----------
    longest : float
        Longest step. With h no kink of the current or of the equations is stepped over unseen,
        and the integrator never gets to use its order; with `inf` it does. [s]
    """
    time = h * np.arange(current.size)
    solution = solve_ivp(
        slope,
        (0.0, time[-1]),
        [pump.Z2 / pump.Z1],
        method="RK45",
        t_eval=time,
        args=(current, h, pump),
        rtol=RTOL,
        atol=ATOL,
        max_step=longest,
    )
    if not solution.success:
        raise RuntimeError(solution.message)
    pressure = np.clip(solution.y[0], pump.lower, pump.upper)
    speed = np.empty_like(pressure)
    observe_speed(current, pressure, pump, speed)
    return speed
