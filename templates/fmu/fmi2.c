/* The functions of FMI 2.0.3 for model exchange and co-simulation: https://fmi-standard.org. */
#include <stdlib.h>
#include <string.h>

#include "eomgen_fmu.h"

#if defined(FMI_HEADERS)
#include "fmi2Functions.h"
#else
typedef void *fmi2Component, *fmi2FMUstate;
typedef unsigned int fmi2ValueReference;
typedef double fmi2Real;
typedef int fmi2Integer, fmi2Boolean, fmi2Status, fmi2Type, fmi2StatusKind;
typedef char fmi2Char, fmi2Byte;
typedef const fmi2Char *fmi2String;

typedef struct {
    void (*logger)(void *environment, fmi2String name, fmi2Status status, fmi2String category, fmi2String message, ...);
    void *(*allocateMemory)(size_t n, size_t size);
    void (*freeMemory)(void *object);
    void (*stepFinished)(void *environment, fmi2Status status);
    void *componentEnvironment;
} fmi2CallbackFunctions;

typedef struct {
    fmi2Boolean newDiscreteStatesNeeded, terminateSimulation, nominalsOfContinuousStatesChanged;
    fmi2Boolean valuesOfContinuousStatesChanged, nextEventTimeDefined;
    fmi2Real nextEventTime;
} fmi2EventInfo;
#endif

#define FMI(name) fmi2##name
#define HANDLE fmi2Component
#define BOOLEAN fmi2Boolean
#define STATE fmi2FMUstate
#define TOKEN "GUID"
#define GET_STATE GetFMUstate
#define SET_STATE SetFMUstate
#define FREE_STATE FreeFMUstate
#define SIZE_OF_STATE SerializedFMUstateSize
#define SERIALIZE SerializeFMUstate
#define DESERIALIZE DeSerializeFMUstate
#define GET_RATES GetDerivatives
#define GET_REAL GetReal
#define SET_REAL SetReal
#define LENGTH(n)
#define REQUIRE_NUMBERS(given, length, array) REQUIRE_ARRAY(length, array)
#include "fmi_calls.h"

static void report(const fmu_instance *f, int status, const char *text)
{
    const fmi2CallbackFunctions *const functions = (const fmi2CallbackFunctions *)f->environment;
    functions->logger(functions->componentEnvironment, f->name, (fmi2Status)status, status >= FMU_ERROR ? "logStatusError" : "logAll",
        "%s", text);
}

FMU_EXPORT const char *fmi2GetTypesPlatform(void)
{
    return "default";
}

FMU_EXPORT const char *fmi2GetVersion(void)
{
    return "2.0";
}

FMU_EXPORT fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String token, fmi2String resources,
    const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean reports)
{
    enum { MODEL_EXCHANGE, CO_SIMULATION };
    if (functions == NULL || functions->logger == NULL) {
        return NULL;
    }
    const char *const wrong = wrong_name(name, token) != NULL ? wrong_name(name, token)
                              : (int)type != MODEL_EXCHANGE && ((int)type != CO_SIMULATION || !FMU_CO_SIMULATION)
                                  ? "no such kind of instance"
                                  : NULL;
    if (wrong != NULL) {
        functions->logger(functions->componentEnvironment, name != NULL ? name : "", (fmi2Status)FMU_ERROR, "logStatusError", "%s", wrong);
        return NULL;
    }
    fmu_instance *const f = fmu_create(name, (int)type == CO_SIMULATION);
    if (f != NULL) {
        f->environment = malloc(sizeof *functions);
        if (f->environment == NULL) {
            fmu_delete(f);
            return NULL;
        }
        memcpy(f->environment, functions, sizeof *functions);
        f->report = report;
        f->reports = reports;
    }
    return f;
}

FMU_EXPORT void fmi2FreeInstance(fmi2Component c)
{
    if (c != NULL) {
        free(INSTANCE->environment);
        fmu_delete(INSTANCE);
    }
}

CALL(SetupExperiment)(fmi2Component c, fmi2Boolean tolerance_given, fmi2Real tolerance, fmi2Real start, fmi2Boolean stop_given,
    fmi2Real stop)
{
    REQUIRE(FMU_INSTANTIATED)
    return fail(INSTANCE, fmu_start(INSTANCE, start, tolerance_given, tolerance));
}

TO_PHASE(EnterInitializationMode, FMU_INSTANTIATED, FMU_INITIALIZING)

/* A call that takes variables, or orders of derivatives, that no model has. */
#define NONE(name, reason, ...) \
    CALL(name)(fmi2Component c, const fmi2ValueReference vr[], size_t n, __VA_ARGS__) \
    { \
        REQUIRE(LIVING) \
        return n == 0 ? (fmi2Status)FMU_OK : fail(INSTANCE, fmu_say(INSTANCE, FMU_ERROR, "%s: " reason, __func__)); \
    }
NONE(GetInteger, "all variables are of type Real", fmi2Integer value[])
NONE(GetBoolean, "all variables are of type Real", fmi2Boolean value[])
NONE(GetString, "all variables are of type Real", fmi2String value[])
NONE(SetInteger, "all variables are of type Real", const fmi2Integer value[])
NONE(SetBoolean, "all variables are of type Real", const fmi2Boolean value[])
NONE(SetString, "all variables are of type Real", const fmi2String value[])
NONE(SetRealInputDerivatives, "inputs are constant within a step", const fmi2Integer order[], const fmi2Real value[])
NONE(GetRealOutputDerivatives, "there are no derivatives of outputs by time", const fmi2Integer order[], fmi2Real value[])

CALL(NewDiscreteStates)(fmi2Component c, fmi2EventInfo *info)
{
    int ended = 0, changed = 0;
    REQUIRE(FMU_EVENTS)
    REQUIRE_ARRAY(1, info)
    memset(info, 0, sizeof *info);
    const int status = fmu_update(INSTANCE, &ended, &changed);
    info->terminateSimulation = ended, info->valuesOfContinuousStatesChanged = changed;
    return fail(INSTANCE, status);
}

/* ---- co-simulation ---- */

#if FMU_CO_SIMULATION
CALL(DoStep)(fmi2Component c, fmi2Real time, fmi2Real step, fmi2Boolean no_return)
{
    int ended = 0;
    REQUIRE(FMU_STEPPING)
    const int status = fmu_step(INSTANCE, time, step, &ended);
    return fail(INSTANCE, status == FMU_OK && ended ? (int)FMU_DISCARD : status);
}
#endif

CALL(CancelStep)(fmi2Component c)
{
    REQUIRE(FMU_STEPPING)
    return fail(INSTANCE, fmu_say(INSTANCE, FMU_ERROR, "steps are finished when fmi2DoStep returns"));
}

#define STATUS(name, type, of, is) \
    CALL(name)(fmi2Component c, fmi2StatusKind kind, type *value) \
    { \
        REQUIRE(LIVING) \
        REQUIRE_ARRAY(1, value) \
        *value = INSTANCE->m.is; \
        return (int)kind == (of) ? FMU_OK : FMU_DISCARD; \
    }
STATUS(GetRealStatus, fmi2Real, 2 /* last successful time */, t)
STATUS(GetBooleanStatus, fmi2Boolean, 3 /* terminated */, ended)

#define NO_STATUS(name, type) \
    CALL(name)(fmi2Component c, fmi2StatusKind kind, type *value) \
    { \
        REQUIRE(LIVING) \
        return FMU_DISCARD; \
    }
NO_STATUS(GetStatus, fmi2Status)
NO_STATUS(GetIntegerStatus, fmi2Integer)
NO_STATUS(GetStringStatus, fmi2String)
