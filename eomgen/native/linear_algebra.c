/* Solvers of equations of motion (eomgen_solvers.h): dense linear algebra. All matrices are row-major. */
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
