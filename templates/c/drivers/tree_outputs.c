static int drive_outputs(double t, const double *restrict x, const double *restrict u, const double *restrict c,
                         double *restrict out, double *restrict w)
{
    const int status = tree_accelerate(t, x, u, c, w);
    return status != 0 ? status : block_accelerated_outputs(t, w + AT_X, u, c, out, w);
}
