/* Step control of explicit Runge-Kutta methods: E. Hairer, S. Norsett, G. Wanner, Solving Ordinary Differential
   Equations I, section II.4, with the constants of SciPy's solve_ivp, so that the same steps are taken. */
#include <math.h>
#include <string.h>

#include "eomgen_steppers.h"

int eomgen_ready(eomgen_run *run, double t, const double *y, double *k)
{
#ifndef EOMGEN_DEVICE
    if (run->ask != NULL) {
        run->stopped = run->stopped || run->ask(run->callback_data, t, y, NULL, k) != 0;
        return 0;
    }
    if (run->until_callback == 0) {
        run->until_callback = run->callback(run->callback_data, &run->t);
        run->stopped = run->until_callback <= 0;
    }
#endif
    for (int i = 0; run->stopped && i < run->n; i++) {
        k[i] = (double)NAN;
    }
    if (run->signals != NULL && !run->stopped) {
        eomgen_force(run, t, y);
    }
    return !run->stopped;
}

void eomgen_note(eomgen_run *run, int status, double t, const double *y)
{
    int finite = 1;
    for (int i = 0; i < run->n; i++) {
        finite = finite && isfinite(y[i]);
    }
    if (finite || run->failure == 0) { /* a state that an earlier failure made tells nothing */
        run->failure = status, run->failure_time = t;
        memcpy(run->failure_state, y, (size_t)run->n * sizeof(double));
    }
}

void eomgen_failed(eomgen_run *run, int status, double t, const double *y, double *k)
{
    for (int i = 0; i < run->n; i++) {
        k[i] = (double)NAN;
    }
    eomgen_note(run, status, t, y);
}

static double stepper_norm(const double *x, const double *y, const eomgen_run *run)
{
    double sum = 0.0;
    for (int i = 0; i < run->n; i++) {
        const double part = (x[i] - (y != NULL ? y[i] : 0.0)) / (run->atol[i] + fabs(run->y[i]) * run->rtol);
        sum += part * part;
    }
    return sqrt(sum / run->n);
}

/* The first step: section II.4, starting step size. */
static double first_step(const eomgen_method *method, eomgen_run *run)
{
    const double length = fabs(run->t_bound - run->t);
    if (run->n == 0 || length == 0.0) {
        return length;
    }
    const double d0 = stepper_norm(run->y, NULL, run), d1 = stepper_norm(run->f, NULL, run);
    double h0 = d0 < RUNS_UNKNOWN || d1 < RUNS_UNKNOWN ? RUNS_FIRST : 0.01 * d0 / d1;
    h0 = h0 < length ? h0 : length;
    double *const y1 = run->K, *const f1 = run->K + run->n;
    for (int i = 0; i < run->n; i++) {
        y1[i] = run->y[i] + h0 * run->direction * run->f[i];
    }
    eomgen_evaluate(run, run->t + h0 * run->direction, y1, f1);
    const double d2 = stepper_norm(f1, run->f, run) / h0, d = d1 > d2 ? d1 : d2;
    const double h1 = d1 <= RUNS_STRAIGHT && d2 <= RUNS_STRAIGHT
                          ? fmax(RUNS_FIRST, h0 * RUNS_GROWTH)
                          : pow(0.01 / d, 1.0 / (method->error_order + 1));
    return fmin(fmin(100.0 * h0, h1), fmin(length, run->max_step));
}

/* Where the next step starts: the state just evaluated, on the constraints. */
static void keep_closed(eomgen_run *run)
{
    if (run->closed != NULL) {
        memcpy(run->next, run->closed, (size_t)run->n * sizeof(double));
    }
}

void eomgen_start(const eomgen_method *method, eomgen_run *run)
{
    run->interpolates = 0;
#ifndef EOMGEN_DEVICE
    if (run->ask != NULL) {
        method->begin(run);
        return;
    }
#endif
    eomgen_evaluate(run, run->t, run->y, run->f);
    keep_closed(run);
    if (!(run->h_abs > 0.0) && !method->expands) {
        run->h_abs = first_step(method, run);
    }
#ifndef EOMGEN_DEVICE /* which has no such methods */
    if (method->begin != NULL) {
        method->begin(run);
    }
#endif
}

/* The least step that SciPy takes. */
static double least_step(const eomgen_run *run)
{
    return 10.0 * fabs(nextafter(run->t, run->direction * HUGE_VAL) - run->t);
}

static int too_small(const eomgen_run *run, double h)
{
    return !(h >= RUNS_FINE * fabs(run->t) + ROUNDING_TINY) && !(h >= least_step(run)); /* nextafter takes its time */
}

/* Where a step of this size ends: not beyond the bound, nor short of it by less than the slack. */
static double end_of_step(const eomgen_run *run, double h_abs, double slack)
{
    const double t_new = run->t + h_abs * run->direction;
    return run->direction * (t_new - run->t_bound) > -slack ? run->t_bound : t_new;
}

double eomgen_longest(eomgen_run *run)
{
    double longest = run->max_step;
#ifndef EOMGEN_DEVICE
    if (run->meeting != NULL) { /* backwards in time velocities are opposite, accelerations are not */
        double *const motion = run->K;
        const int n = run->n - run->n_beside;
        memcpy(motion, run->y, (size_t)n * sizeof(double));
        memcpy(motion + n, run->f + run->n_q, (size_t)(n - run->n_q) * sizeof(double));
        for (int i = run->n_q; i < n; i++) {
            motion[i] *= run->direction;
        }
        if (run->signals != NULL) {
            eomgen_force(run, run->t, run->y);
        }
        double found[5];
        if (run->meeting(run->t, motion, run->u, run->c, found, run->w) == 0 && found[0] < longest) {
            longest = fmin(longest, fmax(found[0], RUNS_UNHURRIED * least_step(run)));
        }
    }
#endif
    return longest;
}

int eomgen_step(const eomgen_method *method, eomgen_run *run)
{
#ifndef EOMGEN_DEVICE
    if (method->step != NULL) {
        return method->step(run);
    }
#endif
    const int n = run->n;
    const double longest = method->fixed ? run->max_step : eomgen_longest(run);
    double h_abs = run->h_abs > longest ? longest : run->h_abs;
    if (h_abs == run->h_abs && too_small(run, h_abs)) {
        h_abs = least_step(run);
    }
    int rejected = 0;
    if (run->most_steps > 0 && run->steps >= run->most_steps) {
        return EOMGEN_TOO_MANY_STEPS;
    }
    double *const spare = run->y_old;
    run->y_old = run->y, run->y = spare;
    if (run->closed != NULL) { /* E. Eich, SIAM J. Numerical Analysis 30, 1993: the order stays; x' is the same at both */
        memcpy(run->y_old, run->next, (size_t)n * sizeof(double));
    }
    memcpy(run->K, run->f, (size_t)n * sizeof(double));
    for (;;) {
        if (run->stopped || too_small(run, h_abs)) {
            run->y = run->y_old, run->y_old = spare;
            return run->stopped ? EOMGEN_STOPPED : EOMGEN_STEP_TOO_SMALL;
        }
        /* no step for what rounding left over */
        const double t_new = end_of_step(run, h_abs, method->fixed ? RUNS_SAME * h_abs : 0.0), h = t_new - run->t;
        h_abs = fabs(h);
        EOMGEN_METHOD(method, attempt)(run, h);
        const double error = n > 0 ? EOMGEN_METHOD(method, error)(run, h) : 0.0;
        if (error < 1.0 && !run->stopped) {
            double factor = error == 0.0 ? 10.0 : fmin(10.0, 0.9 * eomgen_stretch(error, method->error_order));
            factor = rejected && factor > 1.0 ? 1.0 : factor;
            run->h_abs = h_abs * factor;
            run->t_old = run->t, run->t = t_new, run->step = h;
            run->interpolates = 0;
            run->steps++;
            keep_closed(run);
            return 0;
        }
        const double factor = 0.9 * eomgen_stretch(error, method->error_order);
        h_abs *= factor > 0.2 ? factor : 0.2; /* also where the error is NaN */
        rejected = 1;
        run->rejected++;
    }
}

void eomgen_between(const eomgen_method *method, eomgen_run *run, double t, double *y)
{
    (void)method; /* on a device it is known */
    if (!run->interpolates) {
        EOMGEN_METHOD(method, prepare)(run);
        run->interpolates = 1;
    }
    EOMGEN_METHOD(method, interpolate)(run, t, y);
}

/* Inputs over time: the value of a table or of an expression. */

double eomgen_table_value(const eomgen_signal *s, double t, double hold)
{
    int low = 0, high = s->n - 1;
    const int size = s->order >= 3 ? 4 : 1;
    const double at = (s->order == 0 || s->order == 4) && !isnan(hold) ? hold : t; /* picks the piece */
    if (at <= s->times[0] || high == 0) {
        return s->values[0];
    }
    if (at >= s->times[high]) {
        return s->values[high * size];
    }
    while (high - low > 1) {
        const int middle = (low + high) / 2;
        if (s->times[middle] <= at) {
            low = middle;
        } else {
            high = middle;
        }
    }
    const double x = t - s->times[low], *const v = s->values + low * size;
    if (s->order == 0 || s->order == 2) {
        return v[0];
    }
    if (s->order == 1) {
        return v[0] + x * ((v[1] - v[0]) / (s->times[low + 1] - s->times[low]));
    }
    return v[0] + x * (v[1] + x * (v[2] + x * v[3]));
}

void eomgen_force(eomgen_run *run, double t, const double *y)
{
#ifndef EOMGEN_DEVICE
    if (run->ask != NULL) {
        run->stopped = run->ask(run->callback_data, t, y, run->u, NULL) != 0 || run->stopped;
        return;
    }
#endif
    for (int i = 0; i < run->n_u; i++) {
        const eomgen_signal *const s = run->signals + i;
#ifndef EOMGEN_DEVICE
        if (s->n > 0 && s->tape != NULL) {
            eomgen_play(s->tape, t, y, run->u, run->c, run->u + i);
            continue;
        }
#else
        (void)y;
#endif
        if (s->n > 0) {
            run->u[i] = eomgen_table_value(s, t, run->hold);
        }
    }
}

#include "eomgen_real.h"

#ifndef EOMGEN_DEVICE
/* Expressions given at run time, one instruction after the other: the operations of the graph that models are made of. */
/* EOMGEN_TAPE(X) lists X(name, value of a, b, c) for each row of the table of operations; leaves come before. */
#define NAME_OF(NAME, VALUE) #NAME,
#define CODE_OF(NAME, VALUE) TAPE_##NAME,
#define CASE_OF(NAME, VALUE) case TAPE_##NAME: r[k] = (VALUE); break;

/* The names in the order of the codes. */
const char *const eomgen_operations[] = {"const", "t", "x", "u", "p", EOMGEN_TAPE(NAME_OF) NULL};

enum { TAPE_CONST, TAPE_T, TAPE_X, TAPE_U, TAPE_P, EOMGEN_TAPE(CODE_OF) TAPE_END };

void eomgen_play(const eomgen_tape *tape, double t, const double *y, const double *u, const double *p, double *out)
{
    double *const r = tape->results;
    for (int k = 0; k < tape->n; k++) {
        const int *const at = tape->code + 4 * k;
        const int i = at[1];
        const double a = at[0] > TAPE_P ? r[i] : 0.0, b = r[at[2]], c = r[at[3]]; /* unused operands name an earlier result */
        switch (at[0]) {
        case TAPE_CONST: r[k] = tape->numbers[i]; break;
        case TAPE_T: r[k] = t; break;
        case TAPE_X: r[k] = y[i]; break;
        case TAPE_U: r[k] = u[i]; break;
        case TAPE_P: r[k] = p[i]; break;
        EOMGEN_TAPE(CASE_OF)
        default: r[k] = (double)NAN;
        }
    }
    for (int k = 0; k < tape->n_out; k++) {
        out[k] = r[tape->out[k]];
    }
}
#endif

#include "eomgen_methods.h"
