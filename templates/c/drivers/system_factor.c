/* Balanced K, less 1e-10 where redundant constraints may leave it singular, as L U with row exchanges; status 2 where a
   pivot vanishes: no inertia is behind a motion. */
static int factor_system(double *restrict w, int *restrict pivot)
{
    const double *const K = w + AT_SYSTEM, *const row = w + AT_ROW, *const column = w + AT_COLUMN;
    double *const lu = w + AT_LU;
    double sum = 0.0;
    for (int i = 0; i < NZ * NZ; i++) {
        lu[i] = 0.0;
    }
    for (int e = 0; e < PLACES; e++) {
        lu[PLACE[e][0] * NZ + PLACE[e][1]] = K[e] * row[PLACE[e][0]] * column[PLACE[e][1]];
        sum += K[e] * 0.0;
    }
    if (sum != 0.0) {
        return EOMGEN_NON_FINITE;
    }
    for (int e = 0; e < RELAXED; e++) {
        lu[RELAX[e][0] * NZ + RELAX[e][1]] -= 1e-10;
    }
    for (int k = 0; k < NZ; k++) {
        int best = k;
        for (int i = k + 1; i < NZ; i++) {
            best = fabs(lu[i * NZ + k]) > fabs(lu[best * NZ + k]) ? i : best;
        }
        pivot[k] = best;
        if (!(fabs(lu[best * NZ + k]) > 1e-14)) {
            return EOMGEN_SINGULAR_MASS_MATRIX;
        }
        for (int j = 0; j < NZ && best != k; j++) {
            const double entry = lu[k * NZ + j];
            lu[k * NZ + j] = lu[best * NZ + j];
            lu[best * NZ + j] = entry;
        }
        for (int i = k + 1; i < NZ; i++) {
            if (lu[i * NZ + k] != 0.0) { /* K is sparse */
                const double ratio = lu[i * NZ + k] / lu[k * NZ + k];
                lu[i * NZ + k] = ratio;
                for (int j = k + 1; j < NZ; j++) {
                    lu[i * NZ + j] -= ratio * lu[k * NZ + j];
                }
            }
        }
    }
    return 0;
}
