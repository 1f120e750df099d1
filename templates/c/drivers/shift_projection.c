/* The change of the projected state where C and C_q v + C_t change by C and r3: dq and dv in w + AT_DQ and w + AT_DV. */
static int project_shift(double t, const double *restrict C, const double *restrict r3, const double *restrict u,
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
    int status = correct_change(MH, w + (MH < M ? AT_GH : AT_G), r, dv, w);
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
    if (status == 0) {
        status = correct_change(M, w + AT_G, r, dv, w);
    }
    for (int k = 0; k < N; k++) {
        dv[k] *= s[k];
    }
    return status;
}
