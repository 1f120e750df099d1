/* G = L L^T in place, lower triangle of the first `rows` rows of the M x M matrix; status 3 where G is not positive definite. */
static int cholesky(int rows, double *restrict g)
{
    for (int j = 0; j < rows; j++) {
        double d = g[j * M + j];
        for (int k = 0; k < j; k++) {
            d -= g[j * M + k] * g[j * M + k];
        }
        if (!(d > 0.0)) {
            return isnan(d) ? EOMGEN_NON_FINITE : EOMGEN_PROJECTION_FAILED;
        }
        d = sqrt(d);
        g[j * M + j] = d;
        for (int i = j + 1; i < rows; i++) {
            double s = g[i * M + j];
            for (int k = 0; k < j; k++) {
                s -= g[i * M + k] * g[j * M + k];
            }
            g[i * M + j] = s / d;
        }
    }
    return 0;
}

/* b = G^-1 b */
static void cholesky_solve(int rows, const double *restrict g, double *restrict b)
{
    for (int i = 0; i < rows; i++) {
        double s = b[i];
        for (int k = 0; k < i; k++) {
            s -= g[i * M + k] * b[k];
        }
        b[i] = s / g[i * M + i];
    }
    for (int i = rows - 1; i >= 0; i--) {
        double s = b[i];
        for (int k = i + 1; k < rows; k++) {
            s -= g[k * M + i] * b[k];
        }
        b[i] = s / g[i * M + i];
    }
}

/* G = J J^T + relative max(diag) I of the first rows of J, factored; rows that are all zero to rounding ask for no step. */
static int factor_gram(int rows, const double *restrict J, double relative, double *restrict G)
{
    double largest = 0.0;
    for (int i = 0; i < rows; i++) {
        for (int j = 0; j <= i; j++) {
            double sum = 0.0;
            for (int k = 0; k < N; k++) {
                sum += J[i * N + k] * J[j * N + k];
            }
            G[i * M + j] = sum;
        }
        largest = G[i * M + i] > largest ? G[i * M + i] : largest;
    }
    for (int i = 0; i < rows; i++) {
        G[i * M + i] += largest > CONSTRAINTS_UNMOVED * CONSTRAINTS_UNMOVED ? relative * largest : 1.0;
    }
    return cholesky(rows, G);
}
