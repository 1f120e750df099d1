/* Events: zeros of functions of time and state within a step, by the dense output. A change of sign is found as SciPy's
   solve_ivp does; a value that comes to zero and back within one step is looked for as well. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "eomgen_loop.h"

static int event_values(eomgen_run *run, eomgen_events *ev, double t, const double *y, double *g)
{
    if (!EOMGEN_HAS_EVENTS(ev) && ev->tape == NULL && ev->outside == NULL) {
        return 0;
    }
    if (run->signals != NULL) {
        eomgen_force(run, t, y);
    }
    for (int i = 0; i < ev->n_model; i++) {
        g[i] = (double)NAN; /* if nothing is written */
    }
    const int status = EOMGEN_HAS_EVENTS(ev) ? EOMGEN_EVENTS(ev)(t, y, run->u, run->c, g, run->w) : 0;
    if (status != 0 && status != EOMGEN_NON_FINITE) {
        for (int i = 0; i < ev->n_model; i++) {
            g[i] = (double)NAN;
        }
    }
#ifndef EOMGEN_ALONE
    if (ev->tape != NULL) {
        eomgen_play(ev->tape, t, y, run->u, run->c, g + ev->n_model);
    }
    if (ev->outside != NULL && ev->outside(ev->asker, t, y, g + ev->n_model + ev->n_tape) != 0) {
        run->stopped = 1;
    }
#endif
    for (int i = 0; i < ev->n; i++) {
        if (!isfinite(g[i])) {
            g[i] = (double)NAN; /* no event here, and none of the others' business */
        }
    }
    return run->stopped;
}

/* Rates of the values along the motion, by a short way along x', onward (1) or back (-1): at the end of a step by a way
   beyond it, at the beginning of the next by a way before it, so that a value that turns just there is looked at in both. */
static void event_slopes(eomgen_run *run, eomgen_events *ev, const double *g, double *slope, double way)
{
    double length = fabs(run->step) > 0.0 ? run->step : run->direction * run->h_abs;
    if (length == 0.0) { /* at the end of a part, where no step is chosen */
        length = run->t - run->t_old;
    }
    const double least = RUNS_MOMENTARY * fmax(fabs(run->t), 1.0);
    if (fabs(length) < least) { /* a step that ends with a part of the run may be as short as rounding */
        length = run->direction * least;
    }
    const double h = way * RUNS_ASIDE * length;
    for (int i = 0; i < run->n; i++) {
        ev->y[i] = run->y[i] + h * run->f[i];
    }
    ev->for_slope = 1;
    event_values(run, ev, run->t + h, ev->y, slope);
    ev->for_slope = 0;
    for (int i = 0; i < ev->n; i++) {
        slope[i] = (slope[i] - g[i]) / h;
    }
}

void eomgen_arm(eomgen_run *run, eomgen_events *ev)
{
    event_values(run, ev, run->t, run->y, ev->g);
    event_slopes(run, ev, ev->g, ev->slope, 1.0);
    for (int i = 0; i < ev->n; i++) {
        ev->size[i] = fabs(ev->g[i]), ev->leaving[i] = 0, ev->fired[i] = 0, ev->touch[i] = 0, ev->latest[i] = (double)NAN;
    }
}

void eomgen_arrive(eomgen_run *run, eomgen_events *ev)
{
    eomgen_evaluate(run, run->t, run->y, run->f);
    event_values(run, ev, run->t, run->y, ev->g);
    event_slopes(run, ev, ev->g, ev->slope, 1.0);
}

int eomgen_depart(eomgen_run *run, eomgen_events *ev)
{
    int stuck = 0;
    for (int i = 0; i < ev->n; i++) {
        const double came = run->direction * ev->slope[i] * (ev->leaving[i] == 0 ? ev->fired[i] : 0);
        const int at_zero = fabs(ev->g[i]) <= RUNS_TOUCHING * ev->size[i]; /* not beyond a jump of an input */
        /* it goes the other way: less than the accuracy is left */
        stuck = stuck || (at_zero && abs(ev->fired[i]) == 1 && came < 0.0);
        ev->trial[i] = fmax(fabs(ev->slope[i]), fabs(ev->slope_new[i])); /* about how fast it came */
        ev->touch[i] = !at_zero && !ev->fired[i] && ev->action[i] == EOMGEN_RESET && abs(ev->direction[i]) == 1;
    }
    run->step = 0.0;
    event_values(run, ev, run->t, run->y, ev->g);
    event_slopes(run, ev, ev->g, ev->slope, 1.0);
    for (int i = 0; i < ev->n; i++) {
        if (ev->touch[i] && fabs(ev->g[i]) <= RUNS_TOUCHING * ev->size[i]) {
            ev->leaving[i] = ev->direction[i]; /* what a reset brings to zero has not fallen to it */
        }
        ev->touch[i] = 0;
        if (!ev->fired[i] || ev->action[i] == EOMGEN_GO_ON) {
            ev->fired[i] = 0;
            continue;
        }
        const double rate = run->direction * ev->slope[i];
        const int touching = fabs(ev->g[i]) <= RUNS_TOUCHING * ev->size[i];
        const int through = ev->action[i] == EOMGEN_WAIT && rate < 0.0; /* a gap that goes on closing */
        if (ev->leaving[i] != 0) { /* it only touched zero */
            ev->fired[i] = 0;
            continue;
        }
        stuck = stuck || (touching && (through || !(fabs(rate) > RUNS_TOUCHING * ev->trial[i])));
        ev->leaving[i] = touching ? (rate > 0.0 ? 1 : -1) : 0;
        ev->fired[i] = 0;
    }
    return stuck;
}

/* Value of event i at time t of the last step. */
static double value_at(const eomgen_method *method, eomgen_run *run, eomgen_events *ev, int i, double t)
{
    eomgen_between(method, run, t, ev->y);
    event_values(run, ev, t, ev->y, ev->trial);
    return ev->trial[i];
}
