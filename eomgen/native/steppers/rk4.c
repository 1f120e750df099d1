/* RK4 with steps of one size: W. Kutta, Beitrag zur naeherungsweisen Integration totaler Differentialgleichungen, 1901;
   between the steps the cubic through both ends. Its error is not watched: max_step is the step. */
#include "eomgen_calls.h"
#include "eomgen_steppers.h"

static void rk4_attempt(eomgen_run *run, double h)
{
    static const double at[3] = {0.5, 0.5, 1.0};
    const int n = run->n;
    const double t = run->t, *const y0 = run->y_old, *const K = run->K;
    double *const y = run->y;
    for (int s = 0; s < 3; s++) {
        for (int i = 0; i < n; i++) {
            y[i] = y0[i] + at[s] * h * K[s * n + i];
        }
        eomgen_evaluate(run, t + at[s] * h, y, run->K + (s + 1) * n);
    }
    for (int i = 0; i < n; i++) {
        y[i] = y0[i] + h / 6.0 * (K[i] + 2.0 * (K[n + i] + K[2 * n + i]) + K[3 * n + i]);
    }
    eomgen_evaluate(run, t + h, y, run->f);
}

/* Only a state that is no number is refused. */
static double rk4_error(const eomgen_run *run, double h)
{
    double sum = h * 0.0;
    for (int i = 0; i < run->n; i++) {
        sum += 0.0 * run->f[i];
    }
    return sum;
}

static void rk4_prepare(eomgen_run *run)
{
    const int n = run->n;
    const double h = run->step;
    for (int i = 0; i < n; i++) {
        const double change = run->y[i] - run->y_old[i], first = h * run->K[i], last = h * run->f[i];
        run->F[i] = first;
        run->F[n + i] = 3.0 * change - 2.0 * first - last;
        run->F[2 * n + i] = first + last - 2.0 * change;
    }
}

static void rk4_interpolate(const eomgen_run *run, double t, double *y)
{
    const int n = run->n;
    const double x = (t - run->t_old) / run->step;
    for (int i = 0; i < n; i++) {
        const double *const F = run->F + i;
        y[i] = run->y_old[i] + x * (F[0] + x * (F[n] + x * F[2 * n]));
    }
}

const eomgen_method eomgen_rk4 = {"RK4", 4, 3, 4, EOMGEN_TABLED(rk4_attempt), EOMGEN_TABLED(rk4_error),
    EOMGEN_TABLED(rk4_prepare), EOMGEN_TABLED(rk4_interpolate), 1, 0, 0, NULL, NULL};

int eomgen_march(eomgen_function rhs, int n, double t, double h, const double *x, const double *u, const double *c,
    double *out, double *w, double *k)
{
    return step_by_rk4(rhs, n, t, h, x, u, c, out, w, k);
}
