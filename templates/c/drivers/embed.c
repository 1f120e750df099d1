/* B (N x F) with J B = 0 in w + AT_B from eliminated rows. */
static void form_transformation(int width, const partition *restrict parts, double *restrict w)
{
    double *const B = w + AT_B;
    const double *const a = w + AT_ROWS;
    for (int k = 0; k < N * F; k++) {
        B[k] = 0.0;
    }
    for (int k = 0; k < F; k++) {
        B[parts->independent[k] * F + k] = 1.0;
        for (int j = 0; j < R; j++) {
            B[parts->dependent[j] * F + k] = -a[parts->row[j] * width + parts->independent[k]];
        }
    }
}

/* M_e = B^T M B, lower triangle in w + AT_EMBEDDED, from the scaled M (N x N) in w + AT_MASS. */
EOMGEN_SHARED void embed_mass(double *restrict w)
{
    const double *const B = w + AT_B, *const mass = w + AT_MASS;
    double *const MB = w + AT_MB, *const embedded = w + AT_EMBEDDED;
    for (int i = 0; i < N; i++) {
        for (int k = 0; k < F; k++) {
            MB[i * F + k] = 0.0;
            for (int j = 0; j < N; j++) {
                MB[i * F + k] += mass[i * N + j] * B[j * F + k];
            }
        }
    }
    for (int i = 0; i < F; i++) {
        for (int k = 0; k <= i; k++) {
            embedded[i * F + k] = 0.0;
            for (int j = 0; j < N; j++) {
                embedded[i * F + k] += B[j * F + i] * MB[j * F + k];
            }
        }
    }
}
