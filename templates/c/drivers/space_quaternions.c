/* q' = N(q) v: e' = E^T w / 2 for Euler parameters e in q and angular velocities w in v (A. A. Shabana, Computational
   Dynamics, chapter 7); QUATERNION has their places. The length of e is kept by every step and means nothing. Over `real`,
   because lanes of closed loops take this text too. */
EOMGEN_EACH(root_of_each, sqrt)
EOMGEN_EACH(sine_of_each, sin)
EOMGEN_EACH(cosine_of_each, cos)

static void turn(const real *restrict e, const real *restrict w, real factor, real *restrict rates)
{
    const real x = 0.5 * factor * w[0], y = 0.5 * factor * w[1], z = 0.5 * factor * w[2];
    rates[0] -= e[1] * x + e[2] * y + e[3] * z;
    rates[1] += e[0] * x - e[3] * y + e[2] * z;
    rates[2] += e[3] * x + e[0] * y - e[1] * z;
    rates[3] += e[1] * y - e[2] * x + e[0] * z;
}

EOMGEN_SHARED void move(real *restrict q, const real *restrict d)
{
    for (int k = 0; k < N; k++) {
        if (COORDINATE[k] >= 0) {
            q[COORDINATE[k]] += d[k];
        }
    }
    for (int b = 0; b < QUATERNIONS; b++) {
        real *const e = q + QUATERNION[b][0];
        const real *const w = d + QUATERNION[b][1], old[4] = {e[0], e[1], e[2], e[3]};
        const real half = 0.5 * root_of_each(w[0] * w[0] + w[1] * w[1] + w[2] * w[2]);
        const real shrunk = cosine_of_each(half), ratio = sine_of_each(half) / half;
        for (int i = 0; i < 4; i++) {
            e[i] = shrunk * old[i];
        }
        turn(old, w, choose(half > 0.0, ratio, same(1.0)), e);
    }
}

EOMGEN_SHARED void form_rates(const real *restrict q, const real *restrict v, real *restrict rates)
{
    for (int k = 0; k < NQ; k++) {
        rates[k] = same(0.0);
    }
    for (int k = 0; k < N; k++) {
        if (COORDINATE[k] >= 0) {
            rates[COORDINATE[k]] = v[k];
        }
    }
    for (int b = 0; b < QUATERNIONS; b++) {
        turn(q + QUATERNION[b][0], v + QUATERNION[b][1], same(1.0), rates + QUATERNION[b][0]);
    }
}

/* The coordinate whose rate is velocity k; 0 if there is none. */
#define coordinate_of(q, k) (COORDINATE[k] >= 0 ? (q)[COORDINATE[k]] : 0.0)

/* The change of q' where q and v change by dq and dv. */
EOMGEN_SHARED void change_rates(const real *restrict x, const real *restrict dq, const real *restrict dv,
                                real *restrict change)
{
    form_rates(x, dv, change);
    for (int b = 0; b < QUATERNIONS; b++) {
        turn(dq + QUATERNION[b][0], x + NQ + QUATERNION[b][1], same(1.0), change + QUATERNION[b][0]);
    }
}
