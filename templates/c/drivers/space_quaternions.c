/* q' = N(q) v: e' = E^T w / 2 for Euler parameters e in q and angular velocities w in v (A. A. Shabana, Computational
   Dynamics, chapter 7); QUATERNION has their places. The length of e is kept by every step and means nothing. */
static void turn(const double *restrict e, const double *restrict w, double factor, double *restrict rates)
{
    const double x = 0.5 * factor * w[0], y = 0.5 * factor * w[1], z = 0.5 * factor * w[2];
    rates[0] -= e[1] * x + e[2] * y + e[3] * z;
    rates[1] += e[0] * x - e[3] * y + e[2] * z;
    rates[2] += e[3] * x + e[0] * y - e[1] * z;
    rates[3] += e[1] * y - e[2] * x + e[0] * z;
}

EOMGEN_SHARED void move(double *restrict q, const double *restrict d)
{
    for (int k = 0; k < N; k++) {
        if (COORDINATE[k] >= 0) {
            q[COORDINATE[k]] += d[k];
        }
    }
    for (int b = 0; b < QUATERNIONS; b++) {
        double *const e = q + QUATERNION[b][0];
        const double *const w = d + QUATERNION[b][1], old[4] = {e[0], e[1], e[2], e[3]};
        const double half = 0.5 * sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2]);
        for (int i = 0; i < 4; i++) {
            e[i] = cos(half) * old[i];
        }
        turn(old, w, half > 0.0 ? sin(half) / half : 1.0, e);
    }
}

EOMGEN_SHARED void form_rates(const double *restrict q, const double *restrict v, double *restrict rates)
{
    for (int k = 0; k < NQ; k++) {
        rates[k] = 0.0;
    }
    for (int k = 0; k < N; k++) {
        if (COORDINATE[k] >= 0) {
            rates[COORDINATE[k]] = v[k];
        }
    }
    for (int b = 0; b < QUATERNIONS; b++) {
        turn(q + QUATERNION[b][0], v + QUATERNION[b][1], 1.0, rates + QUATERNION[b][0]);
    }
}

/* The coordinate whose rate is velocity k; 0 if there is none. */
#define coordinate_of(q, k) (COORDINATE[k] >= 0 ? (q)[COORDINATE[k]] : 0.0)

/* The change of q' where q and v change by dq and dv. */
EOMGEN_SHARED void change_rates(const double *restrict x, const double *restrict dq, const double *restrict dv,
                                double *restrict change)
{
    form_rates(x, dv, change);
    for (int b = 0; b < QUATERNIONS; b++) {
        turn(dq + QUATERNION[b][0], x + NQ + QUATERNION[b][1], 1.0, change + QUATERNION[b][0]);
    }
}
