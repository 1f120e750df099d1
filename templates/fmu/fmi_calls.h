/* The functions that FMI 2.0 and 3.0 have alike. Included by the file of a version, which names them by FMI(name) and its
   types by HANDLE, BOOLEAN and STATE; LENGTH is the argument that the length of an array is in 3.0. With FMI_HEADERS that
   file takes the headers of the standard, and not types of its own, so that a compiler compares the functions with them. */
#if defined(FMI_HEADERS)
#define FMU_EXPORT
#elif defined(_WIN32)
#define FMU_EXPORT __declspec(dllexport)
#elif defined(__GNUC__)
#define FMU_EXPORT __attribute__((visibility("default")))
#else
#define FMU_EXPORT
#endif

#if defined(__GNUC__)
#pragma GCC diagnostic ignored "-Wunused-parameter" /* the standard's arguments, not all of which a model needs */
#endif

#define CALL(name) FMU_EXPORT FMI(Status) FMI(name)
#define INSTANCE ((fmu_instance *)c)
#define LIVING (FMU_ANY & ~FMU_FAILED)
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

/* The status; an error leaves an instance that can only be reset, copied back or freed. */
static FMI(Status) fail(fmu_instance *f, int status)
{
    if (f != NULL && status >= FMU_ERROR) {
        f->m.phase = FMU_FAILED;
    }
    return (FMI(Status))status;
}

/* Why an instance cannot be made, or NULL. */
static const char *wrong_name(const char *name, const char *token)
{
    return name == NULL || name[0] == '\0' ? "an instance needs a name"
           : token == NULL || strcmp(token, FMU_TOKEN) != 0
               ? "the " TOKEN " is not that of this model; modelDescription.xml belongs to another"
               : NULL;
}

CALL(SetDebugLogging)(HANDLE c, BOOLEAN on, size_t n, const FMI(String) categories[])
{
    if (c == NULL) {
        return FMU_ERROR;
    }
    INSTANCE->reports = on;
    return FMU_OK;
}

/* ---- phases ---- */

CALL(ExitInitializationMode)(HANDLE c)
{
    REQUIRE(FMU_INITIALIZING)
    int status = fmu_assemble(INSTANCE);
    INSTANCE->m.phase = INSTANCE->steps != NULL ? FMU_STEPPING : FMU_EVENTS;
    if (status == FMU_OK && INSTANCE->steps == NULL) {
        status = fmu_arm(INSTANCE);
    }
    return fail(INSTANCE, status);
}

#define TO_PHASE(name, phases, next) \
    CALL(name)(HANDLE c) \
    { \
        REQUIRE(phases) \
        INSTANCE->m.phase = next; \
        return FMU_OK; \
    }
TO_PHASE(EnterEventMode, FMU_CONTINUOUS | FMU_EVENTS, FMU_EVENTS)
TO_PHASE(EnterContinuousTimeMode, FMU_EVENTS, FMU_CONTINUOUS)
TO_PHASE(Terminate, FMU_EVENTS | FMU_CONTINUOUS | FMU_STEPPING, FMU_TERMINATED)

CALL(Reset)(HANDLE c)
{
    REQUIRE(FMU_ANY)
    fmu_reset(INSTANCE);
    return FMU_OK;
}

/* ---- values ---- */

CALL(GET_REAL)(HANDLE c, const FMI(ValueReference) vr[], size_t n, double values[] LENGTH(n_values))
{
    REQUIRE(LIVING)
    REQUIRE_ARRAY(n, vr)
    REQUIRE_NUMBERS(n_values, n, values)
    return fail(INSTANCE, fmu_get(INSTANCE, vr, n, values));
}

CALL(SET_REAL)(HANDLE c, const FMI(ValueReference) vr[], size_t n, const double values[] LENGTH(n_values))
{
    REQUIRE(LIVING & ~FMU_TERMINATED)
    REQUIRE_ARRAY(n, vr)
    REQUIRE_NUMBERS(n_values, n, values)
    return fail(INSTANCE, fmu_set(INSTANCE, vr, n, values));
}

CALL(GetDirectionalDerivative)(HANDLE c, const FMI(ValueReference) unknowns[], size_t n_unknowns,
    const FMI(ValueReference) knowns[], size_t n_knowns, const double seed[] LENGTH(n_seed), double result[] LENGTH(n_result))
{
    REQUIRE(FMU_INITIALIZING | FMU_EVENTS | FMU_CONTINUOUS | FMU_STEPPING | FMU_TERMINATED)
    REQUIRE_ARRAY(n_unknowns, unknowns)
    REQUIRE_ARRAY(n_knowns, knowns)
    REQUIRE_NUMBERS(n_seed, n_knowns, seed)
    REQUIRE_NUMBERS(n_result, n_unknowns, result)
    return fail(INSTANCE, fmu_directional(INSTANCE, unknowns, n_unknowns, knowns, n_knowns, seed, result));
}

/* ---- copies of the state ---- */

CALL(GET_STATE)(HANDLE c, STATE *state)
{
    REQUIRE(LIVING)
    REQUIRE_ARRAY(1, state)
    return fail(INSTANCE, fmu_keep(INSTANCE, state));
}

CALL(SET_STATE)(HANDLE c, STATE state)
{
    REQUIRE(FMU_ANY)
    return fail(INSTANCE, fmu_restore(INSTANCE, state));
}

CALL(FREE_STATE)(HANDLE c, STATE *state)
{
    REQUIRE(FMU_ANY)
    if (state != NULL) {
        free(*state);
        *state = NULL;
    }
    return FMU_OK;
}

CALL(SIZE_OF_STATE)(HANDLE c, STATE state, size_t *size)
{
    REQUIRE(LIVING)
    REQUIRE_ARRAY(1, state)
    REQUIRE_ARRAY(1, size)
    *size = sizeof(fmu_snapshot);
    return FMU_OK;
}

CALL(SERIALIZE)(HANDLE c, STATE state, FMI(Byte) bytes[], size_t size)
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

CALL(DESERIALIZE)(HANDLE c, const FMI(Byte) bytes[], size_t size, STATE *state)
{
    REQUIRE(LIVING)
    REQUIRE_ARRAY(1, bytes)
    REQUIRE_ARRAY(1, state)
    return fail(INSTANCE, fmu_unpack(INSTANCE, bytes, size, state));
}

/* ---- model exchange ---- */

CALL(CompletedIntegratorStep)(HANDLE c, BOOLEAN no_return, BOOLEAN *event, BOOLEAN *end)
{
    int found = 0;
    REQUIRE(FMU_CONTINUOUS)
    REQUIRE_ARRAY(1, event)
    REQUIRE_ARRAY(1, end)
    const int status = fmu_completed(INSTANCE, &found);
    *event = found != 0, *end = 0;
    return fail(INSTANCE, status);
}

CALL(SetTime)(HANDLE c, double time)
{
    REQUIRE(FMU_EVENTS | FMU_CONTINUOUS)
    INSTANCE->m.t = time;
    INSTANCE->m.rates_known = 0;
    return FMU_OK;
}

CALL(SetContinuousStates)(HANDLE c, const double x[], size_t n)
{
    REQUIRE(FMU_CONTINUOUS)
    REQUIRE_LENGTH(n, FMU_N_X, x)
    memcpy(INSTANCE->m.x, x, n * sizeof(double));
    INSTANCE->m.rates_known = 0;
    return FMU_OK;
}

CALL(GetContinuousStates)(HANDLE c, double x[], size_t n)
{
    REQUIRE(LIVING & ~FMU_INSTANTIATED)
    REQUIRE_LENGTH(n, FMU_N_X, x)
    const int status = fmu_ready(INSTANCE);
    memcpy(x, INSTANCE->m.x, n * sizeof(double));
    return fail(INSTANCE, status);
}

CALL(GET_RATES)(HANDLE c, double rates[], size_t n)
{
    REQUIRE(LIVING & ~FMU_INSTANTIATED)
    REQUIRE_LENGTH(n, FMU_N_X, rates)
    const int status = fmu_rates(INSTANCE);
    memcpy(rates, INSTANCE->m.rates, n * sizeof(double));
    return fail(INSTANCE, status);
}

CALL(GetNominalsOfContinuousStates)(HANDLE c, double nominal[], size_t n)
{
    REQUIRE(LIVING & ~FMU_INSTANTIATED)
    REQUIRE_LENGTH(n, FMU_N_X, nominal)
    memcpy(nominal, FMU_NOMINAL, n * sizeof(double));
    return FMU_OK;
}

CALL(GetEventIndicators)(HANDLE c, double values[], size_t n)
{
    REQUIRE(LIVING & ~FMU_INSTANTIATED)
    REQUIRE_LENGTH(n, FMU_N_EVENTS, values)
    return fail(INSTANCE, fmu_indicators(INSTANCE, values));
}
