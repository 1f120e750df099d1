/* Scaled: the a with J a = (right side of the particular solution) and B^T (M a + h) = 0; M_e factored already.
   a: particular solution in, result out; h: N force residuals. */
static void solve_embedded(const double *restrict h, double *restrict a, double *restrict w)
{
    const double *const B = w + AT_B, *const mass = w + AT_MASS;
    double *const y = w + AT_Y;
    for (int k = 0; k < F; k++) {
        y[k] = 0.0;
    }
    for (int i = 0; i < N; i++) {
        double force = h[i];
        for (int j = 0; j < N; j++) {
            force += mass[i * N + j] * a[j];
        }
        for (int k = 0; k < F; k++) {
            y[k] -= B[i * F + k] * force;
        }
    }
    ldl_solve(w + AT_EMBEDDED, y);
    for (int i = 0; i < N; i++) {
        for (int k = 0; k < F; k++) {
            a[i] += B[i * F + k] * y[k];
        }
    }
}

/* Accelerations a (N) of the projected state in w + AT_X; leaves the scaled a, h, M, B and the factor of M_e in w. */
static int accelerate(double t, const double *restrict u, const double *restrict c, int width,
                      partition *restrict parts, double *restrict a, double *restrict w)
{
    double *const mass = w + AT_MASS, *const h = w + AT_H, *const scaled = w + AT_A;
    const double *const s = w + AT_SCALES, *const packed = w + AT_TERMS;
    double *const r = w + AT_RATE;
    const double *const bias = packed + N * (N + 1) / 2, *const C_q = bias + N, *const gamma = C_q + M * N;
    if (terms_block(t, w + AT_X, u, c, w + AT_TERMS, w) != 0) { /* Euler parameters that are all zero */
        return EOMGEN_NON_FINITE;
    }
    form_scaled(C_q, s, w + AT_J);
    form_rows(w + AT_J, gamma, width, w);
    int status = split(width, 0, parts, w);
    if (status != 0) {
        return status;
    }
    form_transformation(width, parts, w);
    for (int i = 0; i < N; i++) {
        for (int k = 0; k <= i; k++) {
            mass[i * N + k] = packed[i * (i + 1) / 2 + k] * s[i] * s[k];
            mass[k * N + i] = mass[i * N + k];
        }
        h[i] = bias[i] * s[i];
        scaled[i] = 0.0;
    }
    for (int i = 0; i < M; i++) {
        r[i] = gamma[i] / s[N + i];
    }
    double noise[M + 1], v[N + 1];
    for (int k = 0; k < N; k++) {
        v[k] = w[AT_V + k] / s[k];
    }
    find_noise(v, NULL, 2, noise);
    /* of minimum norm: no small pivot makes it large */
    status = correct_linear(M, w + AT_G, r, scaled, noise, 2, w);
    if (status != 0) {
        return status;
    }
    embed_mass(w);
    status = ldl_factor(w + AT_B, w + AT_MASS, w + AT_EMBEDDED);
    if (status != 0) {
        return status;
    }
    solve_embedded(h, scaled, w);
    for (int k = 0; k < N; k++) {
        a[k] = s[k] * scaled[k];
    }
    return 0;
}
