/* How the public functions of a model are made: of straight-line functions, or by the solvers, each with a check of its
   result; and a step in real time. */
#ifndef EOMGEN_CALLS_H
#define EOMGEN_CALLS_H

#include "eomgen.h"
#include "eomgen_real.h"

/* NAME, whose result of LENGTH numbers BLOCK writes; SOLVED: a function of a solver. */
#define EOMGEN_FUNCTION(NAME, BLOCK, LENGTH) \
    int NAME(double t, const double *restrict x, const double *restrict u, const double *restrict c, \
        double *restrict out, double *restrict w) \
    { \
        if (out == NULL) { \
            return EOMGEN_SUCCESS; \
        } \
        const int status = BLOCK(t, x, u, c, out, w); \
        return status != 0 ? status : LENGTH > 256 ? check_rows(out, LENGTH) : check_finite(out, LENGTH); \
    }
#define EOMGEN_SOLVED(NAME, SOLVER, LENGTH) \
    int NAME(double t, const double *restrict x, const double *restrict u, const double *restrict c, \
        double *restrict out, double *restrict w) \
    { \
        if (out == NULL) { \
            return EOMGEN_SUCCESS; \
        } \
        const eom_at at = { MODEL, t, u, c, w }; \
        const int status = SOLVER(&at, x, out); \
        return status != 0 ? status : LENGTH > 256 ? check_rows(out, LENGTH) : check_finite(out, LENGTH); \
    }

/* 1 if an entry of the result is NaN or infinite; four sums, because each addition waits for the one before. */
EOMGEN_SHARED int check_finite(const double *restrict out, int length)
{
    double sum[4] = {0.0, 0.0, 0.0, 0.0};
    int i = 0;
    for (; i + 4 <= length; i += 4) {
        sum[0] += out[i] * 0.0;
        sum[1] += out[i + 1] * 0.0;
        sum[2] += out[i + 2] * 0.0;
        sum[3] += out[i + 3] * 0.0;
    }
    for (; i < length; i++) {
        sum[0] += out[i] * 0.0;
    }
    return (sum[0] + sum[1]) + (sum[2] + sum[3]) == 0.0 ? EOMGEN_SUCCESS : EOMGEN_NON_FINITE;
}

#ifdef EOMGEN_LONG_RESULTS
/* The same of a long result. */
EOMGEN_ROWS static int check_rows(const double *restrict out, int length)
{
    double sum[8] = {0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0};
    int i = 0;
    for (; i + 8 <= length; i += 8) {
        for (int k = 0; k < 8; k++) {
            sum[k] += out[i + k] * 0.0;
        }
    }
    for (int k = 1; k < 8; k++) {
        sum[0] += sum[k];
    }
    return sum[0] == 0.0 ? check_finite(out + i, length - i) : EOMGEN_NON_FINITE;
}
#else
#define check_rows check_finite
#endif

/* One classical Runge-Kutta step of size h from x at time t into out, which may be x: for real time, where each step must
   cost the same. k: 5 n doubles of work. Nothing is allocated; the status of the first evaluation that fails. */
EOMGEN_SHARED int step_by_rk4(eomgen_function rhs, int n, double t, double h, const double *x, const double *u,
    const double *c, double *out, double *w, double *k)
{
    static const double at[4] = {0.0, 0.5, 0.5, 1.0};
    double *const y = k + 4 * n;
    for (int s = 0; s < 4; s++) {
        const double *const last = k + (s > 0 ? s - 1 : 0) * n;
        for (int i = 0; i < n; i++) {
            y[i] = s > 0 ? x[i] + at[s] * h * last[i] : x[i];
        }
        const int status = rhs(t + at[s] * h, y, u, c, k + s * n, w);
        if (status != 0) {
            return status;
        }
    }
    for (int i = 0; i < n; i++) {
        out[i] = x[i] + h / 6.0 * (k[i] + 2.0 * (k[n + i] + k[2 * n + i]) + k[3 * n + i]);
    }
    return 0;
}

#endif
