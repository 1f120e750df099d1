/* Model exchange: events, resets, and states that have drifted off the loops. */
#include <math.h>
#include <string.h>

#include "eomgen_fmu.h"

int fmu_indicators(fmu_instance *f, double *values)
{
#if FMU_N_EVENTS
    fmu_memory *const m = &f->m;
    int status = fmu_ready(f);
    status = status == FMU_OK ? fmu_constants(f) : status;
    return status != FMU_OK ? status
                            : fmu_judge(f, FMU_MODEL(events)(m->t, m->x, m->u, m->c, values, f->w), "the event indicators");
#else
    (void)f, (void)values;
    return FMU_OK;
#endif
}

/* Values of events now, and how fast they change along the motion. */
static int look(fmu_instance *f, double *g, double *slope)
{
#if FMU_N_EVENTS
    fmu_memory *const m = &f->m;
    int status = fmu_indicators(f, g);
    status = status == FMU_OK ? fmu_rates(f) : status;
    if (status != FMU_OK) {
        return status;
    }
    const double h = RUNS_MOMENTARY * fmax(fabs(m->t), 1.0);
    for (int i = 0; i < FMU_N_X; i++) {
        f->trial[i] = m->x[i] + h * m->rates[i];
    }
    status = fmu_judge(f, FMU_MODEL(events)(m->t + h, f->trial, m->u, m->c, slope, f->w), "the event indicators");
    for (int i = 0; i < FMU_N_EVENTS; i++) {
        slope[i] = (slope[i] - g[i]) / h;
    }
    return status;
#else
    (void)f, (void)g, (void)slope;
    return FMU_OK;
#endif
}

/* Whether a value is still on the side that a reset sent it away from, and on its way out. */
static int leaves(const fmu_memory *m, int way, double slope, int i)
{
    return m->leaving[i] && way * slope < 0.0;
}

int fmu_arm(fmu_instance *f)
{
    fmu_memory *const m = &f->m;
    double *const g = f->values, *const slope = f->values + FMU_N_EVENTS;
    const int status = look(f, g, slope);
    for (int i = 0; i < FMU_N_EVENTS && status == FMU_OK; i++) {
        m->side[i] = g[i] > 0.0 || (g[i] == 0.0 && FMU_DIRECTION[i] != 1 && slope[i] < 0.0);
        m->leaving[i] = 0, m->g[0][i] = g[i];
    }
    m->last_reset = (double)NAN, m->seen = m->t, m->crowded = 0;
    return status;
}

int fmu_completed(fmu_instance *f, int *event)
{
    fmu_memory *const m = &f->m;
    *event = 0;
#if FMU_HAS_PROJECT
    const int closes = fmu_project(f, m->x, f->closed);
    if (closes != FMU_OK) {
        return closes;
    }
    for (int i = 0; i < FMU_N_X; i++) {
        *event = *event || fabs(f->closed[i] - m->x[i]) > m->rtol * fmax(FMU_NOMINAL[i], fabs(m->x[i]));
    }
#endif
    double *const g = f->values, *const slope = f->values + FMU_N_EVENTS;
    const int status = FMU_N_EVENTS > 0 ? look(f, g, slope) : (int)FMU_OK;
    for (int i = 0; i < FMU_N_EVENTS && status == FMU_OK; i++) { /* one that nobody has seen change sides */
        const int way = (g[i] > 0.0) - m->side[i];
        m->leaving[i] = m->leaving[i] && way != 0;
        m->g[0][i] = g[i], m->seen = m->t;
        *event = *event || (way != 0 && g[i] != 0.0 && !leaves(m, way, slope[i], i));
    }
    return status;
}

#if FMU_N_RESETS
/* New values of states, for one event after the other: each takes the values that those before have given. */
static int reset(fmu_instance *f, const int *fired)
{
    fmu_memory *const m = &f->m;
    double *const new_values = f->trial;
    for (int i = 0; i < FMU_N_EVENTS; i++) {
        if (!fired[i] || !FMU_RESETS[i]) {
            continue;
        }
        const int status = FMU_MODEL(resets)(m->t, m->x, m->u, m->c, new_values, f->w);
        if (status != 0 && status != EOMGEN_NON_FINITE) {
            return fmu_judge(f, status, "the new values of states at an event");
        }
        for (int k = 0; k < FMU_N_RESETS; k++) {
            if (FMU_RESET_OF[k] == i) {
                if (!isfinite(new_values[k])) {
                    return fmu_say(f, FMU_ERROR, "an event at t = %.9g s gives a state a value that is not finite", m->t);
                }
                m->x[FMU_RESET_X[k]] = new_values[k];
            }
        }
    }
    return FMU_OK;
}
#endif

/* The side of zero of a value: 1 above, or the other one where it gets there at this very instant. */
static int side_of(const fmu_memory *m, double g, double slope, int i)
{
    const int side = g > 0.0, coming = side != (slope > 0.0) && slope != 0.0;
    return side == m->side[i] && coming && fabs(g) <= RUNS_SAME * fmax(fabs(m->t), 1.0) * fabs(slope) ? !side : side;
}

/* Whether a value is beyond zero because an input jumped after the last step, not by the motion. */
static int has_jumped(const fmu_memory *m, double g, double slope, int i)
{
    return m->seen == m->t && (m->g[0][i] > 0.0) == m->side[i] && (g > 0.0) != m->side[i] &&
           fabs(g - m->g[0][i]) > RUNS_TOUCHING * fmax(fabs(m->t), 1.0) * fabs(slope);
}

/* Events whose values have changed sides in their direction: the first FMU_N_EVENTS of fired; 2 after a jump. */
static int find_fired(fmu_instance *f, int *fired, int *ended)
{
    fmu_memory *const m = &f->m;
    double *const g = f->values, *const slope = f->values + FMU_N_EVENTS, *const before = slope + FMU_N_EVENTS;
    int any = 0;
    for (int i = 0; i < FMU_N_EVENTS; i++) {
        fired[i] = 0;
    }
    if (FMU_N_EVENTS == 0 || look(f, g, slope) != FMU_OK) {
        return 0;
    }
    for (int i = 0; i < FMU_N_EVENTS; i++) {
        const int side = side_of(m, g[i], slope[i], i), way = side - m->side[i];
        before[i] = g[i];
        if (leaves(m, way, slope[i], i)) {
            continue;
        }
        fired[i] = way == 0 || FMU_DIRECTION[i] * way < 0 ? 0 : has_jumped(m, g[i], slope[i], i) ? 2 : 1;
        if (fired[i]) {
            m->count[i]++;
            any = any || FMU_RESETS[i];
            *ended = *ended || (FMU_MOST[i] > 0 && m->count[i] >= FMU_MOST[i]);
        }
        m->side[i] = side, m->leaving[i] = 0;
    }
    memcpy(m->g[0], g, FMU_N_EVENTS * sizeof(double)), m->seen = m->t; /* an input may jump once more at this time */
    return any;
}

int fmu_update(fmu_instance *f, int *ended, int *changed)
{
    fmu_memory *const m = &f->m;
    int fired[FMU_N_EVENTS + 1];
    *ended = 0, *changed = 0;
    int status = fmu_constants(f);
    const int resets = status == FMU_OK && find_fired(f, fired, ended);
    if (status != FMU_OK) {
        return status;
    }
#if FMU_N_RESETS
    if (resets) {
        status = reset(f, fired);
        if (status != FMU_OK) {
            return status;
        }
    }
#endif
    status = fmu_project(f, m->x, f->closed);
    if (status != FMU_OK) {
        return status;
    }
    *changed = resets || memcmp(m->x, f->closed, FMU_N_X * sizeof(double)) != 0;
    memcpy(m->x, f->closed, FMU_N_X * sizeof(double));
    m->rates_known = m->rates_known && !*changed;
    if (resets) {
        double *const g = f->values, *const slope = f->values + FMU_N_EVENTS, *const before = slope + FMU_N_EVENTS;
        status = look(f, g, slope);
        for (int i = 0; i < FMU_N_EVENTS && status == FMU_OK; i++) { /* one that is still beyond zero may leave at once */
            const int sent = m->leaving[i] || fired[i] == 1;
            m->leaving[i] = sent && g[i] * before[i] >= 0.0 && fabs(g[i]) <= 2.0 * fabs(before[i]) && slope[i] != 0.0;
            m->side[i] = m->leaving[i] ? slope[i] > 0.0 : g[i] > 0.0;
            m->g[0][i] = g[i];
        }
        m->crowded = fabs(m->t - m->last_reset) < RUNS_CROWDED * fmax(fabs(m->t - m->t_start), 1.0) ? m->crowded + 1 : 0;
        m->last_reset = m->t;
        if (m->crowded >= RUNS_CROWD) {
            return fmu_say(f, FMU_ERROR, "events follow each other ever faster at t = %.9g s (a ball that comes to rest)", m->t);
        }
    }
    return status;
}

#if FMU_N_CLOCKS
/* How long ago the next time of a clock was, if its counter is what `x` says. */
static int lateness(fmu_instance *f, const double *x, int clock, double *late)
{
    fmu_memory *const m = &f->m;
    const int status = FMU_MODEL(events)(m->t, x, m->u, m->c, f->values, f->w);
    *late = f->values[FMU_CLOCK_EVENT[clock]];
    return status == EOMGEN_NON_FINITE && isfinite(*late) ? FMU_OK : fmu_judge(f, status, "the sampling times");
}
#endif

int fmu_set_clocks(fmu_instance *f)
{
    int status = fmu_constants(f);
#if FMU_N_CLOCKS
    fmu_memory *const m = &f->m;
    for (int i = 0; i < FMU_N_CLOCKS && status == FMU_OK; i++) {
        double *const counter = &m->x[FMU_CLOCK_COUNTER[i]];
        double late = 0.0, ahead = 0.0;
        memcpy(f->trial, m->x, FMU_N_X * sizeof(double));
        f->trial[FMU_CLOCK_COUNTER[i]] += 1.0;
        status = lateness(f, m->x, i, &late);
        status = status == FMU_OK ? lateness(f, f->trial, i, &ahead) : status;
        const double period = late - ahead;
        if (status == FMU_OK && !(period > 0.0)) {
            return fmu_say(f, FMU_ERROR, "a period is %.9g s; give a positive time between samples", period);
        }
        const double moment = RUNS_INSTANT * fmax(fabs(m->t), RUNS_EARLIEST);
        if (status == FMU_OK && !(fabs(*counter - round(*counter)) < RUNS_WHOLE)) {
            return fmu_say(f, FMU_ERROR, "a state that counts samples must be a whole number, not %.9g", *counter);
        }
        if (status == FMU_OK && (late > 0.0 || (*counter >= 1.0 && late < -period - moment))) {
            *counter = fmax(*counter + ceil((late - moment) / period), 0.0);
            for (late = 0.0; status == FMU_OK && late <= moment && *counter >= 1.0;) { /* the period has been rounded */
                memcpy(f->trial, m->x, FMU_N_X * sizeof(double));
                f->trial[FMU_CLOCK_COUNTER[i]] -= 1.0;
                status = lateness(f, f->trial, i, &late);
                *counter -= late <= moment ? 1.0 : 0.0;
            }
            status = status == FMU_OK ? lateness(f, m->x, i, &late) : status;
        }
        while (status == FMU_OK && late > 0.0) { /* rounding: its time is this one */
            *counter = fmax(nextafter(*counter, HUGE_VAL), *counter + late / period);
            status = lateness(f, m->x, i, &late);
        }
    }
#endif
    return status;
}
