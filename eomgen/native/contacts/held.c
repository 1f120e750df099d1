/* Inertia and constraints at one position. With M = L^T L velocities v are z = L v, whose squares are twice the energy, and forces
   f are L^-T f. Rows of the constraints become orthonormal rows Q of z, so that what obeys them is z - Q^T Q z. */

typedef struct {
    int n, n_c;
    double *L, *Q, *R; /* R: C L^-1 = R^T Q */
} inertia;

/* M = L^T L in place, reciprocals of the pivots on the diagonal; from the last row on, so that zeros between branches of a tree
   stay (Featherstone, 2008, section 6.5). 1 where a pivot is small beside its own diagonal. */
DENSE static int factor_inertia(int n, double *restrict M, double *restrict sizes)
{
    for (int k = 0; k < n; k++) { sizes[k] = M[k*n + k]; }
    for (int k = n - 1; k >= 0; k--) {
        double *restrict const row = M + k*n;
        if (!(row[k] > RIGID_PIVOT*sizes[k]) || !isfinite(row[k])) {
            return 1;
        }
        const double inverse = 1.0/sqrt(row[k]);
        for (int i = 0; i < k; i++) { row[i] *= inverse; }
        row[k] = inverse;
        for (int i = 0; i < k; i++) {
            double *restrict const other = M + i*n;
            const double ratio = row[i];
            for (int j = 0; ratio != 0.0 && j <= i; j++) { other[j] -= ratio*row[j]; }
        }
    }
    return 0;
}

/* L^-T b in place: b has rows of as many columns. */
DENSE static void press(int n, const double *restrict L, int columns, double *restrict b)
{
    for (int k = n - 1; k >= 0; k--) {
        double *restrict const from = b + (ptrdiff_t)k*columns;
        for (int l = 0; l < columns; l++) { from[l] *= L[k*n + k]; }
        for (int i = 0; i < k; i++) {
            double *restrict const to = b + (ptrdiff_t)i*columns;
            const double ratio = L[k*n + i];
            for (int l = 0; ratio != 0.0 && l < columns; l++) { to[l] -= ratio*from[l]; }
        }
    }
}

/* The same of one column. */
DENSE static void press_one(int n, const double *restrict L, double *restrict b)
{
    for (int k = n - 1; k >= 0; k--) {
        const double x = b[k]*L[k*n + k];
        b[k] = x;
        for (int i = 0; x != 0.0 && i < k; i++) { b[i] -= x*L[k*n + i]; }
    }
}

/* v = L^-1 z in place. */
static void release(int n, const double *L, double *z)
{
    for (int i = 0; i < n; i++) { z[i] = (z[i] - dot(i, L + i*n, z))*L[i*n + i]; }
}

/* Orthonormal rows Q from rows of C, R[r][s] what row s has of Q_r; a row that depends on those before is left out. */
static void span_rows(const inertia *at, const double *C, const int *rows)
{
    const int n = at->n, n_c = at->n_c;
    memset(at->R, 0, (size_t)n_c*(size_t)n_c*sizeof(double));
    for (int r = 0; r < n_c; r++) {
        double *const x = at->Q + r*n;
        memcpy(x, C + rows[r]*n, (size_t)n*sizeof(double));
        press_one(n, at->L, x);
        const double before = length_of(n, x);
        for (int k = 0; k < 2*r; k++) { /* twice is enough (Parlett, The Symmetric Eigenvalue Problem, 1980, section 6.9) */
            const int q = k % r;
            const double part = dot(n, at->Q + q*n, x);
            at->R[q*n_c + r] += part;
            for (int i = 0; i < n; i++) { x[i] -= part*at->Q[q*n + i]; }
        }
        const double after = length_of(n, x), inverse = after > RIGID_DEPENDENT*before ? 1.0/after : 0.0;
        at->R[r*n_c + r] = inverse;
        for (int i = 0; i < n; i++) { x[i] *= inverse; }
    }
}

/* z less what the constraints take. */
static void hold(const inertia *at, double *z)
{
    for (int r = 0; r < at->n_c; r++) {
        const double part = dot(at->n, at->Q + r*at->n, z);
        for (int i = 0; i < at->n; i++) { z[i] -= part*at->Q[r*at->n + i]; }
    }
}

/* The same of columns; `parts` has as many numbers. */
DENSE static void hold_columns(int n, int n_c, const double *restrict Q, int columns, double *restrict X, double *restrict parts)
{
    for (int r = 0; r < n_c; r++) {
        for (int l = 0; l < columns; l++) { parts[l] = 0.0; }
        for (int i = 0; i < n; i++) {
            const double q = Q[r*n + i];
            for (int l = 0; q != 0.0 && l < columns; l++) { parts[l] += q*X[(ptrdiff_t)i*columns + l]; }
        }
        for (int i = 0; i < n; i++) {
            const double q = Q[r*n + i];
            for (int l = 0; q != 0.0 && l < columns; l++) { X[(ptrdiff_t)i*columns + l] -= q*parts[l]; }
        }
    }
}

/* The smallest velocities v (as the energy measures) with C v = wanted, of the first `count` rows; wanted is used up. */
static void meet_rows(const inertia *at, int count, double *wanted, double *v)
{
    memset(v, 0, (size_t)at->n*sizeof(double));
    for (int r = 0; r < at->n_c; r++) {
        double y = r < count ? wanted[r] : 0.0;
        for (int q = 0; q < r; q++) { y -= at->R[q*at->n_c + r]*wanted[q]; }
        y *= at->R[r*at->n_c + r];
        wanted[r] = y;
        for (int i = 0; i < at->n; i++) { v[i] += y*at->Q[r*at->n + i]; }
    }
    release(at->n, at->L, v);
}

/* W = X^T X. */
DENSE static void square(int n, int columns, const double *restrict X, double *restrict W)
{
    for (int a = 0; a < columns; a++) {
        double *restrict const row = W + (ptrdiff_t)a*columns;
        for (int l = a; l < columns; l++) { row[l] = 0.0; }
        for (int i = 0; i < n; i++) {
            const double *restrict const from = X + (ptrdiff_t)i*columns;
            const double x = from[a];
            for (int l = a; x != 0.0 && l < columns; l++) { row[l] += x*from[l]; }
        }
    }
    for (int a = 0; a < columns; a++) {
        for (int l = 0; l < a; l++) { W[(ptrdiff_t)a*columns + l] = W[(ptrdiff_t)l*columns + a]; }
    }
}

/* y = x^T X of n rows; the other way to = X y. */
DENSE static void across(int n, int columns, const double *restrict X, const double *restrict x, double *restrict y)
{
    for (int l = 0; l < columns; l++) { y[l] = 0.0; }
    for (int i = 0; i < n; i++) {
        for (int l = 0; x[i] != 0.0 && l < columns; l++) { y[l] += x[i]*X[(ptrdiff_t)i*columns + l]; }
    }
}

static void along(int n, int columns, const double *X, const double *y, double *to)
{
    for (int i = 0; i < n; i++) { to[i] = dot(columns, X + (ptrdiff_t)i*columns, y); }
}
