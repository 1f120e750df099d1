/* The columns of the largest entries of a row that are not taken: [0] of all, [1] of those preferred as dependent. */
static void find_best(const double *restrict row, const int *restrict taken, int *restrict best)
{
    best[0] = best[1] = -1;
    for (int k = 0; k < N; k++) {
        const double entry = taken[k] ? 0.0 : fabs(row[k]);
        if (entry > (best[0] < 0 ? 0.0 : fabs(row[best[0]]))) {
            best[0] = k;
        }
        if (PREFERRED_DEPENDENT[k] && entry > (best[1] < 0 ? 0.0 : fabs(row[best[1]]))) {
            best[1] = k;
        }
    }
}
