/* x' next to a change point, from states on both sides of it if they tell it better; status and x' at the state itself
   are given, and come back. */
static int rhs_across(double t, const double *restrict x, const double *restrict u, const double *restrict c,
                      double weakest, int status, double *restrict out, double *restrict w)
{
    double *const best = w + AT_BEST, *const kept = w + AT_KEPT;
    if (!(weakest < CROSSINGS_NEAR) || (status != 0 && status != EOMGEN_PARTITION_BAD && status != EOMGEN_UNSOLVED)) {
        return status;
    }
    for (int k = 0; k < NQ + N; k++) {
        kept[k] = w[AT_X + k];
    }
    double time_per_length, speed;
    const int found = interpolate_best(t, x, u, c, weakest, &time_per_length, &speed, w) > 0.0;
    for (int k = 0; k < NQ + N; k++) {
        w[AT_X + k] = found ? best[k] : kept[k];
        out[k] = found ? best[NQ + N + k] : out[k];
    }
    if (found) {
        normalise(w + AT_X);
    }
    return found ? 0 : TOLD_STATUS(status, weakest);
}
