static int drive_embedded_mass_matrix(double t, const double *restrict x, const double *restrict u,
                                      const double *restrict c, double *restrict out, double *restrict w)
{
    partition parts;
    const double *const s = w + AT_SCALES, *const C = w + AT_POSITION, *const embedded = w + AT_EMBEDDED;
    double *const mass = w + AT_MASS;
    (void)block_scales(t, x, u, c, w + AT_SCALES, w);
    (void)block_position(t, x, u, c, w + AT_POSITION, w);
    scale_jacobian(C + M, s, w + AT_J);
    form_rows(w + AT_J, C, N + 1, w);
    const int status = split(N + 1, 1, &parts, w);
    if (status != 0) {
        return status;
    }
    form_transformation(N + 1, &parts, w);
    (void)block_mass_matrix(t, x, u, c, mass, w);
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
