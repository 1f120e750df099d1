static int rhs_driver(double t, const double *restrict x, const double *restrict u, const double *restrict c,
                     double *restrict out, double *restrict w)
{
    double weakest;
    const int status = rhs_here(t, x, u, c, out, &weakest, w);
    return TOLD_STATUS(status, weakest);
}
