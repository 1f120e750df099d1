static int jacobian_driver(double t, const double *restrict x, const double *restrict u, const double *restrict c,
                          double *restrict out, double *restrict w)
{
    double weakest = 1.0;
    const int status = jacobian_here(t, x, u, c, out, &weakest, w);
    return TOLD_STATUS(status, weakest);
}
