static int rhs_driver(double t, const double *restrict x, const double *restrict u, const double *restrict c,
                     double *restrict out, double *restrict w)
{
    int plan[3 * NZ];
    for (int k = 0; k < NQ + N; k++) {
        w[AT_X + k] = x[k];
    }
    form_rates(x, x + NQ, out);
    return accelerate_system(t, u, c, plan, out + NQ, w);
}
