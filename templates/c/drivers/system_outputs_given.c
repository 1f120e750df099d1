static int outputs_driver(double t, const double *restrict x, const double *restrict u, const double *restrict c,
                         double *restrict out, double *restrict w)
{
    int plan[3 * NZ];
    for (int k = 0; k < NQ + N; k++) {
        w[AT_X + k] = x[k];
    }
    const int status = accelerate_system(t, u, c, plan, w + AT_ACC, w);
    return status != 0 ? status : accelerated_outputs_block(t, w + AT_X, u, c, out, w);
}
