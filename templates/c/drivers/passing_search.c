/* The best interpolation of [q v x'] at the state x, to w + AT_BEST; its reach, 0 where none is better than the solution
   at x itself; whether time goes on along the curve, and how fast the state moves (scaled). */
static double interpolate_best(double t, const double *restrict x, const double *restrict u, const double *restrict c,
                               double here, double *restrict time_per_length, double *restrict speed,
                               double *restrict w)
{
    double *const best = w + AT_BEST, *const state = w + AT_STATE;
    double least = HUGE_VAL, found = 0.0;
    *time_per_length = *speed = 0.0;
    (void)rate_block(t, x, u, c, w + AT_RATE, w);
    for (int i = 0; i < M; i++) {
        *time_per_length = w[AT_RATE + i] != 0.0 ? 1.0 : *time_per_length;
    }
    for (int k = 0; k < NQ + N; k++) {
        state[k] = x[k];
        if (k >= NQ && k < NQ + MOVING) {
            *speed = fmax(*speed, fabs(x[k] / w[AT_SCALES + k - NQ]));
        }
    }
    normalise(state);
    if (!(*speed > CROSSINGS_STILL)) {
        return 0.0;
    }
    *time_per_length /= *speed;
    const double square = *speed * *speed, lost = fmax(here, CROSSINGS_WEAKEST);
    for (double reach = CROSSINGS_REACH; reach >= CROSSINGS_SHORTEST && !(least <= CROSSINGS_GOOD * square); reach *= 0.5) {
        const double error = interpolate(t, u, c, here, reach, *time_per_length, *speed, w);
        if (error < least) {
            least = error, found = reach;
            for (int k = 0; k < VALUES; k++) {
                best[k] = w[AT_SUMS + 3 * VALUES + k];
            }
        }
    }
    return least * lost * lost * lost <= CROSSINGS_NOISE * square ? found : 0.0;
}
