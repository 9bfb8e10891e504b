/* FMI 3.0 for co-simulation: the names and types of the standard around fmi.c.
 *
 * Every function of the standard's header is here, those of model exchange, scheduled execution and
 * clocks too: importers look all of them up. What the drive does not have fails.
 */
#include "fmi3Functions.h"

#include "fmi.h"

#include <string.h>

static void fmu_say3(const swp_fmu *fmu, int status, const char *message) {
    static const char *const categories[] = {"logAll", "logStatusWarning", "logStatusDiscard",
                                             "logStatusError", "logStatusFatal"};
    fmi3LogMessageCallback log = (fmi3LogMessageCallback)fmu->log;
    if (log) log(fmu->environment, (fmi3Status)status, categories[status], message);
}

const char *fmi3GetVersion(void) { return fmi3Version; }

fmi3Status fmi3SetDebugLogging(fmi3Instance instance, fmi3Boolean loggingOn, size_t nCategories,
                               const fmi3String categories[]) {
    (void)loggingOn, (void)nCategories, (void)categories; /* warnings and errors are always said */
    return instance ? fmi3OK : fmi3Error;
}

/* --- life --------------------------------------------------------------------------------------- */

fmi3Instance fmi3InstantiateCoSimulation(
    fmi3String instanceName, fmi3String instantiationToken, fmi3String resourcePath,
    fmi3Boolean visible, fmi3Boolean loggingOn, fmi3Boolean eventModeUsed,
    fmi3Boolean earlyReturnAllowed, const fmi3ValueReference requiredIntermediateVariables[],
    size_t nRequiredIntermediateVariables, fmi3InstanceEnvironment instanceEnvironment,
    fmi3LogMessageCallback logMessage, fmi3IntermediateUpdateCallback intermediateUpdate) {
    (void)visible, (void)loggingOn, (void)eventModeUsed, (void)earlyReturnAllowed;
    (void)requiredIntermediateVariables, (void)nRequiredIntermediateVariables;
    (void)intermediateUpdate;
    return swp_fmu_new(instanceName, instantiationToken, resourcePath, fmu_say3, instanceEnvironment,
                       (swp_fmu_callback *)logMessage);
}

fmi3Instance fmi3InstantiateModelExchange(fmi3String instanceName, fmi3String instantiationToken,
                                          fmi3String resourcePath, fmi3Boolean visible,
                                          fmi3Boolean loggingOn,
                                          fmi3InstanceEnvironment instanceEnvironment,
                                          fmi3LogMessageCallback logMessage) {
    (void)instanceName, (void)instantiationToken, (void)resourcePath, (void)visible;
    (void)loggingOn;
    if (logMessage)
        logMessage(instanceEnvironment, fmi3Error, "logStatusError",
                   "the FMU is for co-simulation alone");
    return NULL;
}

fmi3Instance fmi3InstantiateScheduledExecution(
    fmi3String instanceName, fmi3String instantiationToken, fmi3String resourcePath,
    fmi3Boolean visible, fmi3Boolean loggingOn, fmi3InstanceEnvironment instanceEnvironment,
    fmi3LogMessageCallback logMessage, fmi3ClockUpdateCallback clockUpdate,
    fmi3LockPreemptionCallback lockPreemption, fmi3UnlockPreemptionCallback unlockPreemption) {
    (void)clockUpdate, (void)lockPreemption, (void)unlockPreemption;
    return fmi3InstantiateModelExchange(instanceName, instantiationToken, resourcePath, visible,
                                        loggingOn, instanceEnvironment, logMessage);
}

void fmi3FreeInstance(fmi3Instance instance) { swp_fmu_free(instance); }

fmi3Status fmi3EnterInitializationMode(fmi3Instance instance, fmi3Boolean toleranceDefined,
                                       fmi3Float64 tolerance, fmi3Float64 startTime,
                                       fmi3Boolean stopTimeDefined, fmi3Float64 stopTime) {
    (void)toleranceDefined, (void)tolerance;
    int status = swp_fmu_setup(instance, startTime, stopTimeDefined, stopTime);
    return (fmi3Status)(status == SWP_FMU_OK ? swp_fmu_begin(instance) : status);
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance instance) {
    return (fmi3Status)swp_fmu_ready(instance);
}

fmi3Status fmi3Terminate(fmi3Instance instance) { return (fmi3Status)swp_fmu_end(instance); }
fmi3Status fmi3Reset(fmi3Instance instance) {
    return (fmi3Status)swp_fmu_reset(instance);
}

fmi3Status fmi3DoStep(fmi3Instance instance, fmi3Float64 currentCommunicationPoint,
                      fmi3Float64 communicationStepSize,
                      fmi3Boolean noSetFMUStatePriorToCurrentPoint,
                      fmi3Boolean *eventHandlingNeeded, fmi3Boolean *terminateSimulation,
                      fmi3Boolean *earlyReturn, fmi3Float64 *lastSuccessfulTime) {
    swp_fmu *fmu = instance;
    (void)noSetFMUStatePriorToCurrentPoint;
    if (!fmu) return fmi3Error;
    int status = swp_fmu_advance(fmu, currentCommunicationPoint, communicationStepSize);
    if (eventHandlingNeeded) *eventHandlingNeeded = fmi3False;
    if (terminateSimulation) *terminateSimulation = fmi3False;
    if (earlyReturn) *earlyReturn = fmi3False;
    if (lastSuccessfulTime) *lastSuccessfulTime = fmu->memory.now;
    return (fmi3Status)status;
}

/* --- values ------------------------------------------------------------------------------------- */

static const char SCALAR[] = "every variable has one value";

fmi3Status fmi3GetFloat64(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                          size_t nValueReferences, fmi3Float64 values[], size_t nValues) {
    if (nValues != nValueReferences) return (fmi3Status)swp_fmu_fail(instance, SCALAR);
    return (fmi3Status)swp_fmu_get_real(instance, valueReferences, nValueReferences, values);
}

fmi3Status fmi3SetFloat64(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                          size_t nValueReferences, const fmi3Float64 values[], size_t nValues) {
    if (nValues != nValueReferences) return (fmi3Status)swp_fmu_fail(instance, SCALAR);
    return (fmi3Status)swp_fmu_set_real(instance, valueReferences, nValueReferences, values);
}

fmi3Status fmi3GetBoolean(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                          size_t nValueReferences, fmi3Boolean values[], size_t nValues) {
    if (nValues != nValueReferences) return (fmi3Status)swp_fmu_fail(instance, SCALAR);
    SWP_FMU_GET_BOOLEANS(fmi3Status, instance, valueReferences, nValueReferences, values);
}

fmi3Status fmi3SetBoolean(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                          size_t nValueReferences, const fmi3Boolean values[], size_t nValues) {
    if (nValues != nValueReferences) return (fmi3Status)swp_fmu_fail(instance, SCALAR);
    SWP_FMU_SET_BOOLEANS(fmi3Status, instance, valueReferences, nValueReferences, values);
}

/* --- states ------------------------------------------------------------------------------------- */

fmi3Status fmi3GetFMUState(fmi3Instance instance, fmi3FMUState *FMUState) {
    return (fmi3Status)swp_fmu_save(instance, FMUState);
}
fmi3Status fmi3SetFMUState(fmi3Instance instance, fmi3FMUState FMUState) {
    return (fmi3Status)swp_fmu_restore(instance, FMUState);
}
fmi3Status fmi3FreeFMUState(fmi3Instance instance, fmi3FMUState *FMUState) {
    return (fmi3Status)swp_fmu_forget(instance, FMUState);
}
fmi3Status fmi3SerializedFMUStateSize(fmi3Instance instance, fmi3FMUState FMUState, size_t *size) {
    (void)FMUState;
    return (fmi3Status)swp_fmu_bytes(instance, size);
}
fmi3Status fmi3SerializeFMUState(fmi3Instance instance, fmi3FMUState FMUState,
                                 fmi3Byte serializedState[], size_t size) {
    return (fmi3Status)swp_fmu_write(instance, FMUState, serializedState, size);
}
fmi3Status fmi3DeserializeFMUState(fmi3Instance instance, const fmi3Byte serializedState[],
                                   size_t size, fmi3FMUState *FMUState) {
    return (fmi3Status)swp_fmu_read(instance, serializedState, size, FMUState);
}

/* --- what the model does not have --------------------------------------------------------------- */

#if defined(__GNUC__) /* nothing below looks at what it is given */
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif

/* the names of the functions are macros of the standard's, which may put a prefix before them */
#define NONE(NAME, ...)                                                                       \
    fmi3Status NAME(fmi3Instance instance, const fmi3ValueReference valueReferences[],        \
                    size_t nValueReferences, __VA_ARGS__) {                                   \
        return (fmi3Status)swp_fmu_none(instance, nValueReferences);                          \
    }
#define WITHOUT(GET, SET, TYPE)                       \
    NONE(GET, TYPE values[], size_t nValues)          \
    NONE(SET, const TYPE values[], size_t nValues)
WITHOUT(fmi3GetFloat32, fmi3SetFloat32, fmi3Float32)
WITHOUT(fmi3GetInt8, fmi3SetInt8, fmi3Int8)
WITHOUT(fmi3GetUInt8, fmi3SetUInt8, fmi3UInt8)
WITHOUT(fmi3GetInt16, fmi3SetInt16, fmi3Int16)
WITHOUT(fmi3GetUInt16, fmi3SetUInt16, fmi3UInt16)
WITHOUT(fmi3GetInt32, fmi3SetInt32, fmi3Int32)
WITHOUT(fmi3GetUInt32, fmi3SetUInt32, fmi3UInt32)
WITHOUT(fmi3GetInt64, fmi3SetInt64, fmi3Int64)
WITHOUT(fmi3GetUInt64, fmi3SetUInt64, fmi3UInt64)
WITHOUT(fmi3GetString, fmi3SetString, fmi3String)
NONE(fmi3GetBinary, size_t valueSizes[], fmi3Binary values[], size_t nValues)
NONE(fmi3SetBinary, const size_t valueSizes[], const fmi3Binary values[], size_t nValues)
NONE(fmi3GetClock, fmi3Clock values[])
NONE(fmi3SetClock, const fmi3Clock values[])
NONE(fmi3GetOutputDerivatives, const fmi3Int32 orders[], fmi3Float64 values[], size_t nValues)

#define ABSENT(NAME, ...)                                                                     \
    fmi3Status NAME(__VA_ARGS__) {                                                            \
        return (fmi3Status)swp_fmu_fail(instance, "the FMU is for co-simulation alone, without " \
                                                  "events, clocks and derivatives");          \
    }
ABSENT(fmi3GetNumberOfVariableDependencies, fmi3Instance instance, fmi3ValueReference
       valueReference, size_t *nDependencies)
ABSENT(fmi3GetVariableDependencies, fmi3Instance instance, fmi3ValueReference dependent, size_t
       elementIndicesOfDependent[], fmi3ValueReference independents[], size_t
       elementIndicesOfIndependents[], fmi3DependencyKind dependencyKinds[], size_t nDependencies)
ABSENT(fmi3GetDirectionalDerivative, fmi3Instance instance, const fmi3ValueReference unknowns[],
       size_t nUnknowns, const fmi3ValueReference knowns[], size_t nKnowns, const fmi3Float64
       seed[], size_t nSeed, fmi3Float64 sensitivity[], size_t nSensitivity)
ABSENT(fmi3GetAdjointDerivative, fmi3Instance instance, const fmi3ValueReference unknowns[], size_t
       nUnknowns, const fmi3ValueReference knowns[], size_t nKnowns, const fmi3Float64 seed[],
       size_t nSeed, fmi3Float64 sensitivity[], size_t nSensitivity)
ABSENT(fmi3EnterConfigurationMode, fmi3Instance instance)
ABSENT(fmi3ExitConfigurationMode, fmi3Instance instance)
ABSENT(fmi3EnterEventMode, fmi3Instance instance)
ABSENT(fmi3EnterStepMode, fmi3Instance instance)
ABSENT(fmi3EnterContinuousTimeMode, fmi3Instance instance)
ABSENT(fmi3EvaluateDiscreteStates, fmi3Instance instance)
ABSENT(fmi3GetIntervalDecimal, fmi3Instance instance, const fmi3ValueReference valueReferences[],
       size_t nValueReferences, fmi3Float64 intervals[], fmi3IntervalQualifier qualifiers[])
ABSENT(fmi3GetIntervalFraction, fmi3Instance instance, const fmi3ValueReference valueReferences[],
       size_t nValueReferences, fmi3UInt64 counters[], fmi3UInt64 resolutions[],
       fmi3IntervalQualifier qualifiers[])
ABSENT(fmi3GetShiftDecimal, fmi3Instance instance, const fmi3ValueReference valueReferences[],
       size_t nValueReferences, fmi3Float64 shifts[])
ABSENT(fmi3GetShiftFraction, fmi3Instance instance, const fmi3ValueReference valueReferences[],
       size_t nValueReferences, fmi3UInt64 counters[], fmi3UInt64 resolutions[])
ABSENT(fmi3SetIntervalDecimal, fmi3Instance instance, const fmi3ValueReference valueReferences[],
       size_t nValueReferences, const fmi3Float64 intervals[])
ABSENT(fmi3SetIntervalFraction, fmi3Instance instance, const fmi3ValueReference valueReferences[],
       size_t nValueReferences, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])
ABSENT(fmi3SetShiftDecimal, fmi3Instance instance, const fmi3ValueReference valueReferences[],
       size_t nValueReferences, const fmi3Float64 shifts[])
ABSENT(fmi3SetShiftFraction, fmi3Instance instance, const fmi3ValueReference valueReferences[],
       size_t nValueReferences, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])
ABSENT(fmi3UpdateDiscreteStates, fmi3Instance instance, fmi3Boolean *discreteStatesNeedUpdate,
       fmi3Boolean *terminateSimulation, fmi3Boolean *nominalsOfContinuousStatesChanged, fmi3Boolean
       *valuesOfContinuousStatesChanged, fmi3Boolean *nextEventTimeDefined, fmi3Float64
       *nextEventTime)
ABSENT(fmi3CompletedIntegratorStep, fmi3Instance instance, fmi3Boolean
       noSetFMUStatePriorToCurrentPoint, fmi3Boolean *enterEventMode, fmi3Boolean
       *terminateSimulation)
ABSENT(fmi3SetTime, fmi3Instance instance, fmi3Float64 time)
ABSENT(fmi3SetContinuousStates, fmi3Instance instance, const fmi3Float64 continuousStates[], size_t
       nContinuousStates)
ABSENT(fmi3GetContinuousStateDerivatives, fmi3Instance instance, fmi3Float64 derivatives[], size_t
       nContinuousStates)
ABSENT(fmi3GetEventIndicators, fmi3Instance instance, fmi3Float64 eventIndicators[], size_t
       nEventIndicators)
ABSENT(fmi3GetContinuousStates, fmi3Instance instance, fmi3Float64 continuousStates[], size_t
       nContinuousStates)
ABSENT(fmi3GetNominalsOfContinuousStates, fmi3Instance instance, fmi3Float64 nominals[], size_t
       nContinuousStates)
ABSENT(fmi3GetNumberOfEventIndicators, fmi3Instance instance, size_t *nEventIndicators)
ABSENT(fmi3GetNumberOfContinuousStates, fmi3Instance instance, size_t *nContinuousStates)
ABSENT(fmi3ActivateModelPartition, fmi3Instance instance, fmi3ValueReference clockReference,
       fmi3Float64 activationTime)
