/* Embedding: a partition of the velocities into dependent and independent ones by pivots, and the equations of motion
   of the latter. */

/* The partition: dependent[j] follows from row[j] of the constraints; the others are independent. Its smallest pivot,
   relative to the first, is of the size of the smallest singular value. Indices as numbers. */
#define WEAKEST (AT(PARTITION)[0])
#define DEPENDENT (AT(PARTITION) + 1)
#define PIVOT_ROW (DEPENDENT + N)
#define INDEPENDENT (PIVOT_ROW + N)

/* Rows [J | -column/s_c | I] of the given width; the unit matrix only where the width has room. */
static void form_rows(const eom_at *at, const double *restrict column, int width)
{
    double *const a = AT(ROWS);
    const double *const J = AT(J), *const s = AT(SCALES);
    for (int i = 0; i < M; i++) {
        copy(N, J + i * N, a + i * width);
        a[i * width + N] = -column[i] / s[N + i];
        for (int k = N + 1; k < width; k++) {
            a[i * width + k] = k - N - 1 == i ? 1.0 : 0.0;
        }
    }
}

/* What entries of each row of J are compared with (eomgen/mechanics/constraint_functions.py); largest: M + 1 numbers of work. */
static void find_sizes(const eom_at *at, int width, double *restrict sizes, double *restrict largest)
{
    const double *const a = AT(ROWS);
    const int *const group = MODEL->row_group;
    fill(M + 1, 0.0, largest);
    for (int i = 0; i < M; i++) {
        const int gap = group[i] > 0 ? group[i] : 0;
        for (int k = 0; k < N; k++) {
            largest[0] = fmax(largest[0], fabs(a[i * width + k]));
            largest[gap] = fmax(largest[gap], fabs(a[i * width + k]));
        }
    }
    for (int i = 0; i < M; i++) {
        const double size = group[i] < 0 ? 1.0 : largest[group[i]];
        sizes[i] = group[i] > 0 ? fmax(size, CROSSINGS_SMALL) : size > 0.0 ? size : 1.0;
    }
}

/* The columns of the largest entries of a row that are not taken: [0] of all, [1] of those preferred as dependent. */
static void find_best(int n, const int *restrict preferred, const double *restrict row, const double *restrict taken,
                      double *restrict best)
{
    int all = -1, dependent = -1;
    double largest = 0.0, largest_dependent = 0.0;
    for (int k = 0; k < n; k++) {
        const double entry = taken[k] != 0.0 ? 0.0 : fabs(row[k]);
        if (entry > largest) {
            all = k, largest = entry;
        }
        if (preferred[k] && entry > largest_dependent) {
            dependent = k, largest_dependent = entry;
        }
    }
    best[0] = (double)all, best[1] = (double)dependent;
}

/* Complete pivoting over the rows, R pivots: the best among the columns preferred as dependent if it is within 100 of
   the best of all. With `strict` only preferred columns are taken. */
static int split(const eom_at *at, int width, int strict)
{
    double *const a = AT(ROWS), *const used = AT(PIVOTING), *const best = used + M, *const changed = best + 2 * M;
    double *const row_sizes = changed + M, *const taken = row_sizes + M + M + 1;
    double size = 0.0, weakest = 1.0;
    int count = 0;
    find_sizes(at, width, row_sizes, row_sizes + M);
    fill(M, 0.0, used);
    fill(M, 1.0, changed);
    fill(N, 0.0, taken);
    for (int step = 0; step < R; step++) {
        int rows[2] = {-1, -1};
        double sizes[2] = {0.0, 0.0};
        for (int i = 0; i < M; i++) {
            if (changed[i] != 0.0) {
                find_best(N, MODEL->preferred_dependent, a + i * width, taken, best + 2 * i);
            }
            for (int kind = 0; kind < 2 && used[i] == 0.0; kind++) {
                const int column = (int)best[2 * i + kind];
                const double entry = column < 0 ? 0.0 : fabs(a[i * width + column]) / row_sizes[i];
                if (entry > sizes[kind]) {
                    sizes[kind] = entry, rows[kind] = i;
                }
            }
        }
        size = step == 0 ? sizes[0] : size;
        weakest = step == 0 ? 1.0 : fmin(weakest, sizes[0] / size);
        const int kind = strict || (sizes[1] >= CONSTRAINTS_PREFERENCE * sizes[0] && sizes[1] > 0.0);
        if (!(sizes[kind] > (strict ? CONSTRAINTS_CHOSEN : CONSTRAINTS_STATE) * size)) {
            WEAKEST = weakest;
            return EOMGEN_PARTITION_BAD;
        }
        const int row = rows[kind], column = (int)best[2 * row + kind];
        for (int i = 0; i < M; i++) { /* what elimination leaves as it is needs no search again */
            changed[i] = a[i * width + column] != 0.0 ? 1.0 : 0.0;
        }
        eliminate(M, width, row, column, a);
        DEPENDENT[step] = (double)column, PIVOT_ROW[step] = (double)row;
        used[row] = taken[column] = 1.0;
    }
    for (int k = 0; k < N; k++) { /* the preferred ones first, in their order */
        if (taken[MODEL->order[k]] == 0.0) {
            INDEPENDENT[count++] = (double)MODEL->order[k];
        }
    }
    WEAKEST = weakest;
    return 0;
}

/* The status of accelerations of a state by itself, which has none where its position is not told from a singular
   one. */
static int status_near(int status, double weakest)
{
    return status == 0 && weakest < CROSSINGS_UNTOLD ? EOMGEN_PARTITION_BAD : status;
}

/* Partition at q and its weakest pivot, 0 where rank is lost; leaves C and C_q, J and eliminated rows in the work
   memory. */
static double find_weakest(const eom_at *at, const double *restrict q)
{
    (void)EVALUATE(scales, q, AT(SCALES));
    evaluate_position(at, q);
    fill(M, 0.0, AT(E));
    form_rows(at, AT(E), N + 1);
    return split(at, N + 1, 0) == 0 ? WEAKEST : 0.0;
}

/* B (N x F) with J B = 0 from eliminated rows. */
static void form_transformation(const eom_at *at, int width)
{
    double *const B = AT(B);
    const double *const a = AT(ROWS);
    fill(N * F, 0.0, B);
    for (int k = 0; k < F; k++) {
        const int independent = (int)INDEPENDENT[k];
        B[independent * F + k] = 1.0;
        for (int j = 0; j < R; j++) {
            B[(int)DEPENDENT[j] * F + k] = -a[(int)PIVOT_ROW[j] * width + independent];
        }
    }
}

/* x_d -= what the eliminated rows, with the unit matrix, make of r. */
static void subtract_dependent(const eom_at *at, const double *restrict r, double *restrict x)
{
    const int width = N + 1 + M;
    for (int j = 0; j < R; j++) {
        const double *const row = AT(ROWS) + (int)PIVOT_ROW[j] * width + N + 1;
        const int d = (int)DEPENDENT[j];
        for (int i = 0; i < M; i++) {
            x[d] -= row[i] * r[i] / AT(SCALES)[N + i];
        }
    }
}

/* M_e = B^T M B, lower triangle, from the scaled M (N x N). */
static void embed_mass(const eom_at *at)
{
    const double *const B = AT(B), *const mass = AT(MASS);
    double *const MB = AT(MB), *const embedded = AT(EMBEDDED);
    for (int i = 0; i < N; i++) {
        for (int k = 0; k < F; k++) {
            double sum = 0.0;
            for (int j = 0; j < N; j++) {
                sum += mass[i * N + j] * B[j * F + k];
            }
            MB[i * F + k] = sum;
        }
    }
    for (int i = 0; i < F; i++) {
        for (int k = 0; k <= i; k++) {
            double sum = 0.0;
            for (int j = 0; j < N; j++) {
                sum += B[j * F + i] * MB[j * F + k];
            }
            embedded[i * F + k] = sum;
        }
    }
}

/* The sums of positive terms in the diagonal of B^T M B: what rounding in M_e is measured by. Returns the largest; of a
   single freedom, for which there is nothing beside, STILL of all that it moves. */
static double embedded_sizes(const eom_at *at, double *restrict sizes)
{
    const double *const B = AT(B), *const mass = AT(MASS);
    double largest = 0.0;
    for (int k = 0; k < F; k++) {
        sizes[k] = 0.0;
        for (int i = 0; i < N; i++) {
            sizes[k] += B[i * F + k] * B[i * F + k] * fabs(mass[i * N + i]);
        }
        largest = sizes[k] > largest ? sizes[k] : largest;
    }
    if (F == 1) {
        double reach = 0.0;
        for (int i = 0; i < N; i++) {
            reach += B[i] != 0.0 ? fabs(mass[i * N + i]) : 0.0;
        }
        largest = fmax(largest, INERTIA_STILL / INERTIA_NOTHING * reach);
    }
    return largest;
}

/* Whether a pivot is lost in the rounding of its own entry, or is what rounding leaves of a zero; of an indefinite
   matrix it must keep half of its digits. NaN shows in the result. */
static int pivot_lost(const eom_at *at, double d, double size, double largest)
{
    (void)at;
    return MODEL->indefinite ? fabs(d) <= INERTIA_FAINT * size
                             : d <= INERTIA_SINGULAR * size || d <= INERTIA_NOTHING * largest;
}

/* M_e = L D L^T in place, lower triangle of the F x F matrix; status 2 where a pivot is lost in rounding, of its own
   entry or of a zero beside the largest. */
static int factor_embedded(const eom_at *at)
{
    double *const a = AT(EMBEDDED), *const sizes = AT(DIAGONAL);
    const double largest = embedded_sizes(at, sizes);
    for (int j = 0; j < F; j++) {
        double d = a[j * F + j];
        for (int k = 0; k < j; k++) {
            const double term = a[j * F + k] * a[j * F + k] * a[k * F + k];
            d -= term;
            sizes[j] += MODEL->indefinite ? fabs(term) : 0.0;
        }
        if (pivot_lost(at, d, sizes[j], largest)) {
            return EOMGEN_SINGULAR_MASS_MATRIX;
        }
        a[j * F + j] = d;
        for (int i = j + 1; i < F; i++) {
            double s = a[i * F + j];
            for (int k = 0; k < j; k++) {
                s -= a[i * F + k] * a[j * F + k] * a[k * F + k];
            }
            a[i * F + j] = s / d;
        }
    }
    return 0;
}

/* Scaled: the a with J a = (right side of the particular solution) and B^T (M a + h) = 0; M_e factored already.
   a: particular solution in, result out; h: N force residuals. */
static void solve_embedded(const eom_at *at, const double *restrict h, double *restrict a)
{
    const double *const B = AT(B), *const mass = AT(MASS);
    double *const y = AT(Y);
    fill(F, 0.0, y);
    for (int i = 0; i < N; i++) {
        double force = h[i];
        for (int j = 0; j < N; j++) {
            force += mass[i * N + j] * a[j];
        }
        for (int k = 0; k < F; k++) {
            y[k] -= B[i * F + k] * force;
        }
    }
    ldl_solve(F, AT(EMBEDDED), y);
    for (int i = 0; i < N; i++) {
        for (int k = 0; k < F; k++) {
            a[i] += B[i * F + k] * y[k];
        }
    }
}

/* M, from its function, or by columns as the forces of unit accelerations. */
static void evaluate_mass_matrix(const eom_at *at, const double *restrict q, double *restrict out)
{
    double *const unit = AT(UNIT), *const column = unit + NX; /* q, a */
    if (MODEL->mass_times == NULL) {
        (void)EVALUATE(mass_matrix, q, out);
        return;
    }
    copy(NQ, q, unit);
    for (int k = 0; k < N; k++) {
        set_unit(N, k, unit + NQ);
        (void)EVALUATE(mass_times, unit, column);
        for (int i = 0; i <= k; i++) {
            out[i * N + k] = out[k * N + i] = column[i];
        }
    }
}

/* M packed row by row, lower triangle, h, C_q, gamma at x = [q; v]. */
static int evaluate_terms(const eom_at *at, const double *restrict x, double *restrict out)
{
    double *const full = AT(FULL), *const bias = out + N * (N + 1) / 2;
    if (MODEL->terms != NULL) {
        return EVALUATE(terms, x, out);
    }
    evaluate_mass_matrix(at, x, full);
    const int status = EVALUATE(bias, x, bias);
    for (int i = 0; i < N; i++) {
        copy(i + 1, full + i * N, out + i * (i + 1) / 2);
    }
    if (M > 0) {
        (void)EVALUATE(constraint_jacobian, x, bias + N);
        (void)EVALUATE(gamma, x, bias + N + M * N);
    }
    return status;
}

/* Accelerations a (N) of the projected state in AT(X); leaves the scaled a, h, M, B and the factor of M_e in the work
   memory. */
static int accelerate(const eom_at *at, int width, double *restrict a)
{
    double *const mass = AT(MASS), *const h = AT(H), *const scaled = AT(A), *const r = AT(RATE), *const v = AT(STEP);
    const double *const s = AT(SCALES), *const packed = AT(TERMS);
    const double *const bias = packed + N * (N + 1) / 2, *const C_q = bias + N, *const gamma = C_q + M * N;
    WEAKEST = 1.0;
    if (evaluate_terms(at, AT(X), AT(TERMS)) != 0) { /* Euler parameters that are all zero */
        return EOMGEN_NON_FINITE;
    }
    form_scaled(at, C_q);
    form_rows(at, gamma, width);
    int status = split(at, width, 0);
    if (status != 0) {
        return status;
    }
    form_transformation(at, width);
    for (int i = 0; i < N; i++) {
        for (int k = 0; k <= i; k++) {
            mass[i * N + k] = packed[i * (i + 1) / 2 + k] * s[i] * s[k];
            mass[k * N + i] = mass[i * N + k];
        }
        h[i] = bias[i] * s[i];
    }
    fill(N, 0.0, scaled);
    for (int i = 0; i < M; i++) {
        r[i] = gamma[i] / s[N + i];
    }
    for (int k = 0; k < N; k++) {
        v[k] = AT_V[k] / s[k];
    }
    find_noise(at, v, NULL, 2);
    /* of minimum norm: no small pivot makes it large */
    status = correct_linear(at, M, AT(G), r, scaled, 2);
    if (status != 0) {
        return status;
    }
    embed_mass(at);
    status = factor_embedded(at);
    if (status != 0) {
        return status;
    }
    solve_embedded(at, h, scaled);
    for (int k = 0; k < N; k++) {
        a[k] = s[k] * scaled[k];
    }
    return 0;
}

/* Multipliers from the dependent rows of C_q^T l = -(M a + h), zero on redundant rows. */
static void find_multipliers(const eom_at *at, int width)
{
    const double *const mass = AT(MASS), *const a = AT(A), *const s = AT(SCALES);
    double *const l = AT_L;
    fill(M, 0.0, l);
    for (int j = 0; j < R; j++) {
        const double *const row = AT(ROWS) + (int)PIVOT_ROW[j] * width + N + 1;
        const int d = (int)DEPENDENT[j];
        double force = AT(H)[d];
        for (int k = 0; k < N; k++) {
            force += mass[d * N + k] * a[k];
        }
        for (int i = 0; i < M; i++) {
            l[i] -= row[i] * force / s[N + i];
        }
    }
}

/* q with C(q) = 0 and the independent coordinates kept, in place, by Newton's method on the dependent ones. */
static int close_dependent(const eom_at *at, double *restrict q)
{
    const double *const s = AT(SCALES), *const rows = AT(ROWS);
    double *const step = AT(STEP), *const d = AT(A);
    double before = 0.0;
    for (int count = 0; count <= 50; count++) {
        (void)EVALUATE(position, q, AT(POSITION));
        const double size = largest_residual(at);
        form_scaled(at, AT(POSITION) + MH);
        if (!isfinite(size)) {
            return EOMGEN_NON_FINITE;
        }
        if (has_converged(at, count, size, before, q)) {
            return 0;
        }
        if (count == 50) {
            return is_within(at, CONSTRAINTS_ACCEPTED, ROUNDING_ROUNDED, q) ? 0 : EOMGEN_PROJECTION_FAILED;
        }
        form_rows(at, AT(POSITION), N + 1);
        const int status = split(at, N + 1, 1);
        if (status != 0) {
            return status;
        }
        for (int j = 0; j < R; j++) {
            step[j] = rows[(int)PIVOT_ROW[j] * (N + 1) + N];
        }
        const double part = damping(step, R);
        fill(N, 0.0, d);
        for (int j = 0; j < R; j++) {
            const int k = (int)DEPENDENT[j];
            d[k] = s[k] * part * step[j];
        }
        move(at, q, d);
        before = size;
    }
    return EOMGEN_PROJECTION_FAILED;
}

/* x (N) from its independent entries (F): B x_i plus the solution of J_d x_d = -r (scaled, by the eliminated rows). */
static void complete(const eom_at *at, const double *restrict independent, const double *restrict r, double *restrict x)
{
    const double *const B = AT(B), *const s = AT(SCALES);
    for (int k = 0; k < N; k++) {
        x[k] = 0.0;
        for (int j = 0; j < F; j++) {
            x[k] += B[k * F + j] * independent[j] / s[(int)INDEPENDENT[j]];
        }
    }
    subtract_dependent(at, r, x);
    multiply(N, s, x);
}

/* x = [q_i v_i a_i q_guess] -> [q v a] of the whole tree; the set of independent coordinates is the preferred one. */
int eom_kinematics(const eom_at *at, const double *x, double *out)
{
    const int coordinates = F - (N - MOVING), width = N + 1 + M;
    double *const q = out, *const v = out + NQ, *const a = out + NX;
    (void)EVALUATE(scales, x, AT(SCALES));
    copy(NQ, x + coordinates + 2 * F, q);
    for (int k = 0; k < coordinates; k++) {
        q[COORDINATE[MODEL->order[k]]] = x[k];
    }
    int status = close_dependent(at, q);
    if (status != 0) {
        return status;
    }
    (void)EVALUATE(rate, q, AT(RATE));
    form_rows(at, AT(RATE), width);
    status = split(at, width, 1);
    if (status != 0) {
        return status;
    }
    form_transformation(at, width);
    complete(at, x + coordinates, AT(RATE), v);
    normalize(at, q);
    copy(NX, out, AT(X));
    (void)evaluate_terms(at, AT(X), AT(TERMS));
    complete(at, x + coordinates + F, AT(TERMS) + N * (N + 1) / 2 + N + M * N, a);
    return 0;
}

int eom_mass_matrix(const eom_at *at, const double *x, double *out)
{
    evaluate_mass_matrix(at, x, out);
    return 0;
}

int eom_embedded_mass_matrix(const eom_at *at, const double *x, double *out)
{
    const double *const s = AT(SCALES), *const embedded = AT(EMBEDDED), *const full = AT(FULL);
    double *const mass = AT(MASS);
    if (M == 0) {
        evaluate_mass_matrix(at, x, AT(FULL));
        for (int i = 0; i < N; i++) {
            for (int k = 0; k < N; k++) {
                out[i * N + k] = full[MODEL->order[i] * N + MODEL->order[k]];
            }
        }
        return 0;
    }
    (void)EVALUATE(scales, x, AT(SCALES));
    evaluate_position(at, x);
    form_rows(at, AT(SCALES) + N, N + 1);
    const int status = split(at, N + 1, 1);
    if (status != 0) {
        return status;
    }
    form_transformation(at, N + 1);
    evaluate_mass_matrix(at, x, mass);
    for (int i = 0; i < N; i++) {
        for (int k = 0; k < N; k++) {
            mass[i * N + k] *= s[i] * s[k];
        }
    }
    embed_mass(at);
    for (int i = 0; i < F; i++) {
        for (int k = 0; k <= i; k++) {
            const double unit = s[(int)INDEPENDENT[i]] * s[(int)INDEPENDENT[k]];
            out[i * F + k] = embedded[i * F + k] / unit;
            out[k * F + i] = out[i * F + k];
        }
    }
    return 0;
}
