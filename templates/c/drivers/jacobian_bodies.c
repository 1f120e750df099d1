/* The Jacobian where the straight-line right-hand side is sound: along a direction the accelerations and multipliers change
   as a sweep over the bodies with the same pivots says. Few freedoms: along those alone, since all directions are first
   projected, P e_j = sum Z_k y_k of the projected units Z_k of the preferred coordinates, A y = (P e_j)_preferred. */
enum { FEW = NQ == N && MH == M && 2 * F <= N, CHANGES = NQ + N, TURNED = NQ > N ? NQ : N };

/* [q'; v'] along the direction in w + AT_TURNING, of q or of v. */
static void change_along(int of_q, double t, const double *restrict u, const double *restrict c, double *restrict change,
                         double *restrict w)
{
    if (of_q) {
        (void)slopes_by_position_block(t, w + AT_COEFFICIENTS, u, c, change, w);
    } else {
        (void)slopes_by_velocity_block(t, w + AT_COEFFICIENTS, u, c, change, w);
    }
}

static void turn_to(int place, double *restrict w)
{
    for (int k = 0; k < TURNED; k++) {
        w[AT_TURNING + k] = k == place ? 1.0 : 0.0;
    }
}

static void every_column(double t, const double *restrict u, const double *restrict c, double *restrict out,
                         double *restrict w)
{
    double *const change = w + AT_CHANGE;
    for (int column = 0; column < CHANGES; column++) {
        turn_to(column < NQ ? column : column - NQ, w);
        change_along(column < NQ, t, u, c, change, w);
        for (int i = 0; i < CHANGES; i++) {
            out[i * CHANGES + column] = change[i];
        }
    }
}

/* A = L L^T in place; nonzero where the preferred coordinates hardly move. */
static int factor_shares(double *restrict A)
{
    for (int i = 0; i < F; i++) {
        for (int j = 0; j <= i; j++) {
            double sum = A[i * F + j];
            for (int k = 0; k < j; k++) {
                sum -= A[i * F + k] * A[j * F + k];
            }
            if (i == j && !(sum > CONSTRAINTS_SPANNING)) {
                return 1;
            }
            A[i * F + j] = i == j ? sqrt(sum) : sum / A[j * F + j];
        }
    }
    return 0;
}

static int few_columns(double t, const double *restrict u, const double *restrict c, double *restrict out,
                       double *restrict w)
{
    double *const span = w + AT_SPAN, *const A = w + AT_SHARES, *const y = w + AT_CHANGE;
    const double *const s = w + AT_SCALES;
    for (int k = 0; k < F; k++) {
        double *const of_v = span + 2 * k * CHANGES, *const of_q = of_v + CHANGES;
        turn_to(ORDER[k], w);
        change_along(0, t, u, c, of_v, w);
        for (int i = 0; i < N; i++) {
            w[AT_TURNING + i] = of_v[i];
        }
        change_along(1, t, u, c, of_q, w);
        for (int i = 0; i < F; i++) {
            A[i * F + k] = of_v[ORDER[i]] * s[ORDER[k]] / s[ORDER[i]];
        }
    }
    if (factor_shares(A) != 0) {
        return 1;
    }
    for (int k = 0; k < CHANGES * CHANGES; k++) {
        out[k] = 0.0;
    }
    for (int column = 0; column < N; column++) {
        for (int k = 0; k < F; k++) {
            y[k] = span[2 * k * CHANGES + column] * s[ORDER[k]] / (s[column] * s[column]);
            for (int j = 0; j < k; j++) {
                y[k] -= A[k * F + j] * y[j];
            }
            y[k] /= A[k * F + k];
        }
        for (int k = F - 1; k >= 0; k--) {
            for (int j = k + 1; j < F; j++) {
                y[k] -= A[j * F + k] * y[j];
            }
            y[k] /= A[k * F + k];
        }
        for (int k = 0; k < F; k++) {
            const double part = y[k] * s[ORDER[k]], *const of_v = span + 2 * k * CHANGES, *const of_q = of_v + CHANGES;
            for (int i = 0; i < CHANGES; i++) {
                out[i * CHANGES + column] += of_q[i] * part;
                out[i * CHANGES + NQ + column] += of_v[i] * part;
            }
        }
    }
    return 0;
}

static int jacobian_here(double t, const double *restrict x, const double *restrict u, const double *restrict c,
                         double *restrict out, double *restrict weakest, double *restrict w)
{
    double *const y = w + AT_X;
    const double *const found = w + AT_SLOPES;
    partition parts;
    int known;
    for (int k = 0; k < NQ + N; k++) {
        y[k] = x[k];
    }
    if (close_directly(t, y, u, c, &known, w) != 0 || loop_slopes_block(t, y, u, c, w + AT_SLOPES, w) != 0 || found[N] == 0.0) {
        return jacobian_by_partition(t, x, u, c, out, weakest, w);
    }
    for (int k = AT_MET; k < AT_SHAPES; k++) { /* pairs of shapes that were near belong to another state */
        w[k] = 0.0;
    }
    *weakest = found[N + 1] != 0.0 ? 1.0 : find_weakest(t, y, u, c, &parts, w);
    (void)scales_block(t, y, u, c, w + AT_SCALES, w);
    if (!FEW || few_columns(t, u, c, out, w) != 0) {
        every_column(t, u, c, out, w);
    }
    return 0;
}
