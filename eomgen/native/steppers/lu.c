/* Dense linear systems with partial pivoting, row-major. */
#include <math.h>

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
    return lu_columns(n, 0, n, a, order);
}

static void lu_solve(int n, const double *restrict a, const int *restrict order, double *restrict b)
{
    for (int k = 0; k < n; k++) {
        const double x = b[order[k]];
        b[order[k]] = b[k], b[k] = x;
    }
    for (int i = 1; i < n; i++) {
        double sum = b[i];
        for (int k = 0; k < i; k++) {
            sum -= a[i * n + k] * b[k];
        }
        b[i] = sum;
    }
    for (int i = n - 1; i >= 0; i--) {
        double sum = b[i];
        for (int k = i + 1; k < n; k++) {
            sum -= a[i * n + k] * b[k];
        }
        b[i] = sum * a[i * n + i];
    }
}
