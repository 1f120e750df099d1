/* Scales of rows and columns that bring the entries of K to about 1, from the units of both on (D. Ruiz, A scaling
   algorithm to equilibrate both rows and columns norms in matrices, RAL-TR-2001-034). Those of constraints get one
   common factor beside their units, since a redundant constraint may have no entries but rounding. */
static void balance_system(double *restrict w)
{
    const double *const K = w + AT_SYSTEM, *const sizes = K + PLACES + NZ;
    double *const largest = w + AT_DEFECT, *const row = w + AT_ROW, *const column = w + AT_COLUMN;
    int calm = 0;
    for (int i = 0; i < NZ; i++) {
        row[i] = 1.0 / sizes[i];
        column[i] = sizes[NZ + i];
    }
    for (int pass = 0; pass < 40 && calm < 2; pass++) {
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
        calm++;
        for (int i = 0; i < NZ; i++) {
            const double size = largest[i] > 0.0 ? largest[i] : 1.0;
            calm = size > 2.0 || size < 0.5 ? 0 : calm;
            scale[i] /= sqrt(size);
        }
    }
}
