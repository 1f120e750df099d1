#define SHIFT_BLOCK(what) what##_shift_block
typedef int block_function(double, const double *restrict, const double *restrict, const double *restrict,
                           double *restrict, double *restrict);

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
        status = factor_gram(MH, w + AT_J, CONSTRAINTS_GENTLE, w + AT_GH);
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
        status = project_shift(t, C, shift + N + M, u, c, w);
        if (status != 0) {
            return status;
        }
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
