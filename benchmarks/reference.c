/* The drive as one would write it in plain C from the printed equations: what the bench compares with.
 *
 * Numbers in brackets are equations of E. E. Kruse, Nonlinear Modeling and Simulation of a
 * Hydrostatic Drive System (2001). SI units. Minus values are magnitudes. Shared object for
 * reference.py, which lists the same structures:
 *
 *     cc -O3 -march=native -shared -fPIC reference.c -lm
 */

#include <math.h>
#include <stdlib.h>

enum { PLUS, MINUS }; /* index of a parameter that depends on the direction */

struct parameters {
    double Z1, Z2, Z3, Z4, Z5, Z6, Z8, Z9, Z10, Z11;
    double Z13[2], Z14, Z15, Z16[2], Z17, Z18, Z19[2], Z20[2], Z21[2], Z22[2];
};

struct channel {
    double V_dz, J, G1, G2, G3, zeta, omega, C, lim1, lim2, I_t1, I_t2, a;
};

struct card {
    double tau;
    struct channel channel[2];
};

static inline double clamp(double value, double low, double high)
{
    return value < low ? low : value > high ? high : value;
}

/* ---- pump and motor: signed current to shaft speed ------------------------------------------- */

/* Net force of the solenoids [6.61], on the signed current beyond the dead zone. */
static double solenoid_force(const struct parameters *p, double current)
{
    int side = current > 0.0 ? PLUS : MINUS;
    double i = fabs(current) - p->Z17;

    if (i <= 0.0)
        return 0.0;
    if (side == MINUS)
        i = -i;
    return i * (p->Z19[side] + i * (p->Z20[side] + i * (p->Z21[side] + i * p->Z22[side])));
}

/* Opening of the valve from force and swash plate angle [6.59, 6.57, 6.36, 6.71]. */
static double valve_opening(const struct parameters *p, double force, double swash_angle)
{
    double alpha = asin(p->Z3 * tan(swash_angle));
    double sine = sin(alpha), cosine = cos(alpha);
    double moment = p->Z5 * p->Z5 * force;
    double squared = moment * force;
    double x = (-p->Z5 * p->Z4 * sine * cosine + moment * sqrt(p->Z4 - squared))
               / (p->Z4 * cosine * cosine - squared) + p->Z18;

    x = clamp(x, -p->Z14, p->Z14);
    return clamp(x, -p->Z16[MINUS], p->Z16[PLUS]);
}

/* Rate of the stroking pressure [6.67] for the gain Z8 x / (1 + Z6). */
static inline double pressure_rate(const struct parameters *p, double gain, double pressure)
{
    return gain * sqrt(0.5 * (p->Z9 - pressure));
}

/* Shaft speed at each of n samples of the current, h apart, from rest.
 *
 * Classical Runge-Kutta on the pressure, the opening held over the step. Z7 and Z12, zero in every
 * published set, are left out. */
void reference_speed(const struct parameters *p, const double *current, long n, double h,
                     double *speed)
{
    double upper_stop = (tan(p->Z13[PLUS]) + p->Z2) / p->Z1;
    double lower_stop = (-tan(p->Z13[MINUS]) + p->Z2) / p->Z1;
    double upper = fmin(upper_stop, p->Z15), lower = fmax(lower_stop, -p->Z15);
    double pressure = p->Z2 / p->Z1;

    for (long k = 0; k < n; k++) {
        double angle = atan(p->Z1 * pressure - p->Z2); /* [6.55] */
        angle = clamp(angle, -p->Z13[MINUS], p->Z13[PLUS]);
        speed[k] = p->Z10 * angle - p->Z11; /* [6.69] */

        double opening = valve_opening(p, solenoid_force(p, current[k]), angle);
        int stopped = pressure >= upper_stop || pressure <= lower_stop;
        double gain = p->Z8 * opening / (stopped ? 1.0 : 1.0 + p->Z6); /* [6.68] */

        double k1 = pressure_rate(p, gain, pressure);
        double k2 = pressure_rate(p, gain, pressure + 0.5 * h * k1);
        double k3 = pressure_rate(p, gain, pressure + 0.5 * h * k2);
        double k4 = pressure_rate(p, gain, pressure + h * k3);
        pressure += h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4);
        pressure = clamp(pressure, lower, upper); /* the relief valve */
    }
}

/* ---- control card: voltage to signed current ------------------------------------------------- */

/* Command at a sample, zero before the record. */
static inline double sample(const double *voltage, long k)
{
    return k < 0 ? 0.0 : voltage[k];
}

/* Share of a straight line from a to b that lies above zero. */
static double share_above(double a, double b)
{
    if (a > 0.0 && b > 0.0)
        return 1.0;
    if (a <= 0.0 && b <= 0.0)
        return 0.0;
    return fmax(a, b) / fabs(a - b);
}

/* Current magnitude of one channel at each sample; `sign` is +1 or -1, the channel's direction. */
static void channel_current(const struct channel *c, double tau, double sign,
                            const double *voltage, long n, double h, double *current)
{
    double delay = tau / h, share_delay = fmax(delay, 0.5) - 0.5;
    long whole = (long)floor(delay), share_whole = (long)floor(share_delay);
    double fraction = delay - whole, share_fraction = share_delay - share_whole;
    double decay = exp(-c->a * h), w = c->omega * h;
    double state = 0.0, previous = 0.0, output = 0.0;

    for (long k = 0; k < n; k++) {
        /* delayed command [3.4], and the three samples around the interval of the jump */
        double newer = sample(voltage, k - whole), older = sample(voltage, k - whole - 1);
        double v = sign * (newer + fraction * (older - newer));
        double newest = sign * sample(voltage, k - share_whole) - c->V_dz;
        double middle = sign * sample(voltage, k - share_whole - 1) - c->V_dz;
        double oldest = sign * sample(voltage, k - share_whole - 2) - c->V_dz;
        double first = middle + share_fraction * (oldest - middle);
        double last = newest + share_fraction * (middle - newest);
        double share = share_fraction * share_above(first, middle)
                       + (1.0 - share_fraction) * share_above(middle, last);

        double d = fmax(v - c->V_dz, 0.0); /* [3.3] */
        double steady = c->J * share + d * (c->G1 + d * (c->G2 + d * c->G3));

        if (state >= output) { /* rate limits and decay [3.8, 3.9] */
            if (state > c->I_t1)
                output = fmin(state, fmax(output, c->I_t1) + c->lim1 * h);
            else
                output = state;
        } else if (output > c->I_t2) {
            output = fmax(fmax(state, output - c->lim2 * h), 0.0);
        } else {
            output = steady == 0.0 ? output * decay : fmax(state, output * decay);
        }
        current[k] = output;

        double direction = clamp((state - previous) / (0.01 * h), -1.0, 1.0); /* [3.6] */
        double next = 2.0 * (1.0 - c->zeta * w) * state
                      + (2.0 * c->zeta * w - w * w - 1.0) * previous
                      - c->C * h * h * direction + w * w * steady;
        previous = state;
        state = next;
    }
}

/* Signed current at each of n samples of the voltage, h apart, from rest. Returns 0, or -1 for lack
 * of memory. */
int reference_current(const struct card *card, const double *voltage, long n, double h,
                      double *current)
{
    double *negative = malloc(n * sizeof *negative);

    if (!negative)
        return -1;
    channel_current(&card->channel[PLUS], card->tau, 1.0, voltage, n, h, current);
    channel_current(&card->channel[MINUS], card->tau, -1.0, voltage, n, h, negative);
    for (long k = 0; k < n; k++)
        current[k] -= negative[k];
    free(negative);
    return 0;
}
