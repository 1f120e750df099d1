/* Which coordinates follow from which: dependent[j] from row[j] of the constraints; the others are independent. */
typedef struct {
    int dependent[N + 1];
    int row[N + 1];
    int independent[N + 1];
    double weakest; /* smallest of the best pivots, relative to the first: of the size of the smallest singular value */
} partition;

/* The status of accelerations of a state alone, which tells none where its position is not told from a change point. */
#define TOLD_STATUS(status, weakest) ((status) == 0 && (weakest) < CROSSINGS_UNTOLD ? EOMGEN_PARTITION_BAD : (status))

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

/* What entries of each row of J in w + AT_ROWS are compared with (eomgen/kinematics/row_groups.py). */
static void find_sizes(const double *restrict a, int width, double *restrict sizes)
{
    double largest[M + 1] = {0.0};
    for (int i = 0; i < M; i++) {
        const int gap = ROW_GROUP[i] > 0 ? ROW_GROUP[i] : 0;
        for (int k = 0; k < N; k++) {
            largest[0] = fmax(largest[0], fabs(a[i * width + k]));
            largest[gap] = fmax(largest[gap], fabs(a[i * width + k]));
        }
    }
    for (int i = 0; i < M; i++) {
        const double size = ROW_GROUP[i] < 0 ? 1.0 : largest[ROW_GROUP[i]];
        sizes[i] = ROW_GROUP[i] > 0 ? fmax(size, CROSSINGS_SMALL) : size > 0.0 ? size : 1.0;
    }
}

/* Complete pivoting over the rows in w + AT_ROWS, R pivots: the best among the columns preferred as dependent if it is
   within 100 of the best of all. With `strict` only preferred columns are taken. */
static int split(int width, int strict, partition *restrict parts, double *restrict w)
{
    double *const a = w + AT_ROWS;
    int spent[M + 1] = {0}, taken[N + 1] = {0}, best[M + 1][2], changed[M + 1], count = 0;
    double size = 0.0, row_sizes[M + 1];
    find_sizes(a, width, row_sizes);
    for (int i = 0; i < M; i++) {
        changed[i] = 1;
    }
    parts->weakest = 1.0;
    for (int step = 0; step < R; step++) {
        int rows[2] = {-1, -1};
        double sizes[2] = {0.0, 0.0};
        for (int i = 0; i < M; i++) {
            if (changed[i]) {
                find_best(a + i * width, taken, best[i]);
            }
            for (int kind = 0; kind < 2 && !spent[i]; kind++) {
                const double entry = best[i][kind] < 0 ? 0.0 : fabs(a[i * width + best[i][kind]]) / row_sizes[i];
                if (entry > sizes[kind]) {
                    sizes[kind] = entry, rows[kind] = i;
                }
            }
        }
        size = step == 0 ? sizes[0] : size;
        parts->weakest = step == 0 ? 1.0 : fmin(parts->weakest, sizes[0] / size);
        const int kind = strict || (sizes[1] >= CONSTRAINTS_PREFERENCE * sizes[0] && sizes[1] > 0.0);
        if (!(sizes[kind] > (strict ? CONSTRAINTS_CHOSEN : CONSTRAINTS_STATE) * size)) {
            return EOMGEN_PARTITION_BAD;
        }
        const int row = rows[kind], column = best[row][kind];
        for (int i = 0; i < M; i++) { /* what elimination leaves as it is needs no search again */
            changed[i] = a[i * width + column] != 0.0;
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
