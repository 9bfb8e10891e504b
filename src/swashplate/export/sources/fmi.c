/* What FMI 2 and FMI 3 have in common; see fmi.h. */
#include "fmi.h"

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

#define RESOURCE_VERSION 1
#define TOKEN_LENGTH 64
#define HEADER_LENGTH (8 + 4 + 4 + 8 + TOKEN_LENGTH)
#define STATE_VERSION 1
#define STATE_HEADER 32
static const char RESOURCE_MAGIC[9] = "SWPDRIVE";
static const char STATE_MAGIC[9] = "SWPSTATE";

/* A sample belongs to a step if it lies at most this share of a sample behind its end: masters that
 * sum up t += H come to a time that is a little off. */
#define TOLERANCE 1e-3

static void *fmu_kept_string(const char *text) {
    size_t length = strlen(text) + 1;
    char *made = malloc(length);
    return made ? memcpy(made, text, length) : NULL;
}

SWP_FMU_API int swp_fmu_fail(swp_fmu *fmu, const char *message) {
    if (fmu) fmu->say(fmu, SWP_FMU_ERROR, message);
    return SWP_FMU_ERROR;
}

SWP_FMU_API int swp_fmu_none(swp_fmu *fmu, size_t count) {
    if (fmu && count == 0) return SWP_FMU_OK;
    return swp_fmu_fail(fmu, "there are no variables of this type: only real numbers and Booleans");
}

/* Text put together without printf, which would double the size of a library. */
typedef struct {
    char text[256];
    size_t length;
} fmu_words;

static void fmu_add(fmu_words *to, const char *text) {
    while (*text && to->length + 1 < sizeof to->text) to->text[to->length++] = *text++;
    to->text[to->length] = '\0';
}

/* A number with seven decimals at most. */
static void fmu_add_number(fmu_words *to, double value) {
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

/* A refused value: the instance goes on as it was. */
static int fmu_refuse(swp_fmu *fmu, const char *what, const char *why) {
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
static unsigned char *fmu_resource(const char *folder, size_t *size) {
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
static const char *fmu_fault(const unsigned char *bytes, size_t size, const char *token) {
    if (size < HEADER_LENGTH || memcmp(bytes, RESOURCE_MAGIC, 8) != 0)
        return "resources/drive.bin holds no numbers of swashplate; export the FMU again";
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

static uint64_t fmu_hash_of(const unsigned char *bytes, size_t size) { /* FNV-1a */
    uint64_t hash = 14695981039346656037u;
    for (size_t i = 0; i < size; i++) hash = (hash ^ bytes[i]) * 1099511628211u;
    return hash;
}

/* Put the model's numbers into a fresh memory. */
static int fmu_begun(swp_memory *memory, const unsigned char *bytes) {
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

SWP_FMU_API swp_fmu *swp_fmu_new(const char *name, const char *token, const char *folder,
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
        wrong = "resources/drive.bin cannot be read; unpack the FMU whole";
    else
        wrong = fmu_fault(bytes, size, token ? token : "");
    if (!wrong && fmu_begun(&fmu->begun, bytes) != SWP_OK)
        wrong = "resources/drive.bin holds numbers that the model refuses; export the FMU again";
    if (wrong) {
        swp_fmu_fail(fmu, wrong);
        free(bytes);
        swp_fmu_free(fmu);
        return NULL;
    }
    fmu->resource = fmu_hash_of(bytes, size);
    free(bytes);
    fmu->memory = fmu->begun;
    return fmu;
}

SWP_FMU_API void swp_fmu_free(swp_fmu *fmu) {
    if (!fmu) return;
    free(fmu->name);
    free(fmu);
}

SWP_FMU_API int swp_fmu_reset(swp_fmu *fmu) {
    if (!fmu) return SWP_FMU_ERROR;
    fmu->memory = fmu->begun;
    return SWP_FMU_OK;
}

static int fmu_within(uint32_t reference, uint32_t first, int count) {
    return reference >= first && reference - first < (uint32_t)count;
}

/* --- samples ------------------------------------------------------------------------------------ */

/* After a failure inside the model nothing more can be computed, but a state can be set. */
static int fmu_failed(swp_fmu *fmu, int status) {
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

/* Inputs within their bounds. */
static int fmu_clipped(swp_fmu *fmu, double *inputs) {
    swp_memory *m = &fmu->memory;
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
    int status = fmu_clipped(fmu, inputs);
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

SWP_FMU_API int swp_fmu_begin(swp_fmu *fmu, double start) {
    if (!fmu) return SWP_FMU_ERROR;
    swp_memory *m = &fmu->memory;
    if (m->mode != SWP_FMU_INSTANTIATED)
        return swp_fmu_fail(fmu, "initialization can only begin after instantiation or reset");
    if (!isfinite(start)) return swp_fmu_fail(fmu, "the start time is no finite number");
    m->start = m->now = start;
    m->mode = SWP_FMU_INITIALIZING;
    return SWP_FMU_OK;
}

SWP_FMU_API int swp_fmu_ready(swp_fmu *fmu) {
    if (!fmu) return SWP_FMU_ERROR;
    swp_memory *m = &fmu->memory;
    if (m->mode != SWP_FMU_INITIALIZING)
        return swp_fmu_fail(fmu, "initialization can only end after it has begun");
    m->sample = -1;
    int status = fmu_updated(fmu);
    if (status == SWP_FMU_OK) status = fmu_sampled(fmu, 0.0, 0);
    if (status == SWP_FMU_OK) m->mode = SWP_FMU_STEPPING;
    return status;
}

SWP_FMU_API int swp_fmu_advance(swp_fmu *fmu, double time, double interval) {
    if (!fmu) return SWP_FMU_ERROR;
    swp_memory *m = &fmu->memory;
    if (m->mode == SWP_FMU_FAILED)
        return swp_fmu_fail(fmu, "the model failed before; reset it or set a state");
    if (m->mode != SWP_FMU_STEPPING)
        return swp_fmu_fail(fmu, "a step can only be done after initialization");
    double end = time + interval;
    if (!(interval >= 0.0) || !isfinite(end) || end < m->now - TOLERANCE * m->step)
        return swp_fmu_fail(fmu, "time can only go on; to go back, set a state");
    int status = fmu_settled_inputs(fmu);
    if (status == SWP_FMU_OK) status = fmu_updated(fmu);
    if (status != SWP_FMU_OK) return status;
    double last = floor((end - m->start) / m->step + TOLERANCE);
    while ((double)m->sample < last) {
        double at = m->start + (double)(m->sample + 1) * m->step;
        status = fmu_sampled(fmu, at - time, 0);
        if (status != SWP_FMU_OK) return status;
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
    swp_memory *m = &fmu->memory;
    int status = fmu_known(fmu);
    if (status != SWP_FMU_OK) return status;
    for (size_t i = 0; i < count; i++) {
        uint32_t r = references[i];
        if (fmu_within(r, SWP_FMI_INPUT, SWP_FMI_INPUTS))
            values[i] = m->input[r - SWP_FMI_INPUT];
        else if (fmu_within(r, SWP_FMI_OUTPUT, SWP_OUTPUTS))
            values[i] = swp_output(&m->model, (int)(r - SWP_FMI_OUTPUT));
        else if (fmu_within(r, SWP_FMI_PARAMETER, SWP_PARAMETERS))
            values[i] = m->wanted[r - SWP_FMI_PARAMETER];
        else if (r == SWP_FMI_STEP)
            values[i] = m->step;
        else if (r == SWP_FMI_TIME)
            values[i] = m->now;
        else
            return swp_fmu_fail(fmu, "there is no number of this value reference");
    }
    return SWP_FMU_OK;
}

static int fmu_set_input(swp_fmu *fmu, uint32_t i, double value) {
    swp_memory *m = &fmu->memory;
    if (!isfinite(value))
        return fmu_refuse(fmu, fmu_input_names[i], "must be a finite number");
    if (value != m->input[i]) m->given[i] = 1; /* until then the parameter counts, if tuned, too */
    m->input[i] = value;
    return SWP_FMU_OK;
}

static int fmu_set_parameter(swp_fmu *fmu, int i, double value) {
    swp_memory *m = &fmu->memory;
    swp_model tried = m->model;
    if (swp_set(&tried, i, value) != SWP_OK)
        return fmu_refuse(fmu, swp_parameter_name(i), "is out of range; it stays as it was");
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
        return fmu_refuse(fmu, "step", "the card's filter is a recursion for the exported step alone");
    int status = swp_set_step(&m->model, step);
    if (status == SWP_OK) status = swp_update(&m->model);
    if (status != SWP_OK) return fmu_refuse(fmu, "step", swp_sentence(status));
    m->step = step;
    return SWP_FMU_OK;
}

SWP_FMU_API int swp_fmu_set_real(swp_fmu *fmu, const uint32_t *references, size_t count,
                                 const double *values) {
    int worst = fmu ? SWP_FMU_OK : SWP_FMU_ERROR;
    for (size_t i = 0; fmu && i < count; i++) {
        uint32_t r = references[i];
        int status;
        if (fmu_within(r, SWP_FMI_INPUT, SWP_FMI_INPUTS))
            status = fmu_set_input(fmu, r - SWP_FMI_INPUT, values[i]);
        else if (fmu_within(r, SWP_FMI_PARAMETER, SWP_PARAMETERS))
            status = fmu_set_parameter(fmu, (int)(r - SWP_FMI_PARAMETER), values[i]);
        else if (r == SWP_FMI_STEP)
            status = fmu_set_step(fmu, values[i]);
        else
            status = swp_fmu_fail(fmu, "no number of this value reference can be set");
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
        return swp_fmu_fail(fmu, "there is no Boolean of this value reference");
    return SWP_FMU_OK;
}

SWP_FMU_API int swp_fmu_set_boolean(swp_fmu *fmu, uint32_t reference, int value) {
    swp_memory *m = &fmu->memory;
    int before = 0;
    int status = swp_fmu_get_boolean(fmu, reference, &before);
    if (status != SWP_FMU_OK || before == !!value) return status;
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

SWP_FMU_API int swp_fmu_set_slope(swp_fmu *fmu, uint32_t reference, double slope) {
    if (!fmu_within(reference, SWP_FMI_INPUT, SWP_FMI_INPUTS))
        return swp_fmu_fail(fmu, "only inputs have derivatives");
    if (!isfinite(slope)) return fmu_refuse(fmu, "a derivative", "must be a finite number");
    uint32_t i = reference - SWP_FMI_INPUT;
    fmu->memory.slope[i] = slope;
    if (slope != 0.0) fmu->memory.given[i] = 1;
    return SWP_FMU_OK;
}

/* --- states ------------------------------------------------------------------------------------- */

SWP_FMU_API int swp_fmu_save(swp_fmu *fmu, void **state) {
    if (!fmu) return SWP_FMU_ERROR;
    if (!*state) *state = malloc(sizeof(swp_memory));
    if (!*state) return swp_fmu_fail(fmu, "there is no memory for a state");
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
    *size = STATE_SIZE;
    return fmu ? SWP_FMU_OK : SWP_FMU_ERROR;
}

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

SWP_FMU_API int swp_fmu_write(swp_fmu *fmu, const void *state, unsigned char *bytes, size_t size) {
    if (!fmu || !state || size < STATE_SIZE)
        return swp_fmu_fail(fmu, "there is no state, or no room for it");
    fmu_header(fmu, bytes);
    memcpy(bytes + STATE_HEADER, state, sizeof(swp_memory));
    return SWP_FMU_OK;
}

SWP_FMU_API int swp_fmu_read(swp_fmu *fmu, const unsigned char *bytes, size_t size, void **state) {
    unsigned char own[STATE_HEADER];
    if (!fmu) return SWP_FMU_ERROR;
    fmu_header(fmu, own);
    if (size != STATE_SIZE || memcmp(bytes, own, 16) != 0)
        return swp_fmu_fail(fmu, "this is no state of this library: its header or size is another");
    if (memcmp(bytes + 16, own + 16, 16) != 0)
        return swp_fmu_fail(fmu, "this state belongs to another set of numbers");
    void *made = malloc(sizeof(swp_memory));
    if (!made) return swp_fmu_fail(fmu, "there is no memory for a state");
    memcpy(made, bytes + STATE_HEADER, sizeof(swp_memory));
    *state = made;
    return SWP_FMU_OK;
}
