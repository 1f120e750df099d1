/* x = [q_i v_i a_i q_guess] -> [q v a] of the whole tree; the set of independent coordinates is the preferred one. */
static int kinematics_driver(double t, const double *restrict x, const double *restrict u, const double *restrict c,
                            double *restrict out, double *restrict w)
{
    enum { FREE = F - (N - MOVING) };
    partition parts;
    const int width = N + 1 + M;
    double *const q = out, *const v = out + NQ, *const a = out + NQ + N;
    (void)scales_block(t, x, u, c, w + AT_SCALES, w);
    for (int k = 0; k < NQ; k++) {
        q[k] = x[FREE + 2 * F + k];
    }
    for (int k = 0; k < FREE; k++) {
        q[COORDINATE[ORDER[k]]] = x[k];
    }
    int status = close_dependent(t, q, u, c, w);
    if (status != 0) {
        return status;
    }
    (void)rate_block(t, q, u, c, w + AT_RATE, w);
    form_rows(w + AT_J, w + AT_RATE, width, w);
    status = split(width, 1, &parts, w);
    if (status != 0) {
        return status;
    }
    form_transformation(width, &parts, w);
    complete(x + FREE, w + AT_RATE, &parts, v, w);
    normalise(q);
    for (int k = 0; k < NQ + N; k++) {
        w[AT_X + k] = out[k];
    }
    (void)terms_block(t, w + AT_X, u, c, w + AT_TERMS, w);
    complete(x + FREE + F, w + AT_TERMS + N * (N + 1) / 2 + N + M * N, &parts, a, w);
    return 0;
}
