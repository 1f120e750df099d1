/* RK23: P. Bogacki, L. Shampine, A 3(2) pair of Runge-Kutta formulas, 1989; as SciPy has it. */
static void rk23_attempt(RUN *run, real h)
{
    const int n = run->n;
    const real t = run->t;
    real *const K = run->K, *const y = run->y;
    const real *const y0 = run->y_old;
    EACH(AT(y) = AT(y0) + h * (0.5 * ROW(0)))
    EVALUATE(run, t + 0.5 * h, y, K + n);
    EACH(AT(y) = AT(y0) + h * (0.75 * ROW(1)))
    EVALUATE(run, t + 0.75 * h, y, K + 2 * n);
    EACH(AT(y) = AT(y0) + h * (0.2222222222222222 * ROW(0) + 0.3333333333333333 * ROW(1) + 0.4444444444444444 *
        ROW(2)))
    EVALUATE(run, t + h, y, run->f);
}

static real rk23_error(const RUN *run, real h)
{
    const int n = run->n;
    const real *const K = run->K;
    real *const part = run->F, *const scale = run->F + n;
    real sum = same(0.0);
    measure(run, scale);
    EACH(AT(part) = h * OVER(0.06944444444444445 * ROW(0) - 0.08333333333333333 * ROW(1) - 0.1111111111111111 * ROW(2) +
        0.125 * AT(run->f)))
    for (int i = 0; i < n; i++) {
        sum += part[i] * part[i];
    }
    return root(sum / (double)n);
}

static void rk23_prepare(RUN *run)
{
    const int n = run->n;
    const real *const K = run->K;
    real *const F = run->F;
    EACH(
        AT(F) = 1.0 * ROW(0);
        AT(F + n) = -1.3333333333333333 * ROW(0) + 1.0 * ROW(1) + 1.3333333333333333 * ROW(2) - 1.0 * AT(run->f);
        AT(F + 2 * n) = 0.5555555555555556 * ROW(0) - 0.6666666666666666 * ROW(1) - 0.8888888888888888 * ROW(2) +
            1.0 * AT(run->f);
    )
}

static void rk23_interpolate(const RUN *run, real t, real *y)
{
    const int n = run->n;
    const real *const F = run->F, *const y0 = run->y_old;
    const real h = run->step, x = (t - run->t_old) / h;
    EACH(AT(y) = AT(y0) + h * x * (AT(F) + x * (AT(F + n) + x * AT(F + 2 * n))))
}

METHOD(rk23, "RK23", 3, 3, 2)
