static int rhs_driver(double t, const double *restrict x, const double *restrict u, const double *restrict c,
                     double *restrict out, double *restrict w)
{
    const int status = tree_accelerate(t, x, u, c, w);
    form_rates(x, x + NQ, out);
    for (int k = 0; k < N; k++) {
        out[NQ + k] = w[AT_ACC + k];
    }
    return status;
}
