/* The functions of FMI 3.0 for model exchange and co-simulation: https://fmi-standard.org. */
#include <stdbool.h>
#include <stdint.h>
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

typedef void *fmi3Instance, *fmi3Environment, *fmi3FMUState;
typedef int fmi3Status;
typedef const char *fmi3String;
typedef const uint8_t *fmi3Binary;
typedef bool fmi3Boolean, fmi3Clock;
typedef double fmi3Float64;
typedef uint32_t fmi3ValueReference;
typedef void (*fmi3Logger)(fmi3Environment environment, fmi3Status status, fmi3String category, fmi3String message);

#define INSTANCE ((fmu_instance *)c)
#define REQUIRE(phases) \
    if (fmu_check(INSTANCE, phases, __func__) != FMU_OK) { \
        return fail(INSTANCE, FMU_ERROR); \
    }
#define REQUIRE_ARRAY(n, array) \
    if ((n) > 0 && (array) == NULL) { \
        return fail(INSTANCE, fmu_say(INSTANCE, FMU_ERROR, "%s: an array is missing", __func__)); \
    }
#define REQUIRE_LENGTH(given, length, array) \
    if ((given) != (size_t)(length)) { \
        return fail(INSTANCE, fmu_say(INSTANCE, FMU_ERROR, "%s: the array has %d entries, not %d", __func__, (int)(given), (int)(length))); \
    } \
    REQUIRE_ARRAY(given, array)
#define LIVING (FMU_ANY & ~FMU_FAILED)

/* The status; an error leaves an instance that can only be reset, copied back or freed. */
static fmi3Status fail(fmu_instance *f, int status)
{
    if (f != NULL && status >= FMU_ERROR) {
        f->m.phase = FMU_FAILED;
    }
    return status;
}

static void report(const fmu_instance *f, int status, const char *text)
{
    ((fmi3Logger)f->logger)(f->environment, status, status >= FMU_ERROR ? "logStatusError" : "logAll", text);
}

FMU_EXPORT const char *fmi3GetVersion(void)
{
    return "3.0";
}

FMU_EXPORT fmi3Status fmi3SetDebugLogging(fmi3Instance c, fmi3Boolean on, size_t n, const fmi3String categories[])
{
    (void)n, (void)categories;
    if (c == NULL) {
        return FMU_ERROR;
    }
    INSTANCE->reports = on;
    return FMU_OK;
}

static fmi3Instance create(fmi3String name, fmi3String token, bool reports, fmi3Environment environment, fmi3Logger logger,
    int steps)
{
    const char *const wrong =
        name == NULL || name[0] == '\0' ? "an instance needs a name"
        : token == NULL || strcmp(token, FMU_TOKEN) != 0
            ? "the instantiation token is not that of this model; modelDescription.xml belongs to another"
            : NULL;
    if (wrong != NULL) {
        if (logger != NULL) {
            logger(environment, FMU_ERROR, "logStatusError", wrong);
        }
        return NULL;
    }
    fmu_instance *const f = fmu_create(name, steps);
    if (f != NULL) {
        f->environment = environment;
        f->logger = (void (*)(void))logger;
        f->report = logger != NULL ? report : NULL;
        f->reports = reports;
    }
    return f;
}

FMU_EXPORT fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources,
    fmi3Boolean visible, fmi3Boolean reports, fmi3Environment environment, fmi3Logger logger)
{
    (void)resources, (void)visible;
    return create(name, token, reports, environment, logger, 0);
}

FMU_EXPORT fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources,
    fmi3Boolean visible, fmi3Boolean reports, fmi3Boolean event_mode, fmi3Boolean early_return,
    const fmi3ValueReference intermediate[], size_t n, fmi3Environment environment, fmi3Logger logger, void (*update)(void))
{
    (void)resources, (void)visible, (void)event_mode, (void)early_return, (void)intermediate, (void)n, (void)update;
    return FMU_CO_SIMULATION ? create(name, token, reports, environment, logger, 1) : NULL;
}

FMU_EXPORT fmi3Instance fmi3InstantiateScheduledExecution(fmi3String name, fmi3String token, fmi3String resources,
    fmi3Boolean visible, fmi3Boolean reports, fmi3Environment environment, fmi3Logger logger, void (*clock)(void),
    void (*lock)(void), void (*unlock)(void))
{
    (void)name, (void)token, (void)resources, (void)visible, (void)reports, (void)clock, (void)lock, (void)unlock;
    if (logger != NULL) {
        logger(environment, FMU_ERROR, "logStatusError", "there is no scheduled execution of this model");
    }
    return NULL;
}

FMU_EXPORT void fmi3FreeInstance(fmi3Instance c)
{
    fmu_delete(INSTANCE);
}

FMU_EXPORT fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean tolerance_given, fmi3Float64 tolerance,
    fmi3Float64 start, fmi3Boolean stop_given, fmi3Float64 stop)
{
    REQUIRE(FMU_INSTANTIATED)
    (void)stop_given, (void)stop;
    const int status = fmu_start(INSTANCE, start, tolerance_given, tolerance);
    INSTANCE->m.phase = FMU_INITIALIZING;
    return fail(INSTANCE, status);
}

FMU_EXPORT fmi3Status fmi3ExitInitializationMode(fmi3Instance c)
{
    REQUIRE(FMU_INITIALIZING)
    int status = fmu_assemble(INSTANCE);
    INSTANCE->m.phase = INSTANCE->steps != NULL ? FMU_STEPPING : FMU_EVENTS;
    if (status == FMU_OK && INSTANCE->steps == NULL) {
        status = fmu_arm(INSTANCE);
    }
    return fail(INSTANCE, status);
}

FMU_EXPORT fmi3Status fmi3EnterEventMode(fmi3Instance c)
{
    REQUIRE(FMU_CONTINUOUS | FMU_EVENTS)
    INSTANCE->m.phase = FMU_EVENTS;
    return FMU_OK;
}

FMU_EXPORT fmi3Status fmi3Terminate(fmi3Instance c)
{
    REQUIRE(FMU_EVENTS | FMU_CONTINUOUS | FMU_STEPPING)
    INSTANCE->m.phase = FMU_TERMINATED;
    return FMU_OK;
}

FMU_EXPORT fmi3Status fmi3Reset(fmi3Instance c)
{
    REQUIRE(FMU_ANY)
    fmu_reset(INSTANCE);
    return FMU_OK;
}

FMU_EXPORT fmi3Status fmi3GetFloat64(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3Float64 values[], size_t n_values)
{
    REQUIRE(LIVING)
    REQUIRE_ARRAY(n, vr)
    REQUIRE_LENGTH(n_values, n, values)
    return fail(INSTANCE, fmu_get(INSTANCE, vr, n, values));
}

FMU_EXPORT fmi3Status fmi3SetFloat64(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const fmi3Float64 values[],
    size_t n_values)
{
    REQUIRE(LIVING & ~FMU_TERMINATED)
    REQUIRE_ARRAY(n, vr)
    REQUIRE_LENGTH(n_values, n, values)
    return fail(INSTANCE, fmu_set(INSTANCE, vr, n, values));
}

/* There are no variables of other types. */
#define NONE_OF(type, each) \
    FMU_EXPORT fmi3Status fmi3Get##type(fmi3Instance c, const fmi3ValueReference vr[], size_t n, each values[], size_t n_values) \
    { \
        (void)vr, (void)values; \
        return none(c, n + n_values, __func__); \
    } \
    FMU_EXPORT fmi3Status fmi3Set##type(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const each values[], size_t n_values) \
    { \
        (void)vr, (void)values; \
        return none(c, n + n_values, __func__); \
    }

static fmi3Status none(fmi3Instance c, size_t n, const char *function)
{
    if (fmu_check(INSTANCE, LIVING, function) != FMU_OK) {
        return fail(INSTANCE, FMU_ERROR);
    }
    return n == 0 ? FMU_OK : fail(INSTANCE, fmu_say(INSTANCE, FMU_ERROR, "%s: all variables are of type Float64", function));
}

static fmi3Status refuse(fmi3Instance c, const char *function)
{
    if (c == NULL) {
        return FMU_ERROR;
    }
    return fail(INSTANCE, fmu_say(INSTANCE, FMU_ERROR, "%s: this model has nothing of that kind", function));
}

NONE_OF(Float32, float)
NONE_OF(Int8, int8_t)
NONE_OF(UInt8, uint8_t)
NONE_OF(Int16, int16_t)
NONE_OF(UInt16, uint16_t)
NONE_OF(Int32, int32_t)
NONE_OF(UInt32, uint32_t)
NONE_OF(Int64, int64_t)
NONE_OF(UInt64, uint64_t)
NONE_OF(Boolean, fmi3Boolean)
NONE_OF(String, fmi3String)

FMU_EXPORT fmi3Status fmi3GetBinary(fmi3Instance c, const fmi3ValueReference vr[], size_t n, size_t sizes[], fmi3Binary values[], size_t n_values)
{
    (void)vr, (void)sizes, (void)values;
    return none(c, n + n_values, __func__);
}

FMU_EXPORT fmi3Status fmi3SetBinary(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const size_t sizes[], const fmi3Binary values[], size_t n_values)
{
    (void)vr, (void)sizes, (void)values;
    return none(c, n + n_values, __func__);
}

FMU_EXPORT fmi3Status fmi3GetClock(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3Clock values[])
{
    (void)vr, (void)values;
    return none(c, n, __func__);
}

FMU_EXPORT fmi3Status fmi3SetClock(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const fmi3Clock values[])
{
    (void)vr, (void)values;
    return none(c, n, __func__);
}

FMU_EXPORT fmi3Status fmi3GetFMUState(fmi3Instance c, fmi3FMUState *state)
{
    REQUIRE(LIVING)
    REQUIRE_ARRAY(1, state)
    return fail(INSTANCE, fmu_keep(INSTANCE, state));
}

FMU_EXPORT fmi3Status fmi3SetFMUState(fmi3Instance c, fmi3FMUState state)
{
    REQUIRE(FMU_ANY)
    return fail(INSTANCE, fmu_restore(INSTANCE, state));
}

FMU_EXPORT fmi3Status fmi3FreeFMUState(fmi3Instance c, fmi3FMUState *state)
{
    REQUIRE(FMU_ANY)
    if (state != NULL) {
        free(*state);
        *state = NULL;
    }
    return FMU_OK;
}

FMU_EXPORT fmi3Status fmi3SerializedFMUStateSize(fmi3Instance c, fmi3FMUState state, size_t *size)
{
    REQUIRE(LIVING)
    REQUIRE_ARRAY(1, state)
    REQUIRE_ARRAY(1, size)
    *size = sizeof(fmu_snapshot);
    return FMU_OK;
}

FMU_EXPORT fmi3Status fmi3SerializeFMUState(fmi3Instance c, fmi3FMUState state, uint8_t bytes[], size_t size)
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

FMU_EXPORT fmi3Status fmi3DeserializeFMUState(fmi3Instance c, const uint8_t bytes[], size_t size, fmi3FMUState *state)
{
    REQUIRE(LIVING)
    REQUIRE_ARRAY(1, bytes)
    REQUIRE_ARRAY(1, state)
    return fail(INSTANCE, fmu_unpack(INSTANCE, bytes, size, state));
}

FMU_EXPORT fmi3Status fmi3GetDirectionalDerivative(fmi3Instance c, const fmi3ValueReference unknowns[], size_t n_unknowns,
    const fmi3ValueReference knowns[], size_t n_knowns, const fmi3Float64 seed[], size_t n_seed, fmi3Float64 result[],
    size_t n_result)
{
    REQUIRE(FMU_INITIALIZING | FMU_EVENTS | FMU_CONTINUOUS | FMU_STEPPING | FMU_TERMINATED)
    REQUIRE_ARRAY(n_unknowns, unknowns)
    REQUIRE_ARRAY(n_knowns, knowns)
    REQUIRE_LENGTH(n_seed, n_knowns, seed)
    REQUIRE_LENGTH(n_result, n_unknowns, result)
    return fail(INSTANCE, fmu_directional(INSTANCE, unknowns, n_unknowns, knowns, n_knowns, seed, result));
}

/* ---- model exchange ---- */

FMU_EXPORT fmi3Status fmi3UpdateDiscreteStates(fmi3Instance c, fmi3Boolean *again, fmi3Boolean *terminate,
    fmi3Boolean *nominals_changed, fmi3Boolean *states_changed, fmi3Boolean *next_known, fmi3Float64 *next)
{
    int ended = 0, changed = 0;
    REQUIRE(FMU_EVENTS)
    if (again == NULL || terminate == NULL || nominals_changed == NULL || states_changed == NULL || next_known == NULL || next == NULL) {
        return fail(INSTANCE, fmu_say(INSTANCE, FMU_ERROR, "%s: an argument is missing", __func__));
    }
    const int status = fmu_update(INSTANCE, &ended, &changed);
    *again = *nominals_changed = *next_known = false;
    *next = 0.0;
    *terminate = ended != 0, *states_changed = changed != 0;
    return fail(INSTANCE, status);
}

FMU_EXPORT fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance c)
{
    REQUIRE(FMU_EVENTS)
    INSTANCE->m.phase = FMU_CONTINUOUS;
    return FMU_OK;
}

FMU_EXPORT fmi3Status fmi3CompletedIntegratorStep(fmi3Instance c, fmi3Boolean no_return, fmi3Boolean *event, fmi3Boolean *end)
{
    int found = 0;
    REQUIRE(FMU_CONTINUOUS)
    REQUIRE_ARRAY(1, event)
    REQUIRE_ARRAY(1, end)
    (void)no_return;
    const int status = fmu_completed(INSTANCE, &found);
    *event = found != 0, *end = false;
    return fail(INSTANCE, status);
}

FMU_EXPORT fmi3Status fmi3SetTime(fmi3Instance c, fmi3Float64 time)
{
    REQUIRE(FMU_EVENTS | FMU_CONTINUOUS)
    INSTANCE->m.t = time;
    INSTANCE->m.rates_known = 0;
    return FMU_OK;
}

FMU_EXPORT fmi3Status fmi3SetContinuousStates(fmi3Instance c, const fmi3Float64 x[], size_t n)
{
    REQUIRE(FMU_CONTINUOUS)
    REQUIRE_LENGTH(n, FMU_N_X, x)
    memcpy(INSTANCE->m.x, x, n * sizeof(double));
    INSTANCE->m.rates_known = 0;
    return FMU_OK;
}

FMU_EXPORT fmi3Status fmi3GetContinuousStateDerivatives(fmi3Instance c, fmi3Float64 rates[], size_t n)
{
    REQUIRE(LIVING & ~FMU_INSTANTIATED)
    REQUIRE_LENGTH(n, FMU_N_X, rates)
    const int status = fmu_rates(INSTANCE);
    memcpy(rates, INSTANCE->m.rates, n * sizeof(double));
    return fail(INSTANCE, status);
}

FMU_EXPORT fmi3Status fmi3GetEventIndicators(fmi3Instance c, fmi3Float64 values[], size_t n)
{
    REQUIRE(LIVING & ~FMU_INSTANTIATED)
    REQUIRE_LENGTH(n, FMU_N_EVENTS, values)
    return fail(INSTANCE, fmu_indicators(INSTANCE, values));
}

FMU_EXPORT fmi3Status fmi3GetContinuousStates(fmi3Instance c, fmi3Float64 x[], size_t n)
{
    REQUIRE(LIVING & ~FMU_INSTANTIATED)
    REQUIRE_LENGTH(n, FMU_N_X, x)
    const int status = fmu_ready(INSTANCE);
    memcpy(x, INSTANCE->m.x, n * sizeof(double));
    return fail(INSTANCE, status);
}

FMU_EXPORT fmi3Status fmi3GetNominalsOfContinuousStates(fmi3Instance c, fmi3Float64 nominal[], size_t n)
{
    REQUIRE(LIVING & ~FMU_INSTANTIATED)
    REQUIRE_LENGTH(n, FMU_N_X, nominal)
    memcpy(nominal, FMU_NOMINAL, n * sizeof(double));
    return FMU_OK;
}

FMU_EXPORT fmi3Status fmi3GetNumberOfEventIndicators(fmi3Instance c, size_t *n)
{
    REQUIRE(LIVING)
    REQUIRE_ARRAY(1, n)
    *n = FMU_N_EVENTS;
    return FMU_OK;
}

FMU_EXPORT fmi3Status fmi3GetNumberOfContinuousStates(fmi3Instance c, size_t *n)
{
    REQUIRE(LIVING)
    REQUIRE_ARRAY(1, n)
    *n = FMU_N_X;
    return FMU_OK;
}

/* ---- co-simulation ---- */

FMU_EXPORT fmi3Status fmi3EnterStepMode(fmi3Instance c)
{
    return refuse(c, __func__);
}

FMU_EXPORT fmi3Status fmi3GetOutputDerivatives(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const int32_t orders[],
    fmi3Float64 values[], size_t n_values)
{
    (void)vr, (void)orders, (void)values;
    return none(c, n + n_values, __func__);
}

#if FMU_CO_SIMULATION
FMU_EXPORT fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 time, fmi3Float64 step, fmi3Boolean no_return, fmi3Boolean *event,
    fmi3Boolean *terminate, fmi3Boolean *early, fmi3Float64 *last)
{
    int ended = 0;
    REQUIRE(FMU_STEPPING)
    if (event == NULL || terminate == NULL || early == NULL || last == NULL) {
        return fail(INSTANCE, fmu_say(INSTANCE, FMU_ERROR, "%s: an argument is missing", __func__));
    }
    (void)no_return;
    const int status = fmu_step(INSTANCE, time, step, &ended);
    *event = *early = false, *terminate = ended != 0, *last = INSTANCE->m.t;
    return fail(INSTANCE, status);
}
#endif

/* ---- what no model has: dependencies that change, adjoint derivatives, structural parameters, clocks ---- */

FMU_EXPORT fmi3Status fmi3GetNumberOfVariableDependencies(fmi3Instance c, fmi3ValueReference vr, size_t *n)
{
    (void)vr, (void)n;
    return refuse(c, __func__);
}

FMU_EXPORT fmi3Status fmi3GetVariableDependencies(fmi3Instance c, fmi3ValueReference vr, size_t at[], fmi3ValueReference
    of[], size_t of_at[], int kinds[], size_t n)
{
    (void)vr, (void)at, (void)of, (void)of_at, (void)kinds, (void)n;
    return refuse(c, __func__);
}

FMU_EXPORT fmi3Status fmi3GetAdjointDerivative(fmi3Instance c, const fmi3ValueReference unknowns[], size_t n_unknowns,
    const fmi3ValueReference knowns[], size_t n_knowns, const fmi3Float64 seed[], size_t n_seed, fmi3Float64 result[],
    size_t n_result)
{
    (void)unknowns, (void)n_unknowns, (void)knowns, (void)n_knowns, (void)seed, (void)n_seed, (void)result, (void)n_result;
    return refuse(c, __func__);
}

FMU_EXPORT fmi3Status fmi3EnterConfigurationMode(fmi3Instance c)
{
    return refuse(c, __func__);
}

FMU_EXPORT fmi3Status fmi3ExitConfigurationMode(fmi3Instance c)
{
    return refuse(c, __func__);
}

FMU_EXPORT fmi3Status fmi3GetIntervalDecimal(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3Float64
    values[], int qualifiers[])
{
    (void)vr, (void)n, (void)values, (void)qualifiers;
    return refuse(c, __func__);
}

FMU_EXPORT fmi3Status fmi3GetIntervalFraction(fmi3Instance c, const fmi3ValueReference vr[], size_t n, uint64_t
    counters[], uint64_t resolutions[], int qualifiers[])
{
    (void)vr, (void)n, (void)counters, (void)resolutions, (void)qualifiers;
    return refuse(c, __func__);
}

FMU_EXPORT fmi3Status fmi3GetShiftDecimal(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3Float64 values[])
{
    (void)vr, (void)n, (void)values;
    return refuse(c, __func__);
}

FMU_EXPORT fmi3Status fmi3GetShiftFraction(fmi3Instance c, const fmi3ValueReference vr[], size_t n, uint64_t counters[],
    uint64_t resolutions[])
{
    (void)vr, (void)n, (void)counters, (void)resolutions;
    return refuse(c, __func__);
}

FMU_EXPORT fmi3Status fmi3SetIntervalDecimal(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const fmi3Float64
    values[])
{
    (void)vr, (void)n, (void)values;
    return refuse(c, __func__);
}

FMU_EXPORT fmi3Status fmi3SetIntervalFraction(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const uint64_t
    counters[], const uint64_t resolutions[])
{
    (void)vr, (void)n, (void)counters, (void)resolutions;
    return refuse(c, __func__);
}

FMU_EXPORT fmi3Status fmi3SetShiftDecimal(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const fmi3Float64
    values[])
{
    (void)vr, (void)n, (void)values;
    return refuse(c, __func__);
}

FMU_EXPORT fmi3Status fmi3SetShiftFraction(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const uint64_t
    counters[], const uint64_t resolutions[])
{
    (void)vr, (void)n, (void)counters, (void)resolutions;
    return refuse(c, __func__);
}

FMU_EXPORT fmi3Status fmi3EvaluateDiscreteStates(fmi3Instance c)
{
    return refuse(c, __func__);
}

FMU_EXPORT fmi3Status fmi3ActivateModelPartition(fmi3Instance c, fmi3ValueReference vr, fmi3Float64 time)
{
    (void)vr, (void)time;
    return refuse(c, __func__);
}
