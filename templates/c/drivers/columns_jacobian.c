/* dx'/dx, one derivative of the accelerations for each direction. */
static int jacobian_driver(double t, const double *restrict x, const double *restrict u, const double *restrict c,
                          double *restrict out, double *restrict w)
{
    double *const along = w + AT_X, *const da = w + AT_ALONG; /* q, v, dq, dv */
    for (int column = 0; column < 2 * N; column++) {
        for (int k = 0; k < 2 * N; k++) {
            along[k] = x[k];
            along[2 * N + k] = k == column ? 1.0 : 0.0;
        }
        const int status = acceleration_tangent_block(t, along, u, c, da, w);
        if (status != 0) {
            return status;
        }
        for (int k = 0; k < N; k++) {
            out[k * 2 * N + column] = along[3 * N + k];
            out[(N + k) * 2 * N + column] = da[k];
        }
    }
    return 0;
}
