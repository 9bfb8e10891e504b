"""Line between pump and motor: oil that is compressed and an inertia that has to be turned.

    T' = k (Ω_0 - Ω - K_mL T),  J Ω' = T - C_g

T is the motor's torque, P_hi - P_lo = K_mf T (Kruse 2001, eq. 6.41); Ω_0 the speed that the pump's
flow would give a stiff line; k = B/(K_mf² V) its stiffness felt at the shaft. The source takes the
line as stiff (k → ∞), which leaves Ω = Ω_0 - K_mL (C_g + J Ω').
"""

from swashplate.physics.component import component


@component
def line_step(
    torque: float,
    speed: float,
    flow_speed: float,
    static_torque: float,
    line_stiffness: float,
    motor_leakage: float,
    load_inertia: float,
    step: float,
) -> tuple[float, float]:
    """Torque and speed of the motor one step later.

    Parameters
    ----------
    torque : float
        T, positive where it drives towards positive speed. [N m]
    speed : float
        Ω. [rad/s]
    flow_speed : float
        Ω_0, mean of the step. [rad/s]
    static_torque : float
        C_g, positive against positive speed. [N m]
    line_stiffness : float
        k. [N m/rad]
    motor_leakage : float
        K_mL. [rad/(s N m)]
    load_inertia : float
        J, above 0. [kg m²]
    step : float
        h. [s]

    Returns
    -------
    torque, speed : float
        By the implicit midpoint rule. [N m, rad/s]

    Notes
    -----
    The rule keeps T²/(2k) + J Ω²/2 but for rounding where neither flow nor load nor leakage acts,
    and with leakage lowers it by h K_mL T² at the middle of the step: stable at any step. It is
    accurate while h √(k/J) is well below 1: at 512 samples a second, up to some 20 Hz.
    """
    half = 0.5 * step
    kick = half / load_inertia
    charge = half * line_stiffness
    # both unknowns at the middle of the step
    middle = (torque + charge * (flow_speed - speed + kick * static_torque)) / (
        1.0 + charge * (motor_leakage + kick)
    )
    return 2.0 * middle - torque, speed + 2.0 * kick * (middle - static_torque)
