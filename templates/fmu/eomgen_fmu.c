/* Instances, messages, values by reference, evaluation. */
#include <float.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "eomgen_fmu.h"

void fmu_reset(fmu_instance *f)
{
    fmu_memory *const m = &f->m;
    memset(m, 0, sizeof *m);
    m->phase = FMU_INSTANTIATED;
    memcpy(m->x, FMU_START_X, FMU_N_X * sizeof(double));
    memcpy(m->u, FMU_START_U, FMU_N_U * sizeof(double));
    memcpy(m->p, FMU_START_P, FMU_N_P * sizeof(double));
    m->rtol = FMU_RTOL;
    m->assembled = 1;
}

fmu_instance *fmu_create(const char *name, int steps)
{
    fmu_instance *const f = (fmu_instance *)calloc(1, sizeof *f);
    if (f == NULL) {
        return NULL;
    }
    f->name = (char *)malloc(strlen(name) + 1);
    f->steps = steps ? (double *)calloc((size_t)fmu_step_room(), sizeof(double)) : NULL;
    if (f->name == NULL || (steps && f->steps == NULL)) {
        fmu_delete(f);
        return NULL;
    }
    memcpy(f->name, name, strlen(name) + 1);
    fmu_reset(f);
    return f;
}

void fmu_delete(fmu_instance *f)
{
    if (f != NULL) {
        free(f->name);
        free(f->steps);
        free(f);
    }
}

int fmu_say(fmu_instance *f, int status, const char *format, ...)
{
    if (f->report != NULL && (f->reports || status >= FMU_ERROR)) {
        va_list given;
        va_start(given, format);
        (void)vsnprintf(f->text, sizeof f->text, format, given);
        va_end(given);
        f->report(f, status, f->text);
    }
    return status;
}

int fmu_check(fmu_instance *f, int phases, const char *function)
{
    static const char *const names[] = {"instantiated", "initialization mode", "event mode", "continuous-time mode",
        "step mode", "terminated", "failed"};
    int at = 0;
    if (f == NULL) {
        return FMU_ERROR;
    }
    if ((f->m.phase & phases) != 0) {
        return FMU_OK;
    }
    while (at < 6 && (f->m.phase >> at & 1) == 0) {
        at++;
    }
    return fmu_say(f, FMU_ERROR, "%s must not be called while the instance is in this state: %s", function, names[at]);
}

int fmu_judge(fmu_instance *f, int status, const char *what)
{
    static const char *const reasons[] = {"", "a result is not a finite number", "the mass matrix is singular",
        "the loops cannot be closed", "the independent coordinates cannot move the mechanism here",
        "rounding leaves the accelerations unsolved"};
    if (status == EOMGEN_SUCCESS) {
        return FMU_OK;
    }
    if (status < 0 || status > EOMGEN_UNSOLVED) {
        return fmu_say(f, FMU_ERROR, "%s at t = %.9g s: status %d", what, f->m.t, status);
    }
    return fmu_say(f, FMU_DISCARD, "%s at t = %.9g s: %s", what, f->m.t, reasons[status]);
}

int fmu_constants(fmu_instance *f)
{
    fmu_memory *const m = &f->m;
    if (!m->constants_known) {
        const int status = fmu_judge(f, FMU_MODEL(precompute)(m->p, m->c), "the constants of the parameters");
        if (status != FMU_OK) {
            return status;
        }
        m->constants_known = 1;
    }
    return FMU_OK;
}

int fmu_ready(fmu_instance *f)
{
    return f->m.phase == FMU_INITIALIZING && !f->m.assembled ? fmu_assemble(f) : (int)FMU_OK;
}

int fmu_rates(fmu_instance *f)
{
    fmu_memory *const m = &f->m;
    int status = fmu_ready(f);
    status = status == FMU_OK ? fmu_constants(f) : status;
    if (status == FMU_OK && !m->rates_known) {
        status = fmu_judge(f, FMU_MODEL(rhs)(m->t, m->x, m->u, m->c, m->rates, f->w), "the derivatives of the states");
        m->rates_known = status == FMU_OK;
    }
    return status;
}

int fmu_outputs(fmu_instance *f, double *y)
{
#if FMU_HAS_OUTPUTS
    const int status = fmu_constants(f);
    return status != FMU_OK ? status : fmu_judge(f, FMU_MODEL(outputs)(f->m.t, f->m.x, f->m.u, f->m.c, y, f->w), "the outputs");
#else
    (void)f, (void)y;
    return FMU_OK;
#endif
}

int fmu_get(fmu_instance *f, const unsigned *references, size_t n, double *values)
{
    const fmu_memory *const m = &f->m;
    int outputs = 0, rates = 0, events = 0;
    for (size_t i = 0; i < n; i++) {
        if (references[i] >= (unsigned)FMU_N_VARIABLES) {
            return fmu_say(f, FMU_ERROR, "value reference %u is none of this model's, which are 0 to %d", references[i],
                FMU_N_VARIABLES - 1);
        }
        outputs |= references[i] >= (unsigned)FMU_AT_Y && references[i] < (unsigned)FMU_AT_TIME;
        events |= references[i] >= (unsigned)FMU_AT_EVENTS;
        rates |= references[i] >= (unsigned)FMU_AT_RATES && references[i] < (unsigned)FMU_AT_U;
    }
    int status = fmu_ready(f);
    status = status == FMU_OK && rates ? fmu_rates(f) : status;
    status = status == FMU_OK && outputs ? fmu_outputs(f, f->values) : status;
    status = status == FMU_OK && events ? fmu_indicators(f, f->values + FMU_N_Y) : status;
    for (size_t i = 0; i < n && status == FMU_OK; i++) {
        const int k = (int)references[i];
        values[i] = k < FMU_AT_RATES  ? m->x[k - FMU_AT_X]
                    : k < FMU_AT_U    ? m->rates[k - FMU_AT_RATES]
                    : k < FMU_AT_P    ? m->u[k - FMU_AT_U]
                    : k < FMU_AT_Y    ? m->p[k - FMU_AT_P]
                    : k < FMU_AT_TIME ? f->values[k - FMU_AT_Y]
                    : k > FMU_AT_TIME ? f->values[FMU_N_Y + k - FMU_AT_EVENTS]
                                      : m->t;
    }
    return status;
}

/* Why a value cannot be set now, or NULL. */
static const char *refusal(const fmu_memory *m, int k, double value)
{
    if (k < 0 || k >= FMU_N_VARIABLES) {
        return "no such variable";
    }
    if (!isfinite(value)) {
        return "the value is not a finite number";
    }
    if (k < FMU_AT_RATES) {
        return (m->phase & (FMU_INSTANTIATED | FMU_INITIALIZING)) != 0 ? NULL : "states are set before initialization ends";
    }
    if (k >= FMU_AT_P && k < FMU_AT_Y) {
        return m->phase != FMU_CONTINUOUS ? NULL : "parameters are not set in continuous-time mode";
    }
    return k >= FMU_AT_U && k < FMU_AT_P ? NULL : "the variable is calculated by the model";
}

int fmu_set(fmu_instance *f, const unsigned *references, size_t n, const double *values)
{
    fmu_memory *const m = &f->m;
    for (size_t i = 0; i < n; i++) {
        const char *const why = refusal(m, references[i] < (unsigned)FMU_N_VARIABLES ? (int)references[i] : -1, values[i]);
        if (why != NULL) { /* nothing is set then */
            return fmu_say(f, FMU_ERROR, "value reference %u cannot be set to %.9g: %s", references[i], values[i], why);
        }
    }
    for (size_t i = 0; i < n; i++) {
        const int k = (int)references[i];
        if (k < FMU_AT_RATES) {
            m->x[k] = values[i];
            m->guessed[k] = !FMU_INDEPENDENT[k];
        } else if (k < FMU_AT_P) {
            m->u[k - FMU_AT_U] = values[i];
        } else {
            m->p[k - FMU_AT_P] = values[i];
            m->constants_known = 0;
        }
    }
    if (n > 0) {
        m->rates_known = 0;
        m->assembled = (m->phase & (FMU_INSTANTIATED | FMU_INITIALIZING)) == 0;
    }
    return FMU_OK;
}

int fmu_keep(fmu_instance *f, void **kept)
{
    fmu_snapshot *copy = (fmu_snapshot *)*kept;
    if (copy == NULL) {
        copy = (fmu_snapshot *)calloc(1, sizeof *copy);
    }
    if (copy == NULL) {
        return fmu_say(f, FMU_ERROR, "there is no memory for a copy of the state");
    }
    memcpy(copy->digest, FMU_TOKEN, sizeof copy->digest);
    copy->steps = f->steps != NULL;
    copy->m = f->m;
    *kept = copy;
    return FMU_OK;
}

int fmu_restore(fmu_instance *f, const void *kept)
{
    const fmu_snapshot *const copy = (const fmu_snapshot *)kept;
    if (copy == NULL || memcmp(copy->digest, FMU_TOKEN, sizeof copy->digest) != 0 || copy->steps != (f->steps != NULL)) {
        return fmu_say(f, FMU_ERROR, "the state to return to is not one of such an instance of %s", FMU_NAME);
    }
    f->m = copy->m;
    return FMU_OK;
}

int fmu_unpack(fmu_instance *f, const void *bytes, size_t size, void **kept)
{
    if (size < sizeof(fmu_snapshot) || memcmp(bytes, FMU_TOKEN, sizeof ((fmu_snapshot *)0)->digest) != 0) {
        return fmu_say(f, FMU_ERROR, "the bytes are no state of %s", FMU_NAME);
    }
    const int status = fmu_keep(f, kept);
    if (status == FMU_OK) {
        memcpy(*kept, bytes, sizeof(fmu_snapshot));
    }
    return status;
}
