/* b = -M^-1 b for `many` of a type of b's columns from `first` on. Many that the compiler knows keep a row in registers. */
#define TREE_SOLVE_COLUMNS(type, many) \
    do { \
        for (int i = N - 1; i >= 0; i--) { \
            const type *const at = (const type *)(b + i * columns + first); \
            type row[many]; \
            for (int k = 0; k < (many); k++) { \
                row[k] = at[k]; \
            } \
            for (int j = PARENT[i]; j >= 0; j = PARENT[j]) { \
                const double ratio = H[i * (i + 1) / 2 + j]; \
                type *const above = (type *)(b + j * columns + first); \
                for (int k = 0; k < (many); k++) { \
                    above[k] -= ratio * row[k]; \
                } \
            } \
        } \
        for (int i = 0; i < N; i++) { \
            const double inverse = -1.0 / H[i * (i + 1) / 2 + i]; \
            type *const at = (type *)(b + i * columns + first), row[many]; \
            for (int k = 0; k < (many); k++) { \
                row[k] = at[k] * inverse; \
            } \
            for (int j = PARENT[i]; j >= 0; j = PARENT[j]) { \
                const double ratio = H[i * (i + 1) / 2 + j]; \
                const type *const above = (const type *)(b + j * columns + first); \
                for (int k = 0; k < (many); k++) { \
                    row[k] -= ratio * above[k]; \
                } \
            } \
            for (int k = 0; k < (many); k++) { \
                at[k] = row[k]; \
            } \
        } \
    } while (0)

#ifdef EOMGEN_VECTORS
typedef double tree_lanes __attribute__((vector_size(32), aligned(8), may_alias)); /* four columns side by side */
#endif

/* b = -M^-1 b for the rows of b, each of so many columns. */
EOMGEN_ROWS static void tree_solve_rows(const double *restrict H, double *restrict b, int columns)
{
    int first = 0;
#ifdef EOMGEN_VECTORS
    for (; first + 12 <= columns; first += 12) {
        TREE_SOLVE_COLUMNS(tree_lanes, 3);
    }
    for (; first + 4 <= columns; first += 4) {
        TREE_SOLVE_COLUMNS(tree_lanes, 1);
    }
#else
    for (; first + 8 <= columns; first += 8) {
        TREE_SOLVE_COLUMNS(double, 8);
    }
#endif
    for (; first < columns; first++) {
        TREE_SOLVE_COLUMNS(double, 1);
    }
}

/* The rows of q' in a Jacobian. Most coordinates have the rate v, which needs no look at their directions. */
static void tree_rate_rows(double t, const double *restrict x, const double *restrict u, const double *restrict c,
                           double *restrict out, double *restrict w)
{
    enum { NX = NQ + N };
    double *const direction = w + AT_DQ, *const rates = w + AT_RATES;
    int plain[NX] = {0};
    (void)t, (void)u, (void)c;
    memset(out, 0, NQ * NX * sizeof(double));
#ifndef form_rates /* as a macro, which given rates have */
    for (int k = 0; k < N; k++) {
        if (COORDINATE[k] >= 0) {
            plain[COORDINATE[k]] = plain[NQ + k] = 1;
            out[COORDINATE[k] * NX + NQ + k] = 1.0;
        }
    }
#endif
    for (int k = 0; k < NX; k++) {
        direction[k] = 0.0;
    }
    for (int column = 0; column < NX; column++) {
        if (plain[column]) {
            continue;
        }
        direction[column] = 1.0;
        change_rates(x, direction, direction + NQ, rates);
        direction[column] = 0.0;
        for (int k = 0; k < NQ; k++) {
            out[k * NX + column] = rates[k];
        }
    }
}

static int jacobian_driver(double t, const double *restrict x, const double *restrict u, const double *restrict c,
                          double *restrict out, double *restrict w)
{
    enum { NX = NQ + N };
    const double *const r1_q = w + AT_RESIDUAL, *const r1_v = r1_q + N * NQ;
    const int status = tree_accelerate(t, x, u, c, w);
    if (status != 0) {
        return status;
    }
    (void)residual_jacobian_block(t, w + AT_X, u, c, w + AT_RESIDUAL, w);
    for (int i = 0; i < N; i++) {
        double *const row = out + (NQ + i) * NX;
        memcpy(row, r1_q + i * NQ, NQ * sizeof(double));
        memcpy(row + NQ, r1_v + i * N, N * sizeof(double));
    }
    tree_solve_rows(w + AT_TERMS, out + NQ * NX, NX);
    tree_rate_rows(t, x, u, c, out, w);
    return 0;
}
