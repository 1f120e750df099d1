/* Where values change sign within a step: between its ends, after a reset, and where they come to zero and leave again. */
#include <math.h>
#include <string.h>

#include "eomgen_loop.h"

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

/* A reset left the value at zero: it has to be seen on its side before it can come back. Where a step ends on the other
   side and never shows it there, it came back within the accuracy of the step: resets that die away. */
static int brackets_after_reset(const eomgen_method *method, eomgen_run *run, eomgen_events *ev, int n, int i)
{
    double t = run->t_old, g = 0.0;
    int seen = 0;
    for (int k = RUNS_HALVED; k >= 0; k--) {
        const double next = k > 0 ? run->t_old + ldexp(run->t - run->t_old, -k) : run->t;
        const double value = k > 0 ? value_at(method, run, ev, i, next) : ev->g_new[i];
        if (seen && value * ev->leaving[i] <= 0.0) {
            ev->leaving[i] = 0;
            return add(ev, n, i, t, next, g, value);
        }
        seen = seen || value * ev->leaving[i] > 0.0;
        t = next, g = value;
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
    double t = run->t_old, g = 0.0;
    int seen = 0;
    for (int k = RUNS_HALVED; k >= 0; k--) {
        const double next = k > 0 ? run->t_old + ldexp(run->t - run->t_old, -k) : run->t;
        const double value = k > 0 ? value_at(method, run, ev, i, next) : ev->g_new[i];
        if (seen && value * side <= 0.0) {
            n = add(ev, n, i, run->t_old, run->t_old, -side, 0.0);
            return add(ev, n, i, t, next, g, value);
        }
        seen = seen || value * side > 0.0;
        t = next, g = value;
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

int eomgen_find_events(const eomgen_method *method, eomgen_run *run, eomgen_journey *j, double *t)
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
        if (ev->touch[i] != 0 && (ev->action[i] != EOMGEN_GO_ON || fabs(run->t - zero) <= RUNS_LATE * fabs(run->step))) {
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
