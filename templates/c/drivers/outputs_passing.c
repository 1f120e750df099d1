static int outputs_driver(double t, const double *restrict x, const double *restrict u, const double *restrict c,
                         double *restrict out, double *restrict w)
{
    double weakest, *const x_dot = w + AT_RATED;
    int status = rhs_here(t, x, u, c, x_dot, &weakest, w);
    status = rhs_across(t, x, u, c, weakest, status, x_dot, w);
    for (int k = 0; k < N; k++) {
        w[AT_ACC + k] = x_dot[NQ + k];
    }
    return status != 0 ? status : accelerated_outputs_block(t, w + AT_X, u, c, out, w);
}
