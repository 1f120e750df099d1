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
