/* As tree_accelerate; states have an inertia of 1, and are not in the factor of M. */
static int held_accelerate(double t, const double *restrict x, const double *restrict u, const double *restrict c,
                           double *restrict w)
{
    double *const a = w + AT_ACC;
    const double *const bias = w + AT_TERMS + MOVING * (MOVING + 1) / 2;
    (void)scales_block(t, x, u, c, w + AT_SCALES, w);
    (void)held_terms_block(t, x, u, c, w + AT_TERMS, w);
    memcpy(w + AT_X, x, (NQ + N) * sizeof(double));
    for (int k = 0; k < N; k++) {
        a[k] = -bias[k];
    }
    const int status = tree_factor(MOVING, w + AT_TERMS, w + AT_SCALES);
    if (status == 0) {
        tree_solve(MOVING, w + AT_TERMS, a);
    }
    return status;
}

/* Adds what the direction in w + AT_ALONG makes of the accelerations of a column. */
static void take_column(int column, int rows, double *restrict out, double *restrict w)
{
    double *const r1 = w + AT_ALONG;
    tree_solve(MOVING, w + AT_TERMS, r1);
    for (int k = 0; k < rows; k++) {
        out[(NQ + k) * (NQ + N) + column] -= r1[k];
    }
}

/* The column of one number of x, as any other. */
static void plain_column(double t, const double *restrict x, const double *restrict u, const double *restrict c, int column,
                         double *restrict out, double *restrict w)
{
    double *const dq = w + AT_DQ, *const dv = w + AT_DV, *const rates = w + AT_RATES;
    memset(dq, 0, (NQ + N) * sizeof(double));
    dq[column] = 1.0;
    residuals_along(t, u, c, w);
    take_column(column, N, out, w);
    change_rates(x, dq, dv, rates);
    for (int k = 0; k < NQ; k++) {
        out[k * (NQ + N) + column] = rates[k];
    }
}

/* The rows of states: columns that share no row, at a time. */
static void held_states(double t, const double *restrict u, const double *restrict c, double *restrict out,
                        double *restrict w)
{
    double *const dq = w + AT_DQ, *const dv = w + AT_DV, *const r1 = w + AT_ALONG;
    for (int group = 0; group < HELD_GROUPS; group++) {
        memset(dq, 0, (NQ + N) * sizeof(double));
        for (int k = HELD_START[group]; k < HELD_START[group + 1]; k++) {
            dv[HELD_STATE[k]] = 1.0;
        }
        residuals_along(t, u, c, w);
        for (int k = HELD_START[group]; k < HELD_START[group + 1]; k++) {
            for (int l = HELD_FIRST[k]; l < HELD_FIRST[k + 1]; l++) {
                out[(NQ + HELD_ROW[l]) * (NQ + N) + NQ + HELD_STATE[k]] = -r1[HELD_ROW[l]];
            }
        }
    }
}

/* The rows of bodies: what near pairs exert by their states. 1 where there was no room for these. */
static int held_bodies(double t, const double *restrict u, const double *restrict c, double *restrict out,
                       double *restrict w)
{
    double *const list = w + AT_HELD_LIST, *const loads = w + AT_DQ;
    (void)held_operands_block(t, w + AT_X, u, c, w + AT_HELD_OPERANDS, w);
    for (int sum = 0; sum < HELD_SUMS; sum++) {
        int load = 0;
        const int *const slots =
            held_pairs(sum, w + AT_X, w + AT_HELD_OPERANDS, w + AT_HELD_GIVEN, list, w + AT_HELD_WORK, &load);
        const int found = (int)list[0];
        if (found < 0) {
            return 1;
        }
        memset(loads, 0, HELD_LOADS * sizeof(double));
        for (const double *record = list + 1; record < list + 1 + HELD_RECORD * found; record += HELD_RECORD) {
            double *const first = loads + load + 6 * (int)record[1], *const second = loads + load + 6 * (int)record[2];
            for (int k = 0; k < 6; k++) {
                first[k] = record[3 + k], second[k] = record[9 + k];
            }
            memset(w + AT_ALONG, 0, N * sizeof(double));
            (void)held_loads_block(t, w + AT_X, u, c, w + AT_ALONG, w);
            if (slots[(int)record[0]] >= 0) {
                take_column(NQ + slots[(int)record[0]], MOVING, out, w);
            }
            for (int k = 0; k < 6; k++) {
                first[k] = second[k] = 0.0;
            }
        }
    }
    return 0;
}

/* dx'/dx whose columns of states of contacts are made from the pairs that have them. */
static int jacobian_driver(double t, const double *restrict x, const double *restrict u, const double *restrict c,
                          double *restrict out, double *restrict w)
{
    const int status = held_accelerate(t, x, u, c, w);
    char held[NQ + N] = {0};
    if (status != 0) {
        return status;
    }
    prepare_residuals(t, u, c, w);
    memset(out, 0, sizeof(double) * (NQ + N) * (NQ + N));
    if (held_bodies(t, u, c, out, w) == 0) {
        held_states(t, u, c, out, w);
        for (int k = 0; k < HELD_START[HELD_GROUPS]; k++) {
            held[NQ + HELD_STATE[k]] = 1;
        }
    } else {
        memset(out, 0, sizeof(double) * (NQ + N) * (NQ + N));
    }
    for (int column = 0; column < NQ + N; column++) {
        if (!held[column]) {
            plain_column(t, x, u, c, column, out, w);
        }
    }
    return 0;
}
