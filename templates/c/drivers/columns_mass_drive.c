static int mass_matrix_driver(double t, const double *restrict x, const double *restrict u, const double *restrict c,
                              double *restrict out, double *restrict w)
{
    return mass_matrix_block(t, x, u, c, out, w);
}
