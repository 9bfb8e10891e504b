/* Python's min: of two that are equal or do not compare, the first. */
static double lesser_of(double a, double b) { return b < a ? b : a; }


/* Python's max: of two that are equal or do not compare, the first. */
static double greater_of(double a, double b) { return b > a ? b : a; }


/* Parameters of one channel. */
struct swp_channel {
    double V_dz; /* dead zone of the card [V] */
    double J; /* current jump at the edge of the dead zone [A] */
    double G1; /* linear gain [A/V] */
    double G2; /* quadratic gain [A/V^2] */
    double G3; /* cubic gain [A/V^3] */
    double zeta; /* damping ratio of the current filter [1] */
    double omega; /* natural frequency of the current filter [rad/s] */
    double C; /* Coulomb-like term of the current filter [A/s^2] */
    double lim1; /* rate limit away from zero [A/s] */
    double lim2; /* rate limit towards zero [A/s] */
    double I_t1; /* current above which lim1 acts [A] */
    double I_t2; /* current below which the decay acts [A] */
    double a; /* rate of the final decay [1/s] */
};

struct swp_double_4 {
    double v[4];
};

/* Parameters of pump and motor, then those of the refinements, then the prime mover's. */
struct swp_pump {
    double Z1; /* pressure to swash plate tangent [1/Pa] */
    double Z2; /* offset of the swash plate tangent [1] */
    double Z3; /* arm ratio of the feedback [1] */
    double Z4; /* squared moment of the feedback spring [N^2 m^2] */
    double Z5; /* arm of the spool [m] */
    double Z6; /* piston motion against oil stiffness [1] */
    double Z7; /* leakage around the stroking piston [1/s] */
    double Z8; /* flow gain of the valve [sqrt(Pa)/(m s)] */
    double Z9; /* supply pressure less static pressure [Pa] */
    double Z10; /* swash plate angle to shaft speed [1/s] */
    double Z11; /* speed lost to static load [rad/s] */
    double Z12; /* speed lost to accelerating load [1] */
    double Z13_plus; /* stop of the swash plate [rad] */
    double Z13_minus;
    double Z14; /* stroke of the spool [m] */
    double Z15; /* largest stroking pressure [Pa] */
    double Z16_plus; /* opening at which the orifice limits the flow [m] */
    double Z16_minus;
    double Z17; /* dead zone of the solenoids [A] */
    double Z18; /* plussing: spool displacement at rest [m] */
    double Z19_plus; /* solenoid force, linear [N/A] */
    double Z19_minus;
    double Z20_plus; /* solenoid force, quadratic [N/A^2] */
    double Z20_minus;
    double Z21_plus; /* solenoid force, cubic [N/A^3] */
    double Z21_minus;
    double Z22_plus; /* solenoid force, quartic [N/A^4] */
    double Z22_minus;
    double spool_friction; /* friction of spool and solenoid [N] */
    double spool_presliding; /* travel over which that friction builds up [m] */
    double dither_time; /* time constant with which dither frees the spool [s] */
    double solenoid_hysteresis; /* half-width of the solenoids' hysteresis [A] */
    double load_torque; /* static torque of the load at the shaft [N m] */
    double load_inertia; /* inertia of motor and load at the shaft [kg m^2] */
    double motor_leakage; /* speed lost to leakage for a torque [rad/(s N m)] */
    double cam_ripple; /* variation of the motor's displacement without load [1] */
    double cam_ripple_per_torque; /* growth of that variation with the load [1/(N m)] */
    double cam_cycles; /* cycles of the cam ring in a turn [1] */
    double cam_phase; /* phase of the cam ring at the start [rad] */
    double swash_damping; /* time constant of the swash plate's damping [s] */
    double line_stiffness; /* stiffness of the line's oil at the shaft [N m/rad] */
    double motor_constant; /* motor speed for a flow [rad/m^3] */
    double pump_speed; /* speed of the prime mover, relative to that of Z10 [1] */
};

/* Parameters of the solenoids, those of `Pump` by the same names. */
struct swp_solenoids {
    double Z17;
    double Z19_plus;
    double Z19_minus;
    double Z20_plus;
    double Z20_minus;
    double Z21_plus;
    double Z21_minus;
    double Z22_plus;
    double Z22_minus;
};

static const double FADED = 1e-30;

/* Output after a step in which it passes I_t1 on the way to `target` and then rises by lim1.
 *
 * The way to I_t1 counts as straight, as steep as from `previous` to `target` in one step. [A]
 */
static double taken_over(double target, double previous, double I_t1, double lim1, double h)
{
    return I_t1 + lim1 * h * (target - I_t1) / (target - previous);
}

/* What the rest of a step leaves of I_t2, where the output passes it on the way to `fallen`.
 *
 * Both the way there and the decay count as straight within the step. [1]
 */
static double remaining_decay(double previous, double fallen, double I_t2, double decay)
{
    return decay + (previous - I_t2) / (previous - fallen) * (1.0 - decay);
}

/* A value, or zero where it has faded below 1e-30; the derivatives take no notice. */
static double faded(double value)
{
    return fabs(value) < FADED ? 0.0 : value;
}

/* Channel output: the filter's state `target` behind rate limits and the final decay. [A]
 *
 * Kruse eqs. 3.8 and 3.9 as a limiter of position, because the printed rate form does not keep the
 * steady level. `previous` is the output one sample earlier; I_ss = 0 means that the command has
 * gone; `decay` is exp(-a h). Without `split` lim1 takes over from the filter, and the decay from
 * lim2, at a step's end; with it where the output passes I_t1 or I_t2: then it follows both
 * thresholds, and anything before them, without flat stretches or jumps.
 */
static double limited_current(double target, double previous, double steady,
    const struct swp_channel *p, double decay, double h, bool split)
{
    if (target >= previous) {
        if (target <= p->I_t1) {
            return target;
        }
        if (!split || previous >= p->I_t1) {
            return lesser_of(greater_of(previous, p->I_t1) + p->lim1 * h, target);
        }
        return lesser_of(taken_over(target, previous, p->I_t1, p->lim1, h), target);
    }
    double left;
    if (previous > p->I_t2) {
        const double fallen = greater_of(greater_of(previous - p->lim2 * h, 0.0), target);
        if (!split || fallen >= p->I_t2) {
            return fallen;
        }
        left = p->I_t2 * remaining_decay(previous, fallen, p->I_t2, decay);
        return steady == 0.0 ? left : greater_of(left, target);
    }
    left = faded(previous * decay);
    return steady == 0.0 ? left : greater_of(left, target);
}

/* Pressures at which the swash plate stops, and the same within ±Z15. [Pa]
 *
 * The stops are (∓tan Z13 + Z2)/Z1. δP never leaves the other two, so nothing winds up at a stop.
 */
static struct swp_double_4 pressure_limits(const struct swp_pump *p)
{
    const double lower_stop = (p->Z2 - tan(p->Z13_minus)) / p->Z1;
    const double upper_stop = (p->Z2 + tan(p->Z13_plus)) / p->Z1;
    return (struct swp_double_4){{lower_stop, upper_stop, greater_of(-p->Z15, lower_stop),
        lesser_of(p->Z15, upper_stop)}};
}

/* Current beyond the symmetric dead zone, i_e = sign(i) max(|i| - Z17, 0). [A] */
static double effective_current(double current, double Z17)
{
    return greater_of(current - Z17, 0.0) + lesser_of(current + Z17, 0.0);
}

/* Net force of both solenoids on the spool under a signed current. [N]
 *
 * F = Z19 i_e + Z20 i_e² + Z21 i_e³ + Z22 i_e⁴, positive towards more speed; Kruse eq. 6.61 on the
 * *signed* i_e: even powers keep their own sign (erratum 1).
 */
static double solenoid_force(double current, const struct swp_solenoids *p)
{
    const double e = effective_current(current, p->Z17);
    const bool plus = e >= 0.0;
    const double c1 = plus ? p->Z19_plus : p->Z19_minus;
    const double c2 = plus ? p->Z20_plus : p->Z20_minus;
    const double c3 = plus ? p->Z21_plus : p->Z21_minus;
    const double c4 = plus ? p->Z22_plus : p->Z22_minus;
    return e * (c1 + e * (c2 + e * (c3 + e * c4)));
}
