/* Random calls of an FMU in any order, with odd arguments and damaged states, under sanitizers.
 *
 *     fuzz RESOURCES TOKEN SEED SECONDS
 *
 * Compiled with -DFMI=2 or 3 together with the FMU's one unit of source, fmu.c, so that it sees the
 * instance's memory. Round n draws from the seed SEED + n: a finding comes back at once from its own
 * seed. Findings are an output that is not finite after a call that answered OK, a damaged state that
 * was accepted, and a call that does not return; for all else the sanitizers stop the program.
 */
#include "fmu.c"

#include <signal.h>
#include <stdio.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

#define CALLS 60 /* of a round */
#define STATES 3 /* kept in a round */
#define PATIENCE 15 /* seconds of the processor that a call may take */

static const char *resources, *token;
static uint64_t seed, random_state;
static long calls, rounds, steps, messages, damaged, refused, forged, accepted;

/* --- chance ------------------------------------------------------------------------------------- */

static uint64_t draw(void) /* splitmix64 */
{
    uint64_t z = (random_state += 0x9e3779b97f4a7c15u);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
}

static unsigned below(unsigned count) { return (unsigned)(draw() % count); }

static bool once_in(unsigned count) { return below(count) == 0; }

static double uniform(void) { return (double)(draw() >> 11) * 0x1p-53; }

static double odd_number(void)
{
    static const double numbers[] = {
        0.0,   -0.0,   1.0,    -1.0,  9.0,   10.0000001, 1e-9,   1e3,      1e9,       1e30, 1e150,
        1e308, -1e308, 5e-324, 2e-16, -12.0, 1800.0,     1e-300, HUGE_VAL, -HUGE_VAL, NAN};
    return numbers[below(sizeof numbers / sizeof *numbers)];
}

static double any_number(void) { return once_in(4) ? odd_number() : 20.0 * uniform() - 10.0; }

/* --- the two versions of the standard ------------------------------------------------------------ */

#if FMI == 2

static void log_message(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status,
                        fmi2String category, fmi2String message, ...)
{
    (void)environment, (void)name, (void)status, (void)category;
    messages += strlen(message) > 0; /* reads all of it */
}

static const fmi2CallbackFunctions callbacks = {log_message, calloc, free, NULL, NULL};

static void *instantiate(const char *guid, const char *folder)
{
    return fmi2Instantiate("fuzz", fmi2CoSimulation, guid, folder, &callbacks, 0, 1);
}

static int setup(void *fmu, double start, bool ends, double stop)
{
    return (int)fmi2SetupExperiment(fmu, 0, 0.0, start, ends, stop);
}

static int initialize(void *fmu, double start, bool ends, double stop)
{
    const int status = setup(fmu, start, ends, stop);
    return status == SWP_FMU_OK ? (int)fmi2EnterInitializationMode(fmu) : status;
}

static int set_real(void *fmu, const uint32_t *references, size_t count, const double *values)
{
    return (int)fmi2SetReal(fmu, references, count, values);
}

static int get_real(void *fmu, const uint32_t *references, size_t count, double *values)
{
    return (int)fmi2GetReal(fmu, references, count, values);
}

static void set_and_get_boolean(void *fmu, uint32_t reference)
{
    int on = (int)below(3) - 1;
    (void)fmi2SetBoolean(fmu, &reference, 1, &on);
    (void)fmi2GetBoolean(fmu, &reference, 1, &on);
}

static void set_derivative(void *fmu, uint32_t reference, double slope)
{
    const int order = once_in(8) ? 2 : 1;
    (void)fmi2SetRealInputDerivatives(fmu, &reference, 1, &order, &slope);
}

static int do_step(void *fmu, double time, double interval)
{
    return (int)fmi2DoStep(fmu, time, interval, 1);
}

static int state_size(void *fmu, void *state, size_t *size)
{
    return (int)fmi2SerializedFMUstateSize(fmu, state, size);
}

static int serialize(void *fmu, void *state, unsigned char *bytes, size_t size)
{
    return (int)fmi2SerializeFMUstate(fmu, state, (char *)bytes, size);
}

static int deserialize(void *fmu, const unsigned char *bytes, size_t size, void **state)
{
    return (int)fmi2DeSerializeFMUstate(fmu, (const char *)bytes, size, state);
}

static void call_the_rest(void *fmu)
{
    fmi2Status status;
    double time;
    int on;
    (void)fmi2GetStatus(fmu, fmi2DoStepStatus, &status);
    (void)fmi2GetRealStatus(fmu, fmi2LastSuccessfulTime, &time);
    (void)fmi2GetBooleanStatus(fmu, fmi2Terminated, &on);
    (void)fmi2GetStatus(fmu, fmi2DoStepStatus, NULL);
    (void)fmi2CancelStep(fmu);
    (void)fmi2SetTime(fmu, odd_number());
    (void)fmi2GetInteger(fmu, NULL, below(2), NULL);
    (void)fmi2SetDebugLogging(fmu, 1, 0, NULL);
    (void)fmi2SetRealInputDerivatives(fmu, NULL, below(2), NULL, NULL);
}

#define free_instance fmi2FreeInstance
#define end_initialization (int)fmi2ExitInitializationMode
#define terminate (int)fmi2Terminate
#define reset (int)fmi2Reset
#define save_state (int)fmi2GetFMUstate
#define restore_state (int)fmi2SetFMUstate
#define free_state (int)fmi2FreeFMUstate

#else

static void log_message(fmi3InstanceEnvironment environment, fmi3Status status, fmi3String category,
                        fmi3String message)
{
    (void)environment, (void)status, (void)category;
    messages += strlen(message) > 0;
}

static void *instantiate(const char *guid, const char *folder)
{
    return fmi3InstantiateCoSimulation("fuzz", guid, folder, false, true, once_in(4), false, NULL, 0,
                                       NULL, log_message, NULL);
}

static int initialize(void *fmu, double start, bool ends, double stop)
{
    return (int)fmi3EnterInitializationMode(fmu, ends, stop, start, ends, stop);
}

static int setup(void *fmu, double start, bool ends, double stop)
{
    return initialize(fmu, start, ends, stop);
}

static int set_real(void *fmu, const uint32_t *references, size_t count, const double *values)
{
    return (int)fmi3SetFloat64(fmu, references, count, values, count);
}

static int get_real(void *fmu, const uint32_t *references, size_t count, double *values)
{
    return (int)fmi3GetFloat64(fmu, references, count, values, count);
}

static void set_and_get_boolean(void *fmu, uint32_t reference)
{
    bool on = below(2) != 0;
    (void)fmi3SetBoolean(fmu, &reference, 1, &on, 1);
    (void)fmi3GetBoolean(fmu, &reference, 1, &on, 1);
}

static void set_derivative(void *fmu, uint32_t reference, double slope) /* FMI 3 has none */
{
    (void)fmi3SetFloat64(fmu, &reference, 2, &slope, 1);
}

static int do_step(void *fmu, double time, double interval)
{
    bool event, end, early;
    double last;
    if (once_in(8)) return (int)fmi3DoStep(fmu, time, interval, true, NULL, NULL, NULL, NULL);
    return (int)fmi3DoStep(fmu, time, interval, true, &event, &end, &early, &last);
}

static int state_size(void *fmu, void *state, size_t *size)
{
    return (int)fmi3SerializedFMUStateSize(fmu, state, size);
}

static int serialize(void *fmu, void *state, unsigned char *bytes, size_t size)
{
    return (int)fmi3SerializeFMUState(fmu, state, bytes, size);
}

static int deserialize(void *fmu, const unsigned char *bytes, size_t size, void **state)
{
    return (int)fmi3DeserializeFMUState(fmu, bytes, size, state);
}

static void call_the_rest(void *fmu)
{
    size_t count;
    (void)fmi3EnterEventMode(fmu);
    (void)fmi3EnterStepMode(fmu);
    (void)fmi3GetNumberOfContinuousStates(fmu, &count);
    (void)fmi3GetInt32(fmu, NULL, below(2), NULL, 0);
    (void)fmi3SetTime(fmu, odd_number());
    (void)fmi3SetDebugLogging(fmu, true, 0, NULL);
}

#define free_instance fmi3FreeInstance
#define end_initialization (int)fmi3ExitInitializationMode
#define terminate (int)fmi3Terminate
#define reset (int)fmi3Reset
#define save_state (int)fmi3GetFMUState
#define restore_state (int)fmi3SetFMUState
#define free_state (int)fmi3FreeFMUState

#endif

/* --- findings ------------------------------------------------------------------------------------ */

static void report(const char *finding)
{
    printf("finding at seed %llu: %s\n", (unsigned long long)seed, finding);
    fflush(stdout);
    _exit(1);
}

static void on_timer(int number)
{
    (void)number;
    report("a call does not return"); /* nothing else prints while a call runs */
}

static void check_outputs(void *fmu)
{
    uint32_t references[SWP_OUTPUTS];
    double values[SWP_OUTPUTS];
    for (uint32_t i = 0; i < SWP_OUTPUTS; i++) references[i] = SWP_FMI_OUTPUT + i;
    if (get_real(fmu, references, SWP_OUTPUTS, values) != SWP_FMU_OK) return;
    for (int i = 0; i < SWP_OUTPUTS; i++)
        if (!isfinite(values[i])) report("an output is not finite after OK");
}

/* --- a round ------------------------------------------------------------------------------------- */

static uint32_t any_reference(void)
{
    switch (below(5)) {
    case 0:
        return SWP_FMI_INPUT + below(SWP_FMI_INPUTS);
    case 1:
        return SWP_FMI_PARAMETER + below(SWP_PARAMETERS);
    case 2:
        return below(2) ? SWP_FMI_STEP : SWP_FMI_TIME;
    case 3:
        return SWP_FMI_OUTPUT + below(SWP_OUTPUTS + 2);
    default:
        return (uint32_t)draw();
    }
}

/* A value near the one that the variable has, or any. */
static void set_any(void *fmu)
{
    uint32_t reference = any_reference();
    double value = any_number();
    if (below(2) && get_real(fmu, &reference, 1, &value) == SWP_FMU_OK) value *= 0.5 + uniform();
    (void)set_real(fmu, &reference, 1, &value);
    if (once_in(20)) (void)set_real(fmu, NULL, below(3), &value);
    if (once_in(20)) (void)get_real(fmu, &reference, 1, NULL);
}

/* Serialize a state, flip up to four of its bits, read it back, and go on from it if it was taken.
 * Half of the changed bodies get the right hash, as from somebody who means harm: such a state may be
 * accepted, but must not lead out of the memory. */
static void damage(void *fmu, void *other, void **states)
{
    static unsigned char bytes[1 << 16], before[1 << 16];
    void *state = NULL;
    size_t size = 0;
    if (save_state(fmu, &state) != SWP_FMU_OK) return;
    if (state_size(fmu, state, &size) != SWP_FMU_OK || size > sizeof bytes) report("a state's size");
    if (serialize(fmu, state, bytes, size) != SWP_FMU_OK) report("a state that is not serialized");
    (void)free_state(fmu, &state);
    memcpy(before, bytes, size);
    for (unsigned flips = below(5); flips > 0; flips--) {
        size_t at = below((unsigned)size);
        if (once_in(4)) at = below(64);                                 /* in the header */
        if (once_in(4)) at = size - 1 - below(512);                     /* modes, what was set */
        if (once_in(4)) at = STATE_HEADER + sizeof(swp_model) - 1 - below(64); /* newest, flags */
        bytes[at] ^= (unsigned char)(1u << below(8));
    }
    const bool changed = memcmp(before, bytes, size) != 0;
    bool forgery = false;
    if (changed && below(2) && memcmp(before, bytes, STATE_HASH) == 0) {
        const uint64_t hash = fmu_hash_of(bytes + STATE_HEADER, size - STATE_HEADER);
        memcpy(bytes + STATE_HASH, &hash, sizeof hash);
        forgery = true;
    }
    const int status = deserialize(other, bytes, once_in(50) ? size - below(40) : size, &state);
    if (changed && !forgery) {
        damaged++;
        refused += status != SWP_FMU_OK;
        if (status == SWP_FMU_OK) report("a damaged state was accepted");
    }
    forged += forgery;
    if (status != SWP_FMU_OK) return;
    accepted += forgery;
    void **place = &states[below(STATES)];
    (void)free_state(other, place);
    *place = state;
    if (below(2)) (void)restore_state(other, state);
}

static void step_on(void *fmu, double *time, double step)
{
    double interval = once_in(3) ? 0.02 * uniform() : step * (double)below(40);
    if (once_in(9)) interval = odd_number();
    if (do_step(fmu, once_in(12) ? odd_number() : *time, interval) != SWP_FMU_OK) return;
    *time += interval;
    steps++;
}

static void call_any(void *fmu, void *other, void **states, double *time, double step)
{
    calls++;
    switch (below(16)) {
    case 0:
        if (below(3))
            (void)initialize(fmu, below(3) ? *time : odd_number(), below(2) != 0, any_number());
        else
            (void)setup(fmu, odd_number(), below(2) != 0, odd_number());
        break;
    case 1:
        (void)end_initialization(fmu);
        break;
    case 2:
    case 3:
    case 4:
        set_any(fmu);
        break;
    case 5:
        set_and_get_boolean(fmu, below(4) ? SWP_FMI_OPTION + below(SWP_OPTIONS + 1)
                                          : SWP_FMI_START_STEADY + below(3));
        break;
    case 6:
        set_derivative(fmu, below(4) ? SWP_FMI_INPUT + below(SWP_FMI_INPUTS) : any_reference(),
                       1e3 * any_number());
        break;
    case 7:
        if (once_in(4)) (void)terminate(fmu);
        break;
    case 8:
        if (once_in(3)) (void)reset(fmu);
        break;
    case 9:
        (void)save_state(fmu, &states[below(STATES)]);
        break;
    case 10:
        (void)restore_state(below(2) ? fmu : other, states[below(STATES)]);
        break;
    case 11:
        damage(fmu, other, states);
        break;
    case 12:
        call_the_rest(once_in(9) ? NULL : fmu);
        break;
    default:
        step_on(fmu, time, step);
        break;
    }
    check_outputs(fmu);
}

static void play_round(void)
{
    void *instances[2], *states[STATES] = {NULL};
    double times[2] = {0.0, 0.0};
    random_state = seed;
    for (int i = 0; i < 2; i++) {
        instances[i] = instantiate(token, resources);
        if (!instances[i]) report("no instance was made");
    }
    if (once_in(50)) free_instance(instantiate(NULL, below(2) ? resources : "file:///%zz%4"));
    for (int i = 0; i < 2; i++) {
        if (once_in(6)) continue; /* whatever comes begins with this one before initialization */
        (void)initialize(instances[i], 0.0, false, 0.0);
        for (unsigned k = below(4); k > 0; k--) set_any(instances[i]);
        (void)end_initialization(instances[i]);
    }
    const struct itimerval patience = {{0, 0}, {PATIENCE, 0}};
    const double step = ((swp_fmu *)instances[0])->memory.step;
    for (int n = 0; n < CALLS; n++) {
        const int i = (int)below(2);
        setitimer(ITIMER_VIRTUAL, &patience, NULL);
        if (below(8)) times[i] = ((swp_fmu *)instances[i])->memory.now;
        call_any(instances[i], instances[1 - i], states, &times[i], step);
    }
    for (int k = 0; k < STATES; k++) (void)free_state(instances[0], &states[k]);
    for (int i = 0; i < 2; i++) free_instance(instances[i]);
    rounds++;
}

int main(int count, char **words)
{
    if (count != 5) return 2;
    resources = words[1];
    token = words[2];
    const uint64_t first = strtoull(words[3], NULL, 10);
    const double seconds = atof(words[4]);
    signal(SIGVTALRM, on_timer);
    do {
        seed = first + (uint64_t)rounds;
        play_round();
    } while ((double)clock() < seconds * (double)CLOCKS_PER_SEC);
    printf("%ld calls of %ld instances, %ld steps, %ld messages; %ld of %ld damaged states refused, "
           "%ld of %ld forged ones accepted\n",
           calls, 2 * rounds, steps, messages, refused, damaged, accepted, forged);
    return 0;
}
