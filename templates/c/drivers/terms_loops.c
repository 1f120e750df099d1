/* M packed, h, C_q, gamma. */
static int terms_block(double t, const double *restrict x, const double *restrict u, const double *restrict c,
                       double *restrict out, double *restrict w)
{
    double *const C_q = out + N * (N + 1) / 2 + N;
    const int status = tree_terms(t, x, u, c, out, w);
    (void)constraint_jacobian_block(t, x, u, c, C_q, w);
    (void)gamma_block(t, x, u, c, C_q + M * N, w);
    return status;
}
