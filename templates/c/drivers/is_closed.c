/* Whether x = [q; v] is on the constraints to rounding, at both levels; it then stays as it is, to the last bit. */
static int is_closed(double t, const double *restrict x, const double *restrict u, const double *restrict c,
                     double *restrict w)
{
    double *const s = w + AT_SCALES, *const C = w + AT_POSITION, *const r = w + AT_RATE;
    (void)scales_block(t, x, u, c, s, w);
    (void)position_block(t, x, u, c, C, w);
    (void)rate_block(t, x, u, c, r, w);
    double fastest = 1.0, left = 0.0;
    for (int k = 0; k < MOVING; k++) {
        fastest = fmax(fastest, fabs(x[NQ + k] / s[k]));
    }
    for (int i = 0; i < M; i++) {
        double rate = r[i];
        for (int k = 0; k < N; k++) {
            rate += C[MH + i * N + k] * x[NQ + k];
        }
        left = fmax(left, fabs(rate / s[N + i]));
    }
    return largest_residual(C, s) <= CONSTRAINTS_EXACT && left <= CONSTRAINTS_EXACT * fastest;
}
