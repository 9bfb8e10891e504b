/* A model for a page: whole runs over arrays in WebAssembly's own memory.
 *
 * One model, which the page gives its numbers; then, for each run, room for its samples, the rows
 * that are wanted, and the run itself. Nothing is imported.
 */
#include "variables.h"

#include <limits.h>

#define EXPORTED __attribute__((visibility("default")))
#define PAGE_SIZE 65536
#define MOST_ROWS 16
#define MOST_SAMPLES (INT_MAX / (int)sizeof(double) / (SWP_FMI_SIGNALS + MOST_ROWS + 1))

extern unsigned char __heap_base; /* what lies behind the program's own data */

static swp_model model;
static int samples, rows;
static int chosen[MOST_ROWS];
static double *input; /* those of a step, one row behind another */
static double *row[MOST_ROWS];
static unsigned char *acting;

/* Room for so many doubles from the heap's beginning on, NULL if there is none. */
static double *room(size_t count)
{
    const size_t begin = ((size_t)&__heap_base + 15U) & ~(size_t)15U;
    const size_t needed = begin + count * sizeof(double);
    const size_t has = (size_t)__builtin_wasm_memory_size(0) * PAGE_SIZE;
    if (needed > has) {
        const size_t more = (needed - has + PAGE_SIZE - 1U) / PAGE_SIZE;
        if (__builtin_wasm_memory_grow(0, more) == (size_t)-1) {
            return NULL;
        }
    }
    return (double *)begin;
}

/* Place for the numbers that swp_page_init takes. */
EXPORTED double *swp_page_values(int count)
{
    return room((size_t)count);
}

EXPORTED int swp_page_init(int count)
{
    samples = rows = 0;
    return swp_init(&model, room((size_t)count), (size_t)count);
}

EXPORTED int swp_page_set(int parameter, double value)
{
    return swp_set(&model, parameter, value);
}

EXPORTED double swp_page_get(int parameter)
{
    return swp_get(&model, parameter);
}

EXPORTED int swp_page_update(void)
{
    return swp_update(&model);
}

EXPORTED const char *swp_page_sentence(int status)
{
    return swp_sentence(status);
}

/* Room for a run of `count` samples, `step` apart [s], of which `wanted` outputs are kept. */
EXPORTED int swp_page_begin(int count, double step, int wanted)
{
    samples = rows = 0;
    if (count < 1 || count > MOST_SAMPLES || wanted < 0 || wanted > MOST_ROWS) {
        return SWP_BAD_VALUE;
    }
    if (step != swp_get_step(&model)) {
        const int status = swp_set_step(&model, step);
        if (status != SWP_OK) {
            return status;
        }
    }
    const size_t n = (size_t)count;
    input = room(n * (size_t)(SWP_FMI_SIGNALS + wanted + 1));
    if (input == NULL) {
        return SWP_BAD_VALUE;
    }
    for (int k = 0; k < wanted; k++) {
        row[k] = input + n * (size_t)(SWP_FMI_SIGNALS + k);
    }
    acting = (unsigned char *)(input + n * (size_t)(SWP_FMI_SIGNALS + wanted));
    samples = count;
    rows = wanted;
    return SWP_OK;
}

/* Place for the samples of an input, 0 for the first. */
EXPORTED double *swp_page_input(int which)
{
    return input + which * samples;
}

EXPORTED void swp_page_select(int place, int output)
{
    if (place >= 0 && place < MOST_ROWS) {
        chosen[place] = output;
    }
}

EXPORTED double *swp_page_row(int place)
{
    return row[place];
}

EXPORTED unsigned char *swp_page_limits(void)
{
    return acting;
}

/* Inputs of a sample. */
static void at(double *u, int n)
{
    for (int i = 0; i < SWP_FMI_SIGNALS; i++) {
        u[i] = input[i * samples + n];
    }
}

/* All samples from rest, or settled under the first inputs. */
EXPORTED int swp_page_run(int settled)
{
    double u[SWP_FMI_SIGNALS + 1];
    int status = swp_reset(&model);
    at(u, 0);
#if SWP_FMI_SETTLES
    if (status == SWP_OK && settled) {
        status = SWP_FMI_CALL(swp_settle, &model, u);
    }
#else
    status = settled ? SWP_BAD_VALUE : status;
#endif
    for (int n = 0; n < samples && status == SWP_OK; n++) {
        at(u, n);
        status = SWP_FMI_CALL(swp_step, &model, u);
        for (int k = 0; k < rows; k++) {
            row[k][n] = swp_output(&model, chosen[k]);
        }
        acting[n] = (unsigned char)swp_limits(&model);
    }
    return status;
}
