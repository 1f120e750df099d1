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

/* Co-simulation: from one communication point to the next by a stepper of eomgen, events and closed loops included. */

#if FMU_CO_SIMULATION
long fmu_step_room(void)
{
    const long n = FMU_N_X;
    return 2 * n + eomgen_rows(&FMU_METHOD, n, NULL) + 10L * (FMU_N_EVENTS + 1) + FMU_N_RESETS + (2L + n) * (2 * FMU_N_EVENTS + 2) + 1;
}

/* What the stepper works with: pointers into the instance. */
typedef struct {
    eomgen_run run;
    eomgen_trajectory trajectory;
    eomgen_events events;
    double atol[FMU_N_X + 1], node;
    long most[FMU_N_EVENTS + 1];
    int whose[2 * FMU_N_EVENTS + 1], fired[FMU_N_EVENTS + 1], touch[FMU_N_EVENTS + 1];
} stepping;

static void prepare_events(fmu_instance *f, stepping *j, double *work)
{
    fmu_memory *const m = &f->m;
    eomgen_events *const ev = &j->events;
    ev->n = ev->n_model = FMU_N_EVENTS;
    ev->direction = FMU_DIRECTION, ev->action = FMU_RESETS, ev->most = j->most;
#if FMU_N_EVENTS
    ev->values = FMU_MODEL(events);
#endif
#if FMU_N_RESETS
    ev->resets = FMU_MODEL(resets);
#endif
#if FMU_HAS_PROJECT
    ev->project = FMU_MODEL(project);
#endif
    ev->n_resets = FMU_N_RESETS, ev->reset_of = FMU_RESET_OF, ev->reset_x = FMU_RESET_X;
    ev->g = m->g[0], ev->slope = m->g[1], ev->g_new = m->g[2], ev->slope_new = m->g[3], ev->size = m->g[4];
    ev->latest = m->g[5];
    ev->count = m->count, ev->leaving = m->leaving;
    ev->last_reset = m->last_reset, ev->crowded = m->crowded, ev->crowd = RUNS_CROWD;
    ev->whose = j->whose, ev->fired = j->fired, ev->touch = j->touch;
    ev->trial = work, ev->bracket = work + FMU_N_EVENTS + 1, ev->values_reset = work + 10 * (FMU_N_EVENTS + 1);
    for (int i = 0; i < FMU_N_EVENTS; i++) {
        j->most[i] = FMU_MOST[i];
    }
}

static void prepare(fmu_instance *f, stepping *j)
{
    const int n = FMU_N_X;
    fmu_memory *const m = &f->m;
    memset(j, 0, sizeof *j);
    eomgen_run *const run = &j->run;
    run->rhs = FMU_MODEL(rhs), run->c = m->c, run->u = m->u, run->n_u = FMU_N_U, run->w = f->w, run->n = n;
#if FMU_HAS_JACOBIAN
    run->jacobian = FMU_MODEL(jacobian);
#endif
#if FMU_HAS_MEETING_TIME
    run->meeting = FMU_MODEL(meeting_time), run->n_q = FMU_N_Q;
#endif
    run->rtol = m->rtol, run->max_step = FMU_MAX_STEP, run->direction = 1.0, run->atol = j->atol;
    for (int i = 0; i < n; i++) {
        j->atol[i] = FMU_ATOL * (m->rtol / FMU_RTOL);
    }
    const int closed_at = FMU_MODEL(model)()->closed_at;
    run->closed = closed_at > 0 ? f->w + closed_at : NULL;
    j->events.y = eomgen_lay_out(run, &FMU_METHOD, f->steps);
    double *at = j->events.y + 2 * n;
    run->until_callback = -1;
    run->t = run->t_old = m->t, run->h_abs = m->h_abs;
    memcpy(run->y, m->x, (size_t)n * sizeof(double));
    prepare_events(f, j, at);
    at += 10 * (FMU_N_EVENTS + 1) + FMU_N_RESETS;
    j->trajectory.nodes = &j->node, j->trajectory.n_nodes = 1;
    j->trajectory.events = FMU_N_EVENTS > 0 ? &j->events : NULL;
    j->trajectory.notes_room = 2 * FMU_N_EVENTS + 2, j->trajectory.notes = at;
}

/* Take back what the next step begins with. */
static void keep(fmu_instance *f, stepping *j)
{
    fmu_memory *const m = &f->m;
    const eomgen_events *const ev = &j->events;
    m->t = j->run.t, m->h_abs = j->run.h_abs;
    memcpy(m->x, j->run.closed != NULL ? j->run.next : j->run.y, FMU_N_X * sizeof(double));
    if (ev->g != m->g[0]) { /* they take turns */
        double spare[2][FMU_N_EVENTS + 1];
        memcpy(spare[0], ev->g, sizeof spare[0]);
        memcpy(spare[1], ev->slope, sizeof spare[1]);
        memcpy(m->g[0], spare[0], sizeof spare[0]);
        memcpy(m->g[1], spare[1], sizeof spare[1]);
    }
    m->last_reset = ev->last_reset, m->crowded = ev->crowded;
    m->rates_known = 0;
}

/* On to time t_end. */
static int go_on(fmu_instance *f, double t_end)
{
    fmu_memory *const m = &f->m;
    stepping j;
    int status = 0;
    prepare(f, &j);
    j.node = j.run.t_bound = t_end, j.trajectory.span = fmax(t_end - m->t_start, t_end - m->t);
    j.run.hold = (double)NAN;
    if (m->begun) {
        j.trajectory.begun = 1;
        eomgen_start(&FMU_METHOD, &j.run);
    }
    do {
        j.trajectory.n_notes = 0;
        status = eomgen_advance(&FMU_METHOD, &j.run, &j.trajectory);
    } while (status == EOMGEN_FULL);
    if (status == EOMGEN_END || status == EOMGEN_TERMINAL) {
        m->begun = 1;
        keep(f, &j);
        m->ended = status == EOMGEN_TERMINAL;
        return FMU_OK;
    }
    if (status == EOMGEN_ZENO) {
        return fmu_say(f, FMU_ERROR, "events follow each other ever faster at t = %.9g s (a ball that comes to rest)", j.run.t);
    }
    if (status == EOMGEN_RESET_FAILED) {
        return fmu_say(f, FMU_ERROR, "the state after an event at t = %.9g s cannot be evaluated or closed", j.run.t);
    }
    (void)fmu_judge(f, j.run.failure, "the derivatives of the states");
    return fmu_say(f, FMU_DISCARD, "the step ended at t = %.9g s: smaller steps do not help", j.run.t);
}

int fmu_step(fmu_instance *f, double t, double step, int *ended)
{
    fmu_memory *const m = &f->m;
    if (!isfinite(t) || !(fabs(t - m->t) <= RUNS_SAME * fmax(fabs(t), fmax(step, RUNS_EARLIEST)))) {
        return fmu_say(f, FMU_ERROR, "the step begins at t = %.9g s, but the last one ended at %.9g s", t, m->t);
    }
    if (!(step >= 0.0 && isfinite(step))) {
        return fmu_say(f, FMU_ERROR, "the step must be a positive number, not %.9g", step);
    }
    int status = fmu_constants(f);
    *ended = m->ended;
    if (status != FMU_OK || m->ended || t + step <= m->t) {
        return status;
    }
    f->before = *m;
    status = go_on(f, t + step);
    if (status != FMU_OK) {
        *m = f->before;
    }
    *ended = m->ended;
    return status;
}
#else
long fmu_step_room(void)
{
    return 1;
}
#endif
