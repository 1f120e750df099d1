/* Scales of rows and columns that bring the entries of K to about 1 (D. Ruiz, A scaling algorithm to equilibrate both
   rows and columns norms in matrices, RAL-TR-2001-034). */
static void balance_system(double *restrict w)
{
    const double *const K = w + AT_SYSTEM;
    double *const largest = w + AT_DEFECT, *const row = w + AT_ROW, *const column = w + AT_COLUMN;
    for (int i = 0; i < NZ; i++) {
        row[i] = column[i] = 1.0;
    }
    for (int pass = 0; pass < 8; pass++) {
        const int side = pass % 2;
        double *const scale = side ? column : row;
        for (int i = 0; i < NZ; i++) {
            largest[i] = 0.0;
        }
        for (int e = 0; e < PLACES; e++) {
            const double size = fabs(K[e]) * row[PLACE[e][0]] * column[PLACE[e][1]];
            if (size > largest[PLACE[e][side]]) {
                largest[PLACE[e][side]] = size;
            }
        }
        for (int i = 0; i < NZ; i++) {
            scale[i] /= largest[i] > 0.0 ? sqrt(largest[i]) : 1.0;
        }
    }
}
