/* q with C(q) = 0 and the independent coordinates held, in place, by Newton's method on the dependent ones. */
static int close_dependent(double t, double *restrict q, const double *restrict u, const double *restrict c,
                           double *restrict w)
{
    partition parts;
    const double *const s = w + AT_SCALES, *const C = w + AT_POSITION, *const rows = w + AT_ROWS;
    double *const step = w + AT_STEP;
    double before = 0.0;
    for (int count = 0; count <= 50; count++) {
        (void)position_block(t, q, u, c, w + AT_POSITION, w);
        const double size = largest_residual(C, s);
        form_scaled(C + MH, s, w + AT_J);
        if (!isfinite(size)) {
            return EOMGEN_NON_FINITE;
        }
        if (has_settled(count, size, before, C, w + AT_J, q, s)) {
            return 0;
        }
        if (count == 50) {
            return is_within(CONSTRAINTS_ACCEPTED, ROUNDING_ROUNDED, C, w + AT_J, q, s) ? 0 : EOMGEN_PROJECTION_FAILED;
        }
        form_rows(w + AT_J, C, N + 1, w);
        const int status = split(N + 1, 1, &parts, w);
        if (status != 0) {
            return status;
        }
        for (int j = 0; j < R; j++) {
            step[j] = rows[parts.row[j] * (N + 1) + N];
        }
        const double part = damping(step, R);
        double *const d = w + AT_A;
        for (int k = 0; k < N; k++) {
            d[k] = 0.0;
        }
        for (int j = 0; j < R; j++) {
            d[parts.dependent[j]] = s[parts.dependent[j]] * part * step[j];
        }
        move(q, d);
        before = size;
    }
    return EOMGEN_PROJECTION_FAILED;
}

/* x (N) from its independent entries (F): B x_i plus the solution of J_d x_d = -r (scaled, by the eliminated rows). */
static void complete(const double *restrict given, const double *restrict r, const partition *restrict parts,
                     double *restrict x, const double *restrict w)
{
    const double *const B = w + AT_B, *const rows = w + AT_ROWS, *const s = w + AT_SCALES;
    const int width = N + 1 + M;
    for (int k = 0; k < N; k++) {
        x[k] = 0.0;
        for (int j = 0; j < F; j++) {
            x[k] += B[k * F + j] * given[j] / s[parts->independent[j]];
        }
    }
    for (int j = 0; j < R; j++) {
        for (int i = 0; i < M; i++) {
            x[parts->dependent[j]] -= rows[parts->row[j] * width + N + 1 + i] * r[i] / s[N + i];
        }
    }
    for (int k = 0; k < N; k++) {
        x[k] *= s[k];
    }
}
