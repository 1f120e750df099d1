/* As lu.c, of a + i c. */
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

static int lu_factor_complex(int n, double *restrict a, double *restrict c, int *restrict order)
{
    return lu_columns_complex(n, 0, n, a, c, order);
}

static void lu_solve_complex(int n, const double *restrict a, const double *restrict c, const int *restrict order,
                             double *restrict b, double *restrict d)
{
    for (int k = 0; k < n; k++) {
        const double x = b[order[k]], y = d[order[k]];
        b[order[k]] = b[k], d[order[k]] = d[k];
        b[k] = x, d[k] = y;
    }
    for (int i = 1; i < n; i++) {
        double x = b[i], y = d[i];
        for (int k = 0; k < i; k++) {
            x -= a[i * n + k] * b[k] - c[i * n + k] * d[k];
            y -= a[i * n + k] * d[k] + c[i * n + k] * b[k];
        }
        b[i] = x, d[i] = y;
    }
    for (int i = n - 1; i >= 0; i--) {
        double x = b[i], y = d[i];
        for (int k = i + 1; k < n; k++) {
            x -= a[i * n + k] * b[k] - c[i * n + k] * d[k];
            y -= a[i * n + k] * d[k] + c[i * n + k] * b[k];
        }
        const double re = a[i * n + i], im = c[i * n + i];
        b[i] = x * re - y * im, d[i] = x * im + y * re;
    }
}
