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

/* No velocity stands for a change dq of q: normal.c says what it changes of C, from where the step back follows. */
#define find_velocities(q, dq, d) ((void)(q), (void)(dq), (void)memset(d, 0, N * sizeof *(d)))
