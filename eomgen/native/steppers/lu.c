/* Dense linear systems with partial pivoting, row-major, two numbers at a time, large ones a panel of columns after the other;
   every entry is summed in the order of its terms, and nothing is contracted, so that the bits are the same everywhere. */
#include "eomgen_real.h"

/* Loops over rows of matrices are worth more of gcc's work than the rest of this file. */
#if defined(__GNUC__) && !defined(__clang__) && defined(__OPTIMIZE__)
#pragma GCC push_options
#pragma GCC optimize("O2", "tree-vectorize")
#endif

/* PANEL: terms of a product, and columns of a factor, that are gone through at a time; LARGE_FROM: rows from which on. */
enum { PANEL = 32, LARGE_FROM = 48 };

#if defined(EOMGEN_VECTORS)
typedef double strip __attribute__((vector_size(16), aligned(8), may_alias));
#define STRIP(a) (*(strip *)(a))
#define LOAD(a) (*(const strip *)(a))
enum { TALL = 4, BROAD = 4, NARROW = 2 };

/* c -= a b of TALL rows and BROAD columns. */
#define TAKE_BLOCK(a, b, c) \
    strip p0 = STRIP(c), q0 = STRIP(c + 2), p1 = STRIP(c + c_step), q1 = STRIP(c + c_step + 2); \
    strip p2 = STRIP(c + 2 * c_step), q2 = STRIP(c + 2 * c_step + 2); \
    strip p3 = STRIP(c + 3 * c_step), q3 = STRIP(c + 3 * c_step + 2); \
    for (int k = 0; k < depth; k++) { \
        const strip x = LOAD(b + k * b_step), y = LOAD(b + k * b_step + 2); \
        p0 -= (a)[k] * x, q0 -= (a)[k] * y; \
        p1 -= (a)[a_step + k] * x, q1 -= (a)[a_step + k] * y; \
        p2 -= (a)[2 * a_step + k] * x, q2 -= (a)[2 * a_step + k] * y; \
        p3 -= (a)[3 * a_step + k] * x, q3 -= (a)[3 * a_step + k] * y; \
    } \
    STRIP(c) = p0, STRIP(c + 2) = q0, STRIP(c + c_step) = p1, STRIP(c + c_step + 2) = q1; \
    STRIP(c + 2 * c_step) = p2, STRIP(c + 2 * c_step + 2) = q2; \
    STRIP(c + 3 * c_step) = p3, STRIP(c + 3 * c_step + 2) = q3;
#else
enum { TALL = 1, BROAD = 1, NARROW = 1 };
#define TAKE_BLOCK(a, b, c) \
    for (int k = 0; k < depth; k++) { \
        *(c) -= (a)[k] * (b)[k * b_step]; \
    }
#endif

/* c -= a b, of rows x depth and depth x columns, rows of which are so many steps apart. */
static void take_panel(int rows, int depth, int columns, const double *restrict a, int a_step, const double *restrict b,
                       int b_step, double *restrict c, int c_step)
{
    const int tall = rows - rows % TALL, broad = columns - columns % BROAD;
    for (int j = 0; j < broad; j += BROAD) {
        for (int i = 0; i < tall; i += TALL) {
            const double *const left = a + i * a_step, *const right = b + j;
            double *const at = c + i * c_step + j;
            TAKE_BLOCK(left, right, at)
        }
    }
    for (int i = 0; i < rows; i++) {
        const int begin = i < tall ? broad : 0;
        for (int k = 0; k < depth; k++) {
            const double x = a[i * a_step + k];
            for (int j = begin; j < columns; j++) {
                c[i * c_step + j] -= x * b[k * b_step + j];
            }
        }
    }
}

static void swap_rows(int n, double *a, double *b)
{
    for (int k = 0; k < n; k++) {
        const double x = a[k];
        a[k] = b[k], b[k] = x;
    }
}

/* Columns begin to end of P A = L U in place, reciprocals of the pivots on the diagonal; rows are swapped whole, those behind
   stay as they are. 1 if a column holds no pivot. */
static int lu_columns(int n, int begin, int end, double *restrict a, int *restrict order)
{
    for (int k = begin; k < end; k++) {
        int best = k;
        for (int i = k + 1; i < n; i++) {
            best = fabs(a[i * n + k]) > fabs(a[best * n + k]) ? i : best;
        }
        order[k] = best;
        if (best != k) {
            swap_rows(n, a + k * n, a + best * n);
        }
        const double *restrict const row = a + k * n;
        if (!(fabs(row[k]) > 0.0) || !isfinite(row[k])) {
            return 1;
        }
        const double inverse = 1.0 / row[k];
        a[k * n + k] = inverse;
        for (int i = k + 1; i < n; i++) {
            double *restrict const other = a + i * n;
            const double ratio = other[k] * inverse;
            other[k] = ratio;
            for (int j = k + 1; j < end; j++) {
                other[j] -= ratio * row[j];
            }
        }
    }
    return 0;
}

static int lu_factor(int n, double *restrict a, int *restrict order)
{
    const int wide = n < LARGE_FROM ? n : PANEL;
    for (int begin = 0; begin < n; begin += wide) {
        const int end = n - begin < wide ? n : begin + wide;
        if (lu_columns(n, begin, end, a, order)) {
            return 1;
        }
        for (int k = begin + 1; k < end; k++) { /* rows of U behind the panel */
            take_panel(1, k - begin, n - end, a + k * n + begin, n, a + begin * n + end, n, a + k * n + end, n);
        }
        take_panel(n - end, end - begin, n - end, a + end * n + begin, n, a + begin * n + end, n, a + end * n + end, n);
    }
    return 0;
}

/* What terms first to last of a row of the factor take from four entries of b. */
static void take_rows(int n, int row, int first, int last, const double *restrict a, double *restrict b)
{
    const double *const at = a + row * n;
    double p = b[row], q = b[row + 1], r = b[row + 2], s = b[row + 3];
    for (int k = first; k < last; k++) {
        p -= at[k] * b[k], q -= at[n + k] * b[k], r -= at[2 * n + k] * b[k], s -= at[3 * n + k] * b[k];
    }
    b[row] = p, b[row + 1] = q, b[row + 2] = r, b[row + 3] = s;
}

/* The same of one entry. */
static double take_one(int n, int i, int first, int last, const double *restrict a, const double *restrict b)
{
    double sum = b[i];
    for (int k = first; k < last; k++) {
        sum -= a[i * n + k] * b[k];
    }
    return sum;
}

static void lu_solve(int n, const double *restrict a, const int *restrict order, double *restrict b)
{
    const int all = n < LARGE_FROM ? 0 : n - n % 4;
    for (int k = 0; k < n; k++) {
        const double x = b[order[k]];
        b[order[k]] = b[k], b[k] = x;
    }
    for (int i = 0; i < n; i++) {
        if (i < all && i % 4 == 0) {
            take_rows(n, i, 0, i, a, b);
        }
        b[i] = take_one(n, i, i < all ? i - i % 4 : 0, i, a, b);
    }
    for (int i = n - 1; i >= 0; i--) {
        const int end = i < all ? i - i % 4 + 4 : n;
        if (i < all && i % 4 == 3) {
            take_rows(n, i - 3, end, n, a, b);
        }
        b[i] = take_one(n, i, i + 1, end, a, b) * a[i * n + i];
    }
}

#if defined(__GNUC__) && !defined(__clang__) && defined(__OPTIMIZE__)
#pragma GCC pop_options
#endif
