static int input_jacobian_driver(double t, const double *restrict x, const double *restrict u, const double *restrict c,
                                 double *restrict out, double *restrict w)
{
    return shift_driver(SHIFT_BLOCK(input), NU, t, x, u, c, out, w);
}
