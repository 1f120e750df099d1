/* dx'/dx without projection: K [da; dl] = -[dr1; dr2] along each direction. */
static int jacobian_driver(double t, const double *restrict x, const double *restrict u, const double *restrict c,
                          double *restrict out, double *restrict w)
{
    int plan[3 * NZ];
    double *const dq = w + AT_DQ, *const dv = w + AT_DV, *const r = w + AT_ALONG, *const rates = w + AT_RATES;
    double *const z = w + AT_MOTION + NQ + N;
    for (int k = 0; k < NQ + N; k++) {
        w[AT_X + k] = x[k];
    }
    int status = accelerate_system(t, u, c, plan, w + AT_ACC, w);
    for (int k = 0; k < M; k++) {
        w[AT_L + k] = z[N + k];
    }
    if (status == 0) {
        prepare_residuals(t, u, c, w);
    }
    for (int column = 0; column < NQ + N && status == 0; column++) {
        for (int k = 0; k < NQ + N; k++) {
            dq[k] = k == column ? 1.0 : 0.0;
        }
        residuals_along(t, u, c, w);
        for (int k = 0; k < NZ; k++) {
            r[k] = -r[k];
        }
        status = solve_system(r, plan, z, w);
        change_rates(x, dq, dv, rates);
        for (int k = 0; k < NQ; k++) {
            out[k * (NQ + N) + column] = rates[k];
        }
        for (int k = 0; k < N; k++) {
            out[(NQ + k) * (NQ + N) + column] = z[k];
        }
    }
    return status;
}
