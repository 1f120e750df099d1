/* Factors of large dense matrices, a panel of columns after the other, and their use, four rows at a time; the factors have
   the bits of lu.c and lu_complex.c. */
enum { LARGE_FROM = 48 };

/* Rows of U behind a panel, and what the panel takes from the rows below. */
static void pass_panel(int n, int begin, int end, double *restrict a)
{
    for (int k = begin + 1; k < end; k++) {
        take_panel(1, k - begin, n - end, a + k * n + begin, n, a + begin * n + end, n, a + k * n + end, n);
    }
    take_panel(n - end, end - begin, n - end, a + end * n + begin, n, a + begin * n + end, n, a + end * n + end, n);
}

static int factor_real(int n, double *restrict a, int *restrict order)
{
    if (n < LARGE_FROM) {
        return lu_factor(n, a, order);
    }
    for (int begin = 0; begin < n; begin += PANEL) {
        const int end = n - begin < PANEL ? n : begin + PANEL;
        if (lu_columns(n, begin, end, a, order)) {
            return 1;
        }
        pass_panel(n, begin, end, a);
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

static void solve_real(int n, const double *restrict a, const int *restrict order, double *restrict b)
{
    const int all = n - n % 4;
    if (n < LARGE_FROM) {
        lu_solve(n, a, order, b);
        return;
    }
    for (int k = 0; k < n; k++) {
        const double x = b[order[k]];
        b[order[k]] = b[k], b[k] = x;
    }
    for (int i = 0; i < n; i++) {
        if (i < all && i % 4 == 0) {
            take_rows(n, i, 0, i, a, b);
        }
        for (int k = i < all ? i - i % 4 : 0; k < i; k++) {
            b[i] -= a[i * n + k] * b[k];
        }
    }
    for (int i = n - 1; i >= 0; i--) {
        const int end = i < all ? i - i % 4 + 4 : n;
        if (i < all && i % 4 == 3) {
            take_rows(n, i - 3, end, n, a, b);
        }
        for (int k = i + 1; k < end; k++) {
            b[i] -= a[i * n + k] * b[k];
        }
        b[i] *= a[i * n + i];
    }
}
