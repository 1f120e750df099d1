/* q + distance d */
static void step_along(double t, const double *restrict u, const double *restrict c, double distance,
                       double *restrict p, double *restrict w)
{
    double *const step = w + AT_STEP;
    (void)t, (void)u, (void)c;
    for (int k = 0; k < N; k++) {
        step[k] = distance * w[AT_DIRECTION + k] * w[AT_SCALES + k];
    }
    for (int k = 0; k < NQ; k++) {
        p[k] = w[AT_STATE + k];
    }
    move(p, step);
}

/* Tangent basis, heading and direction, from a first point of the curve for the velocities v; its weakest pivot, or 0. */
static double set_out(double t, const double *restrict u, const double *restrict c, double reach,
                      double time_per_length,
                   double speed, double *restrict w)
{
    partition parts;
    double *const p = w + AT_POINTS;
    for (int k = 0; k < N; k++) {
        w[AT_DIRECTION + k] = w[AT_STATE + NQ + k] / w[AT_SCALES + k] / speed;
    }
    step_along(t, u, c, reach, p, w);
    const double at = t + reach * time_per_length;
    const double weakest = bring(at, p, u, c, w) == 0 ? find_weakest(at, p, u, c, &parts, w) : 0.0;
    if (weakest == 0.0) {
        return 0.0;
    }
    form_transformation(N + 1, &parts, w);
    for (int k = 0; k < N * F; k++) {
        w[AT_TANGENT + k] = w[AT_B + k];
    }
    invert_tangent(w);
    return set_heading(w) ? weakest : 0.0;
}

/* Closes the point p, guessed, at a distance along the curve. */
static int find_point(double t, const double *restrict u, const double *restrict c, double distance,
                      double *restrict p, double *restrict w)
{
    double *const away = w + AT_AWAY, *const dz = away + NQ, *const a = w + AT_INVERSE;
    const double *const q = w + AT_STATE, *const T = w + AT_TANGENT, *const s = w + AT_SCALES;
    double longest = 0.0;
    for (int step = 0; step < CROSSINGS_ROUNDS; step++) {
        if (bring(t, p, u, c, w) != 0) {
            return 0;
        }
        normalise(p);
        for (int k = 0; k < NQ; k++) {
            away[k] = p[k] - q[k];
        }
        find_velocities(q, away, dz);
        double r[F + 1];
        longest = 0.0;
        for (int i = 0; i < F; i++) {
            r[i] = distance * w[AT_HEADING + i];
            for (int k = 0; k < N; k++) {
                r[i] -= a[i * (F + N) + F + k] * dz[k] / s[k];
            }
            longest = fmax(longest, fabs(r[i]));
        }
        if (longest <= CROSSINGS_ARRIVED) {
            return 1;
        }
        for (int k = 0; k < N; k++) {
            dz[k] = 0.0;
            for (int i = 0; i < F; i++) {
                dz[k] += s[k] * T[k * F + i] * r[i];
            }
        }
        move(p, dz);
    }
    return longest <= CROSSINGS_ENOUGH && bring(t, p, u, c, w) == 0;
}
