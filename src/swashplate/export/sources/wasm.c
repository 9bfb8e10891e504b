/* A drive for a page: whole runs over arrays in WebAssembly's own memory.
 *
 * One drive, which the page gives its numbers; then, for each run, room for its samples, the rows
 * that are wanted, and the run itself. Nothing is imported.
 */
#include "swashplate_drive.h"

#define EXPORTED __attribute__((visibility("default")))
#define PAGE_SIZE 65536
#define MOST_ROWS 16

extern unsigned char __heap_base; /* what lies behind the program's own data */

static swp_drive drive;
static int samples, rows;
static int chosen[MOST_ROWS];
static double *voltage;
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
    return swp_init(&drive, room((size_t)count), (size_t)count);
}

EXPORTED int swp_page_set(int parameter, double value)
{
    return swp_set(&drive, parameter, value);
}

EXPORTED double swp_page_get(int parameter)
{
    return swp_get(&drive, parameter);
}

EXPORTED int swp_page_update(void)
{
    return swp_update(&drive);
}

EXPORTED const char *swp_page_sentence(int status)
{
    return swp_sentence(status);
}

/* Room for a run of `count` samples, `step` apart [s], of which `wanted` outputs are kept. */
EXPORTED int swp_page_begin(int count, double step, int wanted)
{
    samples = rows = 0;
    if (count < 1 || wanted < 0 || wanted > MOST_ROWS) {
        return SWP_BAD_VALUE;
    }
    if (step != swp_get_step(&drive)) {
        const int status = swp_set_step(&drive, step);
        if (status != SWP_OK) {
            return status;
        }
    }
    const size_t n = (size_t)count;
    voltage = room(n * (size_t)(wanted + 2));
    if (voltage == NULL) {
        return SWP_BAD_VALUE;
    }
    for (int k = 0; k < wanted; k++) {
        row[k] = voltage + n * (size_t)(k + 1);
    }
    acting = (unsigned char *)(voltage + n * (size_t)(wanted + 1));
    samples = count;
    rows = wanted;
    return SWP_OK;
}

EXPORTED double *swp_page_input(void)
{
    return voltage;
}

EXPORTED void swp_page_select(int place, int output)
{
    chosen[place] = output;
}

EXPORTED double *swp_page_row(int place)
{
    return row[place];
}

EXPORTED unsigned char *swp_page_limits(void)
{
    return acting;
}

/* All samples from rest, or settled under the first voltage. */
EXPORTED int swp_page_run(int settled)
{
    int status = swp_reset(&drive);
    if (status == SWP_OK && settled) {
        status = swp_settle(&drive, voltage[0]);
    }
    for (int n = 0; n < samples && status == SWP_OK; n++) {
        status = swp_step(&drive, voltage[n]);
        for (int k = 0; k < rows; k++) {
            row[k][n] = swp_output(&drive, chosen[k]);
        }
        acting[n] = (unsigned char)swp_limits(&drive);
    }
    return status;
}
