/* Systems (g - J) x = r where J = [E S; K D] of a state [q; v] with hardly any E, as that of mechanisms in contact is:
   q = B (r_q + S v) with B = 1/(g - E) = 1/g + E/g^2 + ..., and (g - D - K B S) v = r_v + K B r_q. */
#include <math.h>
#include <string.h>

/* c = -a b: n x k by k x m, both of rows that are so many steps apart. */
static void multiply(int n, int k, int m, const double *restrict a, int step, const double *restrict b, int b_step,
                     double *restrict c)
{
    memset(c, 0, (size_t)(n * m) * sizeof(double));
    take_products(n, k, m, a, step, b, b_step, c, m);
}

/* -K S and K E S, with room for -E S; the greatest sum of a row of E. */
static double parts_products(int n, int n_q, const double *restrict J, double *restrict KS, double *restrict KES,
                             double *restrict ES)
{
    const int m = n - n_q;
    double most = 0.0;
    for (int i = 0; i < n_q; i++) {
        double sum = 0.0;
        for (int k = 0; k < n_q; k++) {
            sum += fabs(J[i * n + k]);
        }
        most = fmax(most, sum);
    }
    multiply(n_q, n_q, m, J, n, J + n_q, n, ES);
    multiply(m, n_q, m, J + n_q * n, n, J + n_q, n, KS);
    multiply(m, n_q, m, J + n_q * n, n, ES, m, KES);
    return most;
}

/* g - D - K B S of -K S and K E S for a real g, and for the g with 1/g = u + i v. */
static void parts_matrices(int n, int n_q, const double *restrict J, const double *restrict KS,
                           const double *restrict KES, double g, double u, double v, double *restrict plain,
                           double *restrict re, double *restrict im)
{
    const int m = n - n_q;
    const double square = u * u + v * v, p = u * u - v * v, q = 2.0 * u * v;
    for (int i = 0; i < m; i++) {
        const double *const D = J + (n_q + i) * n + n_q;
        for (int k = 0; k < m; k++) {
            const double first = KS[i * m + k], second = KES[i * m + k];
            plain[i * m + k] = -D[k] + (first - second / g) / g;
            re[i * m + k] = -D[k] + first * u - second * p;
            im[i * m + k] = first * v - second * q;
        }
        plain[i * m + i] += g, re[i * m + i] += u / square, im[i * m + i] -= v / square;
    }
}

/* r_q = B r_q, and as much further as B S x says if x is not NULL; room for n_q numbers. */
static void parts_carry(int n, int n_q, const double *restrict J, double g, const double *x, double *restrict r,
                        double *restrict room)
{
    double *const way = room, *const drift = room + n_q;
    memset(room, 0, (size_t)(2 * n_q) * sizeof(double));
    if (x == NULL) {
        memcpy(way, r, (size_t)n_q * sizeof(double));
    } else {
        add_times(n_q, n - n_q, J + n_q, n, x, way);
    }
    add_times(n_q, n_q, J, n, way, drift);
    for (int i = 0; i < n_q; i++) {
        r[i] = (x == NULL ? 0.0 : r[i]) + (way[i] + drift[i] / g) / g;
    }
}

/* The same for the g with 1/g = u + i v, of r + i s and x + i y; room for four times n_q numbers. */
static void parts_carry_complex(int n, int n_q, const double *restrict J, double u, double v, const double *x,
                                const double *y, double *restrict r, double *restrict s, double *restrict room)
{
    double *const way = room, *const drift = room + n_q, *const turn = room + 2 * n_q, *const more = room + 3 * n_q;
    const double p = u * u - v * v, q = 2.0 * u * v;
    memset(room, 0, (size_t)(4 * n_q) * sizeof(double));
    if (x == NULL) {
        memcpy(way, r, (size_t)n_q * sizeof(double));
        memcpy(turn, s, (size_t)n_q * sizeof(double));
    } else {
        add_times(n_q, n - n_q, J + n_q, n, x, way);
        add_times(n_q, n - n_q, J + n_q, n, y, turn);
    }
    add_times(n_q, n_q, J, n, way, drift);
    add_times(n_q, n_q, J, n, turn, more);
    for (int i = 0; i < n_q; i++) {
        r[i] = (x == NULL ? 0.0 : r[i]) + way[i] * u - turn[i] * v + drift[i] * p - more[i] * q;
        s[i] = (x == NULL ? 0.0 : s[i]) + way[i] * v + turn[i] * u + drift[i] * q + more[i] * p;
    }
}
