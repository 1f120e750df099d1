static int embedded_mass_matrix_driver(double t, const double *restrict x, const double *restrict u,
                                      const double *restrict c, double *restrict out, double *restrict w)
{
    partition parts;
    const double *const s = w + AT_SCALES, *const C = w + AT_POSITION, *const embedded = w + AT_EMBEDDED;
    double *const mass = w + AT_MASS;
    (void)scales_block(t, x, u, c, w + AT_SCALES, w);
    (void)position_block(t, x, u, c, w + AT_POSITION, w);
    form_scaled(C + MH, s, w + AT_J);
    form_rows(w + AT_J, w + AT_SCALES + N, N + 1, w);
    const int status = split(N + 1, 1, &parts, w);
    if (status != 0) {
        return status;
    }
    form_transformation(N + 1, &parts, w);
    (void)mass_matrix_block(t, x, u, c, mass, w);
    for (int i = 0; i < N; i++) {
        for (int k = 0; k < N; k++) {
            mass[i * N + k] *= s[i] * s[k];
        }
    }
    embed_mass(w);
    for (int i = 0; i < F; i++) {
        for (int k = 0; k <= i; k++) {
            const double unit = s[parts.independent[i]] * s[parts.independent[k]];
            out[i * F + k] = embedded[i * F + k] / unit;
            out[k * F + i] = out[i * F + k];
        }
    }
    return 0;
}
