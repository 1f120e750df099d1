static int jacobian_driver(double t, const double *restrict x, const double *restrict u, const double *restrict c,
                          double *restrict out, double *restrict w)
{
    double *const dq = w + AT_X + 3 * N, *const r1 = w + AT_ALONG;
    const int status = tree_accelerate(t, x, u, c, w);
    if (status != 0) {
        return status;
    }
    prepare_residuals(t, u, c, w);
    for (int column = 0; column < 2 * N; column++) {
        for (int k = 0; k < 2 * N; k++) {
            dq[k] = k == column ? 1.0 : 0.0;
        }
        residuals_along(t, u, c, w);
        tree_solve(w + AT_TERMS, r1);
        for (int k = 0; k < N; k++) {
            out[k * 2 * N + column] = dq[N + k];
            out[(N + k) * 2 * N + column] = -r1[k];
        }
    }
    return 0;
}
