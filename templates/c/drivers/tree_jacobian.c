/* b = -M^-1 b for the rows of b, each of so many columns. */
EOMGEN_ROWS static void tree_solve_rows(const double *restrict H, double *restrict b, int columns)
{
    for (int i = N - 1; i >= 0; i--) {
        const double *const row = b + i * columns;
        for (int j = PARENT[i]; j >= 0; j = PARENT[j]) {
            const double ratio = H[i * (i + 1) / 2 + j];
            double *const above = b + j * columns;
            for (int k = 0; k < columns; k++) {
                above[k] -= ratio * row[k];
            }
        }
    }
    for (int i = 0; i < N; i++) {
        const double inverse = -1.0 / H[i * (i + 1) / 2 + i];
        double *const row = b + i * columns;
        for (int k = 0; k < columns; k++) {
            row[k] *= inverse;
        }
        for (int j = PARENT[i]; j >= 0; j = PARENT[j]) {
            const double ratio = H[i * (i + 1) / 2 + j], *const above = b + j * columns;
            for (int k = 0; k < columns; k++) {
                row[k] -= ratio * above[k];
            }
        }
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
    for (int k = 0; k < NQ * NX; k++) {
        out[k] = 0.0;
    }
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
        for (int k = 0; k < NQ; k++) {
            row[k] = r1_q[i * NQ + k];
        }
        for (int k = 0; k < N; k++) {
            row[NQ + k] = r1_v[i * N + k];
        }
    }
    tree_solve_rows(w + AT_TERMS, out + NQ * NX, NX);
    tree_rate_rows(t, x, u, c, out, w);
    return 0;
}
