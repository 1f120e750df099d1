/* Newton's step dz back in w + AT_STEP, by the factor in w + AT_G; what linear theory leaves of the residual. */
static double step_back(const double *restrict C, double *restrict w)
{
    const double *const s = w + AT_SCALES, *const J = w + AT_J;
    double *const e = w + AT_E, *const dz = w + AT_STEP;
    for (int i = 0; i < MH; i++) {
        e[i] = C[i] / s[N + i];
    }
    cholesky_solve(MH, w + AT_G, e);
    for (int k = 0; k < N; k++) {
        dz[k] = 0.0;
        for (int i = 0; i < MH; i++) {
            dz[k] += J[i * N + k] * e[i];
        }
    }
    return largest_left(J, C, dz, s);
}

/* The nearest q with C(q) = 0, in place; leaves C and C_q, J and the factor of G there in w. */
static int close_position(double t, double *restrict q, const double *restrict u, const double *restrict c,
                          double *restrict w)
{
    const double *const s = w + AT_SCALES, *const C = w + AT_POSITION, *const J = w + AT_J;
    double *const dz = w + AT_STEP;
    double before = 0.0;
    int last = 0;
    for (int step = 0; step <= 25; step++) {
        (void)position_block(t, q, u, c, w + AT_POSITION, w);
        const double size = largest_residual(C, s);
        if (!isfinite(size)) {
            return EOMGEN_NON_FINITE;
        }
        form_scaled(C + MH, s, w + AT_J);
        /* the term follows the residual: rows that depend on each other on the manifold only would point along it */
        const int status = factor_gram(MH, J, fmax(CONSTRAINTS_GENTLE, mean_residual(C, s)), w + AT_G);
        if (status != 0 || last || has_settled(step, size, before, C, J, q, s)) {
            return status;
        }
        if (step == 25) {
            return is_within(CONSTRAINTS_ACCEPTED, ROUNDING_ROUNDED, C, J, q, s) ? 0 : EOMGEN_PROJECTION_FAILED;
        }
        double left = step_back(C, w);
        if (left > CONSTRAINTS_HINDERED * size && !is_within(CONSTRAINTS_EXACT, ROUNDING_SUMMED, C, J, q, s)) { /* along weak rows, and the term keeps it */
            double row;
            const double weak = weakness(MH, J, w + AT_E, &row);
            if (size < CONSTRAINTS_NEAR * weak) { /* the step is far shorter than the way to lost rank */
                (void)factor_gram(MH, J, fmax(CONSTRAINTS_TIKHONOV, CONSTRAINTS_BELOW * weak), w + AT_G);
                left = step_back(C, w);
            }
        }
        const double part = damping(dz, N);
        last = arrives(longest_of(dz, N), left);
#ifdef NORMAL_STEPS
        const int mended = left > CONSTRAINTS_HINDERED * size ? mend(t, q, u, c, w) : 0;
        if (mended != 0) {
            return mended;
        }
#endif
        for (int k = 0; k < N; k++) {
            dz[k] *= -s[k] * part;
        }
        move(q, dz);
        before = size;
    }
    return EOMGEN_PROJECTION_FAILED;
}
