/* How coordinates change with velocities: q' = v; or e' = E^T w / 2 for Euler parameters e in q and angular
   velocities w in v (A. A. Shabana, Computational Dynamics, chapter 7), whose length every step keeps and which means
   nothing; or by functions of the model, q' = N(q, t) v + b(q, t). Over `real`: lanes of closed loops share this
   text. The including file defines N, NQ, COORDINATE, QUATERNIONS and QUATERNION, and for one state MODEL, AT and
   EVALUATE. */
EOMGEN_EACH(root_of_each, sqrt)
EOMGEN_EACH(sine_of_each, sin)
EOMGEN_EACH(cosine_of_each, cos)

/* Whether every velocity is the rate of the coordinate of its number. */
#define PLAIN_RATES (QUATERNIONS == 0 && NQ == N)

EOMGEN_SHARED void turn(const real *restrict e, const real *restrict w, real factor, real *restrict rates)
{
    const real x = 0.5 * factor * w[0], y = 0.5 * factor * w[1], z = 0.5 * factor * w[2];
    rates[0] -= e[1] * x + e[2] * y + e[3] * z;
    rates[1] += e[0] * x - e[3] * y + e[2] * z;
    rates[2] += e[3] * x + e[0] * y - e[1] * z;
    rates[3] += e[1] * y - e[2] * x + e[0] * z;
}

#ifdef EOMGEN_PLAIN
/* dq += N(q, t) d, with the areas of q and dv in between. */
EOMGEN_SHARED void add_moved(const eom_at *at, const double *q, const double *d, double *dq)
{
    double *const moved = AT(RATES);
    for (int k = 0; k < NQ; k++) {
        AT(X)[k] = q[k];
    }
    for (int k = 0; k < N; k++) {
        AT_DV[k] = d[k];
    }
    (void)EVALUATE(moved, AT(X), moved);
    for (int k = 0; k < NQ; k++) {
        dq[k] += moved[k];
    }
}
#endif

/* q moved by d, which is as velocities are. */
EOMGEN_SHARED void move(const eom_at *at, real *restrict q, const real *restrict d)
{
    (void)at;
#ifdef EOMGEN_PLAIN
    if (MODEL->rates != NULL) {
        add_moved(at, q, d, q);
        return;
    }
#endif
    if (PLAIN_RATES) {
        for (int k = 0; k < N; k++) {
            q[k] += d[k];
        }
        return;
    }
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

/* q' of [q; v]. */
EOMGEN_SHARED void form_rates(const eom_at *at, const real *restrict q, const real *restrict v, real *restrict rates)
{
    (void)at, (void)q;
#ifdef EOMGEN_PLAIN
    if (MODEL->rates != NULL) {
        (void)EVALUATE(rates, q, rates);
        return;
    }
#endif
    if (PLAIN_RATES) {
        for (int k = 0; k < N; k++) {
            rates[k] = v[k];
        }
        return;
    }
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
