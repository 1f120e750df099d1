static int jacobian_by_partition(double t, const double *restrict x, const double *restrict u, const double *restrict c,
                                 double *restrict out, double *restrict weakest, double *restrict w)
{
    partition parts;
    const int width = N + 1 + M;
    const double *const s = w + AT_SCALES, *const rows = w + AT_ROWS, *const dq = w + AT_DQ, *const dv = w + AT_DV;
    double *const r1 = w + AT_ALONG, *const r2 = r1 + N, *const da = w + AT_STEP, *const rates = w + AT_RATES;
    int status = close_loops(t, x, u, c, w);
    if (status == 0) {
        status = accelerate(t, u, c, width, &parts, w + AT_ACC, w);
        *weakest = parts.weakest;
    }
    if (status == 0 && MH < M) {
        status = factor_gram(MH, w + AT_J, CONSTRAINTS_GENTLE, w + AT_GH);
    }
#ifdef NORMAL_STEPS
    status = status == 0 ? form_normal(t, w + AT_X, u, c, w) : status;
#endif
    if (status != 0) {
        return status;
    }
    find_multipliers(width, &parts, w + AT_L, w);
    prepare_residuals(t, u, c, w);
    for (int column = 0; column < NQ + N; column++) {
        status = project_direction(t, column, u, c, w);
        if (status != 0) {
            return status;
        }
        residuals_along(t, u, c, w);
        for (int k = 0; k < N; k++) {
            r1[k] *= s[k], da[k] = 0.0;
        }
        for (int j = 0; j < R; j++) {
            for (int i = 0; i < M; i++) {
                da[parts.dependent[j]] -= rows[parts.row[j] * width + N + 1 + i] * r2[i] / s[N + i];
            }
        }
        solve_embedded(r1, da, w);
        change_rates(w + AT_X, dq, dv, rates);
        for (int k = 0; k < NQ; k++) {
            out[k * (NQ + N) + column] = rates[k];
        }
        for (int k = 0; k < N; k++) {
            out[(NQ + k) * (NQ + N) + column] = s[k] * da[k];
        }
    }
    return 0;
}
