/* The functions of FMI 2.0.3 for model exchange and co-simulation: https://fmi-standard.org. */
#include <stdlib.h>
#include <string.h>

#include "eomgen_fmu.h"

#if defined(_WIN32)
#define FMU_EXPORT __declspec(dllexport)
#elif defined(__GNUC__)
#define FMU_EXPORT __attribute__((visibility("default")))
#else
#define FMU_EXPORT
#endif

typedef void *fmi2Component;
typedef unsigned int fmi2ValueReference;
typedef double fmi2Real;
typedef int fmi2Integer, fmi2Boolean, fmi2Status;
typedef char fmi2Char, fmi2Byte;
typedef const fmi2Char *fmi2String;
typedef void *fmi2FMUstate;

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

enum { MODEL_EXCHANGE, CO_SIMULATION };
#define INSTANCE ((fmu_instance *)c)
#define REQUIRE(phases) \
    if (fmu_check(INSTANCE, phases, __func__) != FMU_OK) { \
        return fail(INSTANCE, FMU_ERROR); \
    }
#define REQUIRE_ARRAY(n, array) \
    if ((n) > 0 && (array) == NULL) { \
        return fail(INSTANCE, fmu_say(INSTANCE, FMU_ERROR, "%s: an array is missing", __func__)); \
    }
#define LIVING (FMU_ANY & ~FMU_FAILED)

/* The status; an error leaves an instance that can only be reset, copied back or freed. */
static fmi2Status fail(fmu_instance *f, int status)
{
    if (f != NULL && status >= FMU_ERROR) {
        f->m.phase = FMU_FAILED;
    }
    return status;
}

static void report(const fmu_instance *f, int status, const char *text)
{
    const fmi2CallbackFunctions *const functions = (const fmi2CallbackFunctions *)f->environment;
    functions->logger(functions->componentEnvironment, f->name, status, status >= FMU_ERROR ? "logStatusError" : "logAll", "%s", text);
}

FMU_EXPORT const char *fmi2GetTypesPlatform(void)
{
    return "default";
}

FMU_EXPORT const char *fmi2GetVersion(void)
{
    return "2.0";
}

FMU_EXPORT fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String categories[])
{
    (void)n, (void)categories;
    if (c == NULL) {
        return FMU_ERROR;
    }
    INSTANCE->reports = on;
    return FMU_OK;
}

FMU_EXPORT fmi2Component fmi2Instantiate(fmi2String name, int type, fmi2String token, fmi2String resources,
    const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean reports)
{
    (void)resources, (void)visible;
    if (functions == NULL || functions->logger == NULL) {
        return NULL;
    }
    if (name == NULL || name[0] == '\0' || token == NULL || strcmp(token, FMU_TOKEN) != 0) {
        functions->logger(functions->componentEnvironment, name != NULL ? name : "", FMU_ERROR, "logStatusError", "%s",
            name == NULL || name[0] == '\0' ? "an instance needs a name"
                                            : "the GUID is not that of this model; modelDescription.xml belongs to another");
        return NULL;
    }
    if (type != MODEL_EXCHANGE && (type != CO_SIMULATION || !FMU_CO_SIMULATION)) {
        functions->logger(functions->componentEnvironment, name, FMU_ERROR, "logStatusError", "%s", "no such kind of instance");
        return NULL;
    }
    fmu_instance *const f = fmu_create(name, type == CO_SIMULATION);
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

FMU_EXPORT fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean tolerance_given, fmi2Real tolerance, fmi2Real start,
    fmi2Boolean stop_given, fmi2Real stop)
{
    REQUIRE(FMU_INSTANTIATED)
    (void)stop_given, (void)stop;
    return fail(INSTANCE, fmu_start(INSTANCE, start, tolerance_given, tolerance));
}

FMU_EXPORT fmi2Status fmi2EnterInitializationMode(fmi2Component c)
{
    REQUIRE(FMU_INSTANTIATED)
    INSTANCE->m.phase = FMU_INITIALIZING;
    return FMU_OK;
}

FMU_EXPORT fmi2Status fmi2ExitInitializationMode(fmi2Component c)
{
    REQUIRE(FMU_INITIALIZING)
    int status = fmu_assemble(INSTANCE);
    INSTANCE->m.phase = INSTANCE->steps != NULL ? FMU_STEPPING : FMU_EVENTS;
    if (status == FMU_OK && INSTANCE->steps == NULL) {
        status = fmu_arm(INSTANCE);
    }
    return fail(INSTANCE, status);
}

FMU_EXPORT fmi2Status fmi2Terminate(fmi2Component c)
{
    REQUIRE(FMU_EVENTS | FMU_CONTINUOUS | FMU_STEPPING)
    INSTANCE->m.phase = FMU_TERMINATED;
    return FMU_OK;
}

FMU_EXPORT fmi2Status fmi2Reset(fmi2Component c)
{
    REQUIRE(FMU_ANY)
    fmu_reset(INSTANCE);
    return FMU_OK;
}

FMU_EXPORT fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real value[])
{
    REQUIRE(LIVING)
    REQUIRE_ARRAY(n, vr)
    REQUIRE_ARRAY(n, value)
    return fail(INSTANCE, fmu_get(INSTANCE, vr, n, value));
}

FMU_EXPORT fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Real value[])
{
    REQUIRE(LIVING & ~FMU_TERMINATED)
    REQUIRE_ARRAY(n, vr)
    REQUIRE_ARRAY(n, value)
    return fail(INSTANCE, fmu_set(INSTANCE, vr, n, value));
}

/* There are no variables of other types. */
#define NONE_OF(name, type) \
    FMU_EXPORT fmi2Status fmi2##name(fmi2Component c, const fmi2ValueReference vr[], size_t n, type value[]) \
    { \
        (void)vr, (void)value; \
        REQUIRE(LIVING) \
        return n == 0 ? FMU_OK : fail(INSTANCE, fmu_say(INSTANCE, FMU_ERROR, "%s: all variables are of type Real", __func__)); \
    }
NONE_OF(GetInteger, fmi2Integer)
NONE_OF(GetBoolean, fmi2Boolean)
NONE_OF(GetString, fmi2String)
NONE_OF(SetInteger, const fmi2Integer)
NONE_OF(SetBoolean, const fmi2Boolean)
NONE_OF(SetString, const fmi2String)

FMU_EXPORT fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state)
{
    REQUIRE(LIVING)
    REQUIRE_ARRAY(1, state)
    return fail(INSTANCE, fmu_keep(INSTANCE, state));
}

FMU_EXPORT fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state)
{
    REQUIRE(FMU_ANY)
    return fail(INSTANCE, fmu_restore(INSTANCE, state));
}

FMU_EXPORT fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state)
{
    REQUIRE(FMU_ANY)
    if (state != NULL) {
        free(*state);
        *state = NULL;
    }
    return FMU_OK;
}

FMU_EXPORT fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t *size)
{
    REQUIRE(LIVING)
    REQUIRE_ARRAY(1, state)
    REQUIRE_ARRAY(1, size)
    *size = sizeof(fmu_snapshot);
    return FMU_OK;
}

FMU_EXPORT fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t size)
{
    REQUIRE(LIVING)
    REQUIRE_ARRAY(1, state)
    REQUIRE_ARRAY(1, bytes)
    if (size < sizeof(fmu_snapshot)) {
        return fail(INSTANCE, fmu_say(INSTANCE, FMU_ERROR, "%s: the array is too short", __func__));
    }
    memcpy(bytes, state, sizeof(fmu_snapshot));
    return FMU_OK;
}

FMU_EXPORT fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state)
{
    REQUIRE(LIVING)
    REQUIRE_ARRAY(1, bytes)
    REQUIRE_ARRAY(1, state)
    return fail(INSTANCE, fmu_unpack(INSTANCE, bytes, size, state));
}

FMU_EXPORT fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference unknowns[], size_t n_unknowns,
    const fmi2ValueReference knowns[], size_t n_knowns, const fmi2Real seed[], fmi2Real result[])
{
    REQUIRE(FMU_INITIALIZING | FMU_EVENTS | FMU_CONTINUOUS | FMU_STEPPING | FMU_TERMINATED)
    REQUIRE_ARRAY(n_unknowns, unknowns)
    REQUIRE_ARRAY(n_unknowns, result)
    REQUIRE_ARRAY(n_knowns, knowns)
    REQUIRE_ARRAY(n_knowns, seed)
    return fail(INSTANCE, fmu_directional(INSTANCE, unknowns, n_unknowns, knowns, n_knowns, seed, result));
}

/* ---- model exchange ---- */

FMU_EXPORT fmi2Status fmi2EnterEventMode(fmi2Component c)
{
    REQUIRE(FMU_CONTINUOUS | FMU_EVENTS)
    INSTANCE->m.phase = FMU_EVENTS;
    return FMU_OK;
}

FMU_EXPORT fmi2Status fmi2NewDiscreteStates(fmi2Component c, fmi2EventInfo *info)
{
    int ended = 0, changed = 0;
    REQUIRE(FMU_EVENTS)
    REQUIRE_ARRAY(1, info)
    memset(info, 0, sizeof *info);
    const int status = fmu_update(INSTANCE, &ended, &changed);
    info->terminateSimulation = ended, info->valuesOfContinuousStatesChanged = changed;
    return fail(INSTANCE, status);
}

FMU_EXPORT fmi2Status fmi2EnterContinuousTimeMode(fmi2Component c)
{
    REQUIRE(FMU_EVENTS)
    INSTANCE->m.phase = FMU_CONTINUOUS;
    return FMU_OK;
}

FMU_EXPORT fmi2Status fmi2CompletedIntegratorStep(fmi2Component c, fmi2Boolean no_return, fmi2Boolean *event, fmi2Boolean *end)
{
    REQUIRE(FMU_CONTINUOUS)
    REQUIRE_ARRAY(1, event)
    REQUIRE_ARRAY(1, end)
    (void)no_return;
    *end = 0;
    return fail(INSTANCE, fmu_completed(INSTANCE, event));
}

FMU_EXPORT fmi2Status fmi2SetTime(fmi2Component c, fmi2Real time)
{
    REQUIRE(FMU_EVENTS | FMU_CONTINUOUS)
    INSTANCE->m.t = time;
    INSTANCE->m.rates_known = 0;
    return FMU_OK;
}

#define REQUIRE_LENGTH(given, length, array) \
    if ((given) != (size_t)(length)) { \
        return fail(INSTANCE, fmu_say(INSTANCE, FMU_ERROR, "%s: the array has %d entries, not %d", __func__, (int)(given), (int)(length))); \
    } \
    REQUIRE_ARRAY(given, array)

FMU_EXPORT fmi2Status fmi2SetContinuousStates(fmi2Component c, const fmi2Real x[], size_t n)
{
    REQUIRE(FMU_CONTINUOUS)
    REQUIRE_LENGTH(n, FMU_N_X, x)
    memcpy(INSTANCE->m.x, x, n * sizeof(double));
    INSTANCE->m.rates_known = 0;
    return FMU_OK;
}

FMU_EXPORT fmi2Status fmi2GetDerivatives(fmi2Component c, fmi2Real rates[], size_t n)
{
    REQUIRE(LIVING & ~FMU_INSTANTIATED)
    REQUIRE_LENGTH(n, FMU_N_X, rates)
    const int status = fmu_rates(INSTANCE);
    memcpy(rates, INSTANCE->m.rates, n * sizeof(double));
    return fail(INSTANCE, status);
}

FMU_EXPORT fmi2Status fmi2GetEventIndicators(fmi2Component c, fmi2Real values[], size_t n)
{
    REQUIRE(LIVING & ~FMU_INSTANTIATED)
    REQUIRE_LENGTH(n, FMU_N_EVENTS, values)
    return fail(INSTANCE, fmu_indicators(INSTANCE, values));
}

FMU_EXPORT fmi2Status fmi2GetContinuousStates(fmi2Component c, fmi2Real x[], size_t n)
{
    REQUIRE(LIVING & ~FMU_INSTANTIATED)
    REQUIRE_LENGTH(n, FMU_N_X, x)
    const int status = fmu_ready(INSTANCE);
    memcpy(x, INSTANCE->m.x, n * sizeof(double));
    return fail(INSTANCE, status);
}

FMU_EXPORT fmi2Status fmi2GetNominalsOfContinuousStates(fmi2Component c, fmi2Real nominal[], size_t n)
{
    REQUIRE(LIVING & ~FMU_INSTANTIATED)
    REQUIRE_LENGTH(n, FMU_N_X, nominal)
    memcpy(nominal, FMU_NOMINAL, n * sizeof(double));
    return FMU_OK;
}

/* ---- co-simulation ---- */

FMU_EXPORT fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t n,
    const fmi2Integer order[], const fmi2Real value[])
{
    (void)vr, (void)order, (void)value;
    REQUIRE(LIVING)
    return n == 0 ? FMU_OK : fail(INSTANCE, fmu_say(INSTANCE, FMU_ERROR, "inputs are constant within a step"));
}

FMU_EXPORT fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t n,
    const fmi2Integer order[], fmi2Real value[])
{
    (void)vr, (void)order, (void)value;
    REQUIRE(LIVING)
    return n == 0 ? FMU_OK : fail(INSTANCE, fmu_say(INSTANCE, FMU_ERROR, "there are no derivatives of outputs by time"));
}

#if FMU_CO_SIMULATION
FMU_EXPORT fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real step, fmi2Boolean no_return)
{
    int ended = 0;
    REQUIRE(FMU_STEPPING)
    (void)no_return;
    const int status = fmu_step(INSTANCE, time, step, &ended);
    return fail(INSTANCE, status == FMU_OK && ended ? (int)FMU_DISCARD : status);
}
#endif

FMU_EXPORT fmi2Status fmi2CancelStep(fmi2Component c)
{
    REQUIRE(FMU_STEPPING)
    return fail(INSTANCE, fmu_say(INSTANCE, FMU_ERROR, "steps are finished when fmi2DoStep returns"));
}

FMU_EXPORT fmi2Status fmi2GetRealStatus(fmi2Component c, int kind, fmi2Real *value)
{
    enum { LAST_SUCCESSFUL_TIME = 2 };
    REQUIRE(LIVING)
    REQUIRE_ARRAY(1, value)
    *value = INSTANCE->m.t;
    return kind == LAST_SUCCESSFUL_TIME ? FMU_OK : FMU_DISCARD;
}

FMU_EXPORT fmi2Status fmi2GetBooleanStatus(fmi2Component c, int kind, fmi2Boolean *value)
{
    enum { TERMINATED = 3 };
    REQUIRE(LIVING)
    REQUIRE_ARRAY(1, value)
    *value = INSTANCE->m.ended;
    return kind == TERMINATED ? FMU_OK : FMU_DISCARD;
}

#define NO_STATUS(name, type) \
    FMU_EXPORT fmi2Status fmi2##name(fmi2Component c, int kind, type *value) \
    { \
        (void)kind, (void)value; \
        REQUIRE(LIVING) \
        return FMU_DISCARD; \
    }
NO_STATUS(GetStatus, fmi2Status)
NO_STATUS(GetIntegerStatus, fmi2Integer)
NO_STATUS(GetStringStatus, fmi2String)
