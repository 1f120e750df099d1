static int jacobian_driver(double t, const double *restrict x, const double *restrict u, const double *restrict c,
                          double *restrict out, double *restrict w)
{
    double *const dq = w + AT_DQ, *const dv = w + AT_DV, *const r1 = w + AT_ALONG, *const rates = w + AT_RATES;
    const int status = tree_accelerate(t, x, u, c, w);
    if (status != 0) {
        return status;
    }
    prepare_residuals(t, u, c, w);
    for (int column = 0; column < NQ + N; column++) {
        for (int k = 0; k < NQ + N; k++) {
            dq[k] = k == column ? 1.0 : 0.0;
        }
        residuals_along(t, u, c, w);
        tree_solve(N, w + AT_TERMS, r1);
        change_rates(x, dq, dv, rates);
        for (int k = 0; k < NQ; k++) {
            out[k * (NQ + N) + column] = rates[k];
        }
        for (int k = 0; k < N; k++) {
            out[(NQ + k) * (NQ + N) + column] = -r1[k];
        }
    }
    return 0;
}
