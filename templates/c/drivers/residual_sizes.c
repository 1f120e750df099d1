/* The mean of |C / s_c|. */
static double mean_residual(const double *restrict C, const double *restrict s)
{
    double total = 0.0;
    for (int i = 0; i < MH; i++) {
        total += fabs(C[i] / s[N + i]);
    }
    return MH > 0 ? total / MH : 0.0;
}

/* What linear theory leaves of the scaled residual after the step -dz. */
static double largest_left(const double *restrict J, const double *restrict C, const double *restrict dz,
                           const double *restrict s)
{
    double largest = 0.0;
    for (int i = 0; i < MH; i++) {
        double left = C[i] / s[N + i];
        for (int k = 0; k < N; k++) {
            left -= J[i * N + k] * dz[k];
        }
        largest = fabs(left) > largest ? fabs(left) : largest;
    }
    return largest;
}
