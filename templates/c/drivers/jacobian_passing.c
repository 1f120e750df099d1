/* Next to a change point from states on both sides of it, as x' is. */
static int jacobian_driver(double t, const double *restrict x, const double *restrict u, const double *restrict c,
                          double *restrict out, double *restrict w)
{
    enum { NX = NQ + N };
    double weakest = 1.0, *const turn = w + AT_TURN, *const state = w + AT_NEXT;
    int status = jacobian_here(t, x, u, c, out, &weakest, w);
    if (!(weakest < CROSSINGS_NEAR) || (status != 0 && status != EOMGEN_PARTITION_BAD)) {
        return status;
    }
    double time_per_length, speed;
    const double reach = interpolate_best(t, x, u, c, weakest, &time_per_length, &speed, w);
    if (!(reach > 0.0) || !(set_out(t, u, c, reach, time_per_length, speed, w) > 0.0)) {
        return TOLD_STATUS(status, weakest);
    }
    for (int k = 0; k < NX * NX; k++) {
        out[k] = 0.0;
    }
    for (int pair = 1; pair <= PAIRS; pair++) {
        for (int side = 0; side < 2; side++) {
            const double at = t + (side ? -reach : reach) * (double)pair * time_per_length;
            const double *const p = next_point(t, u, c, pair, side, reach, time_per_length, w);
            for (int k = 0; k < NX && p != NULL; k++) {
                state[k] = k < NQ ? p[k] : w[AT_STATE + k];
            }
            status = p == NULL ? EOMGEN_PROJECTION_FAILED : jacobian_here(at, state, u, c, turn, &weakest, w);
            if (status != 0) {
                return status;
            }
            for (int k = 0; k < NX * NX; k++) {
                out[k] += WEIGHT[3][pair - 1] * turn[k];
            }
        }
    }
    return 0;
}
