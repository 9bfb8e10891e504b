"""What goes beyond Kruse's equations: friction, hysteresis, lateness, ripple, damping, line.

Each is off unless its option is on (`PumpOptions` of `swashplate.models.displacement_control`).
docs/refinements.md says what each explains.

Friction of solenoid and spool (Kruse 2001, section 7.6). The friction f holds the spool back
against its feedback spring: it stands d = f/k short of the place at which solenoid and spring
balance. It builds up over a short travel of the spool, slides at F_s, and fades with the time
constant T of the dither, which shakes the spool free:

    f' = (F_s/x_s) x' - f/T,  |f| ≤ F_s.

What moves the spool moves it against the friction; a spool that comes to rest is left where
friction holds it, and goes on to its balance as the dither lets go.

Lateness of the solenoids: the current i acts on the spool after a delay T_d and a lag T_l,

    T_l i_l'(t) = i(t - T_d) - i_l(t).

Solenoid and pilot stage are late, wires and sampling drives too; the ammeter sees nothing of it.

Hysteresis of the solenoids: the force lags behind the current, however slowly it moves.

Ripple of the motor's cam ring: displacement that varies with the shaft's angle. Kruse saw 5.5
cycles a turn of the drum, the larger the heavier the load (sections 1.2 and 9, figures 9.2, 9.3):
the displacement varies by ε = ε0 + ε1 |C_g|.

Damping of the swash plate: it turns towards its equilibrium instead of standing there. With a
damping moment c α' in eq. 6.55 and T = c/(k_r d4²),

    T (tan α_sw)' = (Z1 δP - Z2) - tan α_sw.

The plate's place is written as the pressure p at which it would stand still, tan α_sw = Z1 p - Z2:
T p' = δP - p. Whatever the plate has yet to turn has not yet taken its oil: δP + Z6 p is the oil in
the cylinder, which the plate's motion does not change.

Leakage of the motor under load: Z11 = K_mL C_g and Z12 = K_mL C_i Z10 (eq. 6.70).

Line between pump and motor: oil that is compressed and an inertia that has to be turned,

    T' = k (Ω_0 - Ω - K_mL T),  J Ω' = T - C_g.

T is the motor's torque, P_hi - P_lo = K_mf T (eq. 6.41); Ω_0 the speed that the pump's flow would
give a stiff line; k = B/(K_mf² V) its stiffness felt at the shaft. Kruse (2001) takes the line as
stiff (k → ∞), which leaves Ω = Ω_0 - K_mL (C_g + J Ω').
"""

from math import exp, inf, sin, sqrt

from swashplate.machine import declared, equation
from swashplate.models.displacement_control import Pump


@equation
def friction_width(spool_friction: float, Z4: float, Z5: float) -> float:
    """Distance w = F_s/k from its balance by which friction can hold the spool. [m]

    k = √Z4/Z5² is the feedback spring's stiffness at the spool, of small motion (eq. 6.72).
    """
    return spool_friction / (sqrt(Z4) / (Z5 * Z5))


@equation
def dither_factor(dither_time: float, h: float) -> float:
    """What dither leaves of the spool's deflection after one step, exp(-h/T). [1]"""
    return exp(-h / dither_time)


@equation
def held_back(
    deflection: float, balance: float, before: float, width: float, presliding: float, factor: float
) -> float:
    """Distance d by which friction holds the spool back from its balance, one step later. [m]

    `deflection` is d one step before, positive where the balance lies further towards more speed;
    `before` is where the spool stood then. [m] d = clip((x_s d e^(-h/T) + w (balance - before))/
    (x_s + w), ±w) is the implicit step of f' = (F_s/x_s) x' - f/T, |f| ≤ F_s; x_s = 0 holds the
    spool fast. The friction's work on the spool is never less than what its travel stores, k x_s
    d²/(2 w): over a closed path it takes energy.
    """
    dragged = presliding * (deflection * factor) + width * (balance - before)
    unlimited = dragged / (presliding + width)
    return min(max(unlimited, -width), width)


@equation
def left_of_lag(solenoid_lag: float, h: float) -> float:
    """What a lag leaves of a difference after one step, e^(-h/T_l). [1]"""
    return exp(-h / solenoid_lag) if solenoid_lag > 0.0 else 0.0


@declared(left_of_lag)
def _left_of_lag(solenoid_lag: float, h: float) -> tuple[float, float]:
    if solenoid_lag > 0.0:
        left = exp(-h / solenoid_lag)
        return left * h / (solenoid_lag * solenoid_lag), -left / solenoid_lag
    return 0.0, 0.0


@equation
def mean_of_lag(solenoid_lag: float, h: float) -> float:
    """Mean over one step of what a lag leaves of a difference, (1 - e^(-h/T_l)) T_l/h. [1]"""
    steps = h / solenoid_lag if solenoid_lag > 0.0 else inf
    if steps > 0.0:
        return (1.0 - exp(-steps)) / steps
    return 1.0


@declared(mean_of_lag)
def _mean_of_lag(solenoid_lag: float, h: float) -> tuple[float, float]:
    # without a lag it grows with it by 1/h
    if h <= 0.0:
        return 0.0, 0.0
    if solenoid_lag <= 0.0:
        return 1.0 / h, 0.0
    left = exp(-h / solenoid_lag)
    mean = (1.0 - left) * solenoid_lag / h
    return (mean - left) / solenoid_lag, (left - mean) / h


@equation
def lagged_current(
    current: float, lagged: float, before: float, solenoid_lag: float, h: float
) -> float:
    """Current i_l that acts on the spool one step later. [A]

    Exact for a delayed current that goes straight from `before` to `current` over the step:
    i_l = e i_l + (m - e) before + (1 - m) current with e and m of `left_of_lag`, `mean_of_lag`.
    """
    left = left_of_lag(solenoid_lag, h)
    mean = mean_of_lag(solenoid_lag, h)
    return left * lagged + (mean - left) * before + (1.0 - mean) * current


@equation
def lagged_current_rate(current: float, lagged: float, solenoid_lag: float) -> float:
    """Rate of the current that acts on the spool, (i(t - T_d) - i_l)/T_l; 0 without a lag. [A/s]"""
    return (current - lagged) / solenoid_lag if solenoid_lag > 0.0 else 0.0


@equation
def magnetising_current(current: float, previous: float, solenoid_hysteresis: float) -> float:
    """Current that the solenoids' force belongs to, of the loop's half-width r. [A]

    i_m = min(max(i_m, i - r), i + r), the play operator: i - r while the current rises, i + r while
    it falls, unchanged for 2r behind a turn, whatever the rate. Whenever i_m moves it lies r behind
    the current, so that i Δi_m = i_m Δi_m + r |Δi_m|: a closed loop takes up energy, never gives
    it.
    """
    return min(max(previous, current - solenoid_hysteresis), current + solenoid_hysteresis)


@equation
def rippled_angle(
    swash_angle: float, shaft_angle: float, depth: float, cam_cycles: float, cam_phase: float
) -> float:
    """Swash plate angle that would give a motor without ripple the same speed. [rad]

    α_sw/(1 + ε sin(n θ + ψ)) at the angle θ of the shaft since the start. The motor's displacement
    is D (1 + ε sin(n θ + ψ)). Speed times displacement is the flow, so that the oil of n whole
    cycles, and with it the mean speed of a turn, is that without ripple; torque goes with the
    displacement, and no energy is made.
    """
    return swash_angle / (1.0 + depth * sin(cam_cycles * shaft_angle + cam_phase))


@equation
def damping_factor(swash_damping: float, Z6: float, h: float) -> float:
    """What is left of δP - p after one step without flow, exp(-h (1 + Z6)/T), T above 0. [1]"""
    return exp(-h * (1.0 + Z6) / swash_damping) if swash_damping > 0.0 else 0.0


@equation
def plate_follows(
    pressure: float, plate_pressure: float, Z6: float, factor: float
) -> tuple[float, float]:
    """Pressures δP and p of the plate one step later, without flow. [Pa]

    δP + Z6 p stays as before, δP - p is smaller by the factor. The energy of oil and spring,
    δP² + Z6 p² but for a factor, falls: the damper takes it.
    """
    motion = (pressure - plate_pressure) * (1.0 - factor) / (1.0 + Z6)
    return pressure - Z6 * motion, plate_pressure + motion


@equation
def plate_pressure_rate(pressure: float, plate_pressure: float, swash_damping: float) -> float:
    """Rate of the plate's pressure, p' = (δP - p)/T. [Pa/s]"""
    return (pressure - plate_pressure) / swash_damping


@equation
def load_leakage(tangent: float, swash_rate: float, Z12: float) -> float:
    """Speed lost to leakage while the load accelerates. [rad/s]

    Z12 cos α_sw dα_sw/dt, the form that Kruse's own derivation gives in place of the printed
    one (erratum 22).
    """
    return Z12 * (swash_rate / sqrt(1.0 + tangent * tangent))


@equation
def unloaded_leakage(tangent: float, swash_rate: float, Z12: float) -> float:
    """`load_leakage` at Z12 = 0: none, and there for the derivative by Z12. [rad/s]"""
    return 0.0


@declared(unloaded_leakage)
def _unloaded_leakage(tangent: float, swash_rate: float, Z12: float) -> tuple[float, float, float]:
    return 0.0, 0.0, swash_rate / sqrt(1.0 + tangent * tangent)


@equation
def stiff_line_torque(
    tangent: float, swash_rate: float, load_torque: float, load_inertia: float, Z10: float
) -> float:
    """Torque C_g + C_i Z10 cos α dα/dt that the motor bears where the line is stiff. [N m]

    Kruse eqs. 6.42 and 6.45; `swash_rate` is zero at a stop.
    """
    return load_inertia * load_leakage(tangent, swash_rate, Z10) + load_torque


@equation
def motor_pressure_drop(torque: float, motor_constant: float) -> float:
    """P_hi - P_lo = K_mf τ, from the work done by the motor; Kruse eq. 6.41. [Pa]"""
    return motor_constant * torque


@equation
def line_step(
    torque: float, speed: float, flow_speed: float, load_torque: float, p: Pump, h: float
) -> tuple[float, float]:
    """Torque [N m] and speed [rad/s] of the motor one step later, by the implicit midpoint rule.

    `flow_speed` Ω_0 and `load_torque` C_g are means of the step; J is above 0. The rule keeps
    T²/(2k) + J Ω²/2 but for rounding where neither flow nor load nor leakage acts, and with leakage
    lowers it by h K_mL T² at the middle of the step: stable at any step. It is accurate while
    h √(k/J) is well below 1: at 512 samples a second, up to some 20 Hz.
    """
    half = 0.5 * h  # Half of a step. [s]
    # exported C computes this without a line, too, and then without an inertia
    kick = half / p.load_inertia if p.load_inertia > 0.0 else inf  # Speed for a torque. [1/(N m s)]
    charge = half * p.line_stiffness  # Torque for a speed that lasts half a step. [N m s/rad]
    # both unknowns at the middle of the step
    middle = (torque + charge * (flow_speed - speed + kick * load_torque)) / (
        1.0 + charge * (p.motor_leakage + kick)
    )
    return 2.0 * middle - torque, speed + 2.0 * kick * (middle - load_torque)


@equation
def line_rates(
    torque: float, speed: float, flow_speed: float, load_torque: float, p: Pump
) -> tuple[float, float]:
    """Rates of the motor's torque and speed, of which `line_step` is the discrete form.

    T' = k (Ω_0 - Ω - K_mL T) [N m/s], Ω' = (T - C_g)/J [rad/s²].
    """
    return (
        p.line_stiffness * (flow_speed - speed - p.motor_leakage * torque),
        (torque - load_torque) / p.load_inertia,
    )
