/* The change of the projected state for the unit change of x[column]: dq and dv in w + AT_DQ and w + AT_DV. */
static int project_direction(double t, int column, const double *restrict u, const double *restrict c,
                             double *restrict w)
{
    const double *const s = w + AT_SCALES, *const q = w + AT_X;
    double *const dq = w + AT_DQ, *const dv = w + AT_DV, *const r = w + AT_RATE, *const r3 = w + AT_ALONG + N + M;
    int status = 0;
    for (int k = 0; k < NQ + N; k++) {
        dq[k] = k == column ? 1.0 : 0.0;
    }
    for (int i = 0; i < M; i++) {
        r[i] = 0.0;
    }
    if (column < NQ) {
        find_velocities(q, dq, dv);
#ifdef NORMAL_STEPS
        for (int i = 0; i < MH; i++) {
            r[i] = w[AT_GRADIENT + i * NQ + column];
        }
#endif
        for (int k = 0; k < N; k++) {
            dv[k] /= s[k];
        }
        status = correct_change(MH, w + (MH < M ? AT_GH : AT_G), r, dv, w);
#ifdef NORMAL_STEPS
        add_left(w + (MH < M ? AT_GH : AT_G), r, dv, dq, w);
#endif
        for (int k = 0; k < N; k++) {
            dv[k] *= s[k];
        }
        spread(q, dv, dq);
        rate_along(t, u, c, w);
        for (int i = 0; i < M; i++) {
            r[i] = r3[i] / s[N + i];
        }
    }
    for (int k = 0; k < N; k++) {
        dv[k] = NQ + k == column ? 1.0 / s[k] : 0.0;
    }
    if (status == 0) {
        status = correct_change(M, w + AT_G, r, dv, w);
    }
    for (int k = 0; k < N; k++) {
        dv[k] *= s[k];
    }
    return status;
}
