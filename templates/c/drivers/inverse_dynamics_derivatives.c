/* Derivatives of M a + h by [q v a], one evaluation for each direction. */
static int inverse_dynamics_derivatives_driver(double t, const double *restrict x, const double *restrict u,
                                               const double *restrict c, double *restrict out, double *restrict w)
{
    enum { NZ = NQ + 2 * N };
    double *const along = w + AT_TORQUES, *const slope = along + 2 * NZ;
    for (int k = 0; k < NZ; k++) {
        along[k] = x[k];
        along[NZ + k] = 0.0;
    }
    for (int column = 0; column < NZ; column++) {
        along[NZ + column] = 1.0;
        (void)inverse_tangent_block(t, along, u, c, slope, w);
        along[NZ + column] = 0.0;
        for (int k = 0; k < N; k++) {
            out[k * NZ + column] = slope[k];
        }
    }
    return 0;
}
