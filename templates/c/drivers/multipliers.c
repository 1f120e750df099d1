/* Multipliers l from the dependent rows of C_q^T l = -(M a + h), zero on redundant rows; scaled values in w. */
static void find_multipliers(int width, const partition *restrict parts, double *restrict l, const double *restrict w)
{
    const double *const mass = w + AT_MASS, *const a = w + AT_A, *const rows = w + AT_ROWS, *const s = w + AT_SCALES;
    for (int i = 0; i < M; i++) {
        l[i] = 0.0;
    }
    for (int j = 0; j < R; j++) {
        const int d = parts->dependent[j];
        double force = w[AT_H + d];
        for (int k = 0; k < N; k++) {
            force += mass[d * N + k] * a[k];
        }
        for (int i = 0; i < M; i++) {
            l[i] -= rows[parts->row[j] * width + N + 1 + i] * force / s[N + i];
        }
    }
}
