static int embedded_mass_matrix_driver(double t, const double *restrict x, const double *restrict u,
                                      const double *restrict c, double *restrict out, double *restrict w)
{
    const double *const full = w + AT_FULL;
    (void)mass_matrix_block(t, x, u, c, w + AT_FULL, w);
    for (int i = 0; i < N; i++) {
        for (int k = 0; k < N; k++) {
            out[i * N + k] = full[ORDER[i] * N + ORDER[k]];
        }
    }
    return 0;
}
