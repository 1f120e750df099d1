/* The sums of positive terms in the diagonal of B^T M B: what rounding in M_e is measured by. Returns the largest; of a
   single freedom, for which there is nothing beside, STILL of all that it moves. */
static double embedded_sizes(const double *restrict B, const double *restrict mass, double *restrict sizes)
{
    double largest = 0.0;
    for (int k = 0; k < F; k++) {
        sizes[k] = 0.0;
        for (int i = 0; i < N; i++) {
            sizes[k] += B[i * F + k] * B[i * F + k] * fabs(mass[i * N + i]);
        }
        largest = sizes[k] > largest ? sizes[k] : largest;
    }
    if (F == 1) {
        double reach = 0.0;
        for (int i = 0; i < N; i++) {
            reach += B[i] != 0.0 ? fabs(mass[i * N + i]) : 0.0;
        }
        largest = fmax(largest, INERTIA_STILL / INERTIA_NOTHING * reach);
    }
    return largest;
}

/* Whether a pivot is lost in the rounding of its own entry, or is what rounding leaves of a zero; of an indefinite matrix
   (base/algebra.py, FAINT) it must keep half of its digits. NaN shows in the result. */
static int pivot_lost(double d, double size, double largest)
{
    return INDEFINITE ? fabs(d) <= INERTIA_FAINT * size : d <= INERTIA_SINGULAR * size || d <= INERTIA_NOTHING * largest;
}

/* M_e = L D L^T in place, lower triangle of the F x F matrix; status 2 where a pivot is lost in rounding, of its own entry
   or of a zero beside the largest. */
static int ldl_factor(const double *restrict B, const double *restrict mass, double *restrict a)
{
    double sizes[F + 1]; /* of none too */
    const double largest = embedded_sizes(B, mass, sizes);
    for (int j = 0; j < F; j++) {
        double d = a[j * F + j];
        for (int k = 0; k < j; k++) {
            const double term = a[j * F + k] * a[j * F + k] * a[k * F + k];
            d -= term;
            sizes[j] += INDEFINITE ? fabs(term) : 0.0;
        }
        if (pivot_lost(d, sizes[j], largest)) {
            return EOMGEN_SINGULAR_MASS_MATRIX;
        }
        a[j * F + j] = d;
        for (int i = j + 1; i < F; i++) {
            double s = a[i * F + j];
            for (int k = 0; k < j; k++) {
                s -= a[i * F + k] * a[j * F + k] * a[k * F + k];
            }
            a[i * F + j] = s / d;
        }
    }
    return 0;
}

/* b = M_e^-1 b */
static void ldl_solve(const double *restrict a, double *restrict b)
{
    for (int i = 0; i < F; i++) {
        for (int k = 0; k < i; k++) {
            b[i] -= a[i * F + k] * b[k];
        }
    }
    for (int i = F - 1; i >= 0; i--) {
        b[i] /= a[i * F + i];
        for (int k = i + 1; k < F; k++) {
            b[i] -= a[k * F + i] * b[k];
        }
    }
}
