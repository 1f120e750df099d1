static int outputs_driver(double t, const double *restrict x, const double *restrict u, const double *restrict c,
                         double *restrict out, double *restrict w)
{
    const int status = tree_accelerate(t, x, u, c, w);
    return status != 0 ? status : accelerated_outputs_block(t, w + AT_X, u, c, out, w);
}
