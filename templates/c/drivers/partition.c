/* Which coordinates follow from which: dependent[j] from row[j] of the constraints; the others are independent. */
typedef struct {
    int dependent[N];
    int row[N];
    int independent[N];
} partition;

/* Rows [J | -column/s_c | I] of the given width in w + AT_ROWS; the unit matrix only where the width has room. */
static void form_rows(const double *restrict J, const double *restrict column, int width, double *restrict w)
{
    double *const a = w + AT_ROWS;
    const double *const s = w + AT_SCALES;
    for (int i = 0; i < M; i++) {
        for (int k = 0; k < N; k++) {
            a[i * width + k] = J[i * N + k];
        }
        a[i * width + N] = -column[i] / s[N + i];
        for (int k = N + 1; k < width; k++) {
            a[i * width + k] = k - N - 1 == i ? 1.0 : 0.0;
        }
    }
}

/* Complete pivoting over the rows in w + AT_ROWS, R pivots: the best among the columns preferred as dependent if it is
   within 100 of the best of all. With `strict` only preferred columns are taken. */
static int split(int width, int strict, partition *restrict parts, double *restrict w)
{
    double *const a = w + AT_ROWS;
    int spent[M] = {0}, taken[N] = {0}, count = 0;
    double size = 0.0;
    for (int step = 0; step < R; step++) {
        double best = 0.0, best_any = 0.0;
        int row = 0, column = 0, row_any = 0, column_any = 0;
        for (int i = 0; i < M; i++) {
            for (int k = 0; k < N && !spent[i]; k++) {
                const double entry = fabs(a[i * width + k]);
                if (!taken[k] && entry > best_any) {
                    best_any = entry, row_any = i, column_any = k;
                }
                if (!taken[k] && PREFERRED_DEPENDENT[k] && entry > best) {
                    best = entry, row = i, column = k;
                }
            }
        }
        size = step == 0 ? best_any : size;
        if (!strict && (best < 0.01 * best_any || best == 0.0)) {
            best = best_any, row = row_any, column = column_any;
        }
        if (!(best > (strict ? CONSTRAINTS_CHOSEN : CONSTRAINTS_STATE) * size)) {
            return EOMGEN_PARTITION_BAD;
        }
        eliminate(a, width, row, column);
        parts->dependent[step] = column, parts->row[step] = row;
        spent[row] = 1, taken[column] = 1;
    }
    for (int k = 0; k < N; k++) { /* the preferred ones first, in their order */
        if (!taken[ORDER[k]]) {
            parts->independent[count++] = ORDER[k];
        }
    }
    return 0;
}
