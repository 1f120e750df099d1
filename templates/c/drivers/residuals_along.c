/* Residuals r1 = M a + h + C_q^T l, r2 = C_q a + gamma, r3 = C_q v + C_t along (dq, dv) in w + AT_DQ, one
   evaluation per direction. */
static void prepare_residuals(double t, const double *restrict u, const double *restrict c, double *restrict w)
{
    (void)t, (void)u, (void)c, (void)w;
}

static void residuals_along(double t, const double *restrict u, const double *restrict c, double *restrict w)
{
    (void)residual_tangent_block(t, w + AT_X, u, c, w + AT_ALONG, w);
}

EOMGEN_SHARED void rate_along(double t, const double *restrict u, const double *restrict c, double *restrict w)
{
    double *const dv = w + AT_DV;
    for (int k = 0; k < N; k++) {
        dv[k] = 0.0;
    }
    residuals_along(t, u, c, w);
}
