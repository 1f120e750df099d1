/* M packed row by row, lower triangle, and h. */
static int tree_terms(double t, const double *restrict x, const double *restrict u, const double *restrict c,
                      double *restrict out, double *restrict w)
{
    const double *const full = w + AT_FULL;
    (void)mass_matrix_block(t, x, u, c, w + AT_FULL, w);
    const int status = bias_block(t, x, u, c, out + N * (N + 1) / 2, w);
    for (int i = 0; i < N; i++) {
        for (int k = 0; k <= i; k++) {
            out[i * (i + 1) / 2 + k] = full[i * N + k];
        }
    }
    return status;
}
