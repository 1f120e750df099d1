/* RK23: P. Bogacki, L. Shampine, A 3(2) pair of Runge-Kutta formulas, 1989; as SciPy has it. */
ATTEMPT(rk23)
{
    STAGE(1, 0.5, 0.5 * k(0))
    STAGE(2, 0.75, 0.75 * k(1))
    STAGE(3, 1.0, 0.2222222222222222 * k(0) + 0.3333333333333333 * k(1) + 0.4444444444444444 * k(2))
    LAST_STAGE(3)
}

static real rk23_error(const RUN *run, real h)
{
    const int n = run->n;
    real sum = same(0.0);
    for (int i = 0; i < n; i++) {
        const real *const k = run->K + i;
        const real size = larger_of(abs_of(run->y_old[i]), abs_of(run->y[i]));
        const real part = h * (0.06944444444444445 * k[0] - 0.08333333333333333 * k[n] - 0.1111111111111111 * k[2
            * n] + 0.125 * k[3 * n]) / (run->atol[i] + size * run->rtol);
        sum += part * part;
    }
    return root(sum / (double)n);
}

static void rk23_prepare(RUN *run)
{
    const int n = run->n;
    for (int i = 0; i < n; i++) {
        const real *const k = run->K + i;
        run->F[i] = 1.0 * k[0];
        run->F[n + i] = -1.3333333333333333 * k[0] + 1.0 * k[n] + 1.3333333333333333 * k[2 * n] - 1.0 * k[3 * n];
        run->F[2 * n + i] = 0.5555555555555556 * k[0] - 0.6666666666666666 * k[n] - 0.8888888888888888 * k[2 * n] +
            1.0 * k[3 * n];
    }
}

static void rk23_interpolate(const RUN *run, real t, real *y)
{
    const int n = run->n;
    const real x = (t - run->t_old) / run->step;
    for (int i = 0; i < n; i++) {
        const real *const F = run->F + i;
        y[i] = run->y_old[i] + run->step * x * (F[0] + x * (F[n] + x * F[2 * n]));
    }
}

METHOD(rk23, "RK23", 4, 3, 2)
