/* What FMI 2 and FMI 3 have in common; see fmi.h. */
#include "fmi.h"

#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#ifdef _WIN32
#define WIN32_LEAN_AND_MEAN
#include <windows.h>
#endif

static const char *const fmu_input_names[] = SWP_FMI_INPUT_NAMES;
static const int fmu_input_defaults[] = SWP_FMI_INPUT_DEFAULTS; /* parameters */
static const double fmu_input_bounds[] = SWP_FMI_BOUNDS;
static const double fmu_input_ranges[][2] = SWP_FMI_INPUT_RANGES;

#define RESOURCE_VERSION 1
#define TOKEN_LENGTH 64
#define HEADER_LENGTH (8 + 4 + 4 + 8 + TOKEN_LENGTH)
#define STATE_VERSION 2
#define STATE_HASH 32 /* place of the hash in a state's header */
#define STATE_HEADER (STATE_HASH + 8)
static const char RESOURCE_MAGIC[9] = "SWPDRIVE";
static const char STATE_MAGIC[9] = "SWPSTATE";

/* A sample belongs to a step if it lies at most this share of a sample behind its end: masters that
 * sum up t += H come to a time that is a little off. */
#define TOLERANCE 1e-3
/* A step begins where the unit stands, to this share of a sample: a master's own sum of steps. */
#define POINT_TOLERANCE 0.1
/* Samples of one step of the master, which nothing can interrupt: about a second. */
#define MOST_SAMPLES 1e7
/* Largest rate of an input, a second. */
#define LARGEST_SLOPE 1e12

static void *fmu_kept_string(const char *text) {
    size_t length = strlen(text) + 1;
    char *made = malloc(length);
    return made ? memcpy(made, text, length) : NULL;
}

#if defined(__GNUC__) /* what is called once or never is compiled for size */
#define RARE __attribute__((cold))
#define APART __attribute__((cold, noinline))
#else
#define RARE
#define APART
#endif

SWP_FMU_API RARE int swp_fmu_fail(swp_fmu *fmu, const char *message) {
    if (fmu) fmu->say(fmu, SWP_FMU_ERROR, message);
    return SWP_FMU_ERROR;
}

SWP_FMU_API RARE int swp_fmu_missing(swp_fmu *fmu) {
    return swp_fmu_fail(fmu, "an array or a pointer for a result is missing (NULL)");
}

SWP_FMU_API RARE int swp_fmu_none(swp_fmu *fmu, size_t count) {
    if (fmu && count == 0) return SWP_FMU_OK;
    return swp_fmu_fail(fmu, "there are no variables of this type: only real numbers and Booleans");
}

/* Text put together without printf, which would double the size of a library. */
typedef struct {
    char text[256];
    size_t length;
} fmu_words;

APART static void fmu_add(fmu_words *to, const char *text) {
    while (*text && to->length + 1 < sizeof to->text) to->text[to->length++] = *text++;
    to->text[to->length] = '\0';
}

/* A number with seven decimals at most. */
APART static void fmu_add_number(fmu_words *to, double value) {
    char digits[32];
    size_t at = sizeof digits - 1;
    digits[at] = '\0';
    if (value < 0.0) fmu_add(to, "-");
    if (!(fabs(value) < 1e11)) {
        fmu_add(to, "1e11 or more");
        return;
    }
    uint64_t scaled = (uint64_t)(fabs(value) * 1e7 + 0.5);
    int some = 0;
    for (int i = 0; i < 7; i++, scaled /= 10) {
        some = some || scaled % 10;
        if (some) digits[--at] = (char)('0' + scaled % 10);
    }
    if (some) digits[--at] = '.';
    do digits[--at] = (char)('0' + scaled % 10);
    while (scaled /= 10);
    fmu_add(to, digits + at);
}

/* A call that is not for the mode that the instance is in; `modes` has a bit for each that is. */
APART static int fmu_in_mode(swp_fmu *fmu, unsigned modes, const char *call) {
    static const char *const when[] = {
        "before initialization", "during initialization", "while stepping",
        "after termination; reset the instance or set a state",
        "after the failure of the model; reset the instance or set a state"};
    if (modes >> fmu->memory.mode & 1u) return SWP_FMU_OK;
    fmu_words message = {{0}, 0};
    fmu_add(&message, call);
    fmu_add(&message, " is not possible ");
    fmu_add(&message, when[fmu->memory.mode]);
    return swp_fmu_fail(fmu, message.text);
}

#define IN(MODE) (1u << SWP_FMU_##MODE)

/* A refused value: the instance goes on as it was. */
APART static int fmu_refuse(swp_fmu *fmu, const char *what, const char *why) {
    fmu_words message = {{0}, 0};
    fmu_add(&message, what);
    fmu_add(&message, ": ");
    fmu_add(&message, why);
    fmu->say(fmu, SWP_FMU_DISCARD, message.text);
    return SWP_FMU_DISCARD;
}

/* --- resource ---------------------------------------------------------------------------------- */

static uint64_t fmu_little_endian(const unsigned char *bytes, int count) {
    uint64_t value = 0;
    for (int i = count - 1; i >= 0; i--) value = value << 8 | bytes[i];
    return value;
}

static FILE *fmu_opened(const char *path) {
#ifdef _WIN32 /* FMI speaks UTF-8 */
    int length = MultiByteToWideChar(CP_UTF8, 0, path, -1, NULL, 0);
    wchar_t *wide = length > 0 ? malloc((size_t)length * sizeof *wide) : NULL;
    FILE *file = NULL;
    if (wide && MultiByteToWideChar(CP_UTF8, 0, path, -1, wide, length) > 0)
        file = _wfopen(wide, L"rb");
    free(wide);
    return file;
#else
    return fopen(path, "rb");
#endif
}

/* The bytes of FOLDER/drive.bin, or NULL. */
APART static unsigned char *fmu_resource(const char *folder, size_t *size) {
    static const char name[] = "/drive.bin";
    size_t length = strlen(folder);
    while (length > 0 && (folder[length - 1] == '/' || folder[length - 1] == '\\')) length--;
    char *path = malloc(length + sizeof name);
    if (!path) return NULL;
    memcpy(path, folder, length);
    memcpy(path + length, name, sizeof name);
    FILE *file = fmu_opened(path);
    free(path);
    if (!file) return NULL;
    size_t most = HEADER_LENGTH + 8 * swp_value_count() + 1; /* one more shows a file too long */
    unsigned char *bytes = malloc(most);
    *size = bytes ? fread(bytes, 1, most, file) : 0;
    fclose(file);
    return bytes;
}

/* What is wrong with a resource, NULL if it can be used. */
APART static const char *fmu_fault(const unsigned char *bytes, size_t size, const char *token) {
    if (size < HEADER_LENGTH || memcmp(bytes, RESOURCE_MAGIC, 8) != 0)
        return "resources/drive.bin was not written by swashplate; export the FMU again";
    if (fmu_little_endian(bytes + 8, 4) != RESOURCE_VERSION ||
        fmu_little_endian(bytes + 12, 4) != swp_value_count() ||
        fmu_little_endian(bytes + 16, 8) != SWP_FMI_LAYOUT ||
        size != HEADER_LENGTH + 8 * swp_value_count())
        return "resources/drive.bin belongs to another version of the library; export the FMU again";
    if (strlen(token) >= TOKEN_LENGTH || strcmp(token, (const char *)bytes + 24) != 0)
        return "the GUID is not that of resources/drive.bin: modelDescription.xml or the resource "
               "was changed; export the FMU again";
    return NULL;
}

APART static uint64_t fmu_hash_of(const unsigned char *bytes, size_t size) { /* FNV-1a */
    uint64_t hash = 14695981039346656037u;
    for (size_t i = 0; i < size; i++) hash = (hash ^ bytes[i]) * 1099511628211u;
    return hash;
}

/* Put the model's numbers into a fresh memory. */
APART static int fmu_instantiated(swp_memory *memory, const unsigned char *bytes) {
    size_t count = swp_value_count();
    double *values = malloc(count * sizeof *values);
    if (!values) return SWP_BAD_VALUE;
    for (size_t i = 0; i < count; i++) {
        uint64_t bits = fmu_little_endian(bytes + HEADER_LENGTH + 8 * i, 8);
        memcpy(values + i, &bits, 8);
    }
    memset(memory, 0, sizeof *memory);
    int status = swp_init(&memory->model, values, count);
    free(values);
    for (int i = 0; i < SWP_PARAMETERS; i++) memory->wanted[i] = swp_get(&memory->model, i);
    for (int i = 0; i < SWP_INPUTS; i++)
        memory->input[SWP_FMI_SIGNALS + i] = swp_get(&memory->model, fmu_input_defaults[i]);
    memory->step = swp_get_step(&memory->model);
    memory->clip = 1;
    memory->sample = -1;
    return status;
}

SWP_FMU_API RARE swp_fmu *swp_fmu_new(const char *name, const char *token, const char *folder,
                                      swp_fmu_logger *say, void *environment,
                                      swp_fmu_callback *log) {
    swp_fmu *fmu = calloc(1, sizeof *fmu);
    if (!fmu) return NULL;
    fmu->say = say;
    fmu->environment = environment;
    fmu->log = log;
    fmu->name = fmu_kept_string(name ? name : "");
    size_t size = 0;
    unsigned char *bytes = folder ? fmu_resource(folder, &size) : NULL;
    const char *wrong = NULL;
    if (!fmu->name || !bytes)
        wrong = "resources/drive.bin cannot be read; unpack the whole FMU";
    else
        wrong = fmu_fault(bytes, size, token ? token : "");
    if (!wrong && fmu_instantiated(&fmu->initial, bytes) != SWP_OK)
        wrong = "the model refuses numbers of resources/drive.bin; export the FMU again";
    if (wrong) {
        swp_fmu_fail(fmu, wrong);
        free(bytes);
        swp_fmu_free(fmu);
        return NULL;
    }
    fmu->resource = fmu_hash_of(bytes, size);
    free(bytes);
    fmu->memory = fmu->initial;
    return fmu;
}

SWP_FMU_API void swp_fmu_free(swp_fmu *fmu) {
    if (!fmu) return;
    free(fmu->name);
    free(fmu);
}

SWP_FMU_API int swp_fmu_reset(swp_fmu *fmu) {
    if (!fmu) return SWP_FMU_ERROR;
    fmu->memory = fmu->initial;
    return SWP_FMU_OK;
}

static int fmu_within(uint32_t reference, uint32_t first, int count) {
    return reference >= first && reference - first < (uint32_t)count;
}

/* --- samples ------------------------------------------------------------------------------------ */

/* After a failure inside the model nothing more can be computed, but a state can be set. */
APART static int fmu_failed(swp_fmu *fmu, int status) {
    fmu->memory.mode = SWP_FMU_FAILED;
    return swp_fmu_fail(fmu, swp_sentence(status));
}

/* Hand parameters over that were set since the newest sample. */
static int fmu_updated(swp_fmu *fmu) {
    swp_memory *m = &fmu->memory;
    int any = 0;
    for (int i = 0; i < SWP_PARAMETERS; i++) {
        if (!m->changed[i]) continue;
        m->changed[i] = 0;
        any = 1;
        int status = swp_set(&m->model, i, m->wanted[i]);
        if (status != SWP_OK) return fmu_failed(fmu, status);
    }
    int status = any ? swp_update(&m->model) : SWP_OK;
    return status == SWP_OK ? SWP_FMU_OK : fmu_failed(fmu, status);
}

/* Inputs within their bounds and ranges: a ramp may have led out of them. */
static int fmu_limited(swp_fmu *fmu, double *inputs) {
    swp_memory *m = &fmu->memory;
    for (int i = 0; i < SWP_FMI_INPUTS; i++) {
        const double *range = fmu_input_ranges[i];
        if (i >= SWP_FMI_SIGNALS && !m->given[i]) continue; /* its parameter counts */
        if (isfinite(inputs[i]) && inputs[i] >= range[0] && inputs[i] <= range[1]) continue;
        fmu_words message = {{0}, 0};
        fmu_add(&message, fmu_input_names[i]);
        fmu_add(&message, " is ");
        fmu_add_number(&message, inputs[i]);
        fmu_add(&message, ", out of its range");
        return swp_fmu_fail(fmu, message.text);
    }
    for (int i = 0; i < SWP_FMI_SIGNALS; i++) {
        double bound = fmu_input_bounds[i];
        if (bound == 0.0 || fabs(inputs[i]) <= bound) continue;
        fmu_words message = {{0}, 0};
        fmu_add(&message, fmu_input_names[i]);
        fmu_add(&message, " is ");
        fmu_add_number(&message, inputs[i]);
        fmu_add(&message, ", but must be within +-");
        fmu_add_number(&message, bound);
        fmu_add(&message, m->clip ? "; it is clipped (said once)" : " and clip is false");
        if (!m->clip) return swp_fmu_fail(fmu, message.text);
        if (!m->clipped) fmu->say(fmu, SWP_FMU_WARNING, message.text);
        m->clipped = 1;
        inputs[i] = inputs[i] > 0.0 ? bound : -bound;
    }
    return SWP_FMU_OK;
}

/* Take a sample `ahead` seconds after the communication point, the newest one again if `again`. */
static int fmu_sampled(swp_fmu *fmu, double ahead, int again) {
    swp_memory *m = &fmu->memory;
    double inputs[SWP_FMI_PLACES] = {0.0};
    for (int i = 0; i < SWP_FMI_INPUTS; i++) inputs[i] = m->input[i] + m->slope[i] * ahead;
    int status = fmu_limited(fmu, inputs);
    if (status != SWP_FMU_OK) return status;
    if (again && memcmp(inputs, m->used, sizeof inputs) == 0) return SWP_FMU_OK;
    for (int i = 0; i < SWP_INPUTS; i++) {
        int at = SWP_FMI_SIGNALS + i;
        if (m->given[at] && swp_set_input(&m->model, i, inputs[at]) != SWP_OK)
            return fmu_failed(fmu, SWP_BAD_VALUE);
    }
    int first = m->sample == (again ? 0 : -1);
    int found = SWP_OK;
    if (first) {
        found = swp_reset(&m->model);
#if SWP_FMI_SETTLES
        if (found == SWP_OK && m->steady) found = SWP_FMI_CALL(swp_settle, &m->model, inputs);
#endif
        if (found == SWP_OK) found = SWP_FMI_CALL(swp_step, &m->model, inputs);
    } else if (again) {
        found = SWP_FMI_CALL(swp_correct, &m->model, inputs);
    } else {
        found = SWP_FMI_CALL(swp_step, &m->model, inputs);
    }
    if (found != SWP_OK) return fmu_failed(fmu, found);
    memcpy(m->used, inputs, sizeof inputs);
    m->sample += !again;
    return SWP_FMU_OK;
}

/* Take the newest sample with the inputs as they are now, if it lies at the communication point. */
static int fmu_settled_inputs(swp_fmu *fmu) {
    swp_memory *m = &fmu->memory;
    double at = m->start + (double)m->sample * m->step;
    if (m->mode != SWP_FMU_STEPPING || m->sample < 0) return SWP_FMU_OK;
    if (fabs(m->now - at) > TOLERANCE * m->step) return SWP_FMU_OK;
    return fmu_sampled(fmu, 0.0, 1);
}

/* Whether a time is a finite number that still tells one sample from the next. */
static int fmu_is_time(const swp_memory *m, double time) {
    return fabs(time) * DBL_EPSILON <= POINT_TOLERANCE * m->step;
}

SWP_FMU_API RARE int swp_fmu_setup(swp_fmu *fmu, double start, int ends, double stop) {
    if (!fmu) return SWP_FMU_ERROR;
    int status = fmu_in_mode(fmu, IN(INSTANTIATED), "a start time");
    if (status != SWP_FMU_OK) return status;
    if (!fmu_is_time(&fmu->memory, start))
        return swp_fmu_fail(fmu, "the start time is not a finite number, or too large for the step");
    if (ends && !(isfinite(stop) && stop >= start))
        return swp_fmu_fail(fmu, "the stop time is not a finite number at or after the start");
    fmu->memory.start = start;
    return SWP_FMU_OK;
}

SWP_FMU_API RARE int swp_fmu_begin(swp_fmu *fmu) {
    if (!fmu) return SWP_FMU_ERROR;
    swp_memory *m = &fmu->memory;
    int status = fmu_in_mode(fmu, IN(INSTANTIATED), "initialization");
    if (status != SWP_FMU_OK) return status;
    m->now = m->start;
    m->mode = SWP_FMU_INITIALIZING;
    return SWP_FMU_OK;
}

SWP_FMU_API int swp_fmu_ready(swp_fmu *fmu) {
    if (!fmu) return SWP_FMU_ERROR;
    swp_memory *m = &fmu->memory;
    int status = fmu_in_mode(fmu, IN(INITIALIZING), "the end of initialization");
    if (status != SWP_FMU_OK) return status;
    m->sample = -1;
    status = fmu_updated(fmu);
    if (status == SWP_FMU_OK) status = fmu_sampled(fmu, 0.0, 0);
    if (status == SWP_FMU_OK) m->mode = SWP_FMU_STEPPING;
    return status;
}

/* After a failure an instance stays failed, but can be terminated, as masters do in any case. */
SWP_FMU_API int swp_fmu_end(swp_fmu *fmu) {
    if (!fmu) return SWP_FMU_ERROR;
    int status = fmu_in_mode(fmu, IN(STEPPING) | IN(FAILED), "termination");
    if (status == SWP_FMU_OK && fmu->memory.mode == SWP_FMU_STEPPING)
        fmu->memory.mode = SWP_FMU_TERMINATED;
    return status;
}

/* Whether a step can be made from a time over an interval; what is wrong is said. */
static int fmu_steppable(swp_fmu *fmu, double time, double interval) {
    swp_memory *m = &fmu->memory;
    fmu_words message = {{0}, 0};
    int status = fmu_in_mode(fmu, IN(STEPPING), "a step");
    if (status != SWP_FMU_OK) return status;
    if (!fmu_is_time(m, time) || !(interval >= 0.0))
        return swp_fmu_fail(fmu, "a step needs a finite time, and a finite length of 0 or more");
    if (fabs(time - m->now) > POINT_TOLERANCE * m->step + 4.0 * DBL_EPSILON * fabs(m->now)) {
        fmu_add(&message, "a step begins at ");
        fmu_add_number(&message, time);
        fmu_add(&message, " s, but the model stands at ");
        fmu_add_number(&message, m->now);
        fmu_add(&message, " s; to go to another time, set a state");
        return swp_fmu_fail(fmu, message.text);
    }
    if (!(interval <= MOST_SAMPLES * m->step) || !fmu_is_time(m, time + interval)) {
        fmu_add(&message, "a step of ");
        fmu_add_number(&message, interval);
        fmu_add(&message, " s is too long; take steps of at most ");
        fmu_add_number(&message, MOST_SAMPLES * m->step);
        fmu_add(&message, " s");
        return swp_fmu_fail(fmu, message.text);
    }
    return SWP_FMU_OK;
}

SWP_FMU_API int swp_fmu_advance(swp_fmu *fmu, double time, double interval) {
    if (!fmu) return SWP_FMU_ERROR;
    swp_memory *m = &fmu->memory;
    int status = fmu_steppable(fmu, time, interval);
    if (status == SWP_FMU_OK) status = fmu_settled_inputs(fmu);
    if (status == SWP_FMU_OK) status = fmu_updated(fmu);
    if (status != SWP_FMU_OK) return status;
    double end = time + interval;
    double last = floor((end - m->start) / m->step + TOLERANCE);
    while ((double)m->sample < last) {
        double at = m->start + (double)(m->sample + 1) * m->step;
        status = fmu_sampled(fmu, at - time, 0);
        if (status != SWP_FMU_OK) {
            m->mode = SWP_FMU_FAILED; /* somewhere within the step */
            return status;
        }
    }
    for (int i = 0; i < SWP_FMI_INPUTS; i++) {
        /* a ramp goes on to the end of the step; the next inputs and their rates are the master's */
        m->input[i] += m->slope[i] * interval;
        m->slope[i] = 0.0;
    }
    m->now = end;
    return SWP_FMU_OK;
}

/* --- values ------------------------------------------------------------------------------------- */

static int fmu_is_output(uint32_t reference) {
    return fmu_within(reference, SWP_FMI_OUTPUT, SWP_OUTPUTS);
}

/* Outputs before the first step are those of the first sample, as far as it is known. */
static int fmu_known(swp_fmu *fmu) {
    swp_memory *m = &fmu->memory;
    if (m->mode == SWP_FMU_STEPPING) return fmu_settled_inputs(fmu);
    if (m->mode != SWP_FMU_INITIALIZING) return SWP_FMU_OK;
    m->sample = -1;
    int status = fmu_updated(fmu);
    return status == SWP_FMU_OK ? fmu_sampled(fmu, 0.0, 0) : status;
}

SWP_FMU_API int swp_fmu_get_real(swp_fmu *fmu, const uint32_t *references, size_t count,
                                 double *values) {
    if (!fmu) return SWP_FMU_ERROR;
    if (count > 0 && (!references || !values)) return swp_fmu_missing(fmu);
    swp_memory *m = &fmu->memory;
    int status = fmu_known(fmu);
    if (status != SWP_FMU_OK) return status;
    for (size_t i = 0; i < count; i++) {
        uint32_t r = references[i];
        if (fmu_is_output(r)) {
            status = fmu_in_mode(fmu, ~IN(FAILED), "an output");
            if (status != SWP_FMU_OK) return status;
            values[i] = swp_output(&m->model, (int)(r - SWP_FMI_OUTPUT));
            if (!isfinite(values[i]))
                return swp_fmu_fail(fmu, "an output is not a finite number; reset the instance");
        } else if (fmu_within(r, SWP_FMI_INPUT, SWP_FMI_INPUTS))
            values[i] = m->input[r - SWP_FMI_INPUT];
        else if (fmu_within(r, SWP_FMI_PARAMETER, SWP_PARAMETERS))
            values[i] = m->wanted[r - SWP_FMI_PARAMETER];
        else if (r == SWP_FMI_STEP)
            values[i] = m->step;
        else if (r == SWP_FMI_TIME)
            values[i] = m->now;
        else
            return swp_fmu_fail(fmu, "no real number has this value reference");
    }
    return SWP_FMU_OK;
}

#define SETTABLE (IN(INSTANTIATED) | IN(INITIALIZING) | IN(STEPPING))

static int fmu_set_input(swp_fmu *fmu, uint32_t i, double value) {
    swp_memory *m = &fmu->memory;
    if (!isfinite(value))
        return fmu_refuse(fmu, fmu_input_names[i], "must be a finite number");
    if (!(value >= fmu_input_ranges[i][0] && value <= fmu_input_ranges[i][1]))
        return fmu_refuse(fmu, fmu_input_names[i], "is out of range; it keeps its value");
    if (value != m->input[i]) m->given[i] = 1; /* until then the parameter counts, if tuned, too */
    m->input[i] = value;
    return SWP_FMU_OK;
}

static int fmu_set_parameter(swp_fmu *fmu, int i, double value) {
    swp_memory *m = &fmu->memory;
    swp_model tried = m->model;
    if (swp_set(&tried, i, value) != SWP_OK)
        return fmu_refuse(fmu, swp_parameter_name(i), "is out of range; it keeps its value");
    if (value == m->wanted[i]) return SWP_FMU_OK;
    m->wanted[i] = value;
    m->changed[i] = 1;
    return SWP_FMU_OK;
}

static int fmu_set_step(swp_fmu *fmu, double step) {
    swp_memory *m = &fmu->memory;
    if (step == m->step) return SWP_FMU_OK;
    if (m->mode == SWP_FMU_STEPPING) return fmu_refuse(fmu, "step", "is fixed after initialization");
    if (!(SWP_FMI_FREE_STEP(&m->model)))
        return fmu_refuse(fmu, "step", "the card's filter is a recursion for the exported step only");
    int status = swp_set_step(&m->model, step);
    if (status == SWP_OK) status = swp_update(&m->model);
    if (status != SWP_OK) return fmu_refuse(fmu, "step", swp_sentence(status));
    m->step = step;
    return SWP_FMU_OK;
}

SWP_FMU_API int swp_fmu_set_real(swp_fmu *fmu, const uint32_t *references, size_t count,
                                 const double *values) {
    if (!fmu) return SWP_FMU_ERROR;
    if (count > 0 && (!references || !values)) return swp_fmu_missing(fmu);
    int worst = fmu_in_mode(fmu, SETTABLE, "a new value");
    if (worst != SWP_FMU_OK) return worst;
    for (size_t i = 0; i < count; i++) {
        uint32_t r = references[i];
        int status;
        if (fmu_within(r, SWP_FMI_INPUT, SWP_FMI_INPUTS))
            status = fmu_set_input(fmu, r - SWP_FMI_INPUT, values[i]);
        else if (fmu_within(r, SWP_FMI_PARAMETER, SWP_PARAMETERS))
            status = fmu_set_parameter(fmu, (int)(r - SWP_FMI_PARAMETER), values[i]);
        else if (r == SWP_FMI_STEP)
            status = fmu_set_step(fmu, values[i]);
        else
            status = swp_fmu_fail(fmu, "no real number with this value reference can be set");
        if (status > worst) worst = status;
    }
    return worst;
}

SWP_FMU_API int swp_fmu_get_boolean(swp_fmu *fmu, uint32_t reference, int *value) {
    if (SWP_FMI_SETTLES && reference == SWP_FMI_START_STEADY)
        *value = fmu->memory.steady;
    else if (reference == SWP_FMI_CLIP)
        *value = fmu->memory.clip;
    else if (fmu_within(reference, SWP_FMI_OPTION, SWP_OPTIONS))
        *value = swp_get_option(&fmu->memory.model, (int)(reference - SWP_FMI_OPTION));
    else
        return swp_fmu_fail(fmu, "no Boolean has this value reference");
    return SWP_FMU_OK;
}

SWP_FMU_API RARE int swp_fmu_set_boolean(swp_fmu *fmu, uint32_t reference, int value) {
    swp_memory *m = &fmu->memory;
    int before = 0;
    int status = swp_fmu_get_boolean(fmu, reference, &before);
    if (status != SWP_FMU_OK || before == !!value) return status;
    status = fmu_in_mode(fmu, SETTABLE, "a new value");
    if (status != SWP_FMU_OK) return status;
    if (m->mode == SWP_FMU_STEPPING)
        return fmu_refuse(fmu, "a Boolean parameter", "is fixed after initialization");
    if (reference == SWP_FMI_START_STEADY) {
        m->steady = !!value;
    } else if (reference == SWP_FMI_CLIP) {
        m->clip = !!value;
    } else {
        int found = swp_set_option(&m->model, (int)(reference - SWP_FMI_OPTION), value != 0);
        if (found == SWP_OK) found = swp_update(&m->model);
        if (found != SWP_OK) return fmu_refuse(fmu, "a Boolean parameter", swp_sentence(found));
    }
    return SWP_FMU_OK;
}

SWP_FMU_API RARE int swp_fmu_set_slope(swp_fmu *fmu, uint32_t reference, double slope) {
    if (!fmu_within(reference, SWP_FMI_INPUT, SWP_FMI_INPUTS))
        return swp_fmu_fail(fmu, "only inputs have derivatives");
    int status = fmu_in_mode(fmu, SETTABLE, "a derivative");
    if (status != SWP_FMU_OK) return status;
    if (!(fabs(slope) <= LARGEST_SLOPE))
        return swp_fmu_fail(fmu, "a derivative must be a number within +-1e12 a second");
    uint32_t i = reference - SWP_FMI_INPUT;
    fmu->memory.slope[i] = slope;
    if (slope != 0.0) fmu->memory.given[i] = 1;
    return SWP_FMU_OK;
}

/* --- states ------------------------------------------------------------------------------------- */

SWP_FMU_API int swp_fmu_save(swp_fmu *fmu, void **state) {
    if (!fmu) return SWP_FMU_ERROR;
    if (!state) return swp_fmu_missing(fmu);
    if (!*state) *state = malloc(sizeof(swp_memory));
    if (!*state) return swp_fmu_fail(fmu, "not enough memory for a state");
    memcpy(*state, &fmu->memory, sizeof(swp_memory));
    return SWP_FMU_OK;
}

SWP_FMU_API int swp_fmu_restore(swp_fmu *fmu, const void *state) {
    if (!fmu || !state) return swp_fmu_fail(fmu, "there is no state to set");
    memcpy(&fmu->memory, state, sizeof(swp_memory));
    return SWP_FMU_OK;
}

SWP_FMU_API int swp_fmu_forget(swp_fmu *fmu, void **state) {
    if (state) {
        free(*state);
        *state = NULL;
    }
    return fmu ? SWP_FMU_OK : SWP_FMU_ERROR;
}

#define STATE_SIZE (STATE_HEADER + sizeof(swp_memory))

SWP_FMU_API int swp_fmu_bytes(swp_fmu *fmu, size_t *size) {
    if (!size) return swp_fmu_missing(fmu);
    *size = STATE_SIZE;
    return fmu ? SWP_FMU_OK : SWP_FMU_ERROR;
}

/* All of a header but the hash, which depends on the state. */
static void fmu_header(const swp_fmu *fmu, unsigned char *bytes) {
    uint32_t version = STATE_VERSION;
    uint32_t size = (uint32_t)sizeof(swp_memory);
    uint64_t layout = SWP_FMI_LAYOUT;
    memcpy(bytes, STATE_MAGIC, 8);
    memcpy(bytes + 8, &version, 4);
    memcpy(bytes + 12, &size, 4);
    memcpy(bytes + 16, &layout, 8);
    memcpy(bytes + 24, &fmu->resource, 8);
}

SWP_FMU_API RARE int swp_fmu_write(swp_fmu *fmu, const void *state, unsigned char *bytes,
                                   size_t size) {
    if (!fmu || !state || !bytes || size < STATE_SIZE)
        return swp_fmu_fail(fmu, "the state is missing (NULL), or its buffer is too small");
    fmu_header(fmu, bytes);
    memcpy(bytes + STATE_HEADER, state, sizeof(swp_memory));
    uint64_t hash = fmu_hash_of(bytes + STATE_HEADER, sizeof(swp_memory));
    memcpy(bytes + STATE_HASH, &hash, sizeof hash);
    return SWP_FMU_OK;
}

/* Whether a state could be one of this library: its hash is no protection against intent. */
APART static int fmu_possible(const swp_memory *m) {
    return swp_valid(&m->model) && m->step == swp_get_step(&m->model) && m->sample >= -1 &&
           m->mode >= SWP_FMU_INSTANTIATED && m->mode <= SWP_FMU_FAILED;
}

SWP_FMU_API RARE int swp_fmu_read(swp_fmu *fmu, const unsigned char *bytes, size_t size,
                                  void **state) {
    unsigned char own[STATE_HEADER];
    if (!fmu) return SWP_FMU_ERROR;
    if (!bytes || !state) return swp_fmu_missing(fmu);
    fmu_header(fmu, own);
    if (size != STATE_SIZE || memcmp(bytes, own, 16) != 0)
        return swp_fmu_fail(fmu, "this is not a state of this library: its header or size differs");
    if (memcmp(bytes + 16, own + 16, 16) != 0)
        return swp_fmu_fail(fmu, "this state belongs to another set of numbers");
    uint64_t hash = fmu_hash_of(bytes + STATE_HEADER, sizeof(swp_memory));
    swp_memory *made = malloc(sizeof(swp_memory));
    if (!made) return swp_fmu_fail(fmu, "not enough memory for a state");
    memcpy(made, bytes + STATE_HEADER, sizeof(swp_memory));
    if (memcmp(bytes + STATE_HASH, &hash, sizeof hash) != 0 || !fmu_possible(made)) {
        free(made);
        return swp_fmu_fail(fmu, "this state is damaged");
    }
    *state = made;
    return SWP_FMU_OK;
}
