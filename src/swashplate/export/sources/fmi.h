/* A model as an FMU: what FMI 2 and FMI 3 have in common.
 *
 * The model has its own grid of samples, t0 + k h, whatever the master's step is. A master says what
 * the inputs at an instant are after it has seen the outputs there. So the newest sample is
 * provisional: it is taken with the inputs as they were, and taken again as soon as others are set
 * at its instant. An output without feedthrough does not change by that.
 */
#ifndef SWASHPLATE_FMI_H
#define SWASHPLATE_FMI_H

#include <stddef.h>
#include <stdint.h>

#include "variables.h"

#define SWP_FMI_INPUTS (SWP_FMI_SIGNALS + SWP_INPUTS)
#define SWP_FMI_PLACES (SWP_FMI_INPUTS + 1) /* of arrays, which must not be empty */

#ifndef SWP_FMU_API /* one unit of source code may make everything static */
#if defined(__GNUC__) && !defined(_WIN32)
#define SWP_FMU_API __attribute__((visibility("hidden")))
#else
#define SWP_FMU_API
#endif
#endif

/* Status, numbered as fmi2Status and fmi3Status are. */
enum { SWP_FMU_OK, SWP_FMU_WARNING, SWP_FMU_DISCARD, SWP_FMU_ERROR, SWP_FMU_FATAL };

typedef struct swp_fmu swp_fmu;
typedef void swp_fmu_logger(const swp_fmu *, int status, const char *message);
typedef void swp_fmu_callback(void); /* the master's logger, whose type fmi2.c and fmi3.c know */

/* All that an instance remembers: plain data, so that a copy is a state. */
typedef struct {
    swp_model model;                  /* at its newest sample */
    double input[SWP_FMI_PLACES];     /* as last set */
    double slope[SWP_FMI_PLACES];     /* rates from the communication point on, for one step */
    double used[SWP_FMI_PLACES];      /* of the newest sample */
    double wanted[SWP_PARAMETERS];    /* parameters as last set; they count from the next sample on */
    double step;                      /* h [s] */
    double start;                     /* time of the first sample [s] */
    double now;                       /* communication point [s] */
    int64_t sample;                   /* number of the newest sample; -1 before the first */
    int32_t mode;
    int32_t steady, clip, clipped;
    unsigned char given[SWP_FMI_PLACES];       /* whether it was set, and no parameter counts */
    unsigned char changed[SWP_PARAMETERS];     /* whether it is not the model's own yet */
} swp_memory;

enum {
    SWP_FMU_INSTANTIATED,
    SWP_FMU_INITIALIZING,
    SWP_FMU_STEPPING,
    SWP_FMU_TERMINATED,
    SWP_FMU_FAILED
};

struct swp_fmu {
    swp_memory memory;
    swp_memory initial;   /* as instantiated, for reset */
    uint64_t resource;   /* hash of the model's numbers */
    swp_fmu_logger *say;
    void *environment;
    swp_fmu_callback *log;
    char *name;
};

/* An instance with the numbers in FOLDER/drive.bin, or NULL; `say` has told why. All functions fail
 * without an instance. */
SWP_FMU_API swp_fmu *swp_fmu_new(const char *name, const char *token, const char *folder,
                                 swp_fmu_logger *say, void *environment,
                                 swp_fmu_callback *log);
SWP_FMU_API void swp_fmu_free(swp_fmu *);
/* Start and, if `ends`, stop of the simulation; swp_fmu_begin takes the start. */
SWP_FMU_API int swp_fmu_setup(swp_fmu *, double start, int ends, double stop);
SWP_FMU_API int swp_fmu_begin(swp_fmu *);
SWP_FMU_API int swp_fmu_ready(swp_fmu *);
SWP_FMU_API int swp_fmu_end(swp_fmu *);
SWP_FMU_API int swp_fmu_advance(swp_fmu *, double time, double interval);
SWP_FMU_API int swp_fmu_reset(swp_fmu *);
SWP_FMU_API int swp_fmu_get_real(swp_fmu *, const uint32_t *, size_t, double *);
SWP_FMU_API int swp_fmu_set_real(swp_fmu *, const uint32_t *, size_t, const double *);
SWP_FMU_API int swp_fmu_get_boolean(swp_fmu *, uint32_t, int *);
SWP_FMU_API int swp_fmu_set_boolean(swp_fmu *, uint32_t, int);
SWP_FMU_API int swp_fmu_set_slope(swp_fmu *, uint32_t, double);
SWP_FMU_API int swp_fmu_fail(swp_fmu *, const char *message);
SWP_FMU_API int swp_fmu_none(swp_fmu *, size_t count); /* fails unless nothing is asked for */
SWP_FMU_API int swp_fmu_missing(swp_fmu *); /* fails for a pointer that is NULL */

/* Booleans, which are `int` in FMI 2 and `bool` in FMI 3, until one fails. */
#define SWP_FMU_GET_BOOLEANS(STATUS, fmu, references, count, values)            \
    int status = fmu ? SWP_FMU_OK : SWP_FMU_ERROR;                              \
    if (count > 0 && (!references || !values)) status = swp_fmu_missing(fmu);   \
    for (size_t i = 0; i < count && status == SWP_FMU_OK; i++) {                \
        int on = 0;                                                             \
        status = swp_fmu_get_boolean(fmu, references[i], &on);                  \
        values[i] = on != 0;                                                    \
    }                                                                           \
    return (STATUS)status
#define SWP_FMU_SET_BOOLEANS(STATUS, fmu, references, count, values)            \
    int status = fmu ? SWP_FMU_OK : SWP_FMU_ERROR;                              \
    if (count > 0 && (!references || !values)) status = swp_fmu_missing(fmu);   \
    for (size_t i = 0; i < count && status == SWP_FMU_OK; i++)                  \
        status = swp_fmu_set_boolean(fmu, references[i], values[i] != 0);       \
    return (STATUS)status

/* States. The serialised form has a header: magic, version, size, whose numbers they are, and a hash
 * of what follows, so that a damaged state is refused. */
SWP_FMU_API int swp_fmu_save(swp_fmu *, void **state);
SWP_FMU_API int swp_fmu_restore(swp_fmu *, const void *state);
SWP_FMU_API int swp_fmu_forget(swp_fmu *, void **state);
SWP_FMU_API int swp_fmu_bytes(swp_fmu *, size_t *size);
SWP_FMU_API int swp_fmu_write(swp_fmu *, const void *state, unsigned char *, size_t);
SWP_FMU_API int swp_fmu_read(swp_fmu *, const unsigned char *, size_t, void **state);

#endif
