/* FMI 2.0 for co-simulation: the names and types of the standard around fmi.c.
 *
 * Every function of the standard's header is here; what belongs to model exchange fails.
 */
#include "fmi2Functions.h"

#include "fmi.h"

#include <stdlib.h>
#include <string.h>

static void say2(const swp_fmu *fmu, int status, const char *message) {
    static const char *const categories[] = {"logAll", "logStatusWarning", "logStatusDiscard",
                                             "logStatusError", "logStatusFatal"};
    fmi2CallbackLogger logger = (fmi2CallbackLogger)fmu->log;
    if (logger)
        logger(fmu->environment, fmu->name ? fmu->name : "", (fmi2Status)status, categories[status],
               message);
}

static int digit(char c) {
    if (c >= '0' && c <= '9') return c - '0';
    if (c >= 'a' && c <= 'f') return c - 'a' + 10;
    if (c >= 'A' && c <= 'F') return c - 'A' + 10;
    return -1;
}

/* The folder of a URI such as file:///C:/Temp/a%20b/resources, or a path as it is. */
static char *folder_of(const char *uri) {
    if (!uri) return NULL;
    if (strncmp(uri, "file:", 5) == 0) {
        uri += 5;
        if (strncmp(uri, "//localhost/", 12) == 0) uri += 11;
        if (strncmp(uri, "///", 3) == 0) uri += 2;
        /* a drive letter stands behind a slash */
        if (uri[0] == '/' && uri[1] && (uri[2] == ':' || uri[2] == '|')) uri++;
    }
    char *made = malloc(strlen(uri) + 1);
    char *to = made;
    if (!made) return NULL;
    for (const char *c = uri; *c; c++) {
        if (*c == '%' && digit(c[1]) >= 0 && digit(c[2]) >= 0) {
            *to++ = (char)(16 * digit(c[1]) + digit(c[2]));
            c += 2;
        } else {
            *to++ = *c;
        }
    }
    *to = '\0';
    return made;
}

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char *fmi2GetVersion(void) { return fmi2Version; }

fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean loggingOn, size_t nCategories,
                               const fmi2String categories[]) {
    (void)loggingOn, (void)nCategories, (void)categories; /* warnings and errors are always said */
    return c ? fmi2OK : fmi2Error;
}

fmi2Component fmi2Instantiate(fmi2String instanceName, fmi2Type fmuType, fmi2String fmuGUID,
                              fmi2String fmuResourceLocation,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible,
                              fmi2Boolean loggingOn) {
    (void)visible, (void)loggingOn;
    if (fmuType != fmi2CoSimulation) return NULL;
    char *folder = folder_of(fmuResourceLocation);
    void *environment = functions ? functions->componentEnvironment : NULL;
    swp_fmu_callback *log = functions ? (swp_fmu_callback *)functions->logger : NULL;
    swp_fmu *fmu = swp_fmu_new(instanceName, fmuGUID, folder, say2, environment, log);
    free(folder);
    return fmu;
}

void fmi2FreeInstance(fmi2Component c) { swp_fmu_free(c); }

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean toleranceDefined, fmi2Real tolerance,
                               fmi2Real startTime, fmi2Boolean stopTimeDefined, fmi2Real stopTime) {
    swp_fmu *fmu = c;
    (void)toleranceDefined, (void)tolerance, (void)stopTimeDefined, (void)stopTime;
    if (!fmu) return fmi2Error;
    fmu->memory.start = startTime;
    return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
    swp_fmu *fmu = c;
    return fmu ? (fmi2Status)swp_fmu_begin(fmu, fmu->memory.start) : fmi2Error;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
    return c ? (fmi2Status)swp_fmu_ready(c) : fmi2Error;
}

fmi2Status fmi2Terminate(fmi2Component c) { return c ? fmi2OK : fmi2Error; }
fmi2Status fmi2Reset(fmi2Component c) { return c ? (fmi2Status)swp_fmu_reset(c) : fmi2Error; }

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                       fmi2Real value[]) {
    return c ? (fmi2Status)swp_fmu_get_real(c, vr, nvr, value) : fmi2Error;
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                       const fmi2Real value[]) {
    return c ? (fmi2Status)swp_fmu_set_real(c, vr, nvr, value) : fmi2Error;
}

fmi2Status fmi2GetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                          fmi2Boolean value[]) {
    int status = c ? SWP_FMU_OK : SWP_FMU_ERROR;
    for (size_t i = 0; i < nvr && status == SWP_FMU_OK; i++)
        status = swp_fmu_get_boolean(c, vr[i], &value[i]);
    return (fmi2Status)status;
}

fmi2Status fmi2SetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                          const fmi2Boolean value[]) {
    int status = c ? SWP_FMU_OK : SWP_FMU_ERROR;
    for (size_t i = 0; i < nvr && status == SWP_FMU_OK; i++)
        status = swp_fmu_set_boolean(c, vr[i], value[i]);
    return (fmi2Status)status;
}

/* No variable is of these types: an empty list is fine. */
static fmi2Status none(fmi2Component c, size_t count, const char *what) {
    if (!c) return fmi2Error;
    return count == 0 ? fmi2OK : (fmi2Status)swp_fmu_fail(c, what);
}

fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                          fmi2Integer value[]) {
    (void)vr, (void)value;
    return none(c, nvr, "there are no Integer variables");
}
fmi2Status fmi2SetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                          const fmi2Integer value[]) {
    (void)vr, (void)value;
    return none(c, nvr, "there are no Integer variables");
}
fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                         fmi2String value[]) {
    (void)vr, (void)value;
    return none(c, nvr, "there are no String variables");
}
fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                         const fmi2String value[]) {
    (void)vr, (void)value;
    return none(c, nvr, "there are no String variables");
}

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *FMUstate) {
    return c ? (fmi2Status)swp_fmu_save(c, FMUstate) : fmi2Error;
}
fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate FMUstate) {
    return c ? (fmi2Status)swp_fmu_restore(c, FMUstate) : fmi2Error;
}
fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *FMUstate) {
    return c ? (fmi2Status)swp_fmu_forget(FMUstate) : fmi2Error;
}
fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate FMUstate, size_t *size) {
    (void)FMUstate;
    *size = swp_fmu_bytes();
    return c ? fmi2OK : fmi2Error;
}
fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate FMUstate, fmi2Byte bytes[],
                                 size_t size) {
    return c ? (fmi2Status)swp_fmu_write(c, FMUstate, (unsigned char *)bytes, size) : fmi2Error;
}
fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte serializedState[], size_t size,
                                   fmi2FMUstate *FMUstate) {
    const unsigned char *bytes = (const unsigned char *)serializedState;
    return c ? (fmi2Status)swp_fmu_read(c, bytes, size, FMUstate) : fmi2Error;
}

fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                                       const fmi2Integer order[], const fmi2Real value[]) {
    int status = c ? SWP_FMU_OK : SWP_FMU_ERROR;
    for (size_t i = 0; i < nvr && status == SWP_FMU_OK; i++)
        status = order[i] == 1 ? swp_fmu_set_slope(c, vr[i], value[i])
                               : swp_fmu_fail(c, "inputs have first derivatives only");
    return (fmi2Status)status;
}
fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                                        const fmi2Integer order[], fmi2Real value[]) {
    (void)vr, (void)order, (void)value;
    return none(c, nvr, "outputs have no derivatives");
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real currentCommunicationPoint,
                      fmi2Real communicationStepSize,
                      fmi2Boolean noSetFMUStatePriorToCurrentPoint) {
    (void)noSetFMUStatePriorToCurrentPoint;
    return c ? (fmi2Status)swp_fmu_advance(c, currentCommunicationPoint, communicationStepSize)
             : fmi2Error;
}
fmi2Status fmi2CancelStep(fmi2Component c) {
    return c ? (fmi2Status)swp_fmu_fail(c, "a step ends before it could be canceled") : fmi2Error;
}

fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind s, fmi2Status *value) {
    (void)s;
    *value = fmi2OK; /* no step is ever pending */
    return c ? fmi2OK : fmi2Error;
}
fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind s, fmi2Real *value) {
    const swp_fmu *fmu = c;
    if (!fmu || s != fmi2LastSuccessfulTime) return fmi2Discard;
    *value = fmu->memory.now;
    return fmi2OK;
}
fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind s, fmi2Integer *value) {
    (void)c, (void)s, (void)value;
    return fmi2Discard;
}
fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind s, fmi2Boolean *value) {
    const swp_fmu *fmu = c;
    if (!fmu || s != fmi2Terminated) return fmi2Discard;
    *value = fmu->memory.mode == SWP_FMU_FAILED;
    return fmi2OK;
}
fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind s, fmi2String *value) {
    (void)c, (void)s, (void)value;
    return fmi2Discard;
}

/* --- what the drive does not have: some tools want it to be there all the same ------------------- */

static fmi2Status exchange(fmi2Component c) {
    return c ? (fmi2Status)swp_fmu_fail(c, "the FMU is for co-simulation alone") : fmi2Error;
}

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference vUnknown_ref[],
                                        size_t nUnknown, const fmi2ValueReference vKnown_ref[],
                                        size_t nKnown, const fmi2Real dvKnown[],
                                        fmi2Real dvUnknown[]) {
    (void)vUnknown_ref, (void)nUnknown, (void)vKnown_ref, (void)nKnown, (void)dvKnown;
    (void)dvUnknown;
    return c ? (fmi2Status)swp_fmu_fail(c, "there are no directional derivatives") : fmi2Error;
}
fmi2Status fmi2EnterEventMode(fmi2Component c) { return exchange(c); }
fmi2Status fmi2NewDiscreteStates(fmi2Component c, fmi2EventInfo *info) {
    (void)info;
    return exchange(c);
}
fmi2Status fmi2EnterContinuousTimeMode(fmi2Component c) { return exchange(c); }
fmi2Status fmi2CompletedIntegratorStep(fmi2Component c,
                                       fmi2Boolean noSetFMUStatePriorToCurrentPoint,
                                       fmi2Boolean *enterEventMode,
                                       fmi2Boolean *terminateSimulation) {
    (void)noSetFMUStatePriorToCurrentPoint, (void)enterEventMode, (void)terminateSimulation;
    return exchange(c);
}
fmi2Status fmi2SetTime(fmi2Component c, fmi2Real time) {
    (void)time;
    return exchange(c);
}
fmi2Status fmi2SetContinuousStates(fmi2Component c, const fmi2Real x[], size_t nx) {
    (void)x, (void)nx;
    return exchange(c);
}
fmi2Status fmi2GetDerivatives(fmi2Component c, fmi2Real derivatives[], size_t nx) {
    (void)derivatives, (void)nx;
    return exchange(c);
}
fmi2Status fmi2GetEventIndicators(fmi2Component c, fmi2Real eventIndicators[], size_t ni) {
    (void)eventIndicators, (void)ni;
    return exchange(c);
}
fmi2Status fmi2GetContinuousStates(fmi2Component c, fmi2Real x[], size_t nx) {
    (void)x, (void)nx;
    return exchange(c);
}
fmi2Status fmi2GetNominalsOfContinuousStates(fmi2Component c, fmi2Real x_nominal[], size_t nx) {
    (void)x_nominal, (void)nx;
    return exchange(c);
}
