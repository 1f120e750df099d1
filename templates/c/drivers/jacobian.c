/* The change of the projected state for the unit change of x[column]: dq and dv in w + AT_X + 3 N + M. */
static void project_direction(double t, int column, const double *restrict u, const double *restrict c,
                              double *restrict w)
{
    const double *const s = w + AT_SCALES;
    double *const dq = w + AT_X + 3 * N + M, *const dv = dq + N, *const r = w + AT_RATE, *const r3 = w + AT_ALONG + N + M;
    for (int k = 0; k < 2 * N; k++) {
        dq[k] = k == column ? 1.0 / s[k % N] : 0.0;
    }
    for (int i = 0; i < M; i++) {
        r[i] = 0.0;
    }
    if (column < N) {
        correct_linear(r, dq, w);
        for (int k = 0; k < N; k++) {
            dq[k] *= s[k];
        }
        rate_along(t, u, c, w);
        for (int i = 0; i < M; i++) {
            r[i] = r3[i] / s[N + i];
        }
    }
    correct_linear(r, dv, w);
    for (int k = 0; k < N; k++) {
        dv[k] *= s[k];
    }
}

static int jacobian_driver(double t, const double *restrict x, const double *restrict u, const double *restrict c,
                          double *restrict out, double *restrict w)
{
    partition parts;
    const int width = N + 1 + M;
    const double *const s = w + AT_SCALES, *const rows = w + AT_ROWS, *const dv = w + AT_X + 4 * N + M;
    double *const r1 = w + AT_ALONG, *const r2 = r1 + N, *const da = w + AT_STEP;
    int status = close_loops(t, x, u, c, w);
    if (status == 0) {
        status = accelerate(t, u, c, width, &parts, w + AT_X + 2 * N, w);
    }
    if (status != 0) {
        return status;
    }
    find_multipliers(width, &parts, w + AT_X + 3 * N, w);
    prepare_residuals(t, u, c, w);
    for (int column = 0; column < 2 * N; column++) {
        project_direction(t, column, u, c, w);
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
        for (int k = 0; k < N; k++) {
            out[k * 2 * N + column] = dv[k];
            out[(N + k) * 2 * N + column] = s[k] * da[k];
        }
    }
    return 0;
}
