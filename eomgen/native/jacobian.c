/* Derivatives of x' by the state, inputs and parameters. */

/* Residuals r1 = M a + h + C_q^T l, r2 = C_q a + gamma, r3 = C_q v + C_t along (dq, dv): from their Jacobians,
   evaluated once, or by one evaluation for each direction. */
static void prepare_residuals(const eom_at *at)
{
    if (MODEL->residual_tangent == NULL) {
        (void)EVALUATE(residual_jacobian, AT(X), AT(RESIDUAL));
    }
}

static void residuals_along(const eom_at *at)
{
    const double *const r1_q = AT(RESIDUAL), *const r2_q = r1_q + N * NX;
    double *const r1 = AT(ALONG), *const r2 = r1 + N;
    if (MODEL->residual_tangent != NULL) {
        (void)EVALUATE(residual_tangent, AT(X), r1);
        return;
    }
    fill(N + M, 0.0, r1);
    multiply_add(N, NQ, r1_q, AT_DQ, r1);
    multiply_add(N, N, r1_q + N * NQ, AT_DV, r1);
    multiply_add(M, NQ, r2_q, AT_DQ, r2);
    multiply_add(M, N, r2_q + M * NQ, AT_DV, r2);
}

/* r3 alone, along dq. */
static void rate_along(const eom_at *at)
{
    double *const r3 = AT(ALONG) + N + M;
    if (MODEL->residual_tangent != NULL) {
        fill(N, 0.0, AT_DV);
        residuals_along(at);
        return;
    }
    fill(M, 0.0, r3);
    multiply_add(M, NQ, AT(RESIDUAL) + (N + M) * NX, AT_DQ, r3);
}

/* The factor of the holonomic rows. */
static double *holonomic_gram(const eom_at *at)
{
    return MH < M ? AT(GH) : AT(G);
}

/* The column of a Jacobian of x' where q and v change by dq and dv, and v' by da. */
static void put_column(const eom_at *at, int column, int columns, const double *restrict dq, const double *restrict dv,
                       const double *restrict da, double *restrict out)
{
    double *const rates = AT(RATES);
    change_rates(at, AT(X), dq, dv, rates);
    set_column(NQ, column, columns, rates, out);
    set_column(N, column, columns, da, out + NQ * columns);
}

/* The projected state, its accelerations and multipliers, and the factors that derivatives need. */
static int prepare_derivatives(const eom_at *at, const double *restrict x, double *restrict weakest)
{
    const int width = N + 1 + M;
    int status = close_loops(at, x);
    if (status == 0) {
        status = accelerate(at, width, AT_ACC);
        *weakest = WEAKEST;
    }
    if (status == 0 && MH < M) {
        status = factor_gram(MH, N, M, AT(J), CONSTRAINTS_GENTLE, AT(GH));
    }
    if (status == 0 && MODEL->coordinate_slopes != NULL) {
        status = form_normal(at, AT(X));
    }
    if (status == 0) {
        find_multipliers(at, width);
        prepare_residuals(at);
    }
    return status;
}

/* dv of the projected state, scaled in place: the nearest that closes r, as velocities. */
static int project_velocities(const eom_at *at)
{
    const int status = correct_change(at, M, AT(G), AT(RATE), AT_DV);
    multiply(N, AT(SCALES), AT_DV);
    return status;
}

/* The nearest velocities, in the area of dv, along which the projected coordinates move for the unit change of q[k]. */
static int project_position(const eom_at *at, int k)
{
    const double *const s = AT(SCALES);
    double *const dq = AT_DQ, *const dv = AT_DV, *const r = AT(RATE);
    set_unit(NX, k, dq);
    fill(M, 0.0, r);
    find_velocities(at, AT(X), dq, dv);
    for (int i = 0; i < MH && MODEL->coordinate_slopes != NULL; i++) {
        r[i] = AT(GRADIENT)[i * NQ + k];
    }
    divide(N, s, dv);
    const int status = correct_change(at, MH, holonomic_gram(at), r, dv);
    if (MODEL->coordinate_slopes != NULL) {
        add_left(at, holonomic_gram(at), r, dv, dq);
    }
    multiply(N, s, dv);
    return status;
}

/* The change of the projected state along velocities in the area of dv: dq and dv in their areas. shift: how
   C_q v + C_t changes besides, or NULL. */
static int follow_position(const eom_at *at, const double *restrict shift)
{
    const double *const s = AT(SCALES), *const r3 = AT(ALONG) + N + M;
    double *const dv = AT_DV, *const r = AT(RATE);
    spread(at, AT(X), dv, AT_DQ);
    rate_along(at);
    for (int i = 0; i < M; i++) {
        r[i] = (shift == NULL ? r3[i] : r3[i] + shift[i]) / s[N + i];
    }
    fill(N, 0.0, dv);
    return project_velocities(at);
}

/* The same for the unit change of v[k]. */
static int project_velocity(const eom_at *at, int k)
{
    fill(NQ, 0.0, AT_DQ);
    set_unit(N, k, AT_DV);
    AT_DV[k] = 1.0 / AT(SCALES)[k];
    fill(M, 0.0, AT(RATE));
    return project_velocities(at);
}

/* The change of the projected state where C and C_q v + C_t change by C and r3 of AT(SHIFT): dq and dv in their
   areas. */
static int project_shift(const eom_at *at)
{
    const double *const s = AT(SCALES), *const C = AT(SHIFT);
    double *const dq = AT_DQ, *const dv = AT_DV, *const r = AT(RATE);
    fill(NX, 0.0, dq);
    for (int i = 0; i < MH; i++) {
        r[i] = C[i] / s[N + i];
    }
    const int status = correct_change(at, MH, holonomic_gram(at), r, dv);
    multiply(N, s, dv);
    const int followed = follow_position(at, C + MH + N + M);
    return status == 0 ? followed : status;
}

/* The column of derivatives where the projected state changes by dq and dv and residuals by r1 and r2 (N + M, in
   place). */
static void solve_column(const eom_at *at, int column, int columns, double *restrict r, double *restrict out)
{
    double *const da = AT(STEP);
    multiply(N, AT(SCALES), r);
    fill(N, 0.0, da);
    subtract_dependent(at, r + N, da);
    solve_embedded(at, r, da);
    multiply(N, AT(SCALES), da);
    put_column(at, column, columns, AT_DQ, AT_DV, da, out);
}

/* The column of x' along the change of the projected state. */
static void change_column(const eom_at *at, int column, double *restrict out)
{
    residuals_along(at);
    solve_column(at, column, NX, AT(ALONG), out);
}

/* Where q' = v and every constraint is of positions, units of q[k] and v[k] move along the same velocities. */
static int jacobian_by_partition(const eom_at *at, const double *restrict x, double *restrict out,
                                 double *restrict weakest)
{
    const int alike = PLAIN_RATES && MH == M && MODEL->coordinate_slopes == NULL;
    int status = prepare_derivatives(at, x, weakest);
    for (int k = 0; k < NQ && status == 0; k++) {
        status = project_position(at, k);
        if (status == 0 && alike) {
            fill(NQ, 0.0, AT_DQ);
            change_column(at, NQ + k, out);
        }
        status = status == 0 ? follow_position(at, NULL) : status;
        if (status == 0) {
            change_column(at, k, out);
        }
    }
    for (int k = 0; k < N && status == 0 && !alike; k++) {
        status = project_velocity(at, k);
        if (status == 0) {
            change_column(at, NQ + k, out);
        }
    }
    return status;
}

/* dx' for the unit change of each of so many inputs or parameters; shift: C, r1, r2 and r3 along such changes of
   loops, M a + h of a tree; acceleration: v' of a tree whose mass matrix is not formed. */
static int shift_jacobian(const eom_at *at, eomgen_function shift, eomgen_function acceleration, int columns,
                          const double *restrict x, double *restrict out)
{
    double weakest, *const r = AT(SHIFT) + MH, *const seeds = acceleration != NULL ? AT(X) + NX : AT_DQ;
    int status = 0;
    if (acceleration != NULL) {
        copy(NX, x, AT(X));
    } else {
        status = M > 0 ? prepare_derivatives(at, x, &weakest) : tree_accelerate(at, x, 0);
    }
    for (int column = 0; column < columns && status == 0; column++) {
        set_unit(columns, column, seeds);
        if (M > 0) {
            (void)shift(at->t, AT(X), at->u, at->c, AT(SHIFT), at->w);
            status = project_shift(at);
            if (status != 0) {
                break;
            }
            residuals_along(at);
            for (int k = 0; k < N + M; k++) {
                AT(ALONG)[k] += r[k];
            }
            solve_column(at, column, columns, AT(ALONG), out);
            continue;
        }
        if (acceleration != NULL) {
            status = acceleration(at->t, AT(X), at->u, at->c, AT(ALONG), at->w);
        } else {
            (void)shift(at->t, AT(X), at->u, at->c, r, at->w);
            tree_solve(at, N, AT(TERMS), r);
        }
        for (int k = 0; k < NX && status == 0; k++) {
            out[k * columns + column] = k < NQ ? 0.0 : acceleration != NULL ? AT(ALONG)[k - NQ] : -r[k - NQ];
        }
    }
    return status;
}

int eom_input_jacobian(const eom_at *at, const double *x, double *out)
{
    return shift_jacobian(at, MODEL->input_shift, MODEL->input_acceleration, MODEL->n_u, x, out);
}

int eom_parameter_jacobian(const eom_at *at, const double *x, double *out)
{
    return shift_jacobian(at, MODEL->parameter_shift, MODEL->parameter_acceleration, MODEL->n_p, x, out);
}

/* The Jacobian where the straight-line right-hand side is sound: along a direction the accelerations and multipliers
   change as a sweep over the bodies with the same pivots says. Few freedoms: along those alone, since all directions
   are first projected, P e_j = sum Z_k y_k of the projected units Z_k of the preferred coordinates, A y = (P
   e_j)_preferred. */
static void turn_to(const eom_at *at, int k)
{
    set_unit(NQ > N ? NQ : N, k, AT(TURNING));
}

/* [q'; v'] along the direction in AT(TURNING), of q or of v. */
static void change_along(const eom_at *at, int of_q, double *restrict change)
{
    if (of_q) {
        (void)EVALUATE(slopes_by_position, AT(COEFFICIENTS), change);
    } else {
        (void)EVALUATE(slopes_by_velocity, AT(COEFFICIENTS), change);
    }
}

static void every_column(const eom_at *at, double *restrict out)
{
    double *const change = AT(CHANGE);
    for (int column = 0; column < NX; column++) {
        turn_to(at, column < NQ ? column : column - NQ);
        change_along(at, column < NQ, change);
        set_column(NX, column, NX, change, out);
    }
}

static int few_columns(const eom_at *at, double *restrict out)
{
    double *const span = AT(SPAN), *const A = AT(SHARES), *const y = AT(CHANGE);
    const double *const s = AT(SCALES);
    const int *const order = MODEL->order;
    for (int k = 0; k < F; k++) {
        double *const of_v = span + 2 * k * NX, *const of_q = of_v + NX;
        turn_to(at, order[k]);
        change_along(at, 0, of_v);
        copy(N, of_v, AT(TURNING));
        change_along(at, 1, of_q);
        for (int i = 0; i < F; i++) {
            A[i * F + k] = of_v[order[i]] * s[order[k]] / s[order[i]];
        }
    }
    if (cholesky(F, F, CONSTRAINTS_SPANNING, A) != 0) { /* the preferred coordinates hardly move */
        return 1;
    }
    fill(NX * NX, 0.0, out);
    for (int column = 0; column < N; column++) {
        for (int k = 0; k < F; k++) {
            y[k] = span[2 * k * NX + column] * s[order[k]] / (s[column] * s[column]);
        }
        cholesky_solve(F, F, A, y);
        for (int k = 0; k < F; k++) {
            const double part = y[k] * s[order[k]], *const of_v = span + 2 * k * NX, *const of_q = of_v + NX;
            for (int i = 0; i < NX; i++) {
                out[i * NX + column] += of_q[i] * part;
                out[i * NX + NQ + column] += of_v[i] * part;
            }
        }
    }
    return 0;
}

static int jacobian_here(const eom_at *at, const double *restrict x, double *restrict out, double *restrict weakest)
{
    double *const y = AT(X);
    const double *const slopes = AT(SLOPES);
    const int few = NQ == N && MH == M && 2 * F <= N;
    int shorter;
    if (MODEL->loop_slopes == NULL) {
        return jacobian_by_partition(at, x, out, weakest);
    }
    copy(NX, x, y);
    if (close_directly(at, y, at->w, &shorter) != 0 || EVALUATE(loop_slopes, y, AT(SLOPES)) != 0 || slopes[N] == 0.0) {
        return jacobian_by_partition(at, x, out, weakest);
    }
    for (double *near = AT(MET); near < AT(SHAPES); near++) { /* pairs of shapes near at another state */
        *near = 0.0;
    }
    *weakest = slopes[N + 1] != 0.0 ? 1.0 : find_weakest(at, y);
    (void)EVALUATE(scales, y, AT(SCALES));
    if (!few || few_columns(at, out) != 0) {
        every_column(at, out);
    }
    return 0;
}

/* Next to a singular position from states on both sides of it, as x' is. */
static int jacobian_of_loops(const eom_at *at, const double *restrict x, double *restrict out)
{
    double weakest = 1.0, time_per_length, speed, *const turned = AT(TURN);
    int status = jacobian_here(at, x, out, &weakest);
    if (!MODEL->singular) {
        return status_near(status, weakest);
    }
    if (!(weakest < CROSSINGS_NEAR) || (status != 0 && status != EOMGEN_PARTITION_BAD)) {
        return status;
    }
    const double reach = interpolate_best(at, x, weakest, &time_per_length, &speed);
    if (!(reach > 0.0) || !(set_out(at, reach, time_per_length, speed) > 0.0)) {
        return status_near(status, weakest);
    }
    fill(NX * NX, 0.0, out);
    for (int pair = 1; pair <= PAIRS; pair++) {
        for (int side = 0; side < 2; side++) {
            const eom_at there = at_distance(at, (side ? -reach : reach) * (double)pair, time_per_length);
            const double *const p = next_point(at, pair, side, reach, time_per_length);
            status = p == NULL ? EOMGEN_PROJECTION_FAILED : jacobian_here(&there, set_state(at, p), turned, &weakest);
            if (status != 0) {
                return status;
            }
            for (int k = 0; k < NX * NX; k++) {
                out[k] += WEIGHT[3][pair - 1] * turned[k];
            }
        }
    }
    return 0;
}

/* Without projection: K [da; dl] = -[dr1; dr2] along each direction. */
static int jacobian_unprojected(const eom_at *at, const double *restrict x, double *restrict out)
{
    double *const r = AT(ALONG), *const z = AT(MOTION) + NX;
    int status = accelerate_unprojected(at, x, AT_ACC);
    copy(M, z + N, AT_L);
    if (status == 0) {
        prepare_residuals(at);
    }
    for (int column = 0; column < NX && status == 0; column++) {
        set_unit(NX, column, AT_DQ);
        residuals_along(at);
        for (int k = 0; k < NZ; k++) {
            r[k] = -r[k];
        }
        status = solve_system(at, r, z);
        put_column(at, column, NX, AT_DQ, AT_DV, z, out);
    }
    return status;
}

/* b = -M^-1 b for `many` of a type of b's columns from `first` on. Many that the compiler knows keep a row in
   registers. */
#define TREE_SOLVE_COLUMNS(type, many) \
    do { \
        for (int i = n - 1; i >= 0; i--) { \
            const type *const own = (const type *)(b + i * columns + first); \
            type row[many]; \
            for (int k = 0; k < (many); k++) { \
                row[k] = own[k]; \
            } \
            for (int j = parent[i]; j >= 0; j = parent[j]) { \
                const double ratio = H[i * (i + 1) / 2 + j]; \
                type *const above = (type *)(b + j * columns + first); \
                for (int k = 0; k < (many); k++) { \
                    above[k] -= ratio * row[k]; \
                } \
            } \
        } \
        for (int i = 0; i < n; i++) { \
            const double inverse = -1.0 / H[i * (i + 1) / 2 + i]; \
            type *const own = (type *)(b + i * columns + first), row[many]; \
            for (int k = 0; k < (many); k++) { \
                row[k] = own[k] * inverse; \
            } \
            for (int j = parent[i]; j >= 0; j = parent[j]) { \
                const double ratio = H[i * (i + 1) / 2 + j]; \
                const type *const above = (const type *)(b + j * columns + first); \
                for (int k = 0; k < (many); k++) { \
                    row[k] -= ratio * above[k]; \
                } \
            } \
            for (int k = 0; k < (many); k++) { \
                own[k] = row[k]; \
            } \
        } \
    } while (0)

#ifdef EOMGEN_VECTORS
typedef double tree_lanes __attribute__((vector_size(32), aligned(8), may_alias)); /* four columns side by side */
#endif

/* b = -M^-1 b for the rows of b, each of so many columns. */
EOMGEN_ROWS static void tree_solve_rows(int n, const int *restrict parent, const double *restrict H, double *restrict b,
                                        int columns)
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
static void tree_rate_rows(const eom_at *at, const double *restrict x, double *restrict out)
{
    double *const direction = AT_DQ, *const rates = AT(RATES), *const done = AT(MARKS);
    fill(NQ * NX, 0.0, out);
    fill(NX, 0.0, done);
    for (int k = 0; k < N && MODEL->rates == NULL; k++) {
        const int i = COORDINATE[k];
        if (i >= 0) {
            done[i] = done[NQ + k] = 1.0;
            out[i * NX + NQ + k] = 1.0;
        }
    }
    fill(NX, 0.0, direction);
    for (int column = 0; column < NX; column++) {
        if (done[column] != 0.0) {
            continue;
        }
        direction[column] = 1.0;
        change_rates(at, x, direction, direction + NQ, rates);
        direction[column] = 0.0;
        set_column(NQ, column, NX, rates, out);
    }
}

static int tree_jacobian(const eom_at *at, const double *restrict x, double *restrict out)
{
    const int status = tree_accelerate(at, x, 0);
    double *const r1 = AT(ALONG);
    if (status != 0) {
        return status;
    }
    prepare_residuals(at);
    if (MODEL->residual_tangent == NULL) {
        const double *const r1_q = AT(RESIDUAL), *const r1_v = r1_q + N * NQ;
        for (int i = 0; i < N; i++) {
            copy(NQ, r1_q + i * NQ, out + (NQ + i) * NX);
            copy(N, r1_v + i * N, out + (NQ + i) * NX + NQ);
        }
        tree_solve_rows(N, PARENT, AT(TERMS), out + NQ * NX, NX);
        tree_rate_rows(at, x, out);
        return 0;
    }
    for (int column = 0; column < NX; column++) {
        set_unit(NX, column, AT_DQ);
        residuals_along(at);
        tree_solve(at, N, AT(TERMS), r1);
        for (int k = 0; k < N; k++) {
            r1[k] = -r1[k];
        }
        put_column(at, column, NX, AT_DQ, AT_DV, r1, out);
    }
    return 0;
}

/* Adds what the direction in AT(ALONG) makes of the accelerations of a column. */
static void take_column(const eom_at *at, int column, int rows, double *restrict out)
{
    double *const r1 = AT(ALONG);
    tree_solve(at, MOVING, AT(TERMS), r1);
    for (int k = 0; k < rows; k++) {
        out[(NQ + k) * NX + column] -= r1[k];
    }
}

/* The rows of states of contacts: columns that share no row, at a time. */
static void contact_state_rows(const eom_at *at, double *restrict out)
{
    const eom_contacts *const c = MODEL->contacts;
    double *const r1 = AT(ALONG);
    for (int group = 0; group < c->groups; group++) {
        fill(NX, 0.0, AT_DQ);
        for (int k = c->start[group]; k < c->start[group + 1]; k++) {
            AT_DV[c->state[k]] = 1.0;
        }
        residuals_along(at);
        for (int k = c->start[group]; k < c->start[group + 1]; k++) {
            for (int l = c->first[k]; l < c->first[k + 1]; l++) {
                out[(NQ + c->row[l]) * NX + NQ + c->state[k]] = -r1[c->row[l]];
            }
        }
    }
}

/* The rows of bodies: what near pairs exert by their states. 1 where there was no room for these. A record of a pair:
   the number of a state, two bodies, and the wrench on each. */
static int contact_body_rows(const eom_at *at, double *restrict out)
{
    enum { RECORD = 15 };
    const eom_contacts *const c = MODEL->contacts;
    double *const list = AT(CONTACT_LIST), *const loads = AT_DQ;
    (void)EVALUATE(contact_operands, AT(X), AT(CONTACT_OPERANDS));
    for (int sum = 0; sum < c->sums; sum++) {
        int load = 0;
        const int *const slots =
            c->pairs(sum, AT(X), AT(CONTACT_OPERANDS), AT(CONTACT_GIVEN), list, AT(CONTACT_WORK), &load);
        const int count = (int)list[0];
        if (count < 0) {
            return 1;
        }
        fill(c->loads, 0.0, loads);
        for (const double *record = list + 1; record < list + 1 + RECORD * count; record += RECORD) {
            double *const first = loads + load + 6 * (int)record[1], *const second = loads + load + 6 * (int)record[2];
            const int state = slots[(int)record[0]];
            copy(6, record + 3, first);
            copy(6, record + 9, second);
            fill(N, 0.0, AT(ALONG));
            (void)EVALUATE(contact_loads, AT(X), AT(ALONG));
            if (state >= 0) {
                take_column(at, NQ + state, MOVING, out);
            }
            fill(6, 0.0, first);
            fill(6, 0.0, second);
        }
    }
    return 0;
}

/* The Jacobian of a tree whose columns of states of contacts are made from the pairs that have them. */
static int contact_jacobian(const eom_at *at, const double *restrict x, double *restrict out)
{
    const eom_contacts *const c = MODEL->contacts;
    const int status = tree_accelerate(at, x, 1);
    double *const done = AT(MARKS), *const rates = AT(RATES);
    if (status != 0) {
        return status;
    }
    prepare_residuals(at);
    fill(NX, 0.0, done);
    fill(NX * NX, 0.0, out);
    if (contact_body_rows(at, out) == 0) {
        contact_state_rows(at, out);
        for (int k = 0; k < c->start[c->groups]; k++) {
            done[NQ + c->state[k]] = 1.0;
        }
    } else {
        fill(NX * NX, 0.0, out);
    }
    for (int column = 0; column < NX; column++) {
        if (done[column] != 0.0) {
            continue;
        }
        set_unit(NX, column, AT_DQ);
        residuals_along(at);
        take_column(at, column, N, out);
        change_rates(at, x, AT_DQ, AT_DV, rates);
        set_column(NQ, column, NX, rates, out);
    }
    return 0;
}

/* The Jacobian of a tree whose mass matrix is not formed, one derivative of the accelerations for each direction. */
static int jacobian_by_columns(const eom_at *at, const double *restrict x, double *restrict out)
{
    double *const along = AT(X), *const da = AT(ALONG); /* q, v, dq, dv */
    copy(NX, x, along);
    for (int column = 0; column < NX; column++) {
        set_unit(NX, column, along + NX);
        const int status = EVALUATE(acceleration_tangent, along, da);
        if (status != 0) {
            return status;
        }
        put_column(at, column, NX, along + NX, along + NX + NQ, da, out);
    }
    return 0;
}

int eom_jacobian(const eom_at *at, const double *x, double *out)
{
    if (MODEL->system != NULL && !MODEL->projects) {
        return jacobian_unprojected(at, x, out);
    }
    if (M > 0) {
        return jacobian_of_loops(at, x, out);
    }
    if (MODEL->acceleration_tangent != NULL) {
        return jacobian_by_columns(at, x, out);
    }
    return MODEL->contacts != NULL ? contact_jacobian(at, x, out) : tree_jacobian(at, x, out);
}

/* dF/dy + cj dF/dy' of the differential-algebraic form, one derivative for each unknown; x = [y y' cj]. */
int eom_dae_jacobian(const eom_at *at, const double *x, double *out)
{
    const int n = NX + M + MH;
    double *const along = AT(DAE), *const slope = AT(SLOPE);
    copy(2 * n, x, along);
    fill(2 * n, 0.0, along + 2 * n);
    for (int column = 0; column < n; column++) {
        along[2 * n + column] = 1.0;
        along[3 * n + column] = x[2 * n];
        (void)EVALUATE(dae_tangent, along, slope);
        along[2 * n + column] = along[3 * n + column] = 0.0;
        set_column(n, column, n, slope, out);
    }
    return 0;
}

/* Derivatives of M a + h by [q v a], one evaluation for each direction. */
int eom_inverse_dynamics_derivatives(const eom_at *at, const double *x, double *out)
{
    const int n = NX + N;
    double *const along = AT(TORQUES), *const slope = along + 2 * n;
    copy(n, x, along);
    for (int column = 0; column < n; column++) {
        set_unit(n, column, along + n);
        (void)EVALUATE(inverse_tangent, along, slope);
        set_column(N, column, n, slope, out);
    }
    return 0;
}

/* Of what else may stand in one text with these, as on a GPU. */
#undef EVALUATE
#undef N
#undef NQ
#undef NX
#undef M
#undef MH
#undef R
#undef F
#undef MOVING
#undef AT
