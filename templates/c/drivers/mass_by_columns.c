/* M, whose columns are the forces of unit accelerations. */
static int mass_matrix_block(double t, const double *restrict x, const double *restrict u, const double *restrict c,
                             double *restrict out, double *restrict w)
{
    double *const unit = w + AT_UNIT, *const column = unit + NQ + N; /* q, a */
    for (int i = 0; i < NQ; i++) {
        unit[i] = x[i];
    }
    for (int k = 0; k < N; k++) {
        for (int i = 0; i < N; i++) {
            unit[NQ + i] = i == k ? 1.0 : 0.0;
        }
        (void)mass_times_block(t, unit, u, c, column, w);
        for (int i = 0; i <= k; i++) {
            out[i * N + k] = out[k * N + i] = column[i];
        }
    }
    return 0;
}
