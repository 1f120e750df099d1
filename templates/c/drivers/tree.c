/* M = L^T D L in place, packed lower triangle, over the paths to ground, of the first n velocities: L[i, j] only where j is on i's path
   (R. Featherstone, Rigid Body Dynamics Algorithms, 2008, section 6.5). Status 2 where a pivot is lost in the
   rounding of its own entry, or is what rounding leaves of a zero. */
static int tree_factor(int n, double *restrict H, const double *restrict s)
{
    double largest = 0.0, own[N + 1];
    for (int k = 0; k < n; k++) {
        own[k] = fabs(H[k * (k + 1) / 2 + k]);
        const double entry = own[k] * s[k] * s[k];
        largest = entry > largest ? entry : largest;
    }
    for (int k = n - 1; k >= 0; k--) {
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
static void tree_solve(int n, const double *restrict H, double *restrict b)
{
    for (int i = n - 1; i >= 0; i--) {
        for (int j = PARENT[i]; j >= 0; j = PARENT[j]) {
            b[j] -= H[i * (i + 1) / 2 + j] * b[i];
        }
    }
    for (int i = 0; i < n; i++) {
        b[i] /= H[i * (i + 1) / 2 + i];
        for (int j = PARENT[i]; j >= 0; j = PARENT[j]) {
            b[i] -= H[i * (i + 1) / 2 + j] * b[j];
        }
    }
}
