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

/* Initialization: the states that were set, and the others so that loops are closed. */

int fmu_project(fmu_instance *f, const double *x, double *closed)
{
#if FMU_HAS_PROJECT
    fmu_memory *const m = &f->m;
    const int status = fmu_constants(f);
    return status != FMU_OK ? status
                            : fmu_judge(f, FMU_MODEL(project)(m->t, x, m->u, m->c, closed, f->w), "closing the loops");
#else
    (void)f;
    memcpy(closed, x, FMU_N_X * sizeof(double));
    return FMU_OK;
#endif
}

#if FMU_HAS_KINEMATICS
static double part(double from, double to, double s)
{
    return s == 1.0 ? to : from + s * (to - from);
}

/* All coordinates at a part s of the way from the model's own start to what was set; begins at q. */
static int follow(fmu_instance *f, double s, const double *q, double *found)
{
    fmu_memory *const m = &f->m;
    double *const given = f->trial, *const p = f->values, *const u = f->values + FMU_N_P;
    for (int i = 0; i < FMU_N_P; i++) {
        p[i] = part(FMU_START_P[i], m->p[i], s);
    }
    for (int i = 0; i < FMU_N_U; i++) {
        u[i] = part(FMU_START_U[i], m->u[i], s);
    }
    for (int i = 0; i < FMU_N_DOF; i++) {
        given[i] = part(FMU_START_X[FMU_FREE_Q[i]], m->x[FMU_FREE_Q[i]], s);
        given[FMU_N_DOF + i] = m->x[FMU_N_Q + FMU_FREE_V[i]];
        given[2 * FMU_N_DOF + i] = 0.0;
    }
    memcpy(given + 3 * FMU_N_DOF, q, FMU_N_Q * sizeof(double));
    const int status = FMU_MODEL(precompute)(p, m->c);
    m->constants_known = 0;
    return status != 0 ? status : FMU_MODEL(kinematics)(part(0.0, m->t, s), given, u, m->c, found, f->w);
}

/* The longest way of a coordinate, where 1 is 1 rad or the size of the mechanism. */
static double way(const double *a, const double *b)
{
    double most = 0.0;
    for (int i = 0; i < FMU_N_Q; i++) {
        most = fmax(most, fabs(a[i] - b[i]) / FMU_NOMINAL[i]);
    }
    return most;
}

static int assemble_loops(fmu_instance *f)
{
    enum { SHORTEST = 4096 };
    fmu_memory *const m = &f->m;
    double *const found = f->trial + 3 * FMU_N_DOF + FMU_N_Q, *const q = f->closed;
    int told = 0, status = 0;
    memcpy(q, FMU_START_X, FMU_N_Q * sizeof(double));
    for (int i = 0; i < FMU_N_Q; i++) {
        if (m->guessed[i]) {
            q[i] = m->x[i], told = 1;
        }
    }
    if (told) { /* somebody says where the others are */
        status = follow(f, 1.0, q, found);
        if (status == 0) {
            memcpy(m->x, found, FMU_N_X * sizeof(double));
        }
        return fmu_judge(f, status, "assembly from the coordinates given");
    }
    double s = 0.0, step = 1.0;
    while (s < 1.0) {
        const double next = s + step < 1.0 ? s + step : 1.0;
        status = follow(f, next, q, found);
        if (status == 0 && way(found, q) <= 0.3) { /* short enough to stay on its branch */
            memcpy(q, found, FMU_N_Q * sizeof(double));
            s = next;
            step *= 2.0;
        } else if ((step *= 0.5) < 1.0 / SHORTEST) {
            (void)fmu_say(f, FMU_ERROR,
                "the mechanism cannot be assembled with these start values and parameters: the way from its own start "
                "ends after %.3g of 1", s);
            return FMU_ERROR;
        }
    }
    memcpy(m->x, found, FMU_N_X * sizeof(double));
    return FMU_OK;
}
#endif

static int as_given(const fmu_memory *m)
{
    return m->t == 0.0 && memcmp(m->x, FMU_START_X, FMU_N_X * sizeof(double)) == 0 &&
           memcmp(m->u, FMU_START_U, FMU_N_U * sizeof(double)) == 0 && memcmp(m->p, FMU_START_P, FMU_N_P * sizeof(double)) == 0;
}

#if FMU_HAS_PROJECT && !FMU_HAS_KINEMATICS
/* The nearest closed state with the values of exact states: projected, and these put back, until they stay. */
static int assemble_around(fmu_instance *f)
{
    enum { MOST = 5000 };
    fmu_memory *const m = &f->m;
    double *const given = f->trial, last = HUGE_VAL;
    memcpy(given, m->x, FMU_N_X * sizeof(double));
    for (int k = 0; k < MOST; k++) {
        double off = 0.0;
        const int status = fmu_project(f, m->x, f->closed);
        if (status != FMU_OK) {
            return status;
        }
        for (int i = 0; i < FMU_N_X; i++) {
            const double size = fmax(FMU_NOMINAL[i], fabs(given[i]));
            off = FMU_INDEPENDENT[i] ? fmax(off, fabs(f->closed[i] - given[i]) / size) : off;
            m->x[i] = FMU_INDEPENDENT[i] ? given[i] : f->closed[i];
        }
        if (off <= RUNS_INSTANT || (off <= RUNS_SAME && off >= last)) { /* until rounding is left */
            return FMU_OK;
        }
        last = off;
    }
    return fmu_say(f, FMU_ERROR, "the mechanism cannot be assembled with these start values and parameters");
}
#endif

int fmu_close(fmu_instance *f)
{
#if FMU_HAS_KINEMATICS
    return assemble_loops(f);
#elif FMU_HAS_PROJECT
    return assemble_around(f);
#else
    (void)f;
    return FMU_OK;
#endif
}

int fmu_assemble(fmu_instance *f)
{
    fmu_memory *const m = &f->m;
    m->rates_known = 0;
    int status = as_given(m) ? (int)FMU_OK : fmu_close(f);
    status = status == FMU_OK ? fmu_set_clocks(f) : status;
    m->assembled = status == FMU_OK;
    return status == FMU_DISCARD ? (int)FMU_ERROR : status;
}

int fmu_start(fmu_instance *f, double t, int tolerance_given, double tolerance)
{
    fmu_memory *const m = &f->m;
    if (!isfinite(t)) {
        return fmu_say(f, FMU_ERROR, "the start time is not a finite number");
    }
    if (tolerance_given && !(tolerance > 0.0 && tolerance < 1.0)) {
        return fmu_say(f, FMU_ERROR, "the tolerance must be between 0 and 1, not %.9g", tolerance);
    }
    m->t = m->t_start = t;
    m->rtol = tolerance_given ? tolerance : FMU_RTOL;
    m->rates_known = 0, m->assembled = 0;
    return FMU_OK;
}

/* Directional derivatives of the derivatives of states and of outputs, by states, inputs and parameters. */

/* Sums of the columns of a row-major matrix, each times its part of the direction. */
static void add(const double *matrix, int rows, int columns, const double *direction, double *sum)
{
    for (int i = 0; i < rows; i++) {
        for (int k = 0; k < columns; k++) {
            sum[i] += matrix[i * columns + k] * direction[k];
        }
    }
}

static int any(const double *direction, int n)
{
    int found = 0;
    for (int i = 0; i < n; i++) {
        found = found || direction[i] != 0.0;
    }
    return found;
}

/* d(x') along a direction of x, u and p. */
static int of_rates(fmu_instance *f, const double *dx, const double *du, const double *dp, double *sum)
{
    fmu_memory *const m = &f->m;
    int status = 0;
    memset(sum, 0, FMU_N_X * sizeof(double));
    if (any(dx, FMU_N_X)) {
        status = FMU_MODEL(jacobian)(m->t, m->x, m->u, m->c, f->matrix, f->w);
        add(f->matrix, FMU_N_X, FMU_N_X, dx, sum);
    }
#if FMU_N_U
    if (status == 0 && any(du, FMU_N_U)) {
        status = FMU_MODEL(input_jacobian)(m->t, m->x, m->u, m->c, f->matrix, f->w);
        add(f->matrix, FMU_N_X, FMU_N_U, du, sum);
    }
#else
    (void)du;
#endif
#if FMU_N_P
    if (status == 0 && any(dp, FMU_N_P)) {
        status = FMU_MODEL(parameter_jacobian)(m->t, m->x, m->u, m->c, f->matrix, f->w);
        add(f->matrix, FMU_N_X, FMU_N_P, dp, sum);
    }
#else
    (void)dp;
#endif
    return fmu_judge(f, status, "the directional derivatives");
}

#if FMU_HAS_PROJECT
/* Differences of order 6 at the places -3 .. 3 times their spacing, for the closing of loops, whose own derivative is no
   function of the model. */
static double weight_of(int k, double h)
{
    static const double weights[] = {3.0 / 4.0, -3.0 / 20.0, 1.0 / 60.0};
    return (k < 0 ? -weights[-k - 1] : weights[k - 1]) / h;
}

/* Their spacing along a direction; 0 if it is none. */
static double spacing_along(const fmu_memory *m, const double *dx, const double *du, const double *dp)
{
    double size = 0.0;
    for (int i = 0; i < FMU_N_X; i++) {
        size = fmax(size, fabs(dx[i]) / fmax(FMU_NOMINAL[i], fabs(m->x[i])));
    }
    for (int i = 0; i < FMU_N_U; i++) {
        size = fmax(size, fabs(du[i]) / fmax(1.0, fabs(m->u[i])));
    }
    for (int i = 0; i < FMU_N_P; i++) {
        size = fmax(size, fabs(dp[i]) / fmax(fabs(FMU_START_P[i]), fabs(m->p[i]) > 0.0 ? fabs(m->p[i]) : 1.0));
    }
    return size > 0.0 ? 2e-3 / size : 0.0;
}

static void displace(fmu_memory *m, double way, const double *dx, const double *du, const double *dp)
{
    for (int i = 0; i < FMU_N_X; i++) {
        m->x[i] += way * dx[i];
    }
    for (int i = 0; i < FMU_N_U; i++) {
        m->u[i] += way * du[i];
    }
    for (int i = 0; i < FMU_N_P; i++) {
        m->p[i] += way * dp[i];
    }
    m->constants_known = 0;
}

/* During initialization: dx of all states where those of the exact ones are given and the others follow. */
static int of_start(fmu_instance *f, double *dx, const double *du, const double *dp)
{
    fmu_memory *const m = &f->m;
    double sum[FMU_N_X + 1] = {0.0};
    int status = FMU_OK;
    for (int i = 0; i < FMU_N_X; i++) {
        dx[i] = FMU_INDEPENDENT[i] ? dx[i] : 0.0; /* the value of another is a guess only */
    }
    const double h = spacing_along(m, dx, du, dp);
    f->before = *m;
    for (int k = -3; k <= 3 && h > 0.0 && status == FMU_OK; k += k == -1 ? 2 : 1) {
        displace(m, k * h, dx, du, dp);
        for (int i = 0; i < FMU_N_X; i++) {
            m->guessed[i] = !FMU_INDEPENDENT[i];
        }
        status = fmu_close(f);
        for (int i = 0; i < FMU_N_X; i++) {
            sum[i] += weight_of(k, h) * m->x[i];
        }
        *m = f->before;
    }
    for (int i = 0; i < FMU_N_X; i++) {
        dx[i] = FMU_INDEPENDENT[i] ? dx[i] : sum[i];
    }
    return status;
}
#endif

#if FMU_HAS_OUTPUTS && !FMU_HAS_PROJECT
/* dy by the chain rule: y is a function of q, v, the accelerations, u and p. */
static int of_outputs(fmu_instance *f, const double *dx, const double *du, const double *dp, const double *d_rates, double *sum)
{
    enum { WIDTH = FMU_N_X + FMU_N_V + FMU_N_U + FMU_N_P };
    fmu_memory *const m = &f->m;
    double *const at = f->trial, *const along = f->trial + FMU_N_X + FMU_N_V;
    int status = fmu_rates(f);
    memcpy(at, m->x, FMU_N_X * sizeof(double));
    memcpy(at + FMU_N_X, m->rates + FMU_N_Q, FMU_N_V * sizeof(double));
    memcpy(along, dx, FMU_N_X * sizeof(double));
    memcpy(along + FMU_N_X, d_rates + FMU_N_Q, FMU_N_V * sizeof(double));
    memcpy(along + FMU_N_X + FMU_N_V, du, FMU_N_U * sizeof(double));
    memcpy(along + FMU_N_X + FMU_N_V + FMU_N_U, dp, FMU_N_P * sizeof(double));
    memset(sum, 0, FMU_N_Y * sizeof(double));
    if (status == FMU_OK) {
        status = fmu_judge(f, FMU_MODEL(output_derivatives)(m->t, at, m->u, m->c, f->matrix, f->w), "the directional derivatives");
        add(f->matrix, FMU_N_Y, WIDTH, along, sum);
    }
    return status;
}
#elif FMU_HAS_OUTPUTS
/* dy by differences through the closing of loops. */
static int of_outputs(fmu_instance *f, const double *dx, const double *du, const double *dp, const double *d_rates, double *sum)
{
    fmu_memory *const m = &f->m;
    const double h = spacing_along(m, dx, du, dp);
    (void)d_rates;
    memset(sum, 0, FMU_N_Y * sizeof(double));
    int status = 0;
    f->before = *m;
    for (int k = -3; k <= 3 && h > 0.0 && status == 0; k += k == -1 ? 2 : 1) {
        displace(m, k * h, dx, du, dp);
        status = FMU_MODEL(precompute)(m->p, m->c);
        status = status == 0 ? FMU_MODEL(outputs)(m->t, m->x, m->u, m->c, f->values, f->w) : status;
        for (int i = 0; i < FMU_N_Y; i++) {
            sum[i] += weight_of(k, h) * f->values[i];
        }
        *m = f->before;
    }
    return fmu_judge(f, status, "the directional derivatives");
}
#endif

int fmu_directional(fmu_instance *f, const unsigned *unknowns, size_t n_unknowns, const unsigned *knowns, size_t n_knowns,
    const double *seed, double *result)
{
    double dx[FMU_N_X + 1] = {0.0}, du[FMU_N_U + 1] = {0.0}, dp[FMU_N_P + 1] = {0.0};
    double of_x[FMU_N_X + 1], of_y[FMU_N_Y + 1];
    const int starts = f->m.phase == FMU_INITIALIZING;
    int outputs = 0;
    for (size_t i = 0; i < n_knowns; i++) {
        const unsigned k = knowns[i];
        if (k >= FMU_AT_Y || (k >= FMU_AT_RATES && k < FMU_AT_U)) {
            return fmu_say(f, FMU_ERROR, "value reference %u is neither a state nor an input nor a parameter", k);
        }
        *(k < FMU_AT_RATES ? dx + k : k < FMU_AT_P ? du + (k - FMU_AT_U) : dp + (k - FMU_AT_P)) = seed[i];
    }
    for (size_t i = 0; i < n_unknowns; i++) {
        const unsigned k = unknowns[i];
        if ((k < FMU_AT_RATES && !starts) || (k >= FMU_AT_U && k < FMU_AT_Y) || k >= FMU_AT_TIME) {
            return fmu_say(f, FMU_ERROR, "value reference %u is neither a derivative of a state nor an output", k);
        }
        outputs = outputs || k >= FMU_AT_Y;
    }
    int status = fmu_ready(f);
    status = status == FMU_OK ? fmu_constants(f) : status;
#if FMU_HAS_PROJECT
    status = status == FMU_OK && starts ? of_start(f, dx, du, dp) : status;
#endif
    status = status == FMU_OK ? of_rates(f, dx, du, dp, of_x) : status;
#if FMU_HAS_OUTPUTS
    status = status == FMU_OK && outputs ? of_outputs(f, dx, du, dp, of_x, of_y) : status;
#else
    (void)outputs, of_y[0] = 0.0;
#endif
    for (size_t i = 0; i < n_unknowns && status == FMU_OK; i++) {
        const unsigned k = unknowns[i];
        result[i] = k < FMU_AT_RATES ? dx[k] : k < FMU_AT_U ? of_x[k - FMU_AT_RATES] : of_y[k - FMU_AT_Y];
    }
    return status;
}
