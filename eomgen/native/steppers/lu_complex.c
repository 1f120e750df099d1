/* As lu.c, of complex matrices a + i c; until the end of radau.c loops over rows are worth more of gcc's work. */
#if defined(__GNUC__) && !defined(__clang__) && defined(__OPTIMIZE__)
#pragma GCC push_options
#pragma GCC optimize("O2", "tree-vectorize")
#endif

static int lu_columns_complex(int n, int begin, int end, double *restrict a, double *restrict c, int *restrict order)
{
    for (int k = begin; k < end; k++) {
        int best = k;
        double most = -1.0;
        for (int i = k; i < n; i++) {
            const double size = fabs(a[i * n + k]) + fabs(c[i * n + k]);
            best = size > most ? i : best, most = size > most ? size : most;
        }
        order[k] = best;
        if (!(most > 0.0) || !isfinite(most)) {
            return 1;
        }
        if (best != k) {
            swap_rows(n, a + k * n, a + best * n);
            swap_rows(n, c + k * n, c + best * n);
        }
        const double *restrict const re = a + k * n, *restrict const im = c + k * n;
        const double square = re[k] * re[k] + im[k] * im[k], x = re[k] / square, y = -im[k] / square;
        a[k * n + k] = x, c[k * n + k] = y;
        for (int i = k + 1; i < n; i++) {
            double *restrict const p = a + i * n, *restrict const q = c + i * n;
            const double u = p[k] * x - q[k] * y, v = p[k] * y + q[k] * x;
            p[k] = u, q[k] = v;
            for (int j = k + 1; j < end; j++) {
                p[j] -= u * re[j] - v * im[j];
                q[j] -= u * im[j] + v * re[j];
            }
        }
    }
    return 0;
}

#if defined(EOMGEN_VECTORS)
#define TURN(p, q, row) \
    p -= a[(row) * step + k] * x - c[(row) * step + k] * y, q -= a[(row) * step + k] * y + c[(row) * step + k] * x;
#endif

/* re + i im -= (a + i c) (b + i d), of rows x depth and depth x columns, rows of which are `step` apart. */
static void take_panel_complex(int rows, int depth, int columns, int step, const double *restrict a,
                               const double *restrict c, const double *restrict b, const double *restrict d,
                               double *restrict re, double *restrict im)
{
    int tall = 0, narrow = 0;
#if defined(EOMGEN_VECTORS)
    tall = rows - rows % TALL, narrow = columns - columns % NARROW;
    for (int j = 0; j < narrow; j += NARROW) {
        for (int i = 0; i < tall; i += TALL) {
            double *const p = re + i * step + j, *const q = im + i * step + j;
            strip p0 = STRIP(p), p1 = STRIP(p + step), p2 = STRIP(p + 2 * step), p3 = STRIP(p + 3 * step);
            strip q0 = STRIP(q), q1 = STRIP(q + step), q2 = STRIP(q + 2 * step), q3 = STRIP(q + 3 * step);
            for (int k = 0; k < depth; k++) {
                const strip x = LOAD(b + k * step + j), y = LOAD(d + k * step + j);
                TURN(p0, q0, i) TURN(p1, q1, i + 1) TURN(p2, q2, i + 2) TURN(p3, q3, i + 3)
            }
            STRIP(p) = p0, STRIP(p + step) = p1, STRIP(p + 2 * step) = p2, STRIP(p + 3 * step) = p3;
            STRIP(q) = q0, STRIP(q + step) = q1, STRIP(q + 2 * step) = q2, STRIP(q + 3 * step) = q3;
        }
    }
#endif
    for (int i = 0; i < rows; i++) {
        const int begin = i < tall ? narrow : 0;
        for (int k = 0; k < depth; k++) {
            const double u = a[i * step + k], v = c[i * step + k];
            for (int j = begin; j < columns; j++) {
                re[i * step + j] -= u * b[k * step + j] - v * d[k * step + j];
                im[i * step + j] -= u * d[k * step + j] + v * b[k * step + j];
            }
        }
    }
}

static int factor_complex(int n, double *restrict a, double *restrict c, int *restrict order)
{
    const int wide = n < LARGE_FROM ? n : PANEL;
    for (int begin = 0; begin < n; begin += wide) {
        const int end = n - begin < wide ? n : begin + wide, right = begin * n + end;
        if (lu_columns_complex(n, begin, end, a, c, order)) {
            return 1;
        }
        for (int k = begin + 1; k < end; k++) {
            const int left = k * n + begin, at = k * n + end;
            take_panel_complex(1, k - begin, n - end, n, a + left, c + left, a + right, c + right, a + at, c + at);
        }
        const int left = end * n + begin, at = end * n + end;
        take_panel_complex(n - end, end - begin, n - end, n, a + left, c + left, a + right, c + right, a + at, c + at);
    }
    return 0;
}

/* What terms first to last of a row of the factor take from two entries of b + i d. */
static void take_rows_complex(int n, int row, int first, int last, const double *restrict a, const double *restrict c,
                              double *restrict b, double *restrict d)
{
    const double *const re = a + row * n, *const im = c + row * n;
    double p = b[row], q = d[row], r = b[row + 1], s = d[row + 1];
    for (int k = first; k < last; k++) {
        p -= re[k] * b[k] - im[k] * d[k], q -= re[k] * d[k] + im[k] * b[k];
        r -= re[n + k] * b[k] - im[n + k] * d[k], s -= re[n + k] * d[k] + im[n + k] * b[k];
    }
    b[row] = p, d[row] = q, b[row + 1] = r, d[row + 1] = s;
}

/* The same of one entry. */
static void take_one_complex(int n, int i, int first, int last, const double *restrict a, const double *restrict c,
                             double *restrict b, double *restrict d)
{
    double x = b[i], y = d[i];
    for (int k = first; k < last; k++) {
        x -= a[i * n + k] * b[k] - c[i * n + k] * d[k];
        y -= a[i * n + k] * d[k] + c[i * n + k] * b[k];
    }
    b[i] = x, d[i] = y;
}

static void solve_complex(int n, const double *restrict a, const double *restrict c, const int *restrict order,
                          double *restrict b, double *restrict d)
{
    const int all = n < LARGE_FROM ? 0 : n - n % 2;
    for (int k = 0; k < n; k++) {
        const double x = b[order[k]], y = d[order[k]];
        b[order[k]] = b[k], d[order[k]] = d[k];
        b[k] = x, d[k] = y;
    }
    for (int i = 0; i < n; i++) {
        if (i < all && i % 2 == 0) {
            take_rows_complex(n, i, 0, i, a, c, b, d);
        }
        take_one_complex(n, i, i < all ? i - i % 2 : 0, i, a, c, b, d);
    }
    for (int i = n - 1; i >= 0; i--) {
        const int end = i < all ? i - i % 2 + 2 : n;
        if (i < all && i % 2 == 1) {
            take_rows_complex(n, i - 1, end, n, a, c, b, d);
        }
        take_one_complex(n, i, i + 1, end, a, c, b, d);
        const double x = b[i], y = d[i], re = a[i * n + i], im = c[i * n + i];
        b[i] = x * re - y * im, d[i] = x * im + y * re;
    }
}
