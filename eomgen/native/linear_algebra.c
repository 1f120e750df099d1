/* Solvers of equations of motion (eomgen_solvers.h): dense linear algebra, row-major, and the sparse linear system K z = r of
   methods whose accelerations and multipliers follow together. */
#include <math.h>
#include <stddef.h>
#include "eomgen_straight.h"

#define M (MODEL->n_c)
#define MH (MODEL->n_h)
#define R (MODEL->rank)
#define F (MODEL->n_dof)
#define MOVING (MODEL->n_moving)
#define NX (NQ + N)

static void copy(int n, const double *restrict from, double *restrict to)
{
    for (int k = 0; k < n; k++) {
        to[k] = from[k];
    }
}

static void fill(int n, double value, double *to)
{
    for (int k = 0; k < n; k++) {
        to[k] = value;
    }
}

/* The unit vector of entry k. */
static void set_unit(int n, int k, double *to)
{
    for (int i = 0; i < n; i++) {
        to[i] = i == k ? 1.0 : 0.0;
    }
}

/* Column `column` of the first rows of a matrix. */
static void set_column(int rows, int column, int columns, const double *restrict from, double *restrict to)
{
    for (int i = 0; i < rows; i++) {
        to[i * columns + column] = from[i];
    }
}

/* x * s */
static void multiply(int n, const double *restrict s, double *restrict x)
{
    for (int k = 0; k < n; k++) {
        x[k] *= s[k];
    }
}

/* x / s */
static void divide(int n, const double *restrict s, double *restrict x)
{
    for (int k = 0; k < n; k++) {
        x[k] /= s[k];
    }
}

/* y += a x */
static void multiply_add(int rows, int columns, const double *restrict a, const double *restrict x, double *restrict y)
{
    for (int i = 0; i < rows; i++) {
        for (int k = 0; k < columns; k++) {
            y[i] += a[i * columns + k] * x[k];
        }
    }
}

/* G = L L^T in place, lower triangle of the first `rows` rows of the m x m matrix; status 3 where a pivot is not above
   the least. */
static int cholesky(int rows, int m, double least, double *restrict g)
{
    for (int j = 0; j < rows; j++) {
        double d = g[j * m + j];
        for (int k = 0; k < j; k++) {
            d -= g[j * m + k] * g[j * m + k];
        }
        if (!(d > least)) {
            return isnan(d) ? EOMGEN_NON_FINITE : EOMGEN_PROJECTION_FAILED;
        }
        d = sqrt(d);
        g[j * m + j] = d;
        for (int i = j + 1; i < rows; i++) {
            double s = g[i * m + j];
            for (int k = 0; k < j; k++) {
                s -= g[i * m + k] * g[j * m + k];
            }
            g[i * m + j] = s / d;
        }
    }
    return 0;
}

/* b = G^-1 b */
static void cholesky_solve(int rows, int m, const double *restrict g, double *restrict b)
{
    for (int i = 0; i < rows; i++) {
        double s = b[i];
        for (int k = 0; k < i; k++) {
            s -= g[i * m + k] * b[k];
        }
        b[i] = s / g[i * m + i];
    }
    for (int i = rows - 1; i >= 0; i--) {
        double s = b[i];
        for (int k = i + 1; k < rows; k++) {
            s -= g[k * m + i] * b[k];
        }
        b[i] = s / g[i * m + i];
    }
}

/* G = J J^T + relative max(diag) I of the first rows of J (n columns), factored; rows that are all zero to rounding
   ask for no step. */
static int factor_gram(int rows, int n, int m, const double *restrict J, double relative, double *restrict G)
{
    double largest = 0.0;
    for (int i = 0; i < rows; i++) {
        for (int j = 0; j <= i; j++) {
            double sum = 0.0;
            for (int k = 0; k < n; k++) {
                sum += J[i * n + k] * J[j * n + k];
            }
            G[i * m + j] = sum;
        }
        largest = G[i * m + i] > largest ? G[i * m + i] : largest;
    }
    for (int i = 0; i < rows; i++) {
        G[i * m + i] += largest > CONSTRAINTS_UNMOVED * CONSTRAINTS_UNMOVED ? relative * largest : 1.0;
    }
    return cholesky(rows, m, 0.0, G);
}

/* b = A^-1 b with A = L D L^T of f rows. */
static void ldl_solve(int f, const double *restrict a, double *restrict b)
{
    for (int i = 0; i < f; i++) {
        for (int k = 0; k < i; k++) {
            b[i] -= a[i * f + k] * b[k];
        }
    }
    for (int i = f - 1; i >= 0; i--) {
        b[i] /= a[i * f + i];
        for (int k = i + 1; k < f; k++) {
            b[i] -= a[k * f + i] * b[k];
        }
    }
}

/* Gauss-Jordan elimination of row `row` by column `column`. */
static void eliminate(int rows, int width, int row, int column, double *restrict a)
{
    const double pivot = a[row * width + column];
    for (int k = 0; k < width; k++) {
        a[row * width + k] /= pivot;
    }
    for (int i = 0; i < rows; i++) {
        const double factor = a[i * width + column];
        if (i == row || factor == 0.0) {
            continue;
        }
        for (int k = 0; k < width; k++) {
            a[i * width + k] -= factor * a[row * width + k];
        }
    }
}

#define NZ (MODEL->n_unknowns)
#define PLACES (MODEL->n_places)
#define PLACE (MODEL->place)
#define RELAXED (MODEL->n_relaxed)
#define RELAX (MODEL->relax)

/* Scales of rows and columns that bring the entries of K to about 1, from the units of both on (D. Ruiz, A scaling
   algorithm to equilibrate both rows and columns norms in matrices, RAL-TR-2001-034). Those of constraints get one
   common factor beside their units, since a redundant constraint may have no entries but rounding. */
static void balance_system(const eom_at *at)
{
    const double *const K = AT(SYSTEM), *const sizes = K + PLACES + NZ;
    double *const largest = AT(DEFECT), *const row = AT(ROW), *const column = AT(COLUMN);
    int calm = 0;
    for (int i = 0; i < NZ; i++) {
        row[i] = 1.0 / sizes[i];
        column[i] = sizes[NZ + i];
    }
    for (int pass = 0; pass < 40 && calm < 2; pass++) {
        const int side = pass % 2;
        double *const scale = side ? column : row;
        double common = 0.0;
        fill(NZ, 0.0, largest);
        for (int e = 0; e < PLACES; e++) {
            const double size = fabs(K[e]) * row[PLACE[e][0]] * column[PLACE[e][1]];
            if (size > largest[PLACE[e][side]]) {
                largest[PLACE[e][side]] = size;
            }
        }
        for (int e = 0; e < RELAXED; e++) {
            common = largest[RELAX[e][side]] > common ? largest[RELAX[e][side]] : common;
        }
        for (int e = 0; e < RELAXED; e++) {
            largest[RELAX[e][side]] = common;
        }
        calm++;
        for (int i = 0; i < NZ; i++) {
            const double size = largest[i] > 0.0 ? largest[i] : 1.0;
            calm = size > 2.0 || size < 0.5 ? 0 : calm;
            scale[i] /= sqrt(size);
        }
    }
}

/* The larger of two indices, one of them kept as a number. */
static double later(int index, double other)
{
    return (double)index > other ? (double)index : other;
}

/* Balanced K, less a little where redundant constraints may leave it singular, as L U with row exchanges; status 2
   where a pivot vanishes: no inertia is behind a motion. The plan keeps rows exchanged, last column of each row of U,
   last row of each column of L, so that what is zero in the sparse K costs little. */
static int factor_system(const eom_at *at)
{
    const double *const K = AT(SYSTEM), *const row = AT(ROW), *const column = AT(COLUMN);
    double *const lu = AT(LU), *const plan = AT(PLAN), *const last = plan + NZ, *const deep = last + NZ;
    double sum = 0.0;
    fill(NZ * NZ, 0.0, lu);
    for (int i = 0; i < NZ; i++) {
        last[i] = deep[i] = (double)i;
    }
    for (int e = 0; e < PLACES; e++) {
        const int i = PLACE[e][0], j = PLACE[e][1];
        lu[i * NZ + j] = K[e] * row[i] * column[j];
        last[i] = later(j, last[i]);
        sum += K[e] * 0.0;
    }
    if (sum != 0.0) {
        return EOMGEN_NON_FINITE;
    }
    for (int e = 0; e < RELAXED; e++) {
        const int i = RELAX[e][0], j = RELAX[e][1];
        lu[i * NZ + j] -= SYSTEMS_RELAXATION;
        last[i] = later(j, last[i]);
    }
    for (int k = 0; k < NZ; k++) {
        int best = k;
        for (int i = k + 1; i < NZ; i++) {
            best = fabs(lu[i * NZ + k]) > fabs(lu[best * NZ + k]) ? i : best;
        }
        plan[k] = (double)best;
        if (!(fabs(lu[best * NZ + k]) > SYSTEMS_PIVOT)) {
            return EOMGEN_SINGULAR_MASS_MATRIX;
        }
        if (best != k) {
            const double end = last[k];
            last[k] = last[best];
            last[best] = end;
            for (int j = k; j < NZ; j++) {
                const double entry = lu[k * NZ + j];
                lu[k * NZ + j] = lu[best * NZ + j];
                lu[best * NZ + j] = entry;
            }
        }
        const int end = (int)last[k];
        for (int i = k + 1; i < NZ; i++) {
            if (lu[i * NZ + k] != 0.0) {
                const double ratio = lu[i * NZ + k] / lu[k * NZ + k];
                lu[i * NZ + k] = ratio;
                for (int j = k + 1; j <= end; j++) {
                    lu[i * NZ + j] -= ratio * lu[k * NZ + j];
                }
                last[i] = later(end, last[i]);
                deep[k] = (double)i;
            }
        }
    }
    return 0;
}

/* d = (L U)^-1 d */
static void substitute_system(const eom_at *at, double *restrict d)
{
    const double *const lu = AT(LU), *const plan = AT(PLAN), *const last = plan + NZ, *const deep = last + NZ;
    for (int k = 0; k < NZ; k++) {
        const int pivot = (int)plan[k], end = (int)deep[k];
        const double entry = d[pivot];
        d[pivot] = d[k];
        d[k] = entry;
        for (int i = k + 1; i <= end; i++) {
            d[i] -= lu[i * NZ + k] * entry;
        }
    }
    for (int i = NZ - 1; i >= 0; i--) {
        const int end = (int)last[i];
        for (int j = i + 1; j <= end; j++) {
            d[i] -= lu[i * NZ + j] * d[j];
        }
        d[i] /= lu[i * NZ + i];
    }
}

/* Whether K z = r holds but for rounding: no more is left of any equation than LEFT of its terms, or ROUNDED of the
   largest terms of all; of constraints along which K has the singular value s (s^2 = weak) FAINT / s^2, which is what
   rounding of the position makes of their accelerations. The defect is balanced. */
static int is_solved(const eom_at *at, const double *restrict r, const double *restrict z, double weak)
{
    const double *const K = AT(SYSTEM), *const row = AT(ROW), *const d = AT(DEFECT);
    double *const terms = AT(DEFECT) + NZ;
    double most = 0.0;
    for (int i = 0; i < NZ; i++) {
        terms[i] = fabs(r[i]);
    }
    for (int e = 0; e < PLACES; e++) {
        terms[PLACE[e][0]] += fabs(K[e] * z[PLACE[e][1]]);
    }
    for (int i = 0; i < NZ; i++) {
        terms[i] *= row[i];
        most = fmax(most, terms[i]);
    }
    for (int e = 0; e < RELAXED; e++) {
        terms[RELAX[e][0]] *= fmax(1.0, SYSTEMS_FAINT / SYSTEMS_LEFT / fmax(weak, SYSTEMS_WEAKEST));
    }
    for (int i = 0; i < NZ; i++) {
        if (!(fabs(d[i]) <= SYSTEMS_LEFT * terms[i] + SYSTEMS_ROUNDED * most)) {
            return 0;
        }
    }
    return 1;
}

/* K z = r by steps with the factors of the relaxed K: the proximal point method, which of all solutions with
   redundant constraints finds the one of least multipliers. Ends when the defect no longer halves, and says whether
   it is rounding. */
static int solve_system(const eom_at *at, const double *restrict r, double *restrict z)
{
    const double *const K = AT(SYSTEM), *const row = AT(ROW), *const column = AT(COLUMN);
    double *const d = AT(DEFECT);
    double before = HUGE_VAL;
    fill(NZ, 0.0, z);
    for (int count = 0; count <= 30; count++) {
        double size = 0.0;
        copy(NZ, r, d);
        for (int e = 0; e < PLACES; e++) {
            d[PLACE[e][0]] -= K[e] * z[PLACE[e][1]];
        }
        for (int i = 0; i < NZ; i++) {
            d[i] *= row[i];
            size = fabs(d[i]) <= size ? size : fabs(d[i]);
        }
        if (!isfinite(size)) {
            return EOMGEN_NON_FINITE;
        }
        if (size == 0.0 || count == 30 || (count > 1 && size > 0.5 * before)) {
            /* a step leaves RELAXATION / (s^2 + RELAXATION) along constraints of singular value s */
            const double weak = size > 0.0 ? SYSTEMS_RELAXATION * (before / size - 1.0) : 1.0;
            return is_solved(at, r, z, weak) ? 0 : EOMGEN_UNSOLVED;
        }
        before = size;
        substitute_system(at, d);
        for (int i = 0; i < NZ; i++) {
            z[i] += column[i] * d[i];
        }
    }
    return 0;
}

/* Accelerations a (N) of the state in AT(X); leaves z behind q and v in AT(MOTION), and the factors. */
static int accelerate_system(const eom_at *at, double *restrict a)
{
    double *const motion = AT(MOTION);
    (void)EVALUATE(system, AT(X), AT(SYSTEM));
    balance_system(at);
    int status = factor_system(at);
    if (status == 0) {
        status = solve_system(at, AT(SYSTEM) + PLACES, motion + NX);
    }
    copy(NX, AT(X), motion);
    return status != 0 ? status : EVALUATE(joint_accelerations, motion, a);
}
