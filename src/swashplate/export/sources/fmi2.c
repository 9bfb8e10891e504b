/* FMI 2.0 for co-simulation: the names and types of the standard around fmi.c.
 *
 * Every function of the standard's header is here; what belongs to model exchange fails.
 */
#include "fmi2Functions.h"

#include "fmi.h"

#include <stdlib.h>
#include <string.h>

static void fmu_say2(const swp_fmu *fmu, int status, const char *message) {
    static const char *const categories[] = {"logAll", "logStatusWarning", "logStatusDiscard",
                                             "logStatusError", "logStatusFatal"};
    fmi2CallbackLogger logger = (fmi2CallbackLogger)fmu->log;
    if (logger)
        logger(fmu->environment, fmu->name ? fmu->name : "", (fmi2Status)status, categories[status],
               message);
}

static int fmu_digit(char c) {
    if (c >= '0' && c <= '9') return c - '0';
    if (c >= 'a' && c <= 'f') return c - 'a' + 10;
    if (c >= 'A' && c <= 'F') return c - 'A' + 10;
    return -1;
}

/* The folder of a URI such as file:///C:/Temp/a%20b/resources, or a path as it is. */
static char *fmu_folder_of(const char *uri) {
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
        if (*c == '%' && fmu_digit(c[1]) >= 0 && fmu_digit(c[2]) >= 0) {
            *to++ = (char)(16 * fmu_digit(c[1]) + fmu_digit(c[2]));
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
    char *folder = fmu_folder_of(fmuResourceLocation);
    void *environment = functions ? functions->componentEnvironment : NULL;
    swp_fmu_callback *log = functions ? (swp_fmu_callback *)functions->logger : NULL;
    swp_fmu *fmu = swp_fmu_new(instanceName, fmuGUID, folder, fmu_say2, environment, log);
    free(folder);
    return fmu;
}

void fmi2FreeInstance(fmi2Component c) { swp_fmu_free(c); }

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean toleranceDefined, fmi2Real tolerance,
                               fmi2Real startTime, fmi2Boolean stopTimeDefined, fmi2Real stopTime) {
    (void)toleranceDefined, (void)tolerance;
    return (fmi2Status)swp_fmu_setup(c, startTime, stopTimeDefined, stopTime);
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
    return (fmi2Status)swp_fmu_begin(c);
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
    return (fmi2Status)swp_fmu_ready(c);
}

fmi2Status fmi2Terminate(fmi2Component c) { return (fmi2Status)swp_fmu_end(c); }
fmi2Status fmi2Reset(fmi2Component c) { return (fmi2Status)swp_fmu_reset(c); }

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                       fmi2Real value[]) {
    return (fmi2Status)swp_fmu_get_real(c, vr, nvr, value);
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                       const fmi2Real value[]) {
    return (fmi2Status)swp_fmu_set_real(c, vr, nvr, value);
}

fmi2Status fmi2GetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                          fmi2Boolean value[]) {
    SWP_FMU_GET_BOOLEANS(fmi2Status, c, vr, nvr, value);
}

fmi2Status fmi2SetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                          const fmi2Boolean value[]) {
    SWP_FMU_SET_BOOLEANS(fmi2Status, c, vr, nvr, value);
}

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *FMUstate) {
    return (fmi2Status)swp_fmu_save(c, FMUstate);
}
fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate FMUstate) {
    return (fmi2Status)swp_fmu_restore(c, FMUstate);
}
fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *FMUstate) {
    return (fmi2Status)swp_fmu_forget(c, FMUstate);
}
fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate FMUstate, size_t *size) {
    (void)FMUstate;
    return (fmi2Status)swp_fmu_bytes(c, size);
}
fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate FMUstate, fmi2Byte bytes[],
                                 size_t size) {
    return (fmi2Status)swp_fmu_write(c, FMUstate, (unsigned char *)bytes, size);
}
fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte serializedState[], size_t size,
                                   fmi2FMUstate *FMUstate) {
    const unsigned char *bytes = (const unsigned char *)serializedState;
    return (fmi2Status)swp_fmu_read(c, bytes, size, FMUstate);
}

fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                                       const fmi2Integer order[], const fmi2Real value[]) {
    int status = c ? SWP_FMU_OK : SWP_FMU_ERROR;
    if (nvr > 0 && (!vr || !order || !value)) status = swp_fmu_missing(c);
    for (size_t i = 0; i < nvr && status == SWP_FMU_OK; i++)
        status = order[i] == 1 ? swp_fmu_set_slope(c, vr[i], value[i])
                               : swp_fmu_fail(c, "inputs have first derivatives only");
    return (fmi2Status)status;
}
fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                                        const fmi2Integer order[], fmi2Real value[]) {
    (void)vr, (void)order, (void)value;
    return (fmi2Status)swp_fmu_none(c, nvr);
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real currentCommunicationPoint,
                      fmi2Real communicationStepSize,
                      fmi2Boolean noSetFMUStatePriorToCurrentPoint) {
    (void)noSetFMUStatePriorToCurrentPoint;
    return (fmi2Status)swp_fmu_advance(c, currentCommunicationPoint, communicationStepSize);
}
fmi2Status fmi2CancelStep(fmi2Component c) {
    return (fmi2Status)swp_fmu_fail(c, "a step ends before it could be canceled");
}

fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind s, fmi2Status *value) {
    (void)s;
    if (!value) return (fmi2Status)swp_fmu_missing(c);
    *value = fmi2OK; /* no step is ever pending */
    return c ? fmi2OK : fmi2Error;
}
fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind s, fmi2Real *value) {
    const swp_fmu *fmu = c;
    if (!fmu || !value || s != fmi2LastSuccessfulTime) return fmi2Discard;
    *value = fmu->memory.now;
    return fmi2OK;
}
fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind s, fmi2Integer *value) {
    (void)c, (void)s, (void)value;
    return fmi2Discard;
}
fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind s, fmi2Boolean *value) {
    const swp_fmu *fmu = c;
    if (!fmu || !value || s != fmi2Terminated) return fmi2Discard;
    *value = fmu->memory.mode == SWP_FMU_FAILED;
    return fmi2OK;
}
fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind s, fmi2String *value) {
    (void)c, (void)s, (void)value;
    return fmi2Discard;
}

/* --- what the model does not have: some tools want it to be there all the same ------------------- */

#if defined(__GNUC__) /* nothing below looks at what it is given */
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif

#define WITHOUT(NAME, ...)                             \
    fmi2Status NAME(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, __VA_ARGS__) { \
        return (fmi2Status)swp_fmu_none(c, nvr);       \
    }
WITHOUT(fmi2GetInteger, fmi2Integer value[])
WITHOUT(fmi2SetInteger, const fmi2Integer value[])
WITHOUT(fmi2GetString, fmi2String value[])
WITHOUT(fmi2SetString, const fmi2String value[])

#define ABSENT(NAME, ...)                                                             \
    fmi2Status NAME(__VA_ARGS__) {                                                    \
        return (fmi2Status)swp_fmu_fail(c, "the FMU is for co-simulation alone, without "  \
                                           "directional derivatives");                \
    }
ABSENT(fmi2GetDirectionalDerivative, fmi2Component c, const fmi2ValueReference unknowns[],
       size_t nUnknown, const fmi2ValueReference knowns[], size_t nKnown, const fmi2Real seed[],
       fmi2Real sensitivity[])
ABSENT(fmi2EnterEventMode, fmi2Component c)
ABSENT(fmi2NewDiscreteStates, fmi2Component c, fmi2EventInfo *info)
ABSENT(fmi2EnterContinuousTimeMode, fmi2Component c)
ABSENT(fmi2CompletedIntegratorStep, fmi2Component c, fmi2Boolean noSetFMUStatePriorToCurrentPoint,
       fmi2Boolean *enterEventMode, fmi2Boolean *terminateSimulation)
ABSENT(fmi2SetTime, fmi2Component c, fmi2Real time)
ABSENT(fmi2SetContinuousStates, fmi2Component c, const fmi2Real x[], size_t nx)
ABSENT(fmi2GetDerivatives, fmi2Component c, fmi2Real derivatives[], size_t nx)
ABSENT(fmi2GetEventIndicators, fmi2Component c, fmi2Real indicators[], size_t ni)
ABSENT(fmi2GetContinuousStates, fmi2Component c, fmi2Real x[], size_t nx)
ABSENT(fmi2GetNominalsOfContinuousStates, fmi2Component c, fmi2Real nominals[], size_t nx)
