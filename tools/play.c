/* Plays a command through the FMU functions of a library, for tools/build_binaries.py:
 *
 *     play LIBRARY RESOURCES TOKEN FMI STEP COMMAND RESULT
 *
 * COMMAND is a file of doubles, the voltage at each communication point; RESULT becomes one of
 * current, shaft speed and shaft position at each. RESOURCES is a folder, for FMI 2 as a URI.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2Functions.h"
#include "fmi3Functions.h"

#ifdef _WIN32
#define WIN32_LEAN_AND_MEAN
#include <windows.h>
#define OPEN(path) ((void *)LoadLibraryA(path))
#define FIND(library, name) ((void *)GetProcAddress((HMODULE)(library), name))
#else
#include <dlfcn.h>
#define OPEN(path) dlopen(path, RTLD_NOW | RTLD_LOCAL)
#define FIND(library, name) dlsym(library, name)
#endif

static void *found(void *library, const char *name) {
    void *made = FIND(library, name);
    if (!made) {
        fprintf(stderr, "no function %s\n", name);
        exit(3);
    }
    return made;
}

static void checked(int status, const char *what) {
    if (status > 1) {
        fprintf(stderr, "%s: status %d\n", what, status);
        exit(4);
    }
}

static void say2(void *environment, const char *name, fmi2Status status, const char *category,
                 const char *message, ...) {
    (void)environment, (void)name, (void)status;
    fprintf(stderr, "%s: %s\n", category, message);
}

static void say3(void *environment, fmi3Status status, const char *category, const char *message) {
    (void)environment, (void)status;
    fprintf(stderr, "%s: %s\n", category, message);
}

static const unsigned VOLTAGE[] = {0};
static const unsigned OUTPUTS[] = {12, 18, 19};

static void play2(void *library, char **words, const double *command, size_t count, double step,
                  FILE *result) {
    fmi2InstantiateTYPE *instantiate = found(library, "fmi2Instantiate");
    fmi2SetupExperimentTYPE *setup = found(library, "fmi2SetupExperiment");
    fmi2EnterInitializationModeTYPE *enter = found(library, "fmi2EnterInitializationMode");
    fmi2ExitInitializationModeTYPE *leave = found(library, "fmi2ExitInitializationMode");
    fmi2SetRealTYPE *set = found(library, "fmi2SetReal");
    fmi2GetRealTYPE *get = found(library, "fmi2GetReal");
    fmi2DoStepTYPE *advance = found(library, "fmi2DoStep");
    fmi2FreeInstanceTYPE *end = found(library, "fmi2FreeInstance");
    fmi2CallbackFunctions callbacks = {say2, NULL, NULL, NULL, NULL};
    void *fmu = instantiate("play", fmi2CoSimulation, words[3], words[2], &callbacks, 0, 0);
    if (!fmu) exit(5);
    checked(setup(fmu, 0, 0.0, 0.0, 0, 0.0), "setup");
    checked(enter(fmu), "enter");
    for (size_t i = 0; i < count; i++) {
        double outputs[3];
        checked(set(fmu, VOLTAGE, 1, command + i), "set");
        if (i == 0) checked(leave(fmu), "leave");
        checked(get(fmu, OUTPUTS, 3, outputs), "get");
        fwrite(outputs, sizeof outputs, 1, result);
        checked(advance(fmu, (double)i * step, step, 1), "step");
    }
    end(fmu);
}

static void play3(void *library, char **words, const double *command, size_t count, double step,
                  FILE *result) {
    fmi3InstantiateCoSimulationTYPE *instantiate = found(library, "fmi3InstantiateCoSimulation");
    fmi3EnterInitializationModeTYPE *enter = found(library, "fmi3EnterInitializationMode");
    fmi3ExitInitializationModeTYPE *leave = found(library, "fmi3ExitInitializationMode");
    fmi3SetFloat64TYPE *set = found(library, "fmi3SetFloat64");
    fmi3GetFloat64TYPE *get = found(library, "fmi3GetFloat64");
    fmi3DoStepTYPE *advance = found(library, "fmi3DoStep");
    fmi3FreeInstanceTYPE *end = found(library, "fmi3FreeInstance");
    void *fmu = instantiate("play", words[3], words[2], 0, 0, 0, 0, NULL, 0, NULL, say3, NULL);
    if (!fmu) exit(5);
    checked(enter(fmu, 0, 0.0, 0.0, 0, 0.0), "enter");
    for (size_t i = 0; i < count; i++) {
        double outputs[3], last;
        bool event, terminate, early;
        checked(set(fmu, VOLTAGE, 1, command + i, 1), "set");
        if (i == 0) checked(leave(fmu), "leave");
        checked(get(fmu, OUTPUTS, 3, outputs, 3), "get");
        fwrite(outputs, sizeof outputs, 1, result);
        checked(advance(fmu, (double)i * step, step, 1, &event, &terminate, &early, &last), "step");
    }
    end(fmu);
}

int main(int count, char **words) {
    if (count != 8) return 2;
    void *library = OPEN(words[1]);
    FILE *command = fopen(words[6], "rb");
    FILE *result = fopen(words[7], "wb");
    if (!library || !command || !result) return 2;
    static double voltage[1 << 20];
    size_t samples = fread(voltage, sizeof *voltage, 1 << 20, command);
    double step = strtod(words[5], NULL);
    if (words[4][0] == '2')
        play2(library, words, voltage, samples, step, result);
    else
        play3(library, words, voltage, samples, step, result);
    return fclose(result) == 0 ? 0 : 6;
}
