static int rhs_driver(double t, const double *restrict x, const double *restrict u, const double *restrict c,
                     double *restrict out, double *restrict w)
{
    const int status = tree_accelerate(t, x, u, c, w);
    for (int k = 0; k < 2 * N; k++) {
        out[k] = w[AT_X + N + k];
    }
    return status;
}
