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
