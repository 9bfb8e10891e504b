/* A hydrostatic drive from joystick voltage to shaft speed, made by swashplate.
 *
 * SI throughout. Plain data: no pointers, so that memcpy of a swp_drive is a copy of the state,
 * and two of them never meet. No allocation, no globals, no input or output.
 */
#ifndef SWASHPLATE_DRIVE_H
#define SWASHPLATE_DRIVE_H

#include <stdbool.h>
#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

#ifndef SWP_LINE
#define SWP_LINE 1024 /* samples of the delay line: the longest delay is SWP_LINE - 4 steps */
#endif

typedef struct swp_drive swp_drive;

/* What a call may return. */
enum {
    SWP_OK = 0,
    SWP_BAD_VALUE = 1, /* not a number, or out of range: nothing has changed */
    SWP_UNSTABLE = 2,  /* the card's filter is unstable at this step */
    SWP_BAD_DELAY = 3, /* the delay is longer than the line */
    SWP_DOMAIN = 4     /* the solenoid overpowers the feedback spring, or a number overflowed */
};

/* Outputs, for swp_output. */
enum {
    SWP_current_positive = 0,
    SWP_current_negative = 1,
    SWP_current = 2,
    SWP_solenoid_force = 3,
    SWP_spool_position = 4,
    SWP_orifice_opening = 5,
    SWP_stroker_pressure = 6,
    SWP_swash_angle = 7,
    SWP_shaft_speed = 8,
    SWP_shaft_position = 9,
    SWP_motor_torque = 10,
    SWP_motor_pressure_drop = 11,
    SWP_OUTPUTS = 12
};

/* Limits that can act: bits of swp_limits. */
enum {
    SWP_LIMIT_current_rate = 1,
    SWP_LIMIT_dead_zone = 2,
    SWP_LIMIT_orifice = 4,
    SWP_LIMIT_spool = 8,
    SWP_LIMIT_swash_stop = 16,
    SWP_LIMIT_relief = 32
};

/* Inputs beside the voltage, for swp_set_input; while none is set a parameter counts. */
enum {
    SWP_INPUT_pump_speed = 0,
    SWP_INPUT_load_torque = 1,
    SWP_INPUT_supply_pressure = 2,
    SWP_INPUTS = 3
};

/* Options, for swp_set_option; terms of the pump come on with their parameters. */
enum {
    SWP_OPTION_literal = 0,
    SWP_OPTION_split = 1,
    SWP_OPTION_exact = 2,
    SWP_OPTION_symmetric = 3,
    SWP_OPTIONS = 4
};

/* Parameters, for swp_set and swp_get. */
enum {
    SWP_PARAMETER_V_dz_plus = 0,
    SWP_PARAMETER_J_plus = 1,
    SWP_PARAMETER_G1_plus = 2,
    SWP_PARAMETER_G2_plus = 3,
    SWP_PARAMETER_G3_plus = 4,
    SWP_PARAMETER_zeta_plus = 5,
    SWP_PARAMETER_omega_plus = 6,
    SWP_PARAMETER_C_plus = 7,
    SWP_PARAMETER_lim1_plus = 8,
    SWP_PARAMETER_lim2_plus = 9,
    SWP_PARAMETER_I_t1_plus = 10,
    SWP_PARAMETER_I_t2_plus = 11,
    SWP_PARAMETER_a_plus = 12,
    SWP_PARAMETER_V_dz_minus = 13,
    SWP_PARAMETER_J_minus = 14,
    SWP_PARAMETER_G1_minus = 15,
    SWP_PARAMETER_G2_minus = 16,
    SWP_PARAMETER_G3_minus = 17,
    SWP_PARAMETER_zeta_minus = 18,
    SWP_PARAMETER_omega_minus = 19,
    SWP_PARAMETER_C_minus = 20,
    SWP_PARAMETER_lim1_minus = 21,
    SWP_PARAMETER_lim2_minus = 22,
    SWP_PARAMETER_I_t1_minus = 23,
    SWP_PARAMETER_I_t2_minus = 24,
    SWP_PARAMETER_a_minus = 25,
    SWP_PARAMETER_tau = 26,
    SWP_PARAMETER_Z1 = 27,
    SWP_PARAMETER_Z2 = 28,
    SWP_PARAMETER_Z3 = 29,
    SWP_PARAMETER_Z4 = 30,
    SWP_PARAMETER_Z5 = 31,
    SWP_PARAMETER_Z6 = 32,
    SWP_PARAMETER_Z7 = 33,
    SWP_PARAMETER_Z8 = 34,
    SWP_PARAMETER_Z9 = 35,
    SWP_PARAMETER_Z10 = 36,
    SWP_PARAMETER_Z11 = 37,
    SWP_PARAMETER_Z12 = 38,
    SWP_PARAMETER_Z13_plus = 39,
    SWP_PARAMETER_Z13_minus = 40,
    SWP_PARAMETER_Z14 = 41,
    SWP_PARAMETER_Z15 = 42,
    SWP_PARAMETER_Z16_plus = 43,
    SWP_PARAMETER_Z16_minus = 44,
    SWP_PARAMETER_Z17 = 45,
    SWP_PARAMETER_Z18 = 46,
    SWP_PARAMETER_Z19_plus = 47,
    SWP_PARAMETER_Z19_minus = 48,
    SWP_PARAMETER_Z20_plus = 49,
    SWP_PARAMETER_Z20_minus = 50,
    SWP_PARAMETER_Z21_plus = 51,
    SWP_PARAMETER_Z21_minus = 52,
    SWP_PARAMETER_Z22_plus = 53,
    SWP_PARAMETER_Z22_minus = 54,
    SWP_PARAMETER_spool_friction = 55,
    SWP_PARAMETER_spool_presliding = 56,
    SWP_PARAMETER_dither_time = 57,
    SWP_PARAMETER_solenoid_hysteresis = 58,
    SWP_PARAMETER_load_torque = 59,
    SWP_PARAMETER_load_inertia = 60,
    SWP_PARAMETER_motor_leakage = 61,
    SWP_PARAMETER_cam_ripple = 62,
    SWP_PARAMETER_cam_ripple_per_torque = 63,
    SWP_PARAMETER_cam_cycles = 64,
    SWP_PARAMETER_cam_phase = 65,
    SWP_PARAMETER_swash_damping = 66,
    SWP_PARAMETER_line_stiffness = 67,
    SWP_PARAMETER_motor_constant = 68,
    SWP_PARAMETER_pump_speed = 69,
    SWP_PARAMETERS = 70
};

size_t swp_size(void);        /* bytes of a swp_drive */
size_t swp_value_count(void); /* numbers that swp_init takes */

/* Values of a drive, `count` of them in the order of swashplate's `export.values`: step, parameters,
 * options, and the constants that follow from them. At rest. */
int swp_init(swp_drive *drive, const double *values, size_t count);
int swp_reset(swp_drive *drive);                  /* at rest, values kept */
int swp_settle(swp_drive *drive, double voltage); /* settled under a constant voltage [V] */

/* One sample: the first call after init, reset or settle gives the one at time zero. */
int swp_step(swp_drive *drive, double voltage);
/* The last sample again, with another voltage (and the inputs as they are set now), as if it had been
 * this from the beginning. */
int swp_correct(swp_drive *drive, double voltage);

double swp_output(const swp_drive *drive, int output); /* NaN for a number that is none */
unsigned swp_limits(const swp_drive *drive);           /* limits that act, as bits */

int swp_set_input(swp_drive *drive, int input, double value); /* from the next sample on */
int swp_clear_input(swp_drive *drive, int input);             /* the parameter counts again */

int swp_set(swp_drive *drive, int parameter, double value); /* takes effect in the next sample */
double swp_get(const swp_drive *drive, int parameter);
int swp_set_option(swp_drive *drive, int option, bool on);
bool swp_get_option(const swp_drive *drive, int option);
int swp_set_step(swp_drive *drive, double step); /* [s]; resets nothing */
double swp_get_step(const swp_drive *drive);
int swp_update(swp_drive *drive); /* recompute now what follows from parameters, not in the next step */

/* Numbers of names, -1 for a name that is none; names of numbers, NULL for a number that is none. */
int swp_find(const char *parameter);
int swp_find_output(const char *output);
int swp_find_input(const char *input);
int swp_find_option(const char *option);
const char *swp_parameter_name(int parameter);
const char *swp_output_name(int output);
const char *swp_sentence(int status);

#ifdef __cplusplus
}
#endif

/* (the struct itself follows here in the generated header) */
#endif
