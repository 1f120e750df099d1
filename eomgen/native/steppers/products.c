/* Loops over rows of matrices, until dense_end.c, are worth more of gcc's work than the rest of this file. */
#if defined(__GNUC__) && !defined(__clang__) && defined(__OPTIMIZE__)
#pragma GCC push_options
#pragma GCC optimize("O2", "tree-vectorize")
#endif

/* Products of dense row-major matrices, two numbers at a time; every entry is summed in the order
   of its terms, and nothing is contracted, so that the bits are the same everywhere. */
#include "eomgen_real.h"

enum { PANEL = 32 }; /* terms of a product, and columns of a factor, that are gone through at a time */

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

static void take_products(int rows, int depth, int columns, const double *restrict a, int a_step, const double *restrict b,
                          int b_step, double *restrict c, int c_step)
{
    for (int k = 0; k < depth; k += PANEL) {
        take_panel(rows, depth - k < PANEL ? depth - k : PANEL, columns, a + k, a_step, b + k * b_step, b_step, c, c_step);
    }
}

/* x += a r of n x k numbers, rows of which are `step` apart; four rows at a time. */
static void add_times(int n, int k, const double *restrict a, int step, const double *restrict r, double *restrict x)
{
    int i = 0;
    for (; i + 4 <= n; i += 4) {
        const double *const row = a + i * step;
        double sum[4] = {0.0, 0.0, 0.0, 0.0};
        for (int l = 0; l < k; l++) {
            sum[0] += row[l] * r[l], sum[1] += row[step + l] * r[l];
            sum[2] += row[2 * step + l] * r[l], sum[3] += row[3 * step + l] * r[l];
        }
        for (int m = 0; m < 4; m++) {
            x[i + m] += sum[m];
        }
    }
    for (; i < n; i++) {
        double sum = 0.0;
        for (int l = 0; l < k; l++) {
            sum += a[i * step + l] * r[l];
        }
        x[i] += sum;
    }
}
