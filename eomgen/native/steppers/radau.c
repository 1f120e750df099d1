/* Radau IIA of order 5: E. Hairer, G. Wanner, Solving Ordinary Differential Equations II, section IV.8, with the
   constants and rules of SciPy's Radau, so that the same steps are taken. */
#include <float.h>
#include <math.h>
#include <string.h>

#include "eomgen_steppers.h"

/* Rows of run->K: 3 stages less the state, 3 of the same transformed, 3 slopes, 3 changes; then one each, but spare with
   two; the last step's polynomial, and its whole change. */
enum { RADAU_Z = 0, RADAU_W = 3, RADAU_F = 6, RADAU_D = 9, RADAU_SCALE = 12, RADAU_ERROR, RADAU_ZE, RADAU_SPARE,
       RADAU_Q = 18, RADAU_LAST = 21, RADAU_ROWS = 22 };
/* Numbers kept from step to step in newton_area.state. */
enum { RADAU_H_OLD = 1, RADAU_ERROR_OLD, RADAU_CURRENT, RADAU_FACTORED, RADAU_H_FACTORED, RADAU_H };
enum { NEWTON_MOST = 6 };

static const double S6 = 2.449489742783178, MU = 3.6378342527444957, MU_RE = 2.6810828736277523,
                    MU_IM = -3.0504301992474105;
static const double RADAU_C[3] = {0.15505102572168217, 0.6449489742783178, 1.0};
static const double RADAU_T_[2][3] = {{0.09443876248897524, -0.14125529502095421, 0.03002919410514742},
                                      {0.25021312296533332, 0.20412935229379994, -0.38294211275726192}};
static const double TI[3][3] = {{4.17871859155190428, 0.32768282076106237, 0.52337644549944951},
                                {-4.17871859155190428, -0.32768282076106237, 0.47662355450055044},
                                {0.50287263494578682, -2.57192694985560522, 0.59603920482822492}};

static double radau_norm(const eomgen_run *run, const double *x, int rows)
{
    const double *restrict const scale = run->K + RADAU_SCALE * run->n;
    double sum = 0.0;
    for (int k = 0; k < rows; k++) {
        for (int i = 0; i < run->n; i++) {
            const double part = x[k * run->n + i] / scale[i];
            sum += part * part;
        }
    }
    return run->n > 0 ? sqrt(sum / (rows * run->n)) : 0.0;
}

/* The last step's polynomial at t, less its state at the start. */
static void radau_poly(int n, const double *restrict Q, double x, double *restrict z)
{
    for (int i = 0; i < n; i++) {
        z[i] = x * (Q[i] + x * (Q[n + i] + x * Q[2 * n + i]));
    }
}

/* The collocation equations by Newton's method with the matrices factored: 1 where it converged. */
static int radau_solve(eomgen_run *run, const newton_area *a, double h, int *iterations, double *rate)
{
    const int n = run->n;
    const double g = MU / h, x = MU_RE / h, y = MU_IM / h;
    const double tolerance = fmax(10.0 * DBL_EPSILON / run->rtol, fmin(0.03, sqrt(run->rtol)));
    double *restrict const Z = run->K, *restrict const W = run->K + RADAU_W * n, *const F = run->K + RADAU_F * n;
    double *const D = run->K + RADAU_D * n, *const at = run->K + RADAU_SPARE * n;
    double before = 0.0;
    for (int i = 0; i < n; i++) {
        for (int k = 0; k < 3; k++) {
            W[k * n + i] = TI[k][0] * Z[i] + TI[k][1] * Z[n + i] + TI[k][2] * Z[2 * n + i];
        }
    }
    *rate = -1.0;
    for (int k = 0; k < NEWTON_MOST; k++) {
        *iterations = k + 1;
        double finite = 0.0;
        for (int s = 0; s < 3; s++) {
            for (int i = 0; i < n; i++) {
                at[i] = run->y[i] + Z[s * n + i];
            }
            eomgen_evaluate(run, run->t + RADAU_C[s] * h, at, F + s * n);
            for (int i = 0; i < n; i++) {
                finite += F[s * n + i] * 0.0;
            }
            if (finite != 0.0) {
                return 0;
            }
        }
        for (int i = 0; i < n; i++) {
            const double p = F[i], q = F[n + i], r = F[2 * n + i];
            D[i] = TI[0][0] * p + TI[0][1] * q + TI[0][2] * r - g * W[i];
            D[n + i] = TI[1][0] * p + TI[1][1] * q + TI[1][2] * r - (x * W[n + i] - y * W[2 * n + i]);
            D[2 * n + i] = TI[2][0] * p + TI[2][1] * q + TI[2][2] * r - (x * W[2 * n + i] + y * W[n + i]);
        }
        newton_solve(run, a, g, D);
        newton_solve_complex(run, a, x, y, D + n, D + 2 * n);
        const double size = radau_norm(run, D, 3);
        if (k > 0) {
            *rate = size / before;
            if (!(*rate < 1.0) || pow(*rate, NEWTON_MOST - k) / (1.0 - *rate) * size > tolerance) {
                return 0;
            }
        }
        for (int i = 0; i < n; i++) {
            const double p = W[i] += D[i], q = W[n + i] += D[n + i], r = W[2 * n + i] += D[2 * n + i];
            Z[i] = RADAU_T_[0][0] * p + RADAU_T_[0][1] * q + RADAU_T_[0][2] * r;
            Z[n + i] = RADAU_T_[1][0] * p + RADAU_T_[1][1] * q + RADAU_T_[1][2] * r;
            Z[2 * n + i] = p + q;
        }
        if (size == 0.0 || (k > 0 && *rate / (1.0 - *rate) * size < tolerance)) {
            return 1;
        }
        before = size;
    }
    return 0;
}

/* Section IV.8, predictive step size control. */
static double radau_factor(double h, double h_old, double error, double error_old)
{
    double growth = 1.0;
    if (h_old > 0.0 && error_old >= 0.0 && error != 0.0) {
        growth = fmin(1.0, h / h_old * pow(error_old / error, 0.25));
    }
    return growth * pow(error, -0.25);
}

static void radau_begin(eomgen_run *run)
{
    const newton_area a = newton_areas(run, RADAU_ROWS);
    memset(a.state, 0, NEWTON_STATE * sizeof(double));
    a.state[RADAU_ERROR_OLD] = -1.0;
    a.state[RADAU_CURRENT] =
        eomgen_differentiate(run, run->t, run->y, run->f, a.J, run->K + RADAU_SPARE * run->n) == 0;
    newton_look(run, &a);
}

/* Radau IIA, one step. */

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
    const double least = least_step(run), entered = run->h_abs;
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
        const double t_new = end_of_step(run, h_abs, 0.0), h = t_new - run->t;
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

#if defined(__GNUC__) && !defined(__clang__) && defined(__OPTIMIZE__)
#pragma GCC pop_options
#endif
