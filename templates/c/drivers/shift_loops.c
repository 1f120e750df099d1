#define SHIFT_BLOCK(what) what##_shift_block
typedef int block_function(double, const double *restrict, const double *restrict, const double *restrict,
                           double *restrict, double *restrict);

/* The change of the projected state where C and C_q v + C_t change by C and r3: dq and dv in w + AT_DQ and w + AT_DV. */
static void project_shift(double t, const double *restrict C, const double *restrict r3, const double *restrict u,
                          const double *restrict c, double *restrict w)
{
    const double *const s = w + AT_SCALES, *const q = w + AT_X, *const along = w + AT_ALONG + N + M;
    double *const dq = w + AT_DQ, *const dv = w + AT_DV, *const r = w + AT_RATE;
    for (int k = 0; k < NQ + N; k++) {
        dq[k] = 0.0;
    }
    for (int i = 0; i < MH; i++) {
        r[i] = C[i] / s[N + i];
    }
    correct_linear(MH, w + (MH < M ? AT_GH : AT_G), r, dv, w);
    for (int k = 0; k < N; k++) {
        dv[k] *= s[k];
    }
    spread(q, dv, dq);
    rate_along(t, u, c, w);
    for (int i = 0; i < M; i++) {
        r[i] = (along[i] + r3[i]) / s[N + i];
    }
    for (int k = 0; k < N; k++) {
        dv[k] = 0.0;
    }
    correct_linear(M, w + AT_G, r, dv, w);
    for (int k = 0; k < N; k++) {
        dv[k] *= s[k];
    }
}

/* dx' for the unit change of each of the inputs or parameters; block: C, r1, r2 and r3 along such changes. */
static int shift_driver(block_function *block, int columns, double t, const double *restrict x,
                        const double *restrict u, const double *restrict c, double *restrict out, double *restrict w)
{
    partition parts;
    const int width = N + 1 + M;
    const double *const s = w + AT_SCALES, *const rows = w + AT_ROWS, *const C = w + AT_SHIFT, *const shift = C + MH;
    double *const seeds = w + AT_DQ, *const r = w + AT_ALONG, *const da = w + AT_STEP, *const rates = w + AT_RATES;
    int status = close_loops(t, x, u, c, w);
    if (status == 0) {
        status = accelerate(t, u, c, width, &parts, w + AT_ACC, w);
    }
    if (status == 0 && MH < M) {
        status = factor_gram(MH, w + AT_J, 1e-12, w + AT_GH);
    }
    if (status != 0) {
        return status;
    }
    find_multipliers(width, &parts, w + AT_L, w);
    prepare_residuals(t, u, c, w);
    for (int column = 0; column < columns; column++) {
        for (int k = 0; k < columns; k++) {
            seeds[k] = k == column ? 1.0 : 0.0;
        }
        (void)block(t, w + AT_X, u, c, w + AT_SHIFT, w);
        project_shift(t, C, shift + N + M, u, c, w);
        residuals_along(t, u, c, w);
        for (int k = 0; k < N; k++) {
            r[k] = (r[k] + shift[k]) * s[k], da[k] = 0.0;
        }
        for (int j = 0; j < R; j++) {
            for (int i = 0; i < M; i++) {
                da[parts.dependent[j]] -= rows[parts.row[j] * width + N + 1 + i] * (r[N + i] + shift[N + i]) / s[N + i];
            }
        }
        solve_embedded(r, da, w);
        change_rates(w + AT_X, w + AT_DQ, w + AT_DV, rates);
        for (int k = 0; k < NQ; k++) {
            out[k * columns + column] = rates[k];
        }
        for (int k = 0; k < N; k++) {
            out[(NQ + k) * columns + column] = s[k] * da[k];
        }
    }
    return 0;
}
