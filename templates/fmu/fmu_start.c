/* Initialization: the states that were set, and the others so that loops are closed. */
#include <math.h>
#include <string.h>

#include "eomgen_fmu.h"

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
