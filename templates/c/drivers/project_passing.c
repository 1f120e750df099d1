static int project_driver(double t, const double *restrict x, const double *restrict u, const double *restrict c,
                         double *restrict out, double *restrict w)
{
    if (is_closed(t, x, u, c, w)) {
        for (int k = 0; k < NQ + N; k++) {
            out[k] = x[k];
        }
        normalise(out);
        return 0;
    }
    const int status = close_loops(t, x, u, c, w);
    normalise(w + AT_X);
    if (status == 0) {
        const double weakest = nearness(t, w + AT_X, u, c, w);
        (void)rhs_across(t, x, u, c, weakest, 0, w + AT_RATED, w);
    }
    for (int k = 0; k < NQ + N; k++) {
        out[k] = w[AT_X + k];
    }
    return status;
}
