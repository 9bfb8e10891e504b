"""What goes beyond the source's equations: friction, hysteresis, ripple, damping, leakage, line.

Each is off unless its option is on (`swashplate.models.pump.PumpOptions`). docs/refinements.md says
what each explains.

Friction of solenoid and spool (Kruse 2001, section 7.6). The friction f holds the spool back
against its feedback spring: it stands d = f/k short of the place at which solenoid and spring
balance. It builds up over a short travel of the spool, slides at F_s, and fades with the time
constant T of the dither, which shakes the spool free:

    f' = (F_s/x_s) x' - f/T,  |f| ≤ F_s.

What moves the spool moves it against the friction; a spool that comes to rest is left where
friction holds it, and goes on to its balance as the dither lets go.

Hysteresis of the solenoids: the force lags behind the current, however slowly it moves.

Ripple of the motor's cam ring: displacement that varies with the shaft's angle. The source saw 5.5
cycles a turn of the drum, the larger the heavier the load (sections 1.2 and 9, figures 9.2, 9.3).

Damping of the swash plate: it turns towards its equilibrium instead of standing there. With a
damping moment c α' in eq. 6.55 and T = c/(k_r d4²),

    T (tan α_sw)' = (Z1 δP - Z2) - tan α_sw.

The plate's place is written as the pressure p at which it would stand still, tan α_sw = Z1 p - Z2:
T p' = δP - p. Whatever the plate has yet to turn has not yet taken its oil: δP + Z6 p is the oil in
the cylinder, which the plate's motion does not change.

Leakage of the motor under load: Z11 and Z12 from what they stand for (eq. 6.70).

Line between pump and motor: oil that is compressed and an inertia that has to be turned,

    T' = k (Ω_0 - Ω - K_mL T),  J Ω' = T - C_g.

T is the motor's torque, P_hi - P_lo = K_mf T (eq. 6.41); Ω_0 the speed that the pump's flow would
give a stiff line; k = B/(K_mf² V) its stiffness felt at the shaft. The source takes the line as
stiff (k → ∞), which leaves Ω = Ω_0 - K_mL (C_g + J Ω').
"""

from math import exp, sin, sqrt

from swashplate.equations.equation import equation


@equation
def spring_stiffness(Z4: float, Z5: float) -> float:
    """Stiffness of the feedback spring at the spool, √Z4/Z5², of small motion (eq. 6.72). [N/m]"""
    return sqrt(Z4) / (Z5 * Z5)


@equation
def friction_width(spool_friction: float, Z4: float, Z5: float) -> float:
    """How far from its balance friction can hold the spool.

    Parameters
    ----------
    spool_friction : float
        Force F_s at which the spool slides, either way. [N]
    Z4, Z5 : float
        Squared spring moment [N² m²], arm d1 [m].

    Returns
    -------
    float
        w = F_s/k. [m]
    """
    return spool_friction / spring_stiffness(Z4, Z5)


@equation
def dither_factor(dither_time: float, h: float) -> float:
    """What dither leaves of a friction in one step, exp(-h/T); 1 without dither."""
    return exp(-h / dither_time)


@equation
def held_back(
    deflection: float, balance: float, before: float, width: float, presliding: float, factor: float
) -> float:
    """Distance by which friction holds the spool back from its balance, one step later.

    Parameters
    ----------
    deflection : float
        d one step before, positive where the balance lies further towards more speed. [m]
    balance : float
        Where solenoid and spring balance now. [m]
    before : float
        Where the spool stood one step before. [m]
    width : float
        w, see `friction_width`; above 0. [m]
    presliding : float
        Travel x_s over which friction builds up to F_s; 0 holds the spool fast. [m]
    factor : float
        See `dither_factor`.

    Returns
    -------
    float
        d = clip((x_s d e^(-h/T) + w (balance - before))/(x_s + w), ±w), the implicit step of
        f' = (F_s/x_s) x' - f/T, |f| ≤ F_s; the spool stands at the balance less d. [m]

    Notes
    -----
    The friction's work on the spool is never less than what its travel stores, k x_s d²/(2 w): over
    a closed path it takes energy.
    """
    free = (presliding * (deflection * factor) + width * (balance - before)) / (presliding + width)
    return min(max(free, -width), width)


@equation
def magnetising_current(current: float, previous: float, solenoid_hysteresis: float) -> float:
    """Current that the solenoids' force belongs to.

    Parameters
    ----------
    current : float
        Signed current at this sample. [A]
    previous : float
        Magnetising current one sample before. [A]
    solenoid_hysteresis : float
        Half-width r of the loop. [A]

    Returns
    -------
    float
        i_m = min(max(i_m, i - r), i + r), the play operator: i - r while the current rises, i + r
        while it falls, unchanged for 2r behind a turn. It does not depend on the rate. [A]

    Notes
    -----
    Whenever i_m moves it lies r behind the current, so that i Δi_m = i_m Δi_m + r |Δi_m|: a closed
    loop takes up energy, never gives it.
    """
    return min(max(previous, current - solenoid_hysteresis), current + solenoid_hysteresis)


@equation
def ripple_depth(cam_ripple: float, cam_ripple_per_torque: float, load_torque: float) -> float:
    """Relative variation of the displacement, ε = ε0 + ε1 |C_g|.

    Parameters
    ----------
    cam_ripple : float
        ε0, without a load. [1]
    cam_ripple_per_torque : float
        ε1, its growth. [1/(N m)]
    load_torque : float
        C_g of the load at the shaft. [N m]
    """
    return cam_ripple + cam_ripple_per_torque * abs(load_torque)


@equation
def rippled_angle(
    swash_angle: float, shaft_angle: float, depth: float, cam_cycles: float, cam_phase: float
) -> float:
    """Swash plate angle that would give a motor without ripple the same speed.

    Parameters
    ----------
    swash_angle : float
        α_sw. [rad]
    shaft_angle : float
        Angle θ of the shaft since the start. [rad]
    depth : float
        ε, see `ripple_depth`; below 1.
    cam_cycles : float
        Cycles n a turn of the shaft. [1]
    cam_phase : float
        Phase ψ of the ring at the start. [rad]

    Returns
    -------
    float
        α_sw / (1 + ε sin(n θ + ψ)). [rad]

    Notes
    -----
    The motor's displacement is D (1 + ε sin(n θ + ψ)). Speed times displacement is the flow, so
    that the oil of n whole cycles, and with it the mean speed of a turn, is that without ripple;
    torque goes with the displacement, and no energy is made.
    """
    return swash_angle / (1.0 + depth * sin(cam_cycles * shaft_angle + cam_phase))


@equation
def damping_factor(swash_damping: float, Z6: float, h: float) -> float:
    """What is left of δP - p after one step without flow, exp(-h (1 + Z6)/T).

    Parameters
    ----------
    swash_damping : float
        T, above 0. [s]
    Z6 : float
        Piston motion against oil stiffness. [1]
    h : float
        Step. [s]
    """
    return exp(-h * (1.0 + Z6) / swash_damping)


@equation
def plate_follows(
    pressure: float, plate_pressure: float, Z6: float, factor: float
) -> tuple[float, float]:
    """Pressure and plate one step later, without flow.

    Parameters
    ----------
    pressure, plate_pressure : float
        δP, and p of the plate. [Pa]
    Z6 : float
        Piston motion against oil stiffness. [1]
    factor : float
        See `damping_factor`.

    Returns
    -------
    pressure, plate_pressure : float
        With δP + Z6 p as before and δP - p smaller by the factor. [Pa]

    Notes
    -----
    The energy of oil and spring, δP² + Z6 p² but for a factor, falls: the damper takes it.
    """
    motion = (pressure - plate_pressure) * (1.0 - factor) / (1.0 + Z6)
    return pressure - Z6 * motion, plate_pressure + motion


@equation
def plate_pressure_rate(pressure: float, plate_pressure: float, swash_damping: float) -> float:
    """Rate of the plate's pressure, p' = (δP - p)/T. [Pa/s]"""
    return (pressure - plate_pressure) / swash_damping


@equation
def static_leakage(motor_leakage: float, load_torque: float) -> float:
    """Speed lost to a static load, the Z11 of eq. 6.70.

    Parameters
    ----------
    motor_leakage : float
        K_mL, speed lost to leakage for a torque. [rad/(s N m)]
    load_torque : float
        C_g of gravity at the shaft, positive against positive speed: a load that hangs on the hoist
        is positive. [N m]

    Returns
    -------
    float
        K_mL C_g, positive where the load slows hoisting; it speeds lowering up. [rad/s]
    """
    return motor_leakage * load_torque


@equation
def accelerating_leakage(motor_leakage: float, load_inertia: float, Z10: float) -> float:
    """Share of cos α dα/dt lost to an accelerating load, the Z12 of eq. 6.70.

    Parameters
    ----------
    motor_leakage : float
        K_mL. [rad/(s N m)]
    load_inertia : float
        C_i of motor and load at the shaft. [kg m²]
    Z10 : float
        K_mf C_q, swash plate angle to shaft speed. [1/s]

    Returns
    -------
    float
        K_mL C_i Z10, on cos α dα/dt (erratum 22). [1]
    """
    return motor_leakage * load_inertia * Z10


@equation
def load_leakage(tangent: float, swash_rate: float, Z12: float) -> float:
    """Speed lost to leakage while the load accelerates.

    Parameters
    ----------
    tangent : float
        tan α_sw.
    swash_rate : float
        dα_sw/dt, zero at a stop. [rad/s]
    Z12 : float
        Leakage by acceleration. [1]

    Returns
    -------
    float
        Z12 cos α_sw dα_sw/dt, the form that the source's own derivation gives in place of the
        printed one (erratum 22). [rad/s]
    """
    return Z12 * (swash_rate / sqrt(1.0 + tangent * tangent))


@equation
def stiff_line_torque(
    tangent: float, swash_rate: float, load_torque: float, load_inertia: float, Z10: float
) -> float:
    """Torque that the motor bears where the line is stiff.

    Parameters
    ----------
    tangent : float
        tan α_sw.
    swash_rate : float
        dα_sw/dt, zero at a stop. [rad/s]
    load_torque, load_inertia, Z10 : float
        C_g [N m], C_i [kg m²], swash plate angle to shaft speed [1/s].

    Returns
    -------
    float
        C_g + C_i Z10 cos α dα/dt; Kruse eqs. 6.42 and 6.45. [N m]
    """
    return load_inertia * load_leakage(tangent, swash_rate, Z10) + load_torque


@equation
def motor_pressure_drop(torque: float, motor_constant: float) -> float:
    """P_hi - P_lo = K_mf τ, from the work done by the motor; Kruse eq. 6.41. [Pa]"""
    return motor_constant * torque


@equation
def line_step(
    torque: float,
    speed: float,
    flow_speed: float,
    load_torque: float,
    line_stiffness: float,
    motor_leakage: float,
    load_inertia: float,
    h: float,
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
    load_torque : float
        C_g, mean of the step, positive against positive speed. [N m]
    line_stiffness : float
        k. [N m/rad]
    motor_leakage : float
        K_mL. [rad/(s N m)]
    load_inertia : float
        J, above 0. [kg m²]
    h : float
        Step. [s]

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
    half = 0.5 * h
    kick = half / load_inertia
    charge = half * line_stiffness
    # both unknowns at the middle of the step
    middle = (torque + charge * (flow_speed - speed + kick * load_torque)) / (
        1.0 + charge * (motor_leakage + kick)
    )
    return 2.0 * middle - torque, speed + 2.0 * kick * (middle - load_torque)


@equation
def line_rates(
    torque: float,
    speed: float,
    flow_speed: float,
    load_torque: float,
    line_stiffness: float,
    motor_leakage: float,
    load_inertia: float,
) -> tuple[float, float]:
    """Rates of the motor's torque and speed, of which `line_step` is the discrete form.

    Returns
    -------
    torque_rate, acceleration : float
        T' = k (Ω_0 - Ω - K_mL T) [N m/s], Ω' = (T - C_g)/J [rad/s²].
    """
    return (
        line_stiffness * (flow_speed - speed - motor_leakage * torque),
        (torque - load_torque) / load_inertia,
    )
