static int rhs_driver(double t, const double *restrict x, const double *restrict u, const double *restrict c,
                     double *restrict out, double *restrict w)
{
    int plan[3 * NZ];
    int status = close_loops(t, x, u, c, w);
    if (status == 0) {
        status = accelerate_system(t, u, c, plan, out + NQ, w);
    }
    form_rates(w + AT_X, w + AT_V, out);
    return status;
}
