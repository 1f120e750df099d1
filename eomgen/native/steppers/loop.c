/* The loop of a trajectory: steps from corner to corner of the inputs, output at given times, events and resets. */
#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "eomgen_steppers.h"

static void store(const eomgen_run *run, eomgen_trajectory *j, double t, const double *y)
{
    j->times[j->stored] = t;
    memcpy(j->states + j->stored * run->n, y, (size_t)run->n * sizeof(double));
    j->stored++;
}

/* A step, or a state after a reset, where every step is stored or followed. */
static void store_step(const eomgen_run *run, eomgen_trajectory *j)
{
    if (j->n_eval < 0) {
        store(run, j, run->t, run->y);
    } else if (j->trail_room > 0) {
        double *const row = j->trail + j->n_trail++ * (1 + run->n);
        row[0] = run->t;
        memcpy(row + 1, run->y, (size_t)run->n * sizeof(double));
    }
}

/* Begin the part that ends at the next corner. */
static void begin_part(eomgen_run *run, const eomgen_trajectory *j)
{
    run->t_bound = j->nodes[j->node];
    run->hold = run->t + 0.5 * (run->t_bound - run->t);
}

static void begin(const eomgen_method *method, eomgen_run *run, eomgen_trajectory *j)
{
    j->begun = 1;
    run->direction = j->nodes[j->n_nodes - 1] < run->t ? -1.0 : 1.0;
    begin_part(run, j);
    eomgen_start(method, run);
    if (j->events != NULL) {
        j->events->last_reset = (double)NAN;
        eomgen_arm(run, j->events);
    }
    store_step(run, j);
    if (j->n_eval > 0 && j->t_eval[0] == run->t) {
        store(run, j, run->t, run->y);
        j->done++;
    }
}

static void keep_piece(const eomgen_method *method, eomgen_run *run, eomgen_trajectory *j, double end)
{
    const int n = run->n;
    double *const row = j->pieces + j->n_pieces++ * (3 + n * (1 + method->rows_F));
    eomgen_between(method, run, run->t, row + 3); /* forms F */
    row[0] = run->t_old, row[1] = run->step, row[2] = end;
    memcpy(row + 3, run->y_old, (size_t)n * sizeof(double));
    memcpy(row + 3 + n, run->F, (size_t)(n * method->rows_F) * sizeof(double));
}

int eomgen_jump(const eomgen_method *method, eomgen_run *run, eomgen_trajectory *j)
{
    eomgen_events *const ev = j->events;
    int changes = 0;
    for (int i = 0; i < ev->n; i++) {
        changes = changes || (ev->fired[i] && ev->action[i] != EOMGEN_PAUSE);
    }
    run->h_abs = 0.0;
    eomgen_start(method, run);
    store_step(run, j);
    if (changes) {
        ev->crowded = fabs(run->t - ev->last_reset) < RUNS_CROWDED * j->span ? ev->crowded + 1 : 0;
        ev->last_reset = run->t;
        j->resets++;
    }
    return (eomgen_after_reset(run, ev) && changes) || ev->crowded >= ev->crowd ? EOMGEN_ZENO : 0;
}

/* New values of states by the model's own kernel, for each of its events that happened here. */
static int apply_resets(const eomgen_method *method, eomgen_run *run, eomgen_trajectory *j)
{
    eomgen_events *const ev = j->events;
    for (int i = 0; i < ev->n_model; i++) {
        if (!ev->fired[i] || ev->action[i] != EOMGEN_RESET) {
            continue;
        }
        if (run->signals != NULL) {
            eomgen_force(run, run->t, run->y);
        }
        for (int k = 0; k < ev->n_resets; k++) {
            ev->values_reset[k] = (double)NAN;
        }
        const int status = EOMGEN_RESETS(ev)(run->t, run->y, run->u, run->c, ev->values_reset, run->w);
        if (status != 0 && status != EOMGEN_NON_FINITE) {
            return EOMGEN_RESET_FAILED;
        }
        for (int k = 0; k < ev->n_resets; k++) {
            if (ev->reset_of[k] == i && !isfinite(ev->values_reset[k])) { /* those of others need not be numbers here */
                return EOMGEN_RESET_FAILED;
            }
        }
        for (int k = 0; k < ev->n_resets; k++) {
            if (ev->reset_of[k] == i) {
                run->y[ev->reset_x[k]] = ev->values_reset[k];
            }
        }
    }
    if (EOMGEN_PROJECTS(ev)) {
        memcpy(ev->y, run->y, (size_t)run->n * sizeof(double));
        if (EOMGEN_PROJECT(ev)(run->t, ev->y, run->u, run->c, run->y, run->w) != 0) {
            return EOMGEN_RESET_FAILED;
        }
    }
    return eomgen_jump(method, run, j);
}

int eomgen_end_step(const eomgen_method *method, eomgen_run *run, eomgen_trajectory *j)
{
    double t = run->t;
    const int stop = j->events != NULL ? eomgen_find_events(method, run, j, &t) : 0;
    if (stop < 0) {
        return stop == -1 ? (int)EOMGEN_STOPPED : (int)EOMGEN_ZENO; /* of two enumerations */
    }
    if (j->pieces_room > 0) {
        keep_piece(method, run, j, t);
    }
    while (j->done < j->n_eval && run->direction * (j->t_eval[j->done] - t) <= 0.0) {
        double *const row = j->states + j->stored * run->n;
        if (j->t_eval[j->done] == run->t && !stop) {
            memcpy(row, run->y, (size_t)run->n * sizeof(double));
        } else {
            eomgen_between(method, run, j->t_eval[j->done], row);
        }
        j->times[j->stored++] = j->t_eval[j->done++];
    }
    if (stop) {
        eomgen_between(method, run, t, j->events->y);
        memcpy(run->y, j->events->y, (size_t)run->n * sizeof(double));
        run->t = t;
        eomgen_before_reset(run, j->events);
    }
    store_step(run, j);
    if (stop == 2) {
        return EOMGEN_TERMINAL;
    }
    for (int i = 0; stop && i < j->events->n; i++) {
        if (j->events->fired[i] && (j->events->action[i] != EOMGEN_RESET || j->events->n_resets == 0)) {
            return EOMGEN_WAITING;
        }
    }
    return stop ? apply_resets(method, run, j) : 0;
}

int eomgen_advance(const eomgen_method *method, eomgen_run *run, eomgen_trajectory *j)
{
    if (!j->begun) {
        begin(method, run, j);
    }
    while (run->direction * (run->t - j->nodes[j->n_nodes - 1]) < 0.0) {
        if ((j->n_eval < 0 && j->stored + 2 > j->room) || (j->pieces_room > 0 && j->n_pieces == j->pieces_room) ||
            (j->trail_room > 0 && j->n_trail + 2 > j->trail_room) ||
            (j->events != NULL && j->n_notes + 2 * j->events->n > j->notes_room)) {
            return EOMGEN_FULL;
        }
        const double h_abs = run->h_abs;
        int status = eomgen_step(method, run);
        status = status != 0 ? status : eomgen_end_step(method, run, j);
        if (status != 0) {
            return status;
        }
        if (run->t == run->t_bound && j->node + 1 < j->n_nodes) { /* x' jumps here, or its slope */
            j->node++;
            begin_part(run, j);
            run->h_abs = h_abs > run->h_abs ? h_abs : run->h_abs;
            eomgen_start(method, run);
        }
    }
    if (run->stopped) {
        return EOMGEN_STOPPED;
    }
    return EOMGEN_END;
}

#ifndef eomgen_find_events /* a device leaves them out where there are none */
/* Events: zeros of functions of time and state within a step, by the dense output. A change of sign is found as SciPy's
   solve_ivp does; a value that comes to zero and back within one step is looked for as well. */
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
#ifndef EOMGEN_DEVICE
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

void eomgen_before_reset(eomgen_run *run, eomgen_events *ev)
{
    eomgen_evaluate(run, run->t, run->y, run->f);
    event_values(run, ev, run->t, run->y, ev->g);
    event_slopes(run, ev, ev->g, ev->slope, 1.0);
}

int eomgen_after_reset(eomgen_run *run, eomgen_events *ev)
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

/* The edge of the domain of a value, between a time where it is a number and one where it is none: the last time found
   where it is one, and its value there; no further than to where its sign is another. */
static void domain_edge(const eomgen_method *method, eomgen_run *run, eomgen_events *ev, int i, double *in, double *g, double out)
{
    const double first = *g;
    for (int k = 0; k < RUNS_HALVED && *g != 0.0 && (*g > 0.0) == (first > 0.0); k++) {
        const double t = 0.5 * (*in + out), value = value_at(method, run, ev, i, t);
        if (isnan(value)) {
            out = t;
        } else {
            *in = t, *g = value;
        }
    }
}

/* From a bracket within which, at a time, the value is no number, to one on either side of that gap; 0 if none is there. */
static int leave_gap(const eomgen_method *method, eomgen_run *run, eomgen_events *ev, int i, double *bracket, double gap)
{
    double first[4] = {bracket[0], bracket[0], bracket[2], bracket[2]};
    domain_edge(method, run, ev, i, &first[1], &first[3], gap);
    if (first[3] == 0.0 || (first[3] > 0.0) != (first[2] > 0.0)) {
        memcpy(bracket, first, sizeof first);
        return 1;
    }
    double last[4] = {bracket[1], bracket[1], bracket[3], bracket[3]};
    domain_edge(method, run, ev, i, &last[0], &last[2], gap);
    memcpy(bracket, last, sizeof last);
    return last[2] == 0.0 || (last[2] > 0.0) != (last[3] > 0.0);
}

/* The zero between a and b, where the values fa and fb differ in sign: R. P. Brent, Algorithms for Minimization without
   Derivatives, 1973, chapter 4; to four roundings, like SciPy's. Where the value jumps,
   the far side of the jump: a run that goes on from the near one would meet it again. NaN, and when, where the value is
   no number. */
static double zero_of_numbers(
    const eomgen_method *method, eomgen_run *run, eomgen_events *ev, int i, const double *bracket, double *gap)
{
    double a = bracket[0], b = bracket[1], fa = bracket[2], fb = bracket[3], c = a, fc = fa, d = b - a, e = d;
    for (int k = 0; k < 100 && fb != 0.0; k++) {
        if (fb * fc > 0.0) {
            c = a, fc = fa, d = e = b - a;
        }
        if (fabs(fc) < fabs(fb)) {
            a = b, b = c, c = a;
            fa = fb, fb = fc, fc = fa;
        }
        if (fb == 0.0) {
            break;
        }
        const double tolerance = 2.0 * DBL_EPSILON * (1.0 + fabs(b)), m = 0.5 * (c - b);
        if (fabs(m) <= tolerance) {
            break;
        }
        d = fabs(e) < tolerance || fabs(fa) <= fabs(fb) ? (e = m) : d;
        if (d != m || e != m) {
            const double s = fb / fa, q0 = fa / fc, r = fb / fc;
            double p = a == c ? 2.0 * m * s : s * (2.0 * m * q0 * (q0 - r) - (b - a) * (r - 1.0));
            double q = a == c ? 1.0 - s : (q0 - 1.0) * (r - 1.0) * (s - 1.0);
            q = p > 0.0 ? -q : q, p = fabs(p);
            if (2.0 * p < 3.0 * m * q - fabs(tolerance * q) && p < fabs(0.5 * e * q)) {
                e = d, d = p / q;
            } else {
                d = e = m;
            }
        }
        a = b, fa = fb;
        b += fabs(d) > tolerance ? d : m > 0.0 ? tolerance : -tolerance;
        fb = value_at(method, run, ev, i, b);
        if (isnan(fb)) {
            *gap = b;
            return fb;
        }
    }
    const int jumps = fb * bracket[2] > 0.0 && fb * fc < 0.0 && fabs(fb) > RUNS_TOUCHING * ev->size[i];
    return jumps ? c : b;
}

/* The zero in a bracket; NaN if it lies where the value is no number. No recursion: a device has to know its stack. */
static double zero_between(const eomgen_method *method, eomgen_run *run, eomgen_events *ev, int i, const double *bracket)
{
    double own[4] = {bracket[0], bracket[1], bracket[2], bracket[3]}, gap = 0.0;
    for (;;) {
        const double zero = zero_of_numbers(method, run, ev, i, own, &gap);
        if (!isnan(zero) || !leave_gap(method, run, ev, i, own, gap)) {
            return zero;
        }
    }
}

/* Where values change sign within a step: between its ends, after a reset, and where they come to zero and leave again. */

static int add(eomgen_events *ev, int n, int i, double a, double b, double fa, double fb)
{
    const double row[4] = {a, b, fa, fb};
    if (ev->direction[i] != 0 && ev->direction[i] * (fb - fa) < 0.0) {
        return n;
    }
    memcpy(ev->bracket + 4 * n, row, sizeof row);
    ev->whose[n] = i;
    return n + 1;
}

/* Whether a value that is zero where a step begins is seen on a side: 1, or 2 where it then comes back, within a bracket. */
static int leave_zero(const eomgen_method *method, eomgen_run *run, eomgen_events *ev, int i, double side, double *bracket)
{
    double t = run->t_old, g = 0.0;
    int seen = 0;
    for (int k = RUNS_HALVED; k >= 0; k--) {
        const double next = k > 0 ? run->t_old + ldexp(run->t - run->t_old, -k) : run->t;
        const double value = k > 0 ? value_at(method, run, ev, i, next) : ev->g_new[i];
        if (seen && value * side <= 0.0) {
            bracket[0] = t, bracket[1] = next, bracket[2] = g, bracket[3] = value;
            return 2;
        }
        seen = seen || value * side > 0.0;
        t = next, g = value;
    }
    return seen;
}

/* A reset left the value at zero: it has to be seen on its side before it can come back. Where a step ends on the other
   side and never shows it there, it came back within the accuracy of the step: resets that die away. */
static int brackets_after_reset(const eomgen_method *method, eomgen_run *run, eomgen_events *ev, int n, int i)
{
    double bracket[4];
    const int seen = leave_zero(method, run, ev, i, ev->leaving[i], bracket);
    if (seen == 2) {
        ev->leaving[i] = 0;
        return add(ev, n, i, bracket[0], bracket[1], bracket[2], bracket[3]);
    }
    const double moment = RUNS_INSTANT * fmax(fabs(run->t), RUNS_EARLIEST); /* a step this short shows rounding only */
    const int side = ev->leaving[i], back = !seen && ev->g_new[i] * side < 0.0 && fabs(run->t - run->t_old) > moment;
    ev->leaving[i] = seen || back ? 0 : side;
    if (back && ev->direction[i] * side <= 0 && (ev->action[i] == EOMGEN_RESET || ev->action[i] == EOMGEN_WAIT)) {
        ev->crowded = ev->crowd;
    }
    return back ? add(ev, n, i, run->t_old, run->t_old, side, 0.0) : n;
}

/* A value that is zero where a step begins, leaves to one side and ends on the other: a zero at the beginning, and one
   where it comes back, such as a ball that is thrown up from the floor and falls back onto it within one step. */
static int brackets_from_zero(const eomgen_method *method, eomgen_run *run, eomgen_events *ev, int n, int i)
{
    const double side = run->direction * ev->slope[i] > 0.0 ? 1.0 : -1.0;
    double bracket[4];
    if (leave_zero(method, run, ev, i, side, bracket) == 2) {
        n = add(ev, n, i, run->t_old, run->t_old, -side, 0.0);
        return add(ev, n, i, bracket[0], bracket[1], bracket[2], bracket[3]);
    }
    return add(ev, n, i, run->t_old, run->t, 0.0, ev->g_new[i]);
}

/* Whether a value of one sign at both ends may have been at zero between: it comes near and leaves again. What is no more
   than rounding at both ends rests there. */
static int may_touch(const eomgen_run *run, const eomgen_events *ev, int i)
{
    const double a = ev->g[i], b = ev->g_new[i], h = fabs(run->step), s = a > 0.0 ? 1.0 : -1.0;
    const double da = run->direction * s * ev->slope[i] * h, db = run->direction * s * ev->slope_new[i] * h;
    if (!(a * b > 0.0) || da >= 0.0 || db <= 0.0 || fmax(fabs(a), fabs(b)) <= RUNS_RESTING * RUNS_TOUCHED * ev->size[i]) {
        return 0;
    }
    if (db * s * a - da * s * b <= -da * db) { /* the tangents meet below zero: also a flat touch, (t - 1)**8 */
        return 1;
    }
    const double x = da / (da - db), y = 1.0 - x; /* about where the cubic through both is least */
    const double least = s * a * y * y * (1.0 + 2.0 * x) + da * x * y * y + s * b * x * x * (1.0 + 2.0 * y) - db * x * x * y;
    return least < 0.5 * fmin(fabs(a), fabs(b));
}

static int brackets_of_touch(const eomgen_method *method, eomgen_run *run, eomgen_events *ev, int n, int i)
{
    const double s = ev->g[i] > 0.0 ? 1.0 : -1.0;
    double left = run->t_old, right = run->t, best = HUGE_VAL, at = left;
    for (int k = 1; k < RUNS_SAMPLED; k++) {
        const double t = run->t_old + k * (run->t - run->t_old) / (double)RUNS_SAMPLED;
        const double value = s * value_at(method, run, ev, i, t);
        if (value < best) {
            best = value, at = t;
        }
    }
    const double h = (run->t - run->t_old) / (double)RUNS_SAMPLED, ratio = 0.3819660112501051;
    left = at - h, right = at + h;
    for (int k = 0; k < 60 && best > 0.0 && fabs(right - left) > RUNS_TURNING * fabs(run->step); k++) { /* golden section */
        const int low = fabs(at - left) > fabs(right - at);
        const double t = at + ratio * ((low ? left : right) - at), value = s * value_at(method, run, ev, i, t);
        if (value < best) {
            *(low ? &right : &left) = at;
            best = value, at = t;
        } else {
            *(low ? &left : &right) = t;
        }
    }
    const double rounding = RUNS_TOUCHED * fmax(ev->size[i], fabs(ev->g_new[i]));
    if (best < -rounding) {
        n = add(ev, n, i, run->t_old, at, ev->g[i], s * best);
        return add(ev, n, i, at, run->t, s * best, ev->g_new[i]);
    }
    if (best <= rounding) { /* it comes to zero here, from one side and back */
        ev->touch[i] = s > 0.0 ? 1 : -1;
        return add(ev, n, i, at, at, ev->g[i], 0.0);
    }
    return n;
}

/* A value that is no number at one end of the step: changes of sign in the part where it is one. */
static int brackets_within_domain(const eomgen_method *method, eomgen_run *run, eomgen_events *ev, int n, int i)
{
    const int most = n + 2;
    double t = run->t_old, g = ev->g[i];
    for (int k = 1; k <= RUNS_SAMPLED && n < most; k++) {
        const double next = k < RUNS_SAMPLED ? run->t_old + k * (run->t - run->t_old) / (double)RUNS_SAMPLED : run->t;
        const double value = k < RUNS_SAMPLED ? value_at(method, run, ev, i, next) : ev->g_new[i];
        const int entered = k == 1 || isnan(g); /* a zero at its beginning belongs to no interval before */
        double last = next, end = value;
        if (isnan(value) && !isnan(g)) {
            last = t, end = g;
            domain_edge(method, run, ev, i, &last, &end, next);
        } else if (isnan(g) && !isnan(value)) {
            double start = next;
            g = value;
            domain_edge(method, run, ev, i, &start, &g, t);
            t = start;
        }
        if ((g < 0.0 && end >= 0.0) || (g > 0.0 && end <= 0.0) || (entered && g == 0.0 && !isnan(end))) {
            n = add(ev, n, i, t, last, g, end);
        }
        t = next, g = value;
    }
    return n;
}

static int find_brackets(const eomgen_method *method, eomgen_run *run, eomgen_events *ev)
{
    int n = 0;
    event_slopes(run, ev, ev->g_new, ev->slope_new, 1.0);
    for (int i = 0; i < ev->n; i++) {
        const double a = ev->g[i], b = ev->g_new[i];
        ev->touch[i] = 0;
        const int noted = a == 0.0 && ev->latest[i] == run->t_old; /* at the end of the step before */
        if (ev->direction[i] > 1 || (noted && ev->leaving[i] == 0)) {
            continue;
        }
        if (ev->leaving[i] != 0) {
            n = brackets_after_reset(method, run, ev, n, i);
        } else if (a == 0.0 && run->direction * ev->slope[i] * b < 0.0) {
            n = brackets_from_zero(method, run, ev, n, i);
        } else if ((a <= 0.0 && b >= 0.0) || (a >= 0.0 && b <= 0.0)) {
            n = add(ev, n, i, run->t_old, run->t, a, b);
        } else if (isnan(a) != isnan(b)) {
            n = brackets_within_domain(method, run, ev, n, i);
        } else if (may_touch(run, ev, i)) {
            n = brackets_of_touch(method, run, ev, n, i);
        }
        ev->size[i] = fmax(ev->size[i], fabs(b));
    }
    return n;
}

/* Zeros of the brackets in place of their first ends, in order, and in place of the second the way the value goes there. */
static int sort_zeros(const eomgen_method *method, eomgen_run *run, eomgen_events *ev, int n)
{
    int found = 0;
    for (int k = 0; k < n; k++) {
        const int i = ev->whose[k];
        const double *const row = ev->bracket + 4 * k, way = row[3] - row[2], t = zero_between(method, run, ev, i, row);
        if (isnan(t)) {
            continue;
        }
        int at = found++;
        for (; at > 0 && run->direction * (ev->bracket[4 * (at - 1)] - t) > 0.0; at--) {
            memcpy(ev->bracket + 4 * at, ev->bracket + 4 * (at - 1), 2 * sizeof(double));
            ev->whose[at] = ev->whose[at - 1];
        }
        ev->bracket[4 * at] = t, ev->bracket[4 * at + 1] = way, ev->whose[at] = i;
    }
    return found;
}

int eomgen_find_events(const eomgen_method *method, eomgen_run *run, eomgen_trajectory *j, double *t)
{
    eomgen_events *const ev = j->events;
    int stop = 0;
    event_values(run, ev, run->t, run->y, ev->g_new);
    const int n = sort_zeros(method, run, ev, find_brackets(method, run, ev));
    for (int k = 0; k < n; k++) {
        const int i = ev->whose[k];
        const double zero = ev->bracket[4 * k], way = ev->bracket[4 * k + 1];
        if (stop && (stop == 2 || fabs(zero - *t) > RUNS_INSTANT * fmax(fabs(*t), j->span))) {
            break;
        }
        double *const row = j->notes + j->n_notes++ * (2 + run->n);
        row[0] = i, row[1] = zero;
        eomgen_between(method, run, zero, row + 2);
        ev->count[i]++;
        ev->latest[i] = zero;
        if (ev->touch[i] != 0 && (ev->action[i] != EOMGEN_GO_ON || fabs(run->t - zero) <= RUNS_STEP_END * fabs(run->step))) {
            ev->leaving[i] = ev->touch[i]; /* so that it is not found again beside this zero */
        }
        if (ev->most[i] > 0 && ev->count[i] >= ev->most[i]) {
            stop = 2, *t = zero;
        } else if (ev->action[i] != EOMGEN_GO_ON) {
            *t = stop ? *t : zero;
            stop = 1, ev->fired[i] = way > 0.0 ? 1 : way < 0.0 ? -1 : 2;
        }
    }
    double *const spare = ev->g, *const other = ev->slope;
    ev->g = ev->g_new, ev->g_new = spare;
    ev->slope = ev->slope_new, ev->slope_new = other;
    event_slopes(run, ev, ev->g, ev->slope, -1.0);
    return run->stopped ? -1 : ev->crowded >= ev->crowd ? -2 : stop;
}
#endif
