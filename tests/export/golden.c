/* Python's min: of two that are equal or do not compare, the first. */
static double lesser_of(double a, double b) { return b < a ? b : a; }

/* Python's max: of two that are equal or do not compare, the first. */
static double greater_of(double a, double b) { return b > a ? b : a; }

/* Rate of the stroking pressure under a force; it falls with the pressure. [Pa/s] */
static double pressure_gain(double pressure, double force, double Z9, double p_Z1, double p_Z2,
    double p_Z3, double p_Z4, double p_Z5, double p_Z6, double p_Z7, double p_Z8, double p_Z14,
    double p_Z16_plus, double p_Z16_minus, double p_Z18, bool options_symmetric)
{
    /* moment_sine: sin φ = Z5 F/√Z4: solenoid moment over the feedback spring's; must lie
     * within ±1. */
    const double a = force * (p_Z5 / sqrt(p_Z4));

    /* spool_balance: Spool displacement at which solenoid and feedback spring balance, before
     * any stop. [m] */
    const double t = a / sqrt(1.0 - a * a);
    const double w = 1.0 + t * t;

    /* arm_sine: sin α of the feedback arm, which follows the swash plate; must lie within ±1. */
    const double arm_sine = p_Z3 * p_Z1 * pressure - p_Z3 * p_Z2;

    /* spool_balance */
    const double product = arm_sine * arm_sine;
    const double spread = 1.0 - w * product;
    const double cos_arm = sqrt(1.0 - product);
    const double position = spread > 0.25 ? (p_Z5 * t - p_Z5 * w * arm_sine * cos_arm)
        * (1.0 / spread) + p_Z18 : p_Z5 * (t * cos_arm - arm_sine) / (cos_arm + t * arm_sine)
        + p_Z18;

    /* orifice_opening: Effective opening towards the stroking piston, of the spool before its
     * stop. [m] */
    const double opening = lesser_of(greater_of(position, -lesser_of(p_Z14, p_Z16_minus)),
        lesser_of(p_Z14, p_Z16_plus));

    /* flow_head: Pressure head over the valve, (Z9 - σ δP)/2 [Pa], and σ. */
    const double sign = opening < 0.0 ? -1.0 : 1.0;
    const double sign_2 = options_symmetric ? sign : 1.0;
    const double head = greater_of((Z9 - sign_2 * pressure) * 0.5, 0.0);

    /* head_root: √head. [√Pa] */
    const double head_root = sqrt(head);
    return (p_Z8 * head_root * opening - p_Z7 * pressure) / (1.0 + p_Z6);
}

/* Where pressure_gain is zero within a bracket; of one sign there, the end at which it is smaller.
 * Inverse quadratic interpolation where it is safe, bisection elsewhere (Chandrupatla 1997). */
static double root_of_pressure_gain(double low, double high, double force, double Z9, double p_Z1,
    double p_Z2, double p_Z3, double p_Z4, double p_Z5, double p_Z6, double p_Z7, double p_Z8,
    double p_Z14, double p_Z16_plus, double p_Z16_minus, double p_Z18, bool options_symmetric)
{
    double x_1 = high, x_2 = low, x_3, f_3;
    double f_1 = pressure_gain(high, force, Z9, p_Z1, p_Z2, p_Z3, p_Z4, p_Z5, p_Z6, p_Z7, p_Z8,
        p_Z14, p_Z16_plus, p_Z16_minus, p_Z18, options_symmetric);
    double f_2 = pressure_gain(low, force, Z9, p_Z1, p_Z2, p_Z3, p_Z4, p_Z5, p_Z6, p_Z7, p_Z8,
        p_Z14, p_Z16_plus, p_Z16_minus, p_Z18, options_symmetric);
    if (f_2 == 0.0) {
        return low;
    }
    if (f_1 == 0.0) {
        return high;
    }
    if ((f_1 > 0.0) == (f_2 > 0.0)) {
        return fabs(f_2) <= fabs(f_1) ? low : high;
    }
    double t = 0.5;
    double best = low;
    for (int steps = 0; steps < 128; steps++) {
        const double x = x_1 + t * (x_2 - x_1);
        const double f = pressure_gain(x, force, Z9, p_Z1, p_Z2, p_Z3, p_Z4, p_Z5, p_Z6, p_Z7, p_Z8,
            p_Z14, p_Z16_plus, p_Z16_minus, p_Z18, options_symmetric);
        if ((f > 0.0) == (f_1 > 0.0)) {
            x_3 = x_1;
            f_3 = f_1;
        } else {
            x_3 = x_2;
            f_3 = f_2;
            x_2 = x_1;
            f_2 = f_1;
        }
        x_1 = x;
        f_1 = f;
        best = fabs(f_1) < fabs(f_2) ? x_1 : x_2;
        const double smallest = fabs(f_1) < fabs(f_2) ? f_1 : f_2;
        const double reach = (4.4e-16 * fabs(best) + 1e-300) / fabs(x_2 - x_1);
        if (reach > 0.5 || smallest == 0.0) {
            break;
        }
        const double xi = (x_1 - x_2) / (x_3 - x_2);
        const double phi = (f_1 - f_2) / (f_3 - f_2);
        t = 0.5;
        if (phi * phi < xi && (1.0 - phi) * (1.0 - phi) < 1.0 - xi) {
            t = f_1 / (f_2 - f_1) * (f_3 / (f_2 - f_3));
            t += (x_3 - x_1) / (x_2 - x_1) * (f_1 / (f_3 - f_1)) * (f_2 / (f_3 - f_2));
        }
        t = lesser_of(greater_of(t, reach), 1.0 - reach);
    }
    return best;
}

/* Channel output: the filter's state `target` behind rate limits and the final decay. [A] */
static double limited_current(double target, double previous, double steady, double p_lim1,
    double p_lim2, double p_I_t1, double p_I_t2, double p_a, double h, bool split)
{
    const bool rising = target >= previous;
    double chosen;
    if (rising) {
        if (target <= p_I_t1) {
            chosen = target;
        } else {
            const double product = p_lim1 * h;
            chosen = (!split || previous >= p_I_t1)
                ? lesser_of(greater_of(previous, p_I_t1) + product, target)
                : lesser_of(p_I_t1 + product * (target - p_I_t1) / (target - previous), target);
        }
    } else {
        const bool above_I_t2 = previous > p_I_t2;
        if (above_I_t2) {
            const double fallen = greater_of(greater_of(previous - p_lim2 * h, 0.0), target);
            if (!split || fallen >= p_I_t2) {
                chosen = fallen;
            } else {
                const double decay = exp(-p_a * h);
                const double left = p_I_t2 * (decay
                    + (previous - p_I_t2) / (previous - fallen) * (1.0 - decay));
                chosen = steady == 0.0 ? left : greater_of(left, target);
            }
        } else {
            const double decay_2 = exp(-p_a * h);
            const double value = previous * decay_2;

            /* faded: A value, or zero if its size is below 1e-30, so that no subnormal number
             * slows a march. */
            const double faded = fabs(value) < 1e-30 ? 0.0 : value;

            /* limited_current */
            chosen = steady == 0.0 ? faded : greater_of(faded, target);
        }
    }
    return chosen;
}

/* Pressures at which the swash plate stops, and the same within ±Z15. [Pa] */
static void pressure_limits(double p_Z1, double p_Z2, double p_Z13_plus, double p_Z13_minus,
    double p_Z15, double *result_lower_stop, double *result_upper_stop, double *result_lower,
    double *result_upper)
{
    const double lower_stop = (p_Z2 - tan(p_Z13_minus)) / p_Z1;
    const double upper_stop = (p_Z2 + tan(p_Z13_plus)) / p_Z1;
    *result_lower_stop = lower_stop;
    *result_upper_stop = upper_stop;
    *result_lower = greater_of(-p_Z15, lower_stop);
    *result_upper = lesser_of(p_Z15, upper_stop);
}

/* Net force of both solenoids on the spool under a signed current. [N] */
static double solenoid_force(double current, double p_Z17, double p_Z19_plus, double p_Z19_minus,
    double p_Z20_plus, double p_Z20_minus, double p_Z21_plus, double p_Z21_minus, double p_Z22_plus,
    double p_Z22_minus)
{
    /* effective_current: Current beyond the symmetric dead zone, i_e = sign(i) max(|i| - Z17,
     * 0). [A] */
    const double effective_current = greater_of(current - p_Z17, 0.0)
        + lesser_of(current + p_Z17, 0.0);

    /* solenoid_force */
    const bool plus = effective_current >= 0.0;
    const double c1 = plus ? p_Z19_plus : p_Z19_minus;
    const double c2 = plus ? p_Z20_plus : p_Z20_minus;
    const double c3 = plus ? p_Z21_plus : p_Z21_minus;
    const double c4 = plus ? p_Z22_plus : p_Z22_minus;
    return effective_current * (c1 + effective_current
        * (c2 + effective_current * (c3 + effective_current * c4)));
}

/* δP that the pump settles at under a constant current. [Pa] */
static double settled_pressure(double inputs_current, double inputs_supply_pressure, double p_Z1,
    double p_Z2, double p_Z3, double p_Z4, double p_Z5, double p_Z6, double p_Z7, double p_Z8,
    double p_Z13_plus, double p_Z13_minus, double p_Z14, double p_Z15, double p_Z16_plus,
    double p_Z16_minus, double p_Z17, double p_Z18, double p_Z19_plus, double p_Z19_minus,
    double p_Z20_plus, double p_Z20_minus, double p_Z21_plus, double p_Z21_minus, double p_Z22_plus,
    double p_Z22_minus, bool options_symmetric, bool options_leaky)
{
    /* pressure_limits: Pressures at which the swash plate stops, and the same within ±Z15. [Pa] */
    const double lower_stop = (p_Z2 - tan(p_Z13_minus)) / p_Z1;
    const double limits_lower = greater_of(-p_Z15, lower_stop);
    const double upper_stop = (p_Z2 + tan(p_Z13_plus)) / p_Z1;
    const double limits_upper = lesser_of(p_Z15, upper_stop);

    /* effective_current: Current beyond the symmetric dead zone, i_e = sign(i) max(|i| - Z17,
     * 0). [A] */
    const double effective_current = greater_of(inputs_current - p_Z17, 0.0)
        + lesser_of(inputs_current + p_Z17, 0.0);

    /* solenoid_force: Net force of both solenoids on the spool under a signed current. [N] */
    const bool plus = effective_current >= 0.0;
    const double c1 = plus ? p_Z19_plus : p_Z19_minus;
    const double c2 = plus ? p_Z20_plus : p_Z20_minus;
    const double c3 = plus ? p_Z21_plus : p_Z21_minus;
    const double c4 = plus ? p_Z22_plus : p_Z22_minus;
    const double force = effective_current * (c1 + effective_current
        * (c2 + effective_current * (c3 + effective_current * c4)));

    /* settled_pressure */
    double chosen;
    if (options_leaky) {
        const double root = root_of_pressure_gain(limits_lower, limits_upper, force,
            inputs_supply_pressure, p_Z1, p_Z2, p_Z3, p_Z4, p_Z5, p_Z6, p_Z7, p_Z8, p_Z14,
            p_Z16_plus, p_Z16_minus, p_Z18, options_symmetric);

        /* searched_pressure: δP at which the flow through the spool is what leaks, whatever the
         * equations are. [Pa] */
        chosen = root;
    } else {
        /* closed_pressure: δP at which the spool closes, held within the limits. */
        const double a = lesser_of(greater_of(force * (p_Z5 / sqrt(p_Z4)), -1.0), 1.0);
        const double angle = lesser_of(greater_of(asin(a) + atan(p_Z18 / p_Z5),
            -1.5707963267948966), 1.5707963267948966);
        const double closed = (sin(angle) / p_Z3 + p_Z2) / p_Z1;
        const double closed_2 = lesser_of(greater_of(closed, limits_lower), limits_upper);

        /* flow_head: Pressure head over the valve, (Z9 - σ δP)/2 [Pa], and σ. */
        const double sign = closed_2 < 0.0 ? -1.0 : 1.0;
        const double sign_2 = options_symmetric ? sign : 1.0;
        const double head = greater_of((inputs_supply_pressure - sign_2 * closed_2) * 0.5, 0.0);

        /* leaked_pressure: What leakage takes from the pressure at which the spool closes. [Pa] */
        double chosen_2;
        if (!(limits_lower < closed_2 && closed_2 < limits_upper) || head <= 0.0) {
            chosen_2 = 0.0;
        } else {
            /* arm_sine: sin α of the feedback arm, which follows the swash plate; must lie
             * within ±1. */
            const double s = p_Z3 * p_Z1 * closed_2 - p_Z3 * p_Z2;

            /* leaked_pressure */
            const double stiffness = p_Z1 * p_Z3 * (p_Z5 * p_Z5 + p_Z18 * p_Z18)
                / (p_Z5 * sqrt(1.0 - s * s));
            chosen_2 = p_Z7 * closed_2 / (p_Z8 * sqrt(head) * stiffness);
        }
        chosen = closed_2 - chosen_2; /* settled_pressure */
    }
    return chosen;
}
