/* dq += N(q, t) d, with w + AT_X and w + AT_DV for q and d. */
static void add_moved(double t, const double *q, const double *d, const double *restrict u, const double *restrict c,
                      double *dq, double *w)
{
    for (int k = 0; k < NQ; k++) {
        w[AT_X + k] = q[k];
    }
    for (int k = 0; k < N; k++) {
        w[AT_DV + k] = d[k];
    }
    (void)moved_block(t, w + AT_X, u, c, w + AT_RATES, w);
    for (int k = 0; k < NQ; k++) {
        dq[k] += w[AT_RATES + k];
    }
}
#define move(q, d) add_moved(t, q, d, u, c, q, w)
#define spread(q, d, dq) add_moved(t, q, d, u, c, dq, w)
#define normalise(q) ((void)(q))

/* No velocity stands for a change dq of q: what it changes of C goes to w + AT_RATE instead, from where the step back
   onto the constraints follows. */
static void find_residuals(double t, const double *restrict u, const double *restrict c, double *restrict d, double *w)
{
    (void)slopes_along_block(t, w + AT_X, u, c, w + AT_RATE, w);
    for (int i = 0; i < MH; i++) {
        w[AT_RATE + i] /= w[AT_SCALES + N + i];
    }
    for (int k = 0; k < N; k++) {
        d[k] = 0.0;
    }
}
#define find_velocities(q, dq, d) ((void)(q), (void)(dq), find_residuals(t, u, c, d, w))
