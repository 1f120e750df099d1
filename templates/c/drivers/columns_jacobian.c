/* dx'/dx, one derivative of the accelerations for each direction. */
static int jacobian_driver(double t, const double *restrict x, const double *restrict u, const double *restrict c,
                          double *restrict out, double *restrict w)
{
    enum { NX = NQ + N };
    double *const along = w + AT_X, *const da = w + AT_ALONG, *const rates = w + AT_RATES; /* q, v, dq, dv */
    for (int column = 0; column < NX; column++) {
        for (int k = 0; k < NX; k++) {
            along[k] = x[k];
            along[NX + k] = k == column ? 1.0 : 0.0;
        }
        const int status = acceleration_tangent_block(t, along, u, c, da, w);
        if (status != 0) {
            return status;
        }
        change_rates(x, along + NX, along + NX + NQ, rates);
        for (int k = 0; k < NQ; k++) {
            out[k * NX + column] = rates[k];
        }
        for (int k = 0; k < N; k++) {
            out[(NQ + k) * NX + column] = da[k];
        }
    }
    return 0;
}
