/* Both points of the pair at so many reaches by 2 to 5 pairs: interpolation in the middle. */
static const double WEIGHT[4][PAIRS] = {{ 2.0 / 3, -1.0 / 6, 0.0, 0.0, 0.0 },
                                        { 3.0 / 4, -3.0 / 10, 1.0 / 20, 0.0, 0.0 },
                                        { 4.0 / 5, -2.0 / 5, 4.0 / 35, -1.0 / 70, 0.0 },
                                        { 5.0 / 6, -10.0 / 21, 5.0 / 28, -5.0 / 126, 1.0 / 252 }};

/* The point that follows on a side (0: ahead, 1: behind) of the curve, from those before; its place, or NULL. */
static double *next_point(double t, const double *restrict u, const double *restrict c, int pair, int side,
                          double reach, double time_per_length, double *restrict w)
{
    const double distance = (side ? -reach : reach) * (double)pair;
    double *const p = w + AT_POINTS + (side * PAIRS + pair - 1) * NQ;
    const double *const q = w + AT_STATE;
    if (pair == 1) {
        step_along(t, u, c, distance, p, w);
    }
    for (int k = 0; k < NQ && pair > 1; k++) {
        const double before = pair > 2 ? p[k - 2 * NQ] : q[k], first = pair > 3 ? p[k - 3 * NQ] : q[k];
        p[k] = pair == 2 ? 2.0 * p[k - NQ] - q[k] : 3.0 * (p[k - NQ] - before) + first;
    }
    return find_point(t + distance * time_per_length, u, c, distance, p, w) ? p : NULL;
}

/* Interpolates [q v x'] into w + AT_SUMS, by pairs of points up to five reaches away. What it errs by in accelerations,
   infinite if there is no such curve, or the change point is not near its middle. */
static double interpolate(double t, const double *restrict u, const double *restrict c, double here, double reach,
                          double time_per_length, double speed, double *restrict w)
{
    double *const sums = w + AT_SUMS, *const state = w + AT_NEXT, *const x_dot = state + NQ + N;
    const double *const s = w + AT_SCALES;
    double around, weakest, total = 0.0, last[3] = {0.0, 0.0, 0.0};
    partition parts;
    around = set_out(t, u, c, reach, time_per_length, speed, w);
    for (int k = 0; k < 4 * VALUES; k++) {
        sums[k] = 0.0;
    }
    for (int pair = 1; pair <= PAIRS; pair++) {
        for (int side = 0; side < 2; side++) { /* no curve: around = 0 */
            const double at = t + (side ? -reach : reach) * (double)pair * time_per_length;
            const double *const p = around > 0.0 ? next_point(t, u, c, pair, side, reach, time_per_length, w) : NULL;
            if (p == NULL) {
                return HUGE_VAL;
            }
            around += pair == 1 && side == 1 ? find_weakest(at, p, u, c, &parts, w) : 0.0;
            for (int k = 0; k < NQ + N; k++) {
                state[k] = k < NQ ? p[k] : w[AT_STATE + k];
            }
            if ((pair == 1 && side == 1 && !(around >= CROSSINGS_MIDDLE * here)) ||
                rhs_here(at, state, u, c, x_dot, &weakest, w) != 0) {
                return HUGE_VAL;
            }
            for (int n = 0; n < 4; n++) {
                for (int k = 0; k < VALUES; k++) {
                    sums[n * VALUES + k] += WEIGHT[n][pair - 1] * (k < NQ + N ? w[AT_X + k] : x_dot[k - NQ - N]);
                }
            }
        }
    }
    const double *const q = sums + 3 * VALUES;
    (void)position_block(t, q, u, c, w + AT_POSITION, w);
    form_scaled(w + AT_POSITION + MH, s, w + AT_J);
    if (!is_within(CROSSINGS_CLOSED, ROUNDING_ROUNDED, w + AT_POSITION, w + AT_J, q, s)) { /* the branch does not run through */
        return HUGE_VAL;
    }
    for (int k = NQ; k < VALUES; k++) {
        const int rate = k - NQ - N - NQ; /* accelerations; velocities, by what they change in unit distance */
        const double unit = rate >= 0 ? s[rate] : k < NQ + N ? s[k - NQ] / speed : HUGE_VAL;
        total += q[k];
        for (int n = 0; n < 3; n++) {
            last[n] = fmax(last[n], fabs(q[k - n * VALUES] - q[k - (n + 1) * VALUES]) / unit);
        }
    }
    /* differences fall by this factor at least; one alone may be small by chance */
    const double factor = fmin(1.0, fmax(last[0] / last[1], last[1] / last[2]));
    const double error = fmax(last[0] * factor, last[1] * factor * factor);
    return !isfinite(total) ? HUGE_VAL : last[0] > 0.0 ? error : 0.0;
}
