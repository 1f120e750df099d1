/* M = L^T D L in place, packed lower triangle, over the paths to ground: L[i, j] only where j is on i's path
   (R. Featherstone, Rigid Body Dynamics Algorithms, 2008, section 6.5). Status 2 where a pivot is lost in the
   rounding of its own entry, or is what rounding leaves of a zero. */
static int tree_factor(double *restrict H, const double *restrict s)
{
    double largest = 0.0, own[N + 1];
    for (int k = 0; k < N; k++) {
        own[k] = fabs(H[k * (k + 1) / 2 + k]);
        const double entry = own[k] * s[k] * s[k];
        largest = entry > largest ? entry : largest;
    }
    for (int k = N - 1; k >= 0; k--) {
        double *const row = H + k * (k + 1) / 2;
        const int lost = row[k] <= INERTIA_SINGULAR * own[k] || row[k] * s[k] * s[k] <= INERTIA_NOTHING * largest;
        if (INDEFINITE ? fabs(row[k]) <= INERTIA_FAINT * own[k] : lost) { /* NaN shows in the result */
            return EOMGEN_SINGULAR_MASS_MATRIX;
        }
        for (int i = PARENT[k]; i >= 0; i = PARENT[i]) {
            double *const above = H + i * (i + 1) / 2;
            const double ratio = row[i] / row[k];
            own[i] += INDEFINITE ? fabs(ratio * row[i]) : 0.0;
            for (int j = i; j >= 0; j = PARENT[j]) {
                above[j] -= ratio * row[j];
            }
            row[i] = ratio;
        }
    }
    return 0;
}

/* b = M^-1 b */
static void tree_solve(const double *restrict H, double *restrict b)
{
    for (int i = N - 1; i >= 0; i--) {
        for (int j = PARENT[i]; j >= 0; j = PARENT[j]) {
            b[j] -= H[i * (i + 1) / 2 + j] * b[i];
        }
    }
    for (int i = 0; i < N; i++) {
        b[i] /= H[i * (i + 1) / 2 + i];
        for (int j = PARENT[i]; j >= 0; j = PARENT[j]) {
            b[i] -= H[i * (i + 1) / 2 + j] * b[j];
        }
    }
}

/* Accelerations of x = [q; v]; leaves the factor of M in w + AT_TERMS and [q v a] in w + AT_X. */
static int tree_accelerate(double t, const double *restrict x, const double *restrict u, const double *restrict c,
                           double *restrict w)
{
    double *const a = w + AT_ACC;
    const double *const bias = w + AT_TERMS + N * (N + 1) / 2;
    (void)scales_block(t, x, u, c, w + AT_SCALES, w);
    (void)terms_block(t, x, u, c, w + AT_TERMS, w);
    for (int k = 0; k < NQ + N; k++) {
        w[AT_X + k] = x[k];
    }
    for (int k = 0; k < N; k++) {
        a[k] = -bias[k];
    }
    const int status = tree_factor(w + AT_TERMS, w + AT_SCALES);
    if (status == 0) {
        tree_solve(w + AT_TERMS, a);
    }
    return status;
}
