static int jacobian_driver(double t, const double *restrict x, const double *restrict u, const double *restrict c,
                          double *restrict out, double *restrict w)
{
    double weakest;
    return jacobian_here(t, x, u, c, out, &weakest, w);
}
