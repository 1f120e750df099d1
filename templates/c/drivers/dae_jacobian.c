/* dF/dy + cj dF/dy' of the differential-algebraic form, one derivative for each unknown; x = [y y' cj]. */
static int dae_jacobian_driver(double t, const double *restrict x, const double *restrict u, const double *restrict c,
                              double *restrict out, double *restrict w)
{
    enum { NY = NQ + N + M + MH };
    double *const along = w + AT_DAE, *const slope = w + AT_SLOPE;
    for (int k = 0; k < 2 * NY; k++) {
        along[k] = x[k];
        along[2 * NY + k] = 0.0;
    }
    for (int column = 0; column < NY; column++) {
        along[2 * NY + column] = 1.0;
        along[3 * NY + column] = x[2 * NY];
        (void)dae_tangent_block(t, along, u, c, slope, w);
        along[2 * NY + column] = along[3 * NY + column] = 0.0;
        for (int k = 0; k < NY; k++) {
            out[k * NY + column] = slope[k];
        }
    }
    return 0;
}
