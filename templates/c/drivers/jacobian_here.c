static int jacobian_here(double t, const double *restrict x, const double *restrict u, const double *restrict c,
                         double *restrict out, double *restrict weakest, double *restrict w)
{
    return jacobian_by_partition(t, x, u, c, out, weakest, w);
}
