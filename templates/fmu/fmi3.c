/* The functions of FMI 3.0 for model exchange and co-simulation: https://fmi-standard.org. */
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "eomgen_fmu.h"

#if defined(FMI_HEADERS)
#include "fmi3Functions.h"
#else
typedef void *fmi3Instance, *fmi3InstanceEnvironment, *fmi3FMUState;
typedef int fmi3Status, fmi3DependencyKind, fmi3IntervalQualifier;
typedef const char *fmi3String;
typedef uint8_t fmi3Byte;
typedef const fmi3Byte *fmi3Binary;
typedef bool fmi3Boolean, fmi3Clock;
typedef double fmi3Float64;
typedef uint32_t fmi3ValueReference;
typedef void (*fmi3LogMessageCallback)(fmi3InstanceEnvironment environment, fmi3Status status, fmi3String category, fmi3String message);
typedef void (*fmi3IntermediateUpdateCallback)(void); /* this and those below are never called */
typedef void (*fmi3ClockUpdateCallback)(void);
typedef void (*fmi3LockPreemptionCallback)(void);
typedef void (*fmi3UnlockPreemptionCallback)(void);
#endif

#define FMI(name) fmi3##name
#define HANDLE fmi3Instance
#define BOOLEAN fmi3Boolean
#define STATE fmi3FMUState
#define TOKEN "instantiation token"
#define GET_STATE GetFMUState
#define SET_STATE SetFMUState
#define FREE_STATE FreeFMUState
#define SIZE_OF_STATE SerializedFMUStateSize
#define SERIALIZE SerializeFMUState
#define DESERIALIZE DeserializeFMUState
#define GET_RATES GetContinuousStateDerivatives
#define GET_REAL GetFloat64
#define SET_REAL SetFloat64
#define LENGTH(n) , size_t n
#define REQUIRE_NUMBERS REQUIRE_LENGTH
#include "fmi_calls.h"

static void report(const fmu_instance *f, int status, const char *text)
{
    ((fmi3LogMessageCallback)f->logger)(f->environment, (fmi3Status)status, status >= FMU_ERROR ? "logStatusError" : "logAll", text);
}

FMU_EXPORT const char *fmi3GetVersion(void)
{
    return "3.0";
}

static fmi3Instance create(fmi3String name, fmi3String token, bool reports, fmi3InstanceEnvironment environment,
    fmi3LogMessageCallback logger, int steps)
{
    const char *const wrong = wrong_name(name, token);
    if (wrong != NULL) {
        if (logger != NULL) {
            logger(environment, (fmi3Status)FMU_ERROR, "logStatusError", wrong);
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
    fmi3Boolean visible, fmi3Boolean reports, fmi3InstanceEnvironment environment, fmi3LogMessageCallback logger)
{
    return create(name, token, reports, environment, logger, 0);
}

FMU_EXPORT fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources,
    fmi3Boolean visible, fmi3Boolean reports, fmi3Boolean event_mode, fmi3Boolean early_return,
    const fmi3ValueReference intermediate[], size_t n, fmi3InstanceEnvironment environment, fmi3LogMessageCallback logger,
    fmi3IntermediateUpdateCallback update)
{
    return FMU_CO_SIMULATION ? create(name, token, reports, environment, logger, 1) : NULL;
}

FMU_EXPORT fmi3Instance fmi3InstantiateScheduledExecution(fmi3String name, fmi3String token, fmi3String resources,
    fmi3Boolean visible, fmi3Boolean reports, fmi3InstanceEnvironment environment, fmi3LogMessageCallback logger,
    fmi3ClockUpdateCallback clock, fmi3LockPreemptionCallback lock, fmi3UnlockPreemptionCallback unlock)
{
    if (logger != NULL) {
        logger(environment, (fmi3Status)FMU_ERROR, "logStatusError", "there is no scheduled execution of this model");
    }
    return NULL;
}

FMU_EXPORT void fmi3FreeInstance(fmi3Instance c)
{
    fmu_delete(INSTANCE);
}

CALL(EnterInitializationMode)(fmi3Instance c, fmi3Boolean tolerance_given, fmi3Float64 tolerance, fmi3Float64 start,
    fmi3Boolean stop_given, fmi3Float64 stop)
{
    REQUIRE(FMU_INSTANTIATED)
    const int status = fmu_start(INSTANCE, start, tolerance_given, tolerance);
    INSTANCE->m.phase = FMU_INITIALIZING;
    return fail(INSTANCE, status);
}

/* ---- values ---- */

/* A call for variables of a type that there is none of. */
#define NONE(name, count, ...) \
    CALL(name)(fmi3Instance c, const fmi3ValueReference vr[], size_t n, __VA_ARGS__) \
    { \
        REQUIRE(LIVING) \
        return (count) == 0 ? (fmi3Status)FMU_OK \
                            : fail(INSTANCE, fmu_say(INSTANCE, FMU_ERROR, "%s: all variables are of type Float64", __func__)); \
    }
#define NONE_OF(type, each) \
    NONE(Get##type, n + n_values, each values[], size_t n_values) \
    NONE(Set##type, n + n_values, const each values[], size_t n_values)
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
NONE(GetBinary, n + n_values, size_t sizes[], fmi3Binary values[], size_t n_values)
NONE(SetBinary, n + n_values, const size_t sizes[], const fmi3Binary values[], size_t n_values)
NONE(GetClock, n, fmi3Clock values[])
NONE(SetClock, n, const fmi3Clock values[])
NONE(GetOutputDerivatives, n + n_values, const int32_t orders[], fmi3Float64 values[], size_t n_values)

/* ---- model exchange ---- */

CALL(UpdateDiscreteStates)(fmi3Instance c, fmi3Boolean *again, fmi3Boolean *terminate, fmi3Boolean *nominals_changed,
    fmi3Boolean *states_changed, fmi3Boolean *next_known, fmi3Float64 *next)
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

#define COUNT(name, count) \
    CALL(name)(fmi3Instance c, size_t *n) \
    { \
        REQUIRE(LIVING) \
        REQUIRE_ARRAY(1, n) \
        *n = count; \
        return FMU_OK; \
    }
COUNT(GetNumberOfEventIndicators, FMU_N_EVENTS)
COUNT(GetNumberOfContinuousStates, FMU_N_X)

/* ---- co-simulation ---- */

#if FMU_CO_SIMULATION
CALL(DoStep)(fmi3Instance c, fmi3Float64 time, fmi3Float64 step, fmi3Boolean no_return, fmi3Boolean *event, fmi3Boolean *terminate,
    fmi3Boolean *early, fmi3Float64 *last)
{
    int ended = 0;
    REQUIRE(FMU_STEPPING)
    if (event == NULL || terminate == NULL || early == NULL || last == NULL) {
        return fail(INSTANCE, fmu_say(INSTANCE, FMU_ERROR, "%s: an argument is missing", __func__));
    }
    const int status = fmu_step(INSTANCE, time, step, &ended);
    *event = *early = false, *terminate = ended != 0, *last = INSTANCE->m.t;
    return fail(INSTANCE, status);
}
#endif

/* ---- what no model has: dependencies that change, adjoint derivatives, structural parameters, clocks, steps with events ---- */

#define REFUSED(name, ...) \
    CALL(name)(__VA_ARGS__) \
    { \
        return c == NULL ? (fmi3Status)FMU_ERROR \
                         : fail(INSTANCE, fmu_say(INSTANCE, FMU_ERROR, "%s: this model has nothing of that kind", __func__)); \
    }
#define VARIABLES fmi3Instance c, const fmi3ValueReference vr[], size_t n
REFUSED(EnterStepMode, fmi3Instance c)
REFUSED(GetNumberOfVariableDependencies, fmi3Instance c, fmi3ValueReference vr, size_t *n)
REFUSED(GetVariableDependencies, fmi3Instance c, fmi3ValueReference vr, size_t at[], fmi3ValueReference of[], size_t of_at[],
    fmi3DependencyKind kinds[], size_t n)
REFUSED(GetAdjointDerivative, fmi3Instance c, const fmi3ValueReference unknowns[], size_t n_unknowns,
    const fmi3ValueReference knowns[], size_t n_knowns, const fmi3Float64 seed[], size_t n_seed, fmi3Float64 result[],
    size_t n_result)
REFUSED(EnterConfigurationMode, fmi3Instance c)
REFUSED(ExitConfigurationMode, fmi3Instance c)
REFUSED(GetIntervalDecimal, VARIABLES, fmi3Float64 values[], fmi3IntervalQualifier qualifiers[])
REFUSED(GetIntervalFraction, VARIABLES, uint64_t counters[], uint64_t resolutions[], fmi3IntervalQualifier qualifiers[])
REFUSED(GetShiftDecimal, VARIABLES, fmi3Float64 values[])
REFUSED(GetShiftFraction, VARIABLES, uint64_t counters[], uint64_t resolutions[])
REFUSED(SetIntervalDecimal, VARIABLES, const fmi3Float64 values[])
REFUSED(SetIntervalFraction, VARIABLES, const uint64_t counters[], const uint64_t resolutions[])
REFUSED(SetShiftDecimal, VARIABLES, const fmi3Float64 values[])
REFUSED(SetShiftFraction, VARIABLES, const uint64_t counters[], const uint64_t resolutions[])
REFUSED(EvaluateDiscreteStates, fmi3Instance c)
REFUSED(ActivateModelPartition, fmi3Instance c, fmi3ValueReference vr, fmi3Float64 time)
