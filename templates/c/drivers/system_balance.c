/* Scales of rows and columns that bring the entries of K to about 1 (D. Ruiz, A scaling algorithm to equilibrate both
   rows and columns norms in matrices, RAL-TR-2001-034). Those of constraints get one common factor beside their sizes,
   since a redundant constraint may have no entries but rounding. */
static void balance_system(double *restrict w)
{
    const double *const K = w + AT_SYSTEM, *const sizes = K + PLACES + NZ;
    double *const largest = w + AT_DEFECT, *const row = w + AT_ROW, *const column = w + AT_COLUMN;
    for (int i = 0; i < NZ; i++) {
        row[i] = column[i] = 1.0;
    }
    for (int e = 0; e < RELAXED; e++) {
        row[RELAX[e][0]] /= sizes[e];
        column[RELAX[e][1]] /= sizes[e];
    }
    for (int pass = 0; pass < 8; pass++) {
        const int side = pass % 2;
        double *const scale = side ? column : row;
        double common = 0.0;
        for (int i = 0; i < NZ; i++) {
            largest[i] = 0.0;
        }
        for (int e = 0; e < PLACES; e++) {
            const double size = fabs(K[e]) * row[PLACE[e][0]] * column[PLACE[e][1]];
            if (size > largest[PLACE[e][side]]) {
                largest[PLACE[e][side]] = size;
            }
        }
        for (int e = 0; e < RELAXED; e++) {
            common = largest[RELAX[e][side]] > common ? largest[RELAX[e][side]] : common;
        }
        for (int e = 0; e < RELAXED; e++) {
            largest[RELAX[e][side]] = common;
        }
        for (int i = 0; i < NZ; i++) {
            scale[i] /= largest[i] > 0.0 ? sqrt(largest[i]) : 1.0;
        }
    }
}
