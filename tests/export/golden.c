/* Python's min: of two that are equal or do not compare, the first. */
static double lesser_of(double a, double b) { return b < a ? b : a; }


/* Python's max: of two that are equal or do not compare, the first. */
static double greater_of(double a, double b) { return b > a ? b : a; }


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
        return lesser_of(p->I_t1 + p->lim1 * h * (target - p->I_t1) / (target - previous), target);
    }
    double left;
    if (previous > p->I_t2) {
        const double fallen = greater_of(greater_of(previous - p->lim2 * h, 0.0), target);
        if (!split || fallen >= p->I_t2) {
            return fallen;
        }
        left = p->I_t2 * (decay + (previous - p->I_t2) / (previous - fallen) * (1.0 - decay));
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
