/* The coordinate whose rate is velocity k; 0 if there is none. */
#define coordinate_of(q, k) ((q)[k])

/* The change of q' where q and v change by dq and dv. */
EOMGEN_SHARED void change_rates(const double *restrict x, const double *restrict dq, const double *restrict dv,
                                double *restrict change)
{
    (void)x, (void)dq;
    for (int k = 0; k < N; k++) {
        change[k] = dv[k];
    }
}

/* The velocities of a change of q, and the change of q of velocities d near the change dq. */
EOMGEN_SHARED void find_velocities(const double *restrict q, const double *restrict dq, double *restrict d)
{
    form_rates(q, dq, d);
}

EOMGEN_SHARED void spread(const double *restrict q, const double *restrict d, double *restrict dq)
{
    form_rates(q, d, dq);
}

EOMGEN_SHARED void normalise(double *restrict q)
{
    (void)q;
}
