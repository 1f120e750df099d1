/* Brings x = [q; v] onto the constraints, position level first; result in w + AT_X. */
static int close_loops(double t, const double *restrict x, const double *restrict u, const double *restrict c,
                       double *restrict w)
{
    double *const q = w + AT_X, *const v = w + AT_V, *const r = w + AT_RATE, *const s = w + AT_SCALES;
    (void)scales_block(t, x, u, c, s, w);
    for (int k = 0; k < NQ + N; k++) {
        q[k] = x[k];
    }
    int status = close_position(t, q, u, c, w);
    if (status == 0 && MH < M) { /* nonholonomic rows join here */
        status = factor_gram(M, w + AT_J, CONSTRAINTS_GENTLE, w + AT_G);
    }
    if (status != 0) {
        return status;
    }
    (void)rate_block(t, q, u, c, r, w);
    for (int i = 0; i < M; i++) {
        r[i] /= s[N + i];
    }
    for (int k = 0; k < N; k++) {
        v[k] /= s[k];
    }
    double noise[M + 1];
    find_noise(v, r, 1, noise);
    status = correct_linear(M, w + AT_G, r, v, noise, 1, w);
    for (int k = 0; k < N; k++) {
        v[k] *= s[k];
    }
    return status;
}
