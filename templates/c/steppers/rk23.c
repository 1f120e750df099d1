/* RK23: P. Bogacki, L. Shampine, A 3(2) pair of Runge-Kutta formulas, 1989; as SciPy has it. */
#include <math.h>

#include "eomgen_steppers.h"

static void rk23_attempt(eomgen_run *run, double h)
{
    const int n = run->n;
    const double t = run->t;
    const double *restrict y0 = run->y_old;
    double *restrict y = run->y;
    double *const K = run->K;
    const double *restrict const k0 = K;
    double *const k1 = K + n;
    double *const k2 = K + 2 * n;
    double *const k3 = K + 3 * n;
    for (int i = 0; i < n; i++) {
        y[i] = y0[i] + h * (0.5 * k0[i]);
    }
    eomgen_evaluate(run, t + 0.5 * h, y, k1);
    for (int i = 0; i < n; i++) {
        y[i] = y0[i] + h * (0.75 * k1[i]);
    }
    eomgen_evaluate(run, t + 0.75 * h, y, k2);
    for (int i = 0; i < n; i++) {
        y[i] = y0[i] + h * (0.2222222222222222 * k0[i] + 0.3333333333333333 * k1[i] + 0.4444444444444444 * k2[i]);
    }
    eomgen_evaluate(run, t + h, y, k3);
    for (int i = 0; i < n; i++) {
        run->f[i] = k3[i];
    }
}

static double rk23_error(const eomgen_run *run, double h)
{
    const int n = run->n;
    double sum = 0.0;
    for (int i = 0; i < n; i++) {
        const double *const k = run->K + i;
        const double size = fmax(fabs(run->y_old[i]), fabs(run->y[i]));
        const double part = h * (0.06944444444444445 * k[0] - 0.08333333333333333 * k[n] - 0.1111111111111111 * k[2
            * n] + 0.125 * k[3 * n]) / (run->atol[i] + size * run->rtol);
        sum += part * part;
    }
    return sqrt(sum / n);
}

static void rk23_prepare(eomgen_run *run)
{
    const int n = run->n;
    for (int i = 0; i < n; i++) {
        const double *const k = run->K + i;
        run->F[i] = 1.0 * k[0];
        run->F[n + i] = -1.3333333333333333 * k[0] + 1.0 * k[n] + 1.3333333333333333 * k[2 * n] - 1.0 * k[3 * n];
        run->F[2 * n + i] = 0.5555555555555556 * k[0] - 0.6666666666666666 * k[n] - 0.8888888888888888 * k[2 * n] +
            1.0 * k[3 * n];
    }
}

static void rk23_interpolate(const eomgen_run *run, double t, double *y)
{
    const int n = run->n;
    const double x = (t - run->t_old) / run->step;
    for (int i = 0; i < n; i++) {
        const double *const F = run->F + i;
        y[i] = run->y_old[i] + run->step * x * (F[0] + x * (F[n] + x * F[2 * n]));
    }
}

const eomgen_method eomgen_rk23 = {.name = "RK23", .rows_K = 4, .rows_F = 3, .error_order = 2, .attempt =
                                   rk23_attempt, .error = rk23_error, .prepare = rk23_prepare, .interpolate =
                                   rk23_interpolate};
