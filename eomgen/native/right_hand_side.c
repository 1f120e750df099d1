/* The right-hand side of closed loops: by straight-line functions where these are sound, else by pivots; next to a
   singular position, where the constraints lose rank, by a curve on the branch of the motion, through the state and
   beyond that position.

   Beside it, at a smallest singular value s, C is known to eps, hence the position to eps / s, velocities to V eps / s^2
   and accelerations to V^2 eps / s^3: no solution at the state itself knows more, by whatever pivots. The branch runs
   smoothly through, so what is wanted is interpolated from five pairs of its points on either side (J. Stoer, R.
   Bulirsch, Introduction to Numerical Analysis, section 2.1). Their first pair is CROSSINGS_REACH = 0.1 away, where the
   noise of accelerations is 1e-13 to 1e-12 V^2; interpolation errs by (5!)^2 / 10! REACH^10 = 4e-13 of a tenth
   derivative. The points are closed, and the coordinates of their distance in a tangent basis T that stays the same are
   linear in the parameter of the curve: the closed points nearest to a straight line would have a pole near the crossing.
   The result is taken where it is better: the crossing lies near the middle of the points, the interpolated position is
   closed (a mechanism that only comes near a singular position swings round there, and is not), and the differences
   between the results of two to five pairs foretell a smaller error. */

enum { PAIRS = 5 };
#define VALUES (2 * NX)

/* x' of x; leaves the state on the constraints in AT(X). *weakest: as in the partition, 1 where it is surely not small.
   sound: rhs_directly has been evaluated and holds. */
static int rhs_beyond(const eom_at *at, const double *restrict x, double *restrict out, double *restrict weakest,
                      int sound)
{
    if (sound) {
        *weakest = find_weakest(at, AT(X));
        return 0;
    }
    *weakest = 1.0;
    int status = close_loops(at, x);
    if (status == 0 && MODEL->system != NULL) {
        *weakest = find_weakest(at, AT(X));
        status = accelerate_system(at, out + NQ);
    } else if (status == 0) { /* far away, or the preferred coordinates do not move the mechanism well here */
        status = accelerate(at, N + 1, out + NQ);
        *weakest = WEAKEST;
    }
    form_rates(at, AT(X), AT_V, out);
    return status;
}

/* The same from the beginning. */
static int rhs_here(const eom_at *at, const double *restrict x, double *restrict out, double *restrict weakest)
{
    int far = 0;
    const int direct = MODEL->dynamics != NULL && MODEL->system == NULL;
    const int sound = direct && rhs_directly(at, x, out, &far);
    if (sound && far) {
        *weakest = 1.0;
        return 0;
    }
    return rhs_beyond(at, x, out, weakest, sound);
}

/* The nearest q with C(q) = 0, in place. */
static int bring(const eom_at *at, double *restrict q)
{
    int shorter;
    if (MODEL->dynamics != NULL && MODEL->system == NULL && close_directly(at, q, at->w, &shorter) == 0) {
        return 0;
    }
    return close_position(at, q);
}

/* (T^T T)^-1 T^T in the last N columns of AT(INVERSE), from T (N x F) in AT(TANGENT). */
static void invert_tangent(const eom_at *at)
{
    const int width = F + N;
    const double *const T = AT(TANGENT);
    double *const a = AT(INVERSE);
    for (int i = 0; i < F; i++) {
        for (int k = 0; k < F; k++) {
            a[i * width + k] = 0.0;
            for (int j = 0; j < N; j++) {
                a[i * width + k] += T[j * F + i] * T[j * F + k];
            }
        }
        for (int k = 0; k < N; k++) {
            a[i * width + F + k] = T[k * F + i];
        }
    }
    for (int p = 0; p < F; p++) {
        eliminate(F, width, p, p, a);
    }
}

/* Heading y (F) and scaled direction d = T y from the scaled velocities in AT(DIRECTION); 0 where T leaves nothing. */
static int set_heading(const eom_at *at)
{
    double *const d = AT(DIRECTION), *const y = AT(HEADING);
    const double *const T = AT(TANGENT), *const a = AT(INVERSE);
    double size = F > 0 ? 0.0 : 1.0;
    for (int i = 0; i < F; i++) {
        y[i] = 0.0;
        for (int k = 0; k < N; k++) {
            y[i] += a[i * (F + N) + F + k] * d[k];
        }
    }
    for (int k = 0; k < N && F > 0; k++) {
        d[k] = 0.0;
        for (int i = 0; i < F; i++) {
            d[k] += T[k * F + i] * y[i];
        }
        size = fmax(size, fabs(d[k]));
    }
    for (int i = 0; i < F; i++) {
        y[i] /= size;
    }
    for (int k = 0; k < N && F > 0; k++) {
        d[k] /= size;
    }
    return size > CROSSINGS_SLANT;
}

/* q + distance d */
static void step_along(const eom_at *at, double distance, double *restrict p)
{
    double *const step = AT(STEP);
    for (int k = 0; k < N; k++) {
        step[k] = distance * AT(DIRECTION)[k] * AT(SCALES)[k];
    }
    copy(NQ, AT(STATE), p);
    move(at, p, step);
}

/* The same evaluation at another distance along the curve. */
static eom_at at_distance(const eom_at *at, double distance, double time_per_length)
{
    eom_at there = *at;
    there.t = at->t + distance * time_per_length;
    return there;
}

/* Tangent basis, heading and direction, from a first point of the curve for the velocities v; its weakest pivot, or
   0. */
static double set_out(const eom_at *at, double reach, double time_per_length, double speed)
{
    double *const p = AT(POINTS);
    for (int k = 0; k < N; k++) {
        AT(DIRECTION)[k] = AT(STATE)[NQ + k] / AT(SCALES)[k] / speed;
    }
    step_along(at, reach, p);
    const eom_at there = at_distance(at, reach, time_per_length);
    const double weakest = bring(&there, p) == 0 ? find_weakest(&there, p) : 0.0;
    if (weakest == 0.0) {
        return 0.0;
    }
    form_transformation(at, N + 1);
    copy(N * F, AT(B), AT(TANGENT));
    invert_tangent(at);
    return set_heading(at) ? weakest : 0.0;
}

/* Closes the point p, a guess, at a distance along the curve. */
static int find_point(const eom_at *at, double distance, double *restrict p)
{
    double *const away = AT(AWAY), *const dz = away + NQ, *const r = AT(HEADING) + F;
    const double *const a = AT(INVERSE), *const q = AT(STATE), *const T = AT(TANGENT), *const s = AT(SCALES);
    double longest = 0.0;
    for (int step = 0; (double)step < CROSSINGS_ROUNDS; step++) {
        if (bring(at, p) != 0) {
            return 0;
        }
        normalize(at, p);
        for (int k = 0; k < NQ; k++) {
            away[k] = p[k] - q[k];
        }
        find_velocities(at, q, away, dz);
        longest = 0.0;
        for (int i = 0; i < F; i++) {
            r[i] = distance * AT(HEADING)[i];
            for (int k = 0; k < N; k++) {
                r[i] -= a[i * (F + N) + F + k] * dz[k] / s[k];
            }
            longest = fmax(longest, fabs(r[i]));
        }
        if (longest <= CROSSINGS_ARRIVED) {
            return 1;
        }
        for (int k = 0; k < N; k++) {
            dz[k] = 0.0;
            for (int i = 0; i < F; i++) {
                dz[k] += s[k] * T[k * F + i] * r[i];
            }
        }
        move(at, p, dz);
    }
    return longest <= CROSSINGS_ENOUGH && bring(at, p) == 0;
}

/* Both points of the pair at so many reaches by 2 to 5 pairs: interpolation in the middle. */
static const double WEIGHT[4][PAIRS] = {{ 2.0 / 3, -1.0 / 6, 0.0, 0.0, 0.0 },
                                        { 3.0 / 4, -3.0 / 10, 1.0 / 20, 0.0, 0.0 },
                                        { 4.0 / 5, -2.0 / 5, 4.0 / 35, -1.0 / 70, 0.0 },
                                        { 5.0 / 6, -10.0 / 21, 5.0 / 28, -5.0 / 126, 1.0 / 252 }};

/* The next point of a side (0: ahead, 1: behind) of the curve, from those before, or NULL. */
static double *next_point(const eom_at *at, int pair, int side, double reach, double time_per_length)
{
    const double distance = (side ? -reach : reach) * (double)pair;
    const eom_at there = at_distance(at, distance, time_per_length);
    double *const p = AT(POINTS) + (side * PAIRS + pair - 1) * NQ;
    const double *const q = AT(STATE);
    if (pair == 1) {
        step_along(at, distance, p);
    }
    for (int k = 0; k < NQ && pair > 1; k++) {
        const double before = pair > 2 ? p[k - 2 * NQ] : q[k], first = pair > 3 ? p[k - 3 * NQ] : q[k];
        p[k] = pair == 2 ? 2.0 * p[k - NQ] - q[k] : 3.0 * (p[k - NQ] - before) + first;
    }
    return find_point(&there, distance, p) ? p : NULL;
}

/* [q; v] of a point of the curve, in AT(NEXT). */
static double *set_state(const eom_at *at, const double *p)
{
    copy(NQ, p, AT(NEXT));
    copy(N, AT(STATE) + NQ, AT(NEXT) + NQ);
    return AT(NEXT);
}

/* Interpolates [q v x'] into AT(SUMS), by pairs of points up to five reaches away. What it errs by in accelerations,
   infinite if there is no such curve, or the singular position is not near its middle. */
static double interpolate(const eom_at *at, double here, double reach, double time_per_length, double speed)
{
    double *const sums = AT(SUMS), *const x_dot = AT(NEXT) + NX;
    const double *const s = AT(SCALES);
    double around = set_out(at, reach, time_per_length, speed), weakest, total = 0.0, last[3] = {0.0, 0.0, 0.0};
    fill(4 * VALUES, 0.0, sums);
    for (int pair = 1; pair <= PAIRS; pair++) {
        for (int side = 0; side < 2; side++) { /* no curve: around = 0 */
            const eom_at there = at_distance(at, (side ? -reach : reach) * (double)pair, time_per_length);
            const double *const p = around > 0.0 ? next_point(at, pair, side, reach, time_per_length) : NULL;
            if (p == NULL) {
                return HUGE_VAL;
            }
            around += pair == 1 && side == 1 ? find_weakest(&there, p) : 0.0;
            if ((pair == 1 && side == 1 && !(around >= CROSSINGS_MIDDLE * here)) ||
                rhs_here(&there, set_state(at, p), x_dot, &weakest) != 0) {
                return HUGE_VAL;
            }
            for (int n = 0; n < 4; n++) {
                for (int k = 0; k < VALUES; k++) {
                    sums[n * VALUES + k] += WEIGHT[n][pair - 1] * (k < NX ? AT(X)[k] : x_dot[k - NX]);
                }
            }
        }
    }
    const double *const q = sums + 3 * VALUES;
    evaluate_position(at, q);
    if (!is_within(at, CROSSINGS_CLOSED, ROUNDING_ROUNDED, q)) { /* the branch does not run through */
        return HUGE_VAL;
    }
    for (int k = NQ; k < VALUES; k++) {
        const int rate = k - NX - NQ; /* accelerations; velocities, by what they change in unit distance */
        const double unit = rate >= 0 ? s[rate] : k < NX ? s[k - NQ] / speed : HUGE_VAL;
        total += q[k];
        for (int n = 0; n < 3; n++) {
            last[n] = fmax(last[n], fabs(q[k - n * VALUES] - q[k - (n + 1) * VALUES]) / unit);
        }
    }
    /* differences fall by this factor at least; one alone may be small by chance */
    const double factor = fmin(1.0, fmax(last[0] / last[1], last[1] / last[2]));
    const double error = fmax(last[0] * factor, last[1] * factor * factor);
    return !isfinite(total) ? HUGE_VAL : last[0] > 0.0 ? error : 0.0;
}

/* The best interpolation of [q v x'] at the state x, to AT(BEST); its reach, 0 where none is better than the solution
   at x itself; whether time goes on along the curve, and how fast the state moves (scaled). */
static double interpolate_best(const eom_at *at, const double *restrict x, double here,
                               double *restrict time_per_length, double *restrict speed)
{
    double *const state = AT(STATE);
    double least = HUGE_VAL, best = 0.0;
    *time_per_length = *speed = 0.0;
    (void)EVALUATE(rate, x, AT(RATE));
    for (int i = 0; i < M; i++) {
        *time_per_length = AT(RATE)[i] != 0.0 ? 1.0 : *time_per_length;
    }
    copy(NX, x, state);
    for (int k = 0; k < MOVING; k++) {
        *speed = fmax(*speed, fabs(x[NQ + k] / AT(SCALES)[k]));
    }
    normalize(at, state);
    if (!(*speed > CROSSINGS_STILL)) {
        return 0.0;
    }
    *time_per_length /= *speed;
    const double square = *speed * *speed, lost = fmax(here, CROSSINGS_WEAKEST);
    for (double reach = CROSSINGS_REACH; reach >= CROSSINGS_SHORTEST; reach *= 0.5) {
        if (least <= CROSSINGS_GOOD * square) {
            break;
        }
        const double error = interpolate(at, here, reach, *time_per_length, *speed);
        if (error < least) {
            least = error, best = reach;
            copy(VALUES, AT(SUMS) + 3 * VALUES, AT(BEST));
        }
    }
    return least * lost * lost * lost <= CROSSINGS_NOISE * square ? best : 0.0;
}

/* x' next to a singular position, from states on both sides of it if they are more exact; status and x' at the state
   itself are known, and come back else. */
static int interpolate_rhs(const eom_at *at, const double *restrict x, double weakest, int status, double *restrict out)
{
    double *const best = AT(BEST), *const kept = AT(KEPT);
    if (!(weakest < CROSSINGS_NEAR) || (status != 0 && status != EOMGEN_PARTITION_BAD && status != EOMGEN_UNSOLVED)) {
        return status;
    }
    copy(NX, AT(X), kept);
    double time_per_length, speed;
    if (!(interpolate_best(at, x, weakest, &time_per_length, &speed) > 0.0)) {
        copy(NX, kept, AT(X));
        return status_near(status, weakest);
    }
    copy(NX, best, AT(X));
    copy(NX, best + NX, out);
    normalize(at, AT(X));
    return 0;
}

/* x', and beside a singular position what the curve says. */
static int rhs_of_loops(const eom_at *at, const double *restrict x, double *restrict out, int begun, int sound)
{
    double weakest;
    const int status = begun ? rhs_beyond(at, x, out, &weakest, sound) : rhs_here(at, x, out, &weakest);
    return MODEL->singular ? interpolate_rhs(at, x, weakest, status, out) : status_near(status, weakest);
}

int eom_finish_rhs(const eom_at *at, const double *x, double *out, int sound)
{
    return rhs_of_loops(at, x, out, 1, sound);
}

/* How near the state x on the constraints is to a singular position: the weakest pivot, 1 where the straight-line
   code, whose work grows with the bodies alone, says that none can be near. */
static double nearness(const eom_at *at, const double *restrict x)
{
    const double *const dynamics = AT(DYNAMICS);
    if (MODEL->dynamics != NULL && accelerate_directly(at, x, 1) == 0 && dynamics[2 * N + 1] != 0.0) {
        return 1.0;
    }
    return find_weakest(at, x);
}

int eom_project(const eom_at *at, const double *x, double *out)
{
    if (is_closed(at, x)) {
        copy(NX, x, out);
        normalize(at, out);
        return 0;
    }
    const int status = close_loops(at, x);
    normalize(at, AT(X));
    if (status == 0 && MODEL->project_singular) {
        (void)interpolate_rhs(at, AT(X), nearness(at, AT(X)), 0, AT(RATED));
    }
    copy(NX, AT(X), out);
    return status;
}

/* Trees: the mass matrix factored over the paths to ground, and the public functions of trees and loops. */

#define PARENT (MODEL->parent)

/* M = L^T D L in place, packed lower triangle, of the first n velocities: L[i, j] only where j is on i's path to ground
   (R. Featherstone, Rigid Body Dynamics Algorithms, 2008, section 6.5). Status 2 where a pivot is lost in the
   rounding of its own entry, or is what rounding leaves of a zero. */
static int tree_factor(const eom_at *at, int n, double *restrict H)
{
    const double *const s = AT(SCALES);
    double largest = 0.0, *const sizes = AT(DIAGONAL);
    for (int k = 0; k < n; k++) {
        sizes[k] = fabs(H[k * (k + 1) / 2 + k]);
        const double entry = sizes[k] * s[k] * s[k];
        largest = entry > largest ? entry : largest;
    }
    for (int k = n - 1; k >= 0; k--) {
        double *const row = H + k * (k + 1) / 2;
        const int lost = row[k] <= INERTIA_SINGULAR * sizes[k] || row[k] * s[k] * s[k] <= INERTIA_NOTHING * largest;
        if (MODEL->indefinite ? fabs(row[k]) <= INERTIA_FAINT * sizes[k] : lost) { /* NaN shows in the result */
            return EOMGEN_SINGULAR_MASS_MATRIX;
        }
        for (int i = PARENT[k]; i >= 0; i = PARENT[i]) {
            double *const above = H + i * (i + 1) / 2;
            const double ratio = row[i] / row[k];
            sizes[i] += MODEL->indefinite ? fabs(ratio * row[i]) : 0.0;
            for (int j = i; j >= 0; j = PARENT[j]) {
                above[j] -= ratio * row[j];
            }
            row[i] = ratio;
        }
    }
    return 0;
}

/* b = M^-1 b */
static void tree_solve(const eom_at *at, int n, const double *restrict H, double *restrict b)
{
    (void)at;
    for (int i = n - 1; i >= 0; i--) {
        for (int j = PARENT[i]; j >= 0; j = PARENT[j]) {
            b[j] -= H[i * (i + 1) / 2 + j] * b[i];
        }
    }
    for (int i = 0; i < n; i++) {
        b[i] /= H[i * (i + 1) / 2 + i];
        for (int j = PARENT[i]; j >= 0; j = PARENT[j]) {
            b[i] -= H[i * (i + 1) / 2 + j] * b[j];
        }
    }
}

/* Accelerations of x = [q; v]; leaves the factor of M in AT(TERMS) and [q v a] in AT(X). contacts: with states of
   contacts, whose inertia is 1 and which are not in the factor. */
static int tree_accelerate(const eom_at *at, const double *restrict x, int contacts)
{
    const int n = contacts ? MOVING : N;
    const double *const bias = AT(TERMS) + n * (n + 1) / 2;
    double *const a = AT_ACC;
    (void)EVALUATE(scales, x, AT(SCALES));
    (void)(contacts ? EVALUATE(contact_terms, x, AT(TERMS)) : evaluate_terms(at, x, AT(TERMS)));
    copy(NX, x, AT(X));
    for (int k = 0; k < N; k++) {
        a[k] = -bias[k];
    }
    const int status = tree_factor(at, n, AT(TERMS));
    if (status == 0) {
        tree_solve(at, n, AT(TERMS), a);
    }
    return status;
}

/* Accelerations of x = [q; v] by the linear system, without projection. */
static int accelerate_unprojected(const eom_at *at, const double *restrict x, double *restrict a)
{
    copy(NX, x, AT(X));
    return accelerate_system(at, a);
}

int eom_rhs(const eom_at *at, const double *x, double *out)
{
    if (MODEL->system != NULL && !(M > 0 && MODEL->projects)) {
        form_rates(at, x, x + NQ, out);
        return accelerate_unprojected(at, x, out + NQ);
    }
    if (M > 0) {
        return rhs_of_loops(at, x, out, 0, 0);
    }
    const int status = tree_accelerate(at, x, 0);
    form_rates(at, x, x + NQ, out);
    copy(N, AT_ACC, out + NQ);
    return status;
}

int eom_outputs(const eom_at *at, const double *x, double *out)
{
    int status;
    if (M == 0) {
        status = MODEL->system != NULL ? accelerate_unprojected(at, x, AT_ACC) : tree_accelerate(at, x, 0);
    } else if (MODEL->singular && MODEL->outputs_accelerate) {
        status = rhs_of_loops(at, x, AT(RATED), 0, 0);
        copy(N, AT(RATED) + NQ, AT_ACC);
    } else {
        status = close_loops(at, x);
        if (status == 0 && MODEL->outputs_accelerate) {
            status = MODEL->system != NULL ? accelerate_system(at, AT_ACC) : accelerate(at, N + 1, AT_ACC);
        }
    }
    return status != 0 ? status : EVALUATE(accelerated_outputs, AT(X), out);
}
