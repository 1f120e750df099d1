/* Whether x = [q; v] is on the constraints to rounding, at both levels; it then stays as it is, to the last bit. Of n terms
   each is rounded, and the roundings add up as the root of n. */
static int is_closed(double t, const double *restrict x, const double *restrict u, const double *restrict c,
                     double *restrict w)
{
    double *const s = w + AT_SCALES, *const C = w + AT_POSITION, *const r = w + AT_RATE;
    (void)scales_block(t, x, u, c, s, w);
    (void)position_block(t, x, u, c, C, w);
    (void)rate_block(t, x, u, c, r, w);
    double fastest = 1.0, left = 0.0, placed = 0.0, moved = 0.0;
    for (int k = 0; k < MOVING; k++) {
        fastest = fmax(fastest, fabs(x[NQ + k] / s[k]));
    }
    for (int i = 0; i < M; i++) {
        double rate = r[i], place = 0.0, motion = fabs(r[i]);
        for (int k = 0; k < N; k++) {
            const double entry = C[MH + i * N + k], part = entry * x[NQ + k];
            rate += part;
            motion += fabs(part);
            place += i < MH ? fabs(entry * coordinate_of(x, k)) : 0.0;
        }
        left = fmax(left, fabs(rate / s[N + i]));
        moved = fmax(moved, motion / s[N + i]);
        placed = fmax(placed, place / s[N + i]);
    }
    const double rounding = ROUNDING_EPS * sqrt((double)N);
    return largest_residual(C, s) <= fmax(CONSTRAINTS_EXACT, rounding * placed)
        && left <= fmax(CONSTRAINTS_EXACT * fastest, rounding * moved);
}
