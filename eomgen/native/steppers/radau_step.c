/* Radau IIA, one step. */
#include <math.h>
#include <string.h>

#include "eomgen_steppers.h"

/* The Jacobian at the present state, or at the next one. */
static int radau_differentiate(eomgen_run *run, const newton_area *a, double t, const double *y, const double *f)
{
    a->state[RADAU_FACTORED] = 0.0;
    const int status = eomgen_differentiate(run, t, y, f, a->J, run->K + RADAU_SPARE * run->n);
    a->state[RADAU_CURRENT] = status == 0;
    newton_look(run, a);
    return status;
}

/* Solve for the stages of a step h, with a new Jacobian if the old one does not do. */
static int radau_converge(eomgen_run *run, const newton_area *a, double h, int *iterations, double *rate)
{
    const int n = run->n;
    for (int i = 0; i < n; i++) {
        run->K[RADAU_SCALE * n + i] = run->atol[i] + fabs(run->y[i]) * run->rtol;
    }
    for (;;) {
        for (int s = 0; s < 3; s++) {
            double *const Z = run->K + s * n;
            memset(Z, 0, (size_t)n * sizeof(double));
            if (a->state[RADAU_H] != 0.0) { /* the last step's polynomial goes on */
                radau_poly(n, run->K + RADAU_Q * n, 1.0 + RADAU_C[s] * h / a->state[RADAU_H], Z);
                for (int i = 0; i < n; i++) {
                    Z[i] -= run->K[RADAU_LAST * n + i];
                }
            }
        }
        int fine = 1;
        if (a->state[RADAU_FACTORED] == 0.0) {
            fine = newton_factor(run, a, MU / h, MU_RE / h, MU_IM / h) == 0;
            a->state[RADAU_FACTORED] = fine, a->state[RADAU_H_FACTORED] = h;
        }
        if (fine && radau_solve(run, a, h, iterations, rate)) {
            return 1;
        }
        if (run->stopped || a->state[RADAU_CURRENT] != 0.0 || radau_differentiate(run, a, run->t, run->y, run->f) != 0) {
            return 0;
        }
    }
}

/* The error of the step, section IV.8 (8.19), or (8.20) where the first is too large after a rejection. */
static double radau_error(eomgen_run *run, const newton_area *a, double h, const double *y_new, int rejected)
{
    const int n = run->n;
    const double *const Z = run->K;
    double *const error = run->K + RADAU_ERROR * n, *const ZE = run->K + RADAU_ZE * n;
    double *const at = run->K + RADAU_SPARE * n;
    const double e0 = (-13.0 - 7.0 * S6) / 3.0, e1 = (-13.0 + 7.0 * S6) / 3.0, e2 = -1.0 / 3.0;
    for (int i = 0; i < n; i++) {
        ZE[i] = (Z[i] * e0 + Z[n + i] * e1 + Z[2 * n + i] * e2) / h;
        error[i] = run->f[i] + ZE[i];
        run->K[RADAU_SCALE * n + i] = run->atol[i] + fmax(fabs(run->y[i]), fabs(y_new[i])) * run->rtol;
    }
    newton_solve(run, a, MU / h, error);
    double size = radau_norm(run, error, 1);
    if (rejected && size > 1.0) {
        for (int i = 0; i < n; i++) {
            at[i] = run->y[i] + error[i];
        }
        eomgen_evaluate(run, run->t, at, error);
        for (int i = 0; i < n; i++) {
            error[i] += ZE[i];
        }
        newton_solve(run, a, MU / h, error);
        size = radau_norm(run, error, 1);
    }
    return size;
}

static void radau_accept(eomgen_run *run, const newton_area *a, double h, double t_new)
{
    const int n = run->n;
    const double *const Z = run->K;
    double *const Q = run->K + RADAU_Q * n, *const y = run->y_old;
    for (int i = 0; i < n; i++) {
        const double p = Z[i], q = Z[n + i], r = Z[2 * n + i];
        Q[i] = p * (13.0 / 3.0 + 7.0 * S6 / 3.0) + q * (13.0 / 3.0 - 7.0 * S6 / 3.0) + r / 3.0;
        Q[n + i] = p * (-23.0 / 3.0 - 22.0 * S6 / 3.0) + q * (-23.0 / 3.0 + 22.0 * S6 / 3.0) - r * (8.0 / 3.0);
        Q[2 * n + i] = p * (10.0 / 3.0 + 5.0 * S6) + q * (10.0 / 3.0 - 5.0 * S6) + r * (10.0 / 3.0);
    }
    memcpy(run->K + RADAU_LAST * n, Z + 2 * n, (size_t)n * sizeof(double));
    a->state[RADAU_H] = h;
    run->y_old = run->y, run->y = y;
    run->t_old = run->t, run->t = t_new, run->step = h;
    run->interpolates = 0;
    run->steps++;
    eomgen_evaluate(run, t_new, run->y, run->f);
}

static int radau_step(eomgen_run *run)
{
    const int n = run->n;
    const newton_area area = newton_areas(run, RADAU_ROWS), *const a = &area;
    const double least = 10.0 * fabs(nextafter(run->t, run->direction * HUGE_VAL) - run->t), entered = run->h_abs;
    double h_abs = fmin(fmax(entered, least), eomgen_longest(run)), rate = -1.0, size;
    double h_old = a->state[RADAU_H_OLD], error_old = a->state[RADAU_ERROR_OLD];
    if (run->most_steps > 0 && run->steps >= run->most_steps) {
        return EOMGEN_TOO_MANY_STEPS;
    }
    if (h_abs != entered) {
        h_old = 0.0;
    }
    for (int rejected = 0, iterations = 0;;) {
        if (run->stopped || !(h_abs >= least)) {
            return run->stopped ? EOMGEN_STOPPED : EOMGEN_STEP_TOO_SMALL;
        }
        double t_new = run->t + h_abs * run->direction;
        if (run->direction * (t_new - run->t_bound) > 0.0) {
            t_new = run->t_bound;
        }
        const double h = t_new - run->t;
        h_abs = fabs(h);
        if (!(fabs(h - a->state[RADAU_H_FACTORED]) <= RUNS_SAME * h_abs)) {
            a->state[RADAU_FACTORED] = 0.0;
        }
        if (!radau_converge(run, a, h, &iterations, &rate)) {
            h_abs *= 0.5, a->state[RADAU_FACTORED] = 0.0;
            run->rejected++;
            continue;
        }
        for (int i = 0; i < n; i++) {
            run->y_old[i] = run->y[i] + run->K[2 * n + i];
        }
        size = radau_error(run, a, h, run->y_old, rejected);
        const double safety = 0.9 * (2 * NEWTON_MOST + 1) / (2 * NEWTON_MOST + iterations);
        double factor = safety * radau_factor(h_abs, h_old, size, error_old);
        if (!(size <= 1.0)) {
            h_abs *= factor > 0.2 ? factor : 0.2;
            a->state[RADAU_FACTORED] = 0.0, rejected = 1;
            run->rejected++;
            continue;
        }
        const int renew = iterations > 2 && rate > RUNS_SLOW;
        factor = fmin(10.0, factor);
        if (!renew && factor < 1.2) {
            factor = 1.0;
        } else {
            a->state[RADAU_FACTORED] = 0.0;
        }
        radau_accept(run, a, h, t_new);
        a->state[RADAU_CURRENT] = 0.0;
        if (renew) {
            radau_differentiate(run, a, run->t, run->y, run->f);
        }
        a->state[RADAU_H_OLD] = entered, a->state[RADAU_ERROR_OLD] = size;
        run->h_abs = h_abs * factor;
        return 0;
    }
}

static void radau_prepare(eomgen_run *run)
{
    memcpy(run->F, run->K + RADAU_Q * run->n, (size_t)(3 * run->n) * sizeof(double));
}

static void radau_interpolate(const eomgen_run *run, double t, double *y)
{
    radau_poly(run->n, run->F, (t - run->t_old) / run->step, y);
    for (int i = 0; i < run->n; i++) {
        y[i] += run->y_old[i];
    }
}

const eomgen_method eomgen_radau = {"Radau", RADAU_ROWS, 3, 3, NULL, NULL, radau_prepare, radau_interpolate, 0, 4, 0,
                                    radau_begin, radau_step};
