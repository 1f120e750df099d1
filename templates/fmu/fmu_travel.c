/* Co-simulation: from one communication point to the next by a stepper of eomgen, events and closed loops included. */
#include <math.h>
#include <string.h>

#include "eomgen_fmu.h"

#if FMU_CO_SIMULATION
long fmu_step_room(void)
{
    const long n = FMU_N_X;
    return n * (7 + FMU_METHOD.rows_K + FMU_METHOD.rows_F) + eomgen_further(&FMU_METHOD, n, NULL) +
           10L * (FMU_N_EVENTS + 1) + FMU_N_RESETS + (2L + n) * (2 * FMU_N_EVENTS + 2) + 1;
}

/* What the stepper works with: pointers into the instance. */
typedef struct {
    eomgen_run run;
    eomgen_journey journey;
    eomgen_events events;
    double atol[FMU_N_X + 1], node;
    long most[FMU_N_EVENTS + 1];
    int whose[2 * FMU_N_EVENTS + 1], fired[FMU_N_EVENTS + 1], touch[FMU_N_EVENTS + 1];
} travel;

static void prepare_events(fmu_instance *f, travel *j, double *work)
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

static void prepare(fmu_instance *f, travel *j)
{
    const int n = FMU_N_X;
    fmu_memory *const m = &f->m;
    double *at = f->steps;
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
    run->y = at, run->y_old = at + n, run->f = at + 2 * n, run->failure_state = at + 3 * n, run->next = at + 4 * n;
    const int closed_at = FMU_MODEL(model)()->closed_at;
    run->closed = closed_at > 0 ? f->w + closed_at : NULL;
    run->K = at + 5 * n;
    run->F = run->K + n * FMU_METHOD.rows_K + eomgen_further(&FMU_METHOD, n, NULL);
    j->events.y = run->F + n * FMU_METHOD.rows_F;
    at = j->events.y + 2 * n;
    run->until_callback = -1;
    run->t = run->t_old = m->t, run->h_abs = m->h_abs;
    memcpy(run->y, m->x, (size_t)n * sizeof(double));
    prepare_events(f, j, at);
    at += 10 * (FMU_N_EVENTS + 1) + FMU_N_RESETS;
    j->journey.nodes = &j->node, j->journey.n_nodes = 1;
    j->journey.events = FMU_N_EVENTS > 0 ? &j->events : NULL;
    j->journey.notes_room = 2 * FMU_N_EVENTS + 2, j->journey.notes = at;
}

/* Take back what the next step begins with. */
static void keep(fmu_instance *f, travel *j)
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
    travel j;
    int status = 0;
    prepare(f, &j);
    j.node = j.run.t_bound = t_end, j.journey.span = fmax(t_end - m->t_start, t_end - m->t);
    j.run.hold = (double)NAN;
    if (m->begun) {
        j.journey.begun = 1;
        eomgen_start(&FMU_METHOD, &j.run);
    }
    do {
        j.journey.n_notes = 0;
        status = eomgen_travel(&FMU_METHOD, &j.run, &j.journey);
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
