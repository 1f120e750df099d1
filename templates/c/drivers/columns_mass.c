/* Column k of M into w + AT_ALONG: the forces of a unit acceleration. */
static int mass_column(double t, const double *restrict q, const double *restrict u, const double *restrict c, int k,
                       double *restrict w)
{
    double *const unit = w + AT_X; /* q, a */
    for (int i = 0; i < NQ; i++) {
        unit[i] = q[i];
    }
    for (int i = 0; i < N; i++) {
        unit[NQ + i] = i == k ? 1.0 : 0.0;
    }
    return mass_times_block(t, unit, u, c, w + AT_ALONG, w);
}
