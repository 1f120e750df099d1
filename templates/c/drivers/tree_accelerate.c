/* Accelerations of x = [q; v]; leaves the factor of M in w + AT_TERMS and [q v a] in w + AT_X. */
static int tree_accelerate(double t, const double *restrict x, const double *restrict u, const double *restrict c,
                           double *restrict w)
{
    double *const a = w + AT_ACC;
    const double *const bias = w + AT_TERMS + N * (N + 1) / 2;
    (void)scales_block(t, x, u, c, w + AT_SCALES, w);
    (void)terms_block(t, x, u, c, w + AT_TERMS, w);
    for (int k = 0; k < NQ + N; k++) {
        w[AT_X + k] = x[k];
    }
    for (int k = 0; k < N; k++) {
        a[k] = -bias[k];
    }
    const int status = tree_factor(N, w + AT_TERMS, w + AT_SCALES);
    if (status == 0) {
        tree_solve(N, w + AT_TERMS, a);
    }
    return status;
}
