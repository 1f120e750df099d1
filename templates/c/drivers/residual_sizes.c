/* The mean of |C / s_c|. */
static double mean_residual(const double *restrict C, const double *restrict s)
{
    double total = 0.0;
    for (int i = 0; i < MH; i++) {
        total += fabs(C[i] / s[N + i]);
    }
    return MH > 0 ? total / (double)MH : 0.0;
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

/* The square of the singular value of J along z, relative to the square of the largest row of J. */
static double weakness(int rows, const double *restrict J, const double *restrict z, double *restrict largest)
{
    double across = 0.0, along = 0.0;
    *largest = 0.0;
    for (int k = 0; k < N; k++) {
        double d = 0.0;
        for (int i = 0; i < rows; i++) {
            d += J[i * N + k] * z[i];
        }
        across += d * d;
    }
    for (int i = 0; i < rows; i++) {
        double size = 0.0;
        for (int k = 0; k < N; k++) {
            size += J[i * N + k] * J[i * N + k];
        }
        along += z[i] * z[i];
        *largest = fmax(*largest, size);
    }
    return along * *largest > 0.0 ? across / (along * *largest) : 1.0;
}
