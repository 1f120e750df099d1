/* Balanced K, less a little where redundant constraints may leave it singular, as L U with row exchanges; status 2 where a
   pivot vanishes: no inertia is behind a motion. plan (3 NZ): rows exchanged, last column of each row of U, last row of
   each column of L, so that what is zero in the sparse K costs little. */
static int factor_system(double *restrict w, int *restrict plan)
{
    const double *const K = w + AT_SYSTEM, *const row = w + AT_ROW, *const column = w + AT_COLUMN;
    double *const lu = w + AT_LU;
    int *const last = plan + NZ, *const deep = plan + 2 * NZ;
    double sum = 0.0;
    for (int i = 0; i < NZ * NZ; i++) {
        lu[i] = 0.0;
    }
    for (int i = 0; i < NZ; i++) {
        last[i] = deep[i] = i;
    }
    for (int e = 0; e < PLACES; e++) {
        const int i = PLACE[e][0], j = PLACE[e][1];
        lu[i * NZ + j] = K[e] * row[i] * column[j];
        last[i] = j > last[i] ? j : last[i];
        sum += K[e] * 0.0;
    }
    if (sum != 0.0) {
        return EOMGEN_NON_FINITE;
    }
    for (int e = 0; e < RELAXED; e++) {
        lu[RELAX[e][0] * NZ + RELAX[e][1]] -= SYSTEMS_RELAXATION;
        last[RELAX[e][0]] = RELAX[e][1] > last[RELAX[e][0]] ? RELAX[e][1] : last[RELAX[e][0]];
    }
    for (int k = 0; k < NZ; k++) {
        int best = k;
        for (int i = k + 1; i < NZ; i++) {
            best = fabs(lu[i * NZ + k]) > fabs(lu[best * NZ + k]) ? i : best;
        }
        plan[k] = best;
        if (!(fabs(lu[best * NZ + k]) > SYSTEMS_PIVOT)) {
            return EOMGEN_SINGULAR_MASS_MATRIX;
        }
        if (best != k) {
            const int end = last[k];
            last[k] = last[best];
            last[best] = end;
            for (int j = k; j < NZ; j++) {
                const double entry = lu[k * NZ + j];
                lu[k * NZ + j] = lu[best * NZ + j];
                lu[best * NZ + j] = entry;
            }
        }
        for (int i = k + 1; i < NZ; i++) {
            if (lu[i * NZ + k] != 0.0) {
                const double ratio = lu[i * NZ + k] / lu[k * NZ + k];
                lu[i * NZ + k] = ratio;
                for (int j = k + 1; j <= last[k]; j++) {
                    lu[i * NZ + j] -= ratio * lu[k * NZ + j];
                }
                last[i] = last[k] > last[i] ? last[k] : last[i];
                deep[k] = i;
            }
        }
    }
    return 0;
}
