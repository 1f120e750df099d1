/* One classical Runge-Kutta step of size h from x at time t into out, which may be x: for real time, where each step must
   cost the same. k: 5 n doubles of work. Nothing is allocated; the status of the first evaluation that fails. */
static int step_by_rk4(eomgen_function rhs, int n, double t, double h, const double *x, const double *u, const double *c,
    double *out, double *w, double *k)
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
