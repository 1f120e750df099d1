static int mass_matrix_driver(double t, const double *restrict x, const double *restrict u, const double *restrict c,
                              double *restrict out, double *restrict w)
{
    const double *const column = w + AT_ALONG;
    for (int k = 0; k < N; k++) {
        (void)mass_column(t, x, u, c, k, w);
        for (int i = 0; i <= k; i++) {
            out[i * N + k] = out[k * N + i] = column[i];
        }
    }
    return 0;
}
