/* Projection onto the constraints. Scaled quantities: q / s_q, C / s_c, J = diag(1/s_c) C_q diag(s_q).

   The correction is the minimum-norm Newton step -J^T (J J^T)^-1 e, which depends on no partition of the coordinates, so
   that one that goes bad at a dead centre costs no digits. A term in J J^T, relative to its largest diagonal entry,
   carries redundant rows and positions where the rank drops. In position steps it is as large as the mean residual: rows
   that depend on each other on the manifold only gain a false rank off it, of the size of the distance, whose Newton
   step would run along the motion.

   Velocities and accelerations take passes with the factor of J J^T + term, the rest taken in the rows themselves, so
   that its squared conditioning costs no digits: of a part along a singular value s, relative to the largest, each
   leaves term / (s^2 + term). What is left after a few lies along the weak rows that it points out, and the term is
   lowered below their s^2, unless the rest is nothing but rounding (P. C. Hansen, Rank-Deficient and Discrete Ill-Posed
   Problems, 1998, 7.2: stop at the noise). The position is known to eps / s along weak rows, since C is known to eps. J
   turns with it, so C_q v is known to V eps / s and gamma, with the square of v, to V^2 eps / s^2. A smaller rest tells
   nothing: taking it for true would divide it by s once more. A mechanism that nearly changes its mode swings round with
   gamma of the size V^2, and has its rest taken down to s = 1e-6; one that passes through the change point has gamma of
   the size s V^2 and is left to go straight on within s = 1e-5, where only noise would turn it. V is that of the loop:
   rocker and coupler of another one that turn a thousand times as fast are no noise here. */

static void form_scaled(const eom_at *at, const double *restrict C_q)
{
    const double *const s = AT(SCALES);
    double *const J = AT(J);
    for (int i = 0; i < M; i++) {
        for (int k = 0; k < N; k++) {
            J[i * N + k] = C_q[i * N + k] * s[k] / s[N + i];
        }
    }
}

/* C and C_q at q, and J. */
static void evaluate_position(const eom_at *at, const double *q)
{
    (void)EVALUATE(position, q, AT(POSITION));
    form_scaled(at, AT(POSITION) + MH);
}

/* The coordinate whose rate is velocity k; 0 if there is none. */
static double coordinate_of(const eom_at *at, const double *q, int k)
{
    (void)at;
    return MODEL->rates == NULL && COORDINATE[k] >= 0 ? q[COORDINATE[k]] : 0.0;
}

/* The change of q' where q and v of x change by dq and dv; by functions of the model that of the areas of x, dq and
   dv. */
static void change_rates(const eom_at *at, const double *restrict x, const double *restrict dq,
                         const double *restrict dv, double *restrict change)
{
    if (MODEL->rates != NULL) {
        (void)EVALUATE(rates_along, AT(X), change);
        return;
    }
    form_rates(at, x, dv, change);
    for (int b = 0; b < QUATERNIONS; b++) {
        turn(dq + QUATERNION[b][0], x + NQ + QUATERNION[b][1], 1.0, change + QUATERNION[b][0]);
    }
}

/* The velocities of a change of q, but for what changes the length of Euler parameters. Where q' is a function of the
   model none stands for it: form_normal has what it changes of C, from where the step back follows. */
static void find_velocities(const eom_at *at, const double *restrict q, const double *restrict dq, double *restrict d)
{
    for (int k = 0; k < N; k++) {
        d[k] = coordinate_of(at, dq, k);
    }
    for (int b = 0; b < QUATERNIONS && MODEL->rates == NULL; b++) {
        const double *const e = q + QUATERNION[b][0], *const de = dq + QUATERNION[b][0];
        double *const omega = d + QUATERNION[b][1];
        const double scale = 2.0 / (e[0] * e[0] + e[1] * e[1] + e[2] * e[2] + e[3] * e[3]);
        omega[0] = scale * (e[0] * de[1] - e[1] * de[0] + e[3] * de[2] - e[2] * de[3]);
        omega[1] = scale * (e[0] * de[2] - e[2] * de[0] + e[1] * de[3] - e[3] * de[1]);
        omega[2] = scale * (e[0] * de[3] - e[3] * de[0] + e[2] * de[1] - e[1] * de[2]);
    }
}

/* Replaces a change dq by that of the velocities d; the change of the length of Euler parameters stays. */
static void spread(const eom_at *at, const double *restrict q, const double *restrict d, double *restrict dq)
{
    double *const change = AT(RATES);
    if (MODEL->rates != NULL) {
        add_moved(at, q, d, dq);
        return;
    }
    form_rates(at, q, d, change);
    for (int b = 0; b < QUATERNIONS; b++) {
        const double *const e = q + QUATERNION[b][0], *const de = dq + QUATERNION[b][0];
        const double stretch = (e[0] * de[0] + e[1] * de[1] + e[2] * de[2] + e[3] * de[3])
                               / (e[0] * e[0] + e[1] * e[1] + e[2] * e[2] + e[3] * e[3]);
        for (int i = 0; i < 4; i++) {
            change[QUATERNION[b][0] + i] += stretch * e[i];
        }
    }
    copy(NQ, change, dq);
}

/* Euler parameters of length 1. */
static void normalize(const eom_at *at, double *restrict q)
{
    (void)at;
    for (int b = 0; b < QUATERNIONS && MODEL->rates == NULL; b++) {
        double *const e = q + QUATERNION[b][0];
        const double length = sqrt(e[0] * e[0] + e[1] * e[1] + e[2] * e[2] + e[3] * e[3]);
        for (int i = 0; i < 4; i++) {
            e[i] /= length;
        }
    }
}

/* The largest |C / s_c|; NaN if an entry is NaN. */
static double largest_residual(const eom_at *at)
{
    const double *const C = AT(POSITION), *const s = AT(SCALES);
    double largest = 0.0;
    for (int i = 0; i < MH; i++) {
        const double size = fabs(C[i] / s[N + i]);
        if (!(size <= largest)) {
            largest = size;
        }
        if (!isfinite(size)) {
            return (double)NAN;
        }
    }
    return largest;
}

/* Whether each |C / s_c| is within the limit, or within what rounding of q leaves of it: that part of |J| |q / s_q|. */
static int is_within(const eom_at *at, double limit, double roundings, const double *restrict q)
{
    const double *const C = AT(POSITION), *const J = AT(J), *const s = AT(SCALES);
    for (int i = 0; i < MH; i++) {
        double rounded = 0.0;
        for (int k = 0; k < N; k++) {
            rounded += fabs(J[i * N + k] * coordinate_of(at, q, k)) / s[k];
        }
        if (!(fabs(C[i] / s[N + i]) <= fmax(limit, roundings * rounded))) {
            return 0;
        }
    }
    return 1;
}

/* Newton has arrived, at rounding or within CONVERGED and no longer getting closer; one step at least is always made,
   because near configurations where rows depend on each other a small residual is not a small distance. */
static int has_converged(const eom_at *at, int step, double size, double before, const double *restrict q)
{
    return size == 0.0 || (step > 0 && (size <= CONSTRAINTS_EXACT
        || (size > 0.5 * before && is_within(at, CONSTRAINTS_CONVERGED, ROUNDING_ROUNDED, q))));
}

/* The mean of |C / s_c|. */
static double mean_residual(const eom_at *at)
{
    const double *const C = AT(POSITION), *const s = AT(SCALES);
    double total = 0.0;
    for (int i = 0; i < MH; i++) {
        total += fabs(C[i] / s[N + i]);
    }
    return MH > 0 ? total / (double)MH : 0.0;
}

/* What linear theory leaves of the scaled residual after the step -dz. */
static double largest_left(const eom_at *at, const double *restrict dz)
{
    const double *const C = AT(POSITION), *const J = AT(J), *const s = AT(SCALES);
    double largest = 0.0;
    for (int i = 0; i < MH; i++) {
        double left = C[i] / s[N + i];
        for (int k = 0; k < N; k++) {
            left -= J[i * N + k] * dz[k];
        }
        largest = fabs(left) > largest ? fabs(left) : largest;
    }
    return largest;
}

/* The square of the singular value of J along z, relative to the square of the largest row of J. */
static double weakness(const eom_at *at, int rows, const double *restrict z, double *restrict largest)
{
    const double *const J = AT(J);
    double through = 0.0, along = 0.0;
    *largest = 0.0;
    for (int k = 0; k < N; k++) {
        double d = 0.0;
        for (int i = 0; i < rows; i++) {
            d += J[i * N + k] * z[i];
        }
        through += d * d;
    }
    for (int i = 0; i < rows; i++) {
        double size = 0.0;
        for (int k = 0; k < N; k++) {
            size += J[i * N + k] * J[i * N + k];
        }
        along += z[i] * z[i];
        *largest = fmax(*largest, size);
    }
    return along * *largest > 0.0 ? through / (along * *largest) : 1.0;
}

/* The noise of each row: EXACT times a power, 1 or 2, of the largest scaled velocity that it knows, and of r if not
   NULL. */
static void find_noise(const eom_at *at, const double *restrict v, const double *restrict r, int order)
{
    double *const noise = AT(NOISE);
    for (int i = 0; i < M; i++) {
        double fastest = r == NULL ? 0.0 : fabs(r[i]);
        for (int k = MODEL->row_start[i]; k < MODEL->row_start[i + 1]; k++) {
            fastest = fmax(fastest, fabs(v[MODEL->row_velocity[k]]));
        }
        noise[i] = CONSTRAINTS_EXACT * (order == 2 ? fastest * fastest : fastest);
    }
}

/* The root mean square of the noise of rows over a combination z of them. */
static double noise_along(const eom_at *at, int rows, const double *restrict z)
{
    const double *const noise = AT(NOISE);
    double total = 0.0, squares = 0.0;
    for (int i = 0; i < rows; i++) {
        squares += z[i] * z[i];
        total += z[i] * z[i] * (noise[i] / CONSTRAINTS_EXACT) * (noise[i] / CONSTRAINTS_EXACT);
    }
    return squares > 0.0 ? CONSTRAINTS_EXACT * sqrt(total / squares) : HUGE_VAL;
}

/* The nearest x with J x + r = 0, in the first rows of J, by passes x -= J^T G^-1 (J x + r). Where weak rows keep
   something, the term in G is lowered below them, unless it is rounding: noise / s^order along a singular value s,
   with noise = EXACT V^order of the velocities V that a row knows. Leaves G as it
   was, with the term CONSTRAINTS_GENTLE. */
static int correct_linear(const eom_at *at, int rows, double *restrict G, const double *restrict r,
                          double *restrict x, int order)
{
    const int n = N;
    const double *const restrict J = AT(J);
    double *const e = AT(E), *const z = e + M, relative = CONSTRAINTS_GENTLE, before = HUGE_VAL;
    int status = 0;
    for (int pass = 0; pass < 50 && status == 0; pass++) {
        double longest = 0.0, square = 0.0, size;
        int left = 0;
        for (int i = 0; i < rows; i++) {
            double total = fabs(r[i]);
            e[i] = r[i];
            for (int k = 0; k < n; k++) {
                const double term = J[i * n + k] * x[k];
                e[i] += term;
                total += fabs(term);
            }
            if (!isfinite(total)) { /* or it would pass for rounding */
                return EOMGEN_NON_FINITE;
            }
            left = left || fabs(e[i]) > ROUNDING_SUMMED * total;
            longest = fabs(e[i]) > longest ? fabs(e[i]) : longest;
            square += e[i] * e[i];
            z[i] = e[i];
        }
        if (!left) {
            break;
        }
        cholesky_solve(rows, M, G, z);
        if (longest > CONSTRAINTS_FAST * before) {
            const double weak = weakness(at, rows, z, &size);
            if (!(sqrt(square) * (order == 2 ? weak : sqrt(weak)) > noise_along(at, rows, z) * sqrt(size))) {
                break;
            }
            if (relative > CONSTRAINTS_TIKHONOV) {
                relative = fmax(CONSTRAINTS_TIKHONOV, fmin(0.1 * relative, CONSTRAINTS_BELOW * weak));
                status = factor_gram(rows, N, M, J, relative, G);
                copy(rows, e, z);
                cholesky_solve(rows, M, G, z);
            } else if (longest > 0.5 * before) {
                break;
            }
        }
        for (int i = 0; i < rows; i++) {
            for (int k = 0; k < n; k++) {
                x[k] -= J[i * n + k] * z[i];
            }
        }
        before = longest;
    }
    if (relative < CONSTRAINTS_GENTLE && status == 0) {
        status = factor_gram(rows, N, M, J, CONSTRAINTS_GENTLE, G);
    }
    return status;
}

/* The nearest x with J x + r = 0, of derivatives by some coordinate, input or parameter. */
static int correct_change(const eom_at *at, int rows, double *restrict G, const double *restrict r, double *restrict x)
{
    fill(rows, CONSTRAINTS_EXACT * fmax(longest_of(x, N), longest_of(r, rows)), AT(NOISE));
    return correct_linear(at, rows, G, r, x, 1);
}

/* dC/dq of the holonomic rows at q, scaled as residuals, and the factor of its products: for what no velocity
   changes, as the length of Euler parameters of which e^T e - 1 stands as a constraint. */
static int form_normal(const eom_at *at, const double *restrict q)
{
    double *const rows = AT(GRADIENT);
    (void)EVALUATE(coordinate_slopes, q, rows);
    for (int i = 0; i < MH; i++) {
        for (int k = 0; k < NQ; k++) {
            rows[i * NQ + k] /= AT(SCALES)[N + i];
        }
    }
    return factor_gram(MH, NQ, M, rows, CONSTRAINTS_TIKHONOV, AT(NORMAL));
}

/* change -= the least one of q that changes the scaled residual by r + J d, which the best velocities d leave of r. The
   d of correct_change ends where something is left, of the size of its term. */
static void add_left(const eom_at *at, const double *restrict G, const double *restrict r, double *restrict d,
                     double *restrict change)
{
    const double *const J = AT(J);
    double *const e = AT(E);
    for (int pass = 0; pass < 3; pass++) {
        for (int i = 0; i < MH; i++) {
            e[i] = r[i];
            for (int k = 0; k < N; k++) {
                e[i] += J[i * N + k] * d[k];
            }
        }
        cholesky_solve(MH, M, pass < 2 ? G : AT(NORMAL), e);
        for (int i = 0; i < MH; i++) {
            for (int k = 0; k < N && pass < 2; k++) {
                d[k] -= J[i * N + k] * e[i];
            }
            for (int k = 0; k < NQ && pass == 2; k++) {
                change[k] -= AT(GRADIENT)[i * NQ + k] * e[i];
            }
        }
    }
}

/* Moves q towards the constraints by what no velocity changes, at C and J in the work memory. */
static int mend(const eom_at *at, double *restrict q)
{
    double *const change = AT(MENDED), *const r = change + NQ, *const d = r + M;
    fill(NQ, 0.0, change);
    fill(N, 0.0, d);
    for (int i = 0; i < MH; i++) {
        r[i] = -AT(POSITION)[i] / AT(SCALES)[N + i];
    }
    int status = factor_gram(MH, N, M, AT(J), CONSTRAINTS_GENTLE, AT(G));
    status = status == 0 ? correct_change(at, MH, AT(G), r, d) : status;
    status = status == 0 ? form_normal(at, q) : status;
    if (status == 0) {
        add_left(at, AT(G), r, d, change);
        const double part = damping(change, NQ);
        for (int k = 0; k < NQ; k++) {
            q[k] -= part * change[k];
        }
    }
    return status;
}

/* Newton's step dz back, by the factor of G; what linear theory leaves of the residual. */
static double step_back(const eom_at *at)
{
    const double *const s = AT(SCALES), *const C = AT(POSITION), *const J = AT(J);
    double *const e = AT(E), *const dz = AT(STEP);
    for (int i = 0; i < MH; i++) {
        e[i] = C[i] / s[N + i];
    }
    cholesky_solve(MH, M, AT(G), e);
    for (int k = 0; k < N; k++) {
        dz[k] = 0.0;
        for (int i = 0; i < MH; i++) {
            dz[k] += J[i * N + k] * e[i];
        }
    }
    return largest_left(at, dz);
}

/* The nearest q with C(q) = 0, in place; leaves C and C_q, J and the factor of G there. */
static int close_position(const eom_at *at, double *restrict q)
{
    const double *const s = AT(SCALES);
    double *const dz = AT(STEP), *const G = AT(G);
    double before = 0.0;
    int last = 0;
    for (int step = 0; step <= 25; step++) {
        (void)EVALUATE(position, q, AT(POSITION));
        const double size = largest_residual(at);
        if (!isfinite(size)) {
            return EOMGEN_NON_FINITE;
        }
        form_scaled(at, AT(POSITION) + MH);
        /* the term follows the residual: rows that depend on each other on the manifold only would point along it */
        const int status = factor_gram(MH, N, M, AT(J), fmax(CONSTRAINTS_GENTLE, mean_residual(at)), G);
        if (status != 0 || last || has_converged(at, step, size, before, q)) {
            return status;
        }
        if (step == 25) {
            return is_within(at, CONSTRAINTS_ACCEPTED, ROUNDING_ROUNDED, q) ? 0 : EOMGEN_PROJECTION_FAILED;
        }
        double left = step_back(at);
        /* along weak rows, where the term keeps it */
        if (left > CONSTRAINTS_HINDERED * size && !is_within(at, CONSTRAINTS_EXACT, ROUNDING_SUMMED, q)) {
            double row;
            const double weak = weakness(at, MH, AT(E), &row);
            if (size < CONSTRAINTS_NEAR * weak) { /* the step is far shorter than the way to lost rank */
                (void)factor_gram(MH, N, M, AT(J), fmax(CONSTRAINTS_TIKHONOV, CONSTRAINTS_BELOW * weak), G);
                left = step_back(at);
            }
        }
        const double part = damping(dz, N);
        last = arrives(longest_of(dz, N), left);
        if (MODEL->coordinate_slopes != NULL && left > CONSTRAINTS_HINDERED * size) {
            const int mended = mend(at, q);
            if (mended != 0) {
                return mended;
            }
        }
        for (int k = 0; k < N; k++) {
            dz[k] *= -s[k] * part;
        }
        move(at, q, dz);
        before = size;
    }
    return EOMGEN_PROJECTION_FAILED;
}

/* Brings x = [q; v] onto the constraints, position level first; result in AT(X). */
static int close_loops(const eom_at *at, const double *restrict x)
{
    double *const q = AT(X), *const v = AT_V, *const r = AT(RATE), *const s = AT(SCALES);
    (void)EVALUATE(scales, x, s);
    copy(NX, x, q);
    int status = close_position(at, q);
    if (status == 0 && MH < M) { /* nonholonomic rows join here */
        status = factor_gram(M, N, M, AT(J), CONSTRAINTS_GENTLE, AT(G));
    }
    if (status != 0) {
        return status;
    }
    (void)EVALUATE(rate, q, r);
    divide(M, s + N, r);
    divide(N, s, v);
    find_noise(at, v, r, 1);
    status = correct_linear(at, M, AT(G), r, v, 1);
    multiply(N, s, v);
    return status;
}

/* Whether x = [q; v] is on the constraints to rounding, at both levels; it then stays as it is, to the last bit. Of n
   terms each is rounded, and the roundings add up as the root of n. */
static int is_closed(const eom_at *at, const double *restrict x)
{
    double *const s = AT(SCALES), *const C = AT(POSITION), *const r = AT(RATE);
    (void)EVALUATE(scales, x, s);
    (void)EVALUATE(position, x, C);
    (void)EVALUATE(rate, x, r);
    double fastest = 1.0, left = 0.0, placed = 0.0, moved = 0.0;
    for (int k = 0; k < MOVING; k++) {
        fastest = fmax(fastest, fabs(x[NQ + k] / s[k]));
    }
    for (int i = 0; i < M; i++) {
        double rate = r[i], position = 0.0, motion = fabs(r[i]);
        for (int k = 0; k < N; k++) {
            const double entry = C[MH + i * N + k], part = entry * x[NQ + k];
            rate += part;
            motion += fabs(part);
            position += i < MH ? fabs(entry * coordinate_of(at, x, k)) : 0.0;
        }
        left = fmax(left, fabs(rate / s[N + i]));
        moved = fmax(moved, motion / s[N + i]);
        placed = fmax(placed, position / s[N + i]);
    }
    const double rounding = ROUNDING_EPS * sqrt((double)N);
    return largest_residual(at) <= fmax(CONSTRAINTS_EXACT, rounding * placed)
        && left <= fmax(CONSTRAINTS_EXACT * fastest, rounding * moved);
}
