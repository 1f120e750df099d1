/* Systems (g - J) x = r of implicit methods. Where J = [0 1; K D], of a state [q; v] with q' = v, only
   (g - D - K / g) v = r_v + K r_q / g is solved, and q = (r_q + v) / g; other large ones by parts, or by what of J is not 0,
   whatever takes the least work. */
#include <math.h>
#include <string.h>

#include "eomgen_steppers.h"

/* Until the end of radau.c loops over rows are worth more of gcc's work. */
#if defined(__GNUC__) && !defined(__clang__) && defined(__OPTIMIZE__)
#pragma GCC push_options
#pragma GCC optimize("O2", "tree-vectorize")
#endif

/* As lu.c, of complex matrices a + i c. */
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

/* Systems (g - J) x = r where J = [E S; K D] of a state [q; v] with hardly any E, as that of mechanisms in contact is:
   q = B (r_q + S v) with B = 1/(g - E) = 1/g + E/g^2 + ..., and (g - D - K B S) v = r_v + K B r_q. */
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

/* Systems (g - J) x = r where J has few numbers: P (g - J) P^T = L U on the pattern of both and what fills it, in the order of
   least degree (W. F. Tinney, J. W. Walker, Proc. IEEE 55 (1967) 1801-1809), without exchanges of rows. The unknowns of
   bodies and elements that do not touch stay apart; elements that only their bodies know are eliminated first. */
#include <stdint.h>

/* SPARSE_FROM: states from which patterns are looked at; SPARSE_TIMES: a product takes so much longer than in a dense matrix;
   a row, so many products more. */
enum { SPARSE_FROM = 48, SPARSE_TIMES = 8, SPARSE_ROW = 64, WORD = 64 };

/* Where the pattern is: rows one after the other, columns ascending, in the order of elimination. */
typedef struct {
    int *order;  /* n: which unknown is eliminated when */
    int *start;  /* n + 1: where rows start */
    int *middle; /* n: where their diagonals are */
    int *column; /* of every number */
} sparse_pattern;

static sparse_pattern sparse_at(int n, int filled, double *rows)
{
    int *const at = (int *)(rows + filled);
    const sparse_pattern p = {at, at + n, at + 2 * n + 1, at + 3 * n + 1};
    return p;
}

static int sparse_ones(uint64_t x)
{
    x -= (x >> 1) & 0x5555555555555555u;
    x = (x & 0x3333333333333333u) + ((x >> 2) & 0x3333333333333333u);
    x = (x + (x >> 4)) & 0x0f0f0f0f0f0f0f0fu;
    return (int)((x * 0x0101010101010101u) >> 56);
}

/* Which unknowns stand together in an equation, as bits of n rows of `words`; how many of J are not 0. */
static long sparse_near(int n, int words, const double *restrict J, uint64_t *restrict near)
{
    long some = 0;
    memset(near, 0, (size_t)n * (size_t)words * sizeof *near);
    for (int i = 0; i < n; i++) {
        const double *const row = J + (long)i * n;
        for (int k = 0; k < n; k++) {
            if (row[k] != 0.0) {
                near[(long)i * words + k / WORD] |= (uint64_t)1 << k % WORD;
                near[(long)k * words + i / WORD] |= (uint64_t)1 << i % WORD;
                some++;
            }
        }
        near[(long)i * words + i / WORD] &= ~((uint64_t)1 << i % WORD);
    }
    return some;
}

/* Eliminates the unknowns in an order of least degree; each then has in `near` those that it meets after its own turn. The
   numbers of the factors, and the products that they take. */
static long sparse_eliminate(int n, int words, uint64_t *restrict near, int *restrict order, int *restrict degree,
                             double *products)
{
    long filled = n;
    *products = 0.0;
    for (int i = 0; i < n; i++) {
        degree[i] = 0;
        for (int k = 0; k < words; k++) {
            degree[i] += sparse_ones(near[(long)i * words + k]);
        }
    }
    for (int turn = 0; turn < n; turn++) {
        int best = 0;
        for (int i = 1; i < n; i++) {
            best = degree[i] < degree[best] ? i : best;
        }
        const uint64_t *const own = near + (long)best * words;
        const double d = degree[best];
        order[turn] = best, filled += 2 * degree[best], *products += d * (d + 1.0);
        for (int k = 0; k < words; k++) {
            for (uint64_t left = own[k]; left != 0; left &= left - 1) {
                const int i = k * WORD + sparse_ones((left & (~left + 1)) - 1);
                uint64_t *const other = near + (long)i * words;
                degree[i] = 0;
                for (int l = 0; l < words; l++) {
                    other[l] |= own[l];
                }
                other[best / WORD] &= ~((uint64_t)1 << best % WORD), other[i / WORD] &= ~((uint64_t)1 << i % WORD);
                for (int l = 0; l < words; l++) {
                    degree[i] += sparse_ones(other[l]);
                }
            }
        }
        degree[best] = n + 1;
    }
    return filled;
}

/* Writes the pattern down in `rows`, by rows: what comes before a row are those that meet it after their turn. `turn`: n. */
static void sparse_write(int n, int words, long filled, const uint64_t *restrict near, const int *restrict order,
                         int *restrict turn, double *restrict rows)
{
    const sparse_pattern p = sparse_at(n, (int)filled, rows);
    int *const end = p.middle;
    for (int i = 0; i < n; i++) {
        p.order[i] = order[i], turn[order[i]] = i, end[i] = 1;
    }
    for (int pass = 0; pass < 2; pass++) { /* how long the rows are; then the rows up to their diagonals */
        for (int i = 0; i < n; i++) {
            const uint64_t *const own = near + (long)order[i] * words;
            if (pass == 1) {
                p.column[end[i]++] = i;
            }
            for (int k = 0; k < words; k++) {
                for (uint64_t left = own[k]; left != 0; left &= left - 1) {
                    const int later = turn[k * WORD + sparse_ones((left & (~left + 1)) - 1)];
                    if (pass == 0) {
                        end[i]++, end[later]++;
                    } else {
                        p.column[end[later]++] = i;
                    }
                }
            }
        }
        for (int i = 0, at = 0; pass == 0 && i < n; i++) {
            const int length = end[i];
            p.start[i] = end[i] = at, at += length, p.start[i + 1] = at;
        }
    }
    for (int i = 0; i < n; i++) {
        int at = end[i];
        const uint64_t *const own = near + (long)order[i] * words;
        for (int k = 0; k < words; k++) {
            for (uint64_t left = own[k]; left != 0; left &= left - 1) {
                const int later = turn[k * WORD + sparse_ones((left & (~left + 1)) - 1)];
                int place = at++;
                for (; place > end[i] && p.column[place - 1] > later; place--) {
                    p.column[place] = p.column[place - 1];
                }
                p.column[place] = later;
            }
        }
        p.middle[i] = end[i] - 1;
    }
}

/* How many numbers the factors have where they take less work than `dense` products, and their pattern; else 0. */
static int sparse_look(int n, const double *restrict J, double dense, double *restrict rows, double *restrict re,
                       double *restrict im)
{
    const int words = (n + WORD - 1) / WORD;
    uint64_t *const near = (uint64_t *)im;
    int *const order = (int *)re, *const degree = order + n;
    double products;
    if (n < SPARSE_FROM || 4 * sparse_near(n, words, J, near) > (long)n * n) {
        return 0;
    }
    const long filled = sparse_eliminate(n, words, near, order, degree, &products);
    if (2 * filled > (long)n * n || (double)SPARSE_TIMES * (products + (double)(SPARSE_ROW * n)) > dense) {
        return 0;
    }
    sparse_write(n, words, filled, near, order, degree, rows);
    return (int)filled;
}

/* Factors g - J in place of `rows` before the pattern; 1 where little is left of a pivot. room: n numbers. */
static int sparse_factor(int n, int filled, const double *restrict J, double g, double *restrict rows,
                         double *restrict room)
{
    const sparse_pattern p = sparse_at(n, filled, rows);
    for (int i = 0; i < n; i++) {
        const double *const row = J + (long)p.order[i] * n;
        for (int at = p.start[i]; at < p.start[i + 1]; at++) {
            room[p.column[at]] = -row[p.order[p.column[at]]];
        }
        room[i] += g;
        double size = fabs(room[i]);
        for (int at = p.start[i]; at < p.middle[i]; at++) {
            const int k = p.column[at];
            const double ratio = room[k] * rows[p.middle[k]], before = room[i];
            room[k] = ratio;
            for (int l = p.middle[k] + 1; l < p.start[k + 1]; l++) {
                room[p.column[l]] -= ratio * rows[l];
            }
            size += fabs(room[i] - before);
        }
        if (!(fabs(room[i]) > RUNS_FAINT * size) || !isfinite(size)) {
            return 1;
        }
        room[i] = 1.0 / room[i];
        for (int at = p.start[i]; at < p.start[i + 1]; at++) {
            rows[at] = room[p.column[at]];
        }
    }
    return 0;
}

/* The same of x + i y - J; room: 2 n numbers. */
static int sparse_factor_complex(int n, int filled, const double *restrict J, double x, double y, double *restrict rows,
                                 double *restrict re, double *restrict im, double *restrict room)
{
    const sparse_pattern p = sparse_at(n, filled, rows);
    double *restrict const a = room, *restrict const b = room + n;
    for (int i = 0; i < n; i++) {
        const double *const row = J + (long)p.order[i] * n;
        for (int at = p.start[i]; at < p.start[i + 1]; at++) {
            a[p.column[at]] = -row[p.order[p.column[at]]], b[p.column[at]] = 0.0;
        }
        a[i] += x, b[i] += y;
        double size = fabs(a[i]) + fabs(b[i]);
        for (int at = p.start[i]; at < p.middle[i]; at++) {
            const int k = p.column[at];
            const double u = re[p.middle[k]], v = im[p.middle[k]], first = a[i], second = b[i];
            const double c = a[k] * u - b[k] * v, d = a[k] * v + b[k] * u;
            a[k] = c, b[k] = d;
            for (int l = p.middle[k] + 1; l < p.start[k + 1]; l++) {
                a[p.column[l]] -= c * re[l] - d * im[l], b[p.column[l]] -= c * im[l] + d * re[l];
            }
            size += fabs(a[i] - first) + fabs(b[i] - second);
        }
        if (!(fabs(a[i]) + fabs(b[i]) > RUNS_FAINT * size) || !isfinite(size)) {
            return 1;
        }
        const double square = a[i] * a[i] + b[i] * b[i];
        a[i] /= square, b[i] /= -square;
        for (int at = p.start[i]; at < p.start[i + 1]; at++) {
            re[at] = a[p.column[at]], im[at] = b[p.column[at]];
        }
    }
    return 0;
}

static void sparse_solve(int n, int filled, double *rows, double *restrict r, double *restrict room)
{
    const sparse_pattern p = sparse_at(n, filled, rows);
    for (int i = 0; i < n; i++) {
        double sum = r[p.order[i]];
        for (int at = p.start[i]; at < p.middle[i]; at++) {
            sum -= rows[at] * room[p.column[at]];
        }
        room[i] = sum;
    }
    for (int i = n - 1; i >= 0; i--) {
        double sum = room[i];
        for (int at = p.middle[i] + 1; at < p.start[i + 1]; at++) {
            sum -= rows[at] * room[p.column[at]];
        }
        r[p.order[i]] = room[i] = sum * rows[p.middle[i]];
    }
}

static void sparse_solve_complex(int n, int filled, double *rows, const double *restrict re, const double *restrict im,
                                 double *restrict r, double *restrict s, double *restrict room)
{
    const sparse_pattern p = sparse_at(n, filled, rows);
    double *restrict const a = room, *restrict const b = room + n;
    for (int i = 0; i < n; i++) {
        double x = r[p.order[i]], y = s[p.order[i]];
        for (int at = p.start[i]; at < p.middle[i]; at++) {
            const int k = p.column[at];
            x -= re[at] * a[k] - im[at] * b[k], y -= re[at] * b[k] + im[at] * a[k];
        }
        a[i] = x, b[i] = y;
    }
    for (int i = n - 1; i >= 0; i--) {
        double x = a[i], y = b[i];
        for (int at = p.middle[i] + 1; at < p.start[i + 1]; at++) {
            const int k = p.column[at];
            x -= re[at] * a[k] - im[at] * b[k], y -= re[at] * b[k] + im[at] * a[k];
        }
        const double u = re[p.middle[i]], v = im[p.middle[i]];
        r[p.order[i]] = a[i] = x * u - y * v, s[p.order[i]] = b[i] = x * v + y * u;
    }
}

/* Where each number of a run is, after the rows_K rows of n in run->K. */
typedef struct {
    double *J, *real, *re, *im; /* n x n each */
    double *state;              /* NEWTON_STATE numbers */
    int *order, *order_complex; /* n each */
} newton_area;

/* Numbers of the state: how J is made, by how much q drifts by itself, how many numbers sparse factors have; LARGE: states from
   which parts are worth while. */
enum { NEWTON_STATE = 16, HALVED = 0, DRIFT = 8, FILLED = 9 };
enum { WHOLE = 0, HALF = 1, PARTS = 2, SPARSE = 3, LARGE = 24 };

static newton_area newton_areas(const eomgen_run *run, int rows)
{
    const int n = run->n, square = n * n;
    double *const at = run->K + rows * n;
    double *const state = at + 4 * square;
    int *const order = (int *)(state + NEWTON_STATE);
    const newton_area areas = {at, at + square, at + 2 * square, at + 3 * square, state, order, order + n};
    return areas;
}

static int form_of(const newton_area *a)
{
    return (int)a->state[HALVED];
}

/* Whether the first half of J is [0 1]. */
static int is_halved(int n, const double *J)
{
    const int half = n / 2;
    if (n % 2 != 0) {
        return 0;
    }
    for (int i = 0; i < half; i++) {
        for (int k = 0; k < n; k++) {
            if (J[i * n + k] != (k == half + i ? 1.0 : 0.0)) {
                return 0;
            }
        }
    }
    return 1;
}

/* Whether J may be taken by parts. */
static int has_parts(const eomgen_run *run)
{
    const int n = run->n, m = n - run->n_q;
    return n >= LARGE && run->n_q > 0 && 2 * m * m <= n * n;
}

/* How J is made where its zeros are of no use. */
static void newton_look_whole(const eomgen_run *run, const newton_area *a)
{
    const int n = run->n, n_q = run->n_q, m = n - n_q;
    a->state[HALVED] = is_halved(n, a->J) ? HALF : WHOLE;
    if (form_of(a) == WHOLE && has_parts(run)) {
        a->state[HALVED] = PARTS;
        a->state[DRIFT] = parts_products(n, n_q, a->J, a->real + m * m, a->re + m * m, a->im);
    }
}

/* How J is made, which a step that is too long for parts ends, and a pivot that is too small (newton_factor). */
static void newton_look(const eomgen_run *run, const newton_area *a)
{
    const double n = run->n, n_q = run->n_q, m = n - n_q;
    double dense = n * n * n / 3.0;
    if (run->n >= SPARSE_FROM) {
        dense = is_halved(run->n, a->J) ? dense / 8.0 : has_parts(run) ? m * m * m / 3.0 + n_q * m * (n + m) : dense;
        a->state[FILLED] = sparse_look(run->n, a->J, dense, a->real, a->re, a->im);
        if (a->state[FILLED] > 0.0) {
            a->state[HALVED] = SPARSE;
            return;
        }
    }
    newton_look_whole(run, a);
}

/* dx'/dx at (t, y) into J, inputs that are expressions of the state included; 0, or the status of a failure. */
int eomgen_differentiate(eomgen_run *run, double t, const double *y, const double *f, double *J, double *spare)
{
    const int n = run->n;
    int feedback = 0;
    if (run->signals != NULL) {
        eomgen_force(run, t, y);
        for (int i = 0; i < run->n_u; i++) {
            feedback = feedback || run->signals[i].tape != NULL;
        }
    }
    run->differentiations++;
    const int status = run->jacobian(t, y, run->u, run->c, J, run->w);
    if (status != 0) {
        run->failure = status, run->failure_time = t;
        memcpy(run->failure_state, y, (size_t)n * sizeof(double));
        return status;
    }
    double *const moved = spare, *const change = spare + n;
    for (int k = 0; feedback && k < n; k++) { /* x' at inputs of a state moved a little, all else where it is */
        const double step = RUNS_SLOPE * fmax(fabs(y[k]), RUNS_SIZE);
        memcpy(moved, y, (size_t)n * sizeof(double));
        moved[k] += step;
        eomgen_force(run, t, moved);
        run->evaluations++;
        if (run->rhs(t, y, run->u, run->c, change, run->w) != 0) {
            continue;
        }
        for (int i = 0; i < n; i++) {
            J[i * n + k] += (change[i] - f[i]) / (moved[k] - y[k]);
        }
    }
    return 0;
}

/* Factor g - J for a real g and for g = x + i y; 1 if one is singular. */
static int newton_factor(eomgen_run *run, const newton_area *a, double g, double x, double y)
{
    const int n = run->n, n_q = run->n_q;
    const double square = x * x + y * y;
    run->factorizations += 2;
    if (form_of(a) == SPARSE) {
        const int filled = (int)a->state[FILLED];
        double *const room = a->im + filled;
        if (sparse_factor(n, filled, a->J, g, a->real, room) == 0 &&
            sparse_factor_complex(n, filled, a->J, x, y, a->real, a->re, a->im, room) == 0) {
            return 0;
        }
        newton_look_whole(run, a);
    }
    if (form_of(a) == PARTS && a->state[DRIFT] < RUNS_DRIFTING * fmin(fabs(g), sqrt(square))) {
        const int m = n - n_q;
        parts_matrices(n, n_q, a->J, a->real + m * m, a->re + m * m, g, x / square, -y / square, a->real, a->re, a->im);
        return lu_factor(m, a->real, a->order) || factor_complex(m, a->re, a->im, a->order_complex);
    }
    a->state[HALVED] = form_of(a) == HALF ? HALF : WHOLE;
    const int halved = form_of(a) == HALF, m = halved ? n / 2 : n;
    for (int i = 0; i < m; i++) {
        const double *const row = a->J + (halved ? m + i : i) * n;
        double *const plain = a->real + i * m, *const re = a->re + i * m, *const im = a->im + i * m;
        for (int k = 0; k < m; k++) {
            const double K = halved ? row[k] : 0.0, D = row[halved ? m + k : k];
            plain[k] = -D - K / g;
            re[k] = -D - K * (x / square);
            im[k] = K * (y / square);
        }
        plain[i] += g, re[i] += x, im[i] += y;
    }
    return lu_factor(m, a->real, a->order) || factor_complex(m, a->re, a->im, a->order_complex);
}

static void newton_solve(const eomgen_run *run, const newton_area *a, double g, double *restrict r)
{
    const int n = run->n, m = n / 2;
    if (form_of(a) == SPARSE) {
        sparse_solve(n, (int)a->state[FILLED], a->real, r, a->im + (int)a->state[FILLED]);
        return;
    }
    if (form_of(a) == PARTS) {
        const int n_q = run->n_q, n_v = n - n_q;
        double *const room = a->im + n_v * n_v;
        parts_carry(n, n_q, a->J, g, NULL, r, room);
        add_times(n_v, n_q, a->J + n_q * n, n, r, r + n_q);
        lu_solve(n_v, a->real, a->order, r + n_q);
        parts_carry(n, n_q, a->J, g, r + n_q, r, room);
        return;
    }
    if (form_of(a) == WHOLE) {
        lu_solve(n, a->real, a->order, r);
        return;
    }
    const double inverse = 1.0 / g;
    for (int i = 0; i < m; i++) {
        double sum = 0.0;
        for (int k = 0; k < m; k++) {
            sum += a->J[(m + i) * n + k] * r[k];
        }
        r[m + i] += sum * inverse;
    }
    lu_solve(m, a->real, a->order, r + m);
    for (int i = 0; i < m; i++) {
        r[i] = (r[i] + r[m + i]) * inverse;
    }
}

/* The same for g = x + i y and r + i s. */
static void newton_solve_complex(const eomgen_run *run, const newton_area *a, double x, double y, double *restrict r,
                                 double *restrict s)
{
    const int n = run->n, m = n / 2;
    const double square = x * x + y * y, u = x / square, v = -y / square;
    if (form_of(a) == SPARSE) {
        const int filled = (int)a->state[FILLED];
        sparse_solve_complex(n, filled, a->real, a->re, a->im, r, s, a->im + filled);
        return;
    }
    if (form_of(a) == PARTS) {
        const int n_q = run->n_q, n_v = n - n_q;
        double *const room = a->im + n_v * n_v;
        parts_carry_complex(n, n_q, a->J, u, v, NULL, NULL, r, s, room);
        add_times(n_v, n_q, a->J + n_q * n, n, r, r + n_q);
        add_times(n_v, n_q, a->J + n_q * n, n, s, s + n_q);
        solve_complex(n_v, a->re, a->im, a->order_complex, r + n_q, s + n_q);
        parts_carry_complex(n, n_q, a->J, u, v, r + n_q, s + n_q, r, s, room);
        return;
    }
    if (form_of(a) == WHOLE) {
        solve_complex(n, a->re, a->im, a->order_complex, r, s);
        return;
    }
    for (int i = 0; i < m; i++) {
        double p = 0.0, q = 0.0;
        for (int k = 0; k < m; k++) {
            p += a->J[(m + i) * n + k] * r[k];
            q += a->J[(m + i) * n + k] * s[k];
        }
        r[m + i] += p * u - q * v, s[m + i] += p * v + q * u;
    }
    solve_complex(m, a->re, a->im, a->order_complex, r + m, s + m);
    for (int i = 0; i < m; i++) {
        const double p = r[i] + r[m + i], q = s[i] + s[m + i];
        r[i] = p * u - q * v, s[i] = p * v + q * u;
    }
}

/* Radau IIA of order 5: E. Hairer, G. Wanner, Solving Ordinary Differential Equations II, section IV.8, with the
   constants and rules of SciPy's Radau, so that the same steps are taken. */
#include <float.h>
#include <math.h>
#include <string.h>

#include "eomgen_steppers.h"

/* Rows of run->K: 3 stages less the state, 3 of the same transformed, 3 slopes, 3 changes; then one each, but spare with
   two; the last step's polynomial, and its whole change. */
enum { RADAU_Z = 0, RADAU_W = 3, RADAU_F = 6, RADAU_D = 9, RADAU_SCALE = 12, RADAU_ERROR, RADAU_ZE, RADAU_SPARE,
       RADAU_Q = 18, RADAU_LAST = 21, RADAU_ROWS = 22 };
/* Numbers kept from step to step in newton_area.state. */
enum { RADAU_H_OLD = 1, RADAU_ERROR_OLD, RADAU_CURRENT, RADAU_FACTORED, RADAU_H_FACTORED, RADAU_H };
enum { NEWTON_MOST = 6 };

static const double S6 = 2.449489742783178, MU = 3.6378342527444957, MU_RE = 2.6810828736277523,
                    MU_IM = -3.0504301992474105;
static const double RADAU_C[3] = {0.15505102572168217, 0.6449489742783178, 1.0};
static const double RADAU_T_[2][3] = {{0.09443876248897524, -0.14125529502095421, 0.03002919410514742},
                                      {0.25021312296533332, 0.20412935229379994, -0.38294211275726192}};
static const double TI[3][3] = {{4.17871859155190428, 0.32768282076106237, 0.52337644549944951},
                                {-4.17871859155190428, -0.32768282076106237, 0.47662355450055044},
                                {0.50287263494578682, -2.57192694985560522, 0.59603920482822492}};

static double radau_norm(const eomgen_run *run, const double *x, int rows)
{
    const double *restrict const scale = run->K + RADAU_SCALE * run->n;
    double sum = 0.0;
    for (int k = 0; k < rows; k++) {
        for (int i = 0; i < run->n; i++) {
            const double part = x[k * run->n + i] / scale[i];
            sum += part * part;
        }
    }
    return run->n > 0 ? sqrt(sum / (rows * run->n)) : 0.0;
}

/* The last step's polynomial at t, less its state at the start. */
static void radau_poly(int n, const double *restrict Q, double x, double *restrict z)
{
    for (int i = 0; i < n; i++) {
        z[i] = x * (Q[i] + x * (Q[n + i] + x * Q[2 * n + i]));
    }
}

/* The collocation equations by Newton's method with the matrices factored: 1 where it converged. */
static int radau_solve(eomgen_run *run, const newton_area *a, double h, int *iterations, double *rate)
{
    const int n = run->n;
    const double g = MU / h, x = MU_RE / h, y = MU_IM / h;
    const double tolerance = fmax(10.0 * DBL_EPSILON / run->rtol, fmin(0.03, sqrt(run->rtol)));
    double *restrict const Z = run->K, *restrict const W = run->K + RADAU_W * n, *const F = run->K + RADAU_F * n;
    double *const D = run->K + RADAU_D * n, *const at = run->K + RADAU_SPARE * n;
    double before = 0.0;
    for (int i = 0; i < n; i++) {
        for (int k = 0; k < 3; k++) {
            W[k * n + i] = TI[k][0] * Z[i] + TI[k][1] * Z[n + i] + TI[k][2] * Z[2 * n + i];
        }
    }
    *rate = -1.0;
    for (int k = 0; k < NEWTON_MOST; k++) {
        *iterations = k + 1;
        double finite = 0.0;
        for (int s = 0; s < 3; s++) {
            for (int i = 0; i < n; i++) {
                at[i] = run->y[i] + Z[s * n + i];
            }
            eomgen_evaluate(run, run->t + RADAU_C[s] * h, at, F + s * n);
            for (int i = 0; i < n; i++) {
                finite += F[s * n + i] * 0.0;
            }
            if (finite != 0.0) {
                return 0;
            }
        }
        for (int i = 0; i < n; i++) {
            const double p = F[i], q = F[n + i], r = F[2 * n + i];
            D[i] = TI[0][0] * p + TI[0][1] * q + TI[0][2] * r - g * W[i];
            D[n + i] = TI[1][0] * p + TI[1][1] * q + TI[1][2] * r - (x * W[n + i] - y * W[2 * n + i]);
            D[2 * n + i] = TI[2][0] * p + TI[2][1] * q + TI[2][2] * r - (x * W[2 * n + i] + y * W[n + i]);
        }
        newton_solve(run, a, g, D);
        newton_solve_complex(run, a, x, y, D + n, D + 2 * n);
        const double size = radau_norm(run, D, 3);
        if (k > 0) {
            *rate = size / before;
            if (!(*rate < 1.0) || pow(*rate, NEWTON_MOST - k) / (1.0 - *rate) * size > tolerance) {
                return 0;
            }
        }
        for (int i = 0; i < n; i++) {
            const double p = W[i] += D[i], q = W[n + i] += D[n + i], r = W[2 * n + i] += D[2 * n + i];
            Z[i] = RADAU_T_[0][0] * p + RADAU_T_[0][1] * q + RADAU_T_[0][2] * r;
            Z[n + i] = RADAU_T_[1][0] * p + RADAU_T_[1][1] * q + RADAU_T_[1][2] * r;
            Z[2 * n + i] = p + q;
        }
        if (size == 0.0 || (k > 0 && *rate / (1.0 - *rate) * size < tolerance)) {
            return 1;
        }
        before = size;
    }
    return 0;
}

/* Section IV.8, predictive step size control. */
static double radau_factor(double h, double h_old, double error, double error_old)
{
    double growth = 1.0;
    if (h_old > 0.0 && error_old >= 0.0 && error != 0.0) {
        growth = fmin(1.0, h / h_old * pow(error_old / error, 0.25));
    }
    return growth * pow(error, -0.25);
}

static void radau_begin(eomgen_run *run)
{
    const newton_area a = newton_areas(run, RADAU_ROWS);
    memset(a.state, 0, NEWTON_STATE * sizeof(double));
    a.state[RADAU_ERROR_OLD] = -1.0;
    a.state[RADAU_CURRENT] =
        eomgen_differentiate(run, run->t, run->y, run->f, a.J, run->K + RADAU_SPARE * run->n) == 0;
    newton_look(run, &a);
}

/* Radau IIA, one step. */

/* The Jacobian at the present state, or at the next one. */
static int radau_differentiate(eomgen_run *run, const newton_area *a, double t, const double *y, const double *f)
{
    a->state[RADAU_FACTORED] = 0.0;
    const int status = eomgen_differentiate(run, t, y, f, a->J, run->K + RADAU_SPARE * run->n);
    a->state[RADAU_CURRENT] = status == 0;
    newton_look(run, a);
    return status;
}

/* Solve for the stages of a step h, with a new Jacobian if the old one does not do. */
static int radau_converge(eomgen_run *run, const newton_area *a, double h, int *iterations, double *rate)
{
    const int n = run->n;
    for (int i = 0; i < n; i++) {
        run->K[RADAU_SCALE * n + i] = run->atol[i] + fabs(run->y[i]) * run->rtol;
    }
    for (;;) {
        for (int s = 0; s < 3; s++) {
            double *const Z = run->K + s * n;
            memset(Z, 0, (size_t)n * sizeof(double));
            if (a->state[RADAU_H] != 0.0) { /* the last step's polynomial goes on */
                radau_poly(n, run->K + RADAU_Q * n, 1.0 + RADAU_C[s] * h / a->state[RADAU_H], Z);
                for (int i = 0; i < n; i++) {
                    Z[i] -= run->K[RADAU_LAST * n + i];
                }
            }
        }
        int fine = 1;
        if (a->state[RADAU_FACTORED] == 0.0) {
            fine = newton_factor(run, a, MU / h, MU_RE / h, MU_IM / h) == 0;
            a->state[RADAU_FACTORED] = fine, a->state[RADAU_H_FACTORED] = h;
        }
        if (fine && radau_solve(run, a, h, iterations, rate)) {
            return 1;
        }
        if (run->stopped || a->state[RADAU_CURRENT] != 0.0 || radau_differentiate(run, a, run->t, run->y, run->f) != 0) {
            return 0;
        }
    }
}

/* The error of the step, section IV.8 (8.19), or (8.20) where the first is too large after a rejection. */
static double radau_error(eomgen_run *run, const newton_area *a, double h, const double *y_new, int rejected)
{
    const int n = run->n;
    const double *const Z = run->K;
    double *const error = run->K + RADAU_ERROR * n, *const ZE = run->K + RADAU_ZE * n;
    double *const at = run->K + RADAU_SPARE * n;
    const double e0 = (-13.0 - 7.0 * S6) / 3.0, e1 = (-13.0 + 7.0 * S6) / 3.0, e2 = -1.0 / 3.0;
    for (int i = 0; i < n; i++) {
        ZE[i] = (Z[i] * e0 + Z[n + i] * e1 + Z[2 * n + i] * e2) / h;
        error[i] = run->f[i] + ZE[i];
        run->K[RADAU_SCALE * n + i] = run->atol[i] + fmax(fabs(run->y[i]), fabs(y_new[i])) * run->rtol;
    }
    newton_solve(run, a, MU / h, error);
    double size = radau_norm(run, error, 1);
    if (rejected && size > 1.0) {
        for (int i = 0; i < n; i++) {
            at[i] = run->y[i] + error[i];
        }
        eomgen_evaluate(run, run->t, at, error);
        for (int i = 0; i < n; i++) {
            error[i] += ZE[i];
        }
        newton_solve(run, a, MU / h, error);
        size = radau_norm(run, error, 1);
    }
    return size;
}

static void radau_accept(eomgen_run *run, const newton_area *a, double h, double t_new)
{
    const int n = run->n;
    const double *const Z = run->K;
    double *const Q = run->K + RADAU_Q * n, *const y = run->y_old;
    for (int i = 0; i < n; i++) {
        const double p = Z[i], q = Z[n + i], r = Z[2 * n + i];
        Q[i] = p * (13.0 / 3.0 + 7.0 * S6 / 3.0) + q * (13.0 / 3.0 - 7.0 * S6 / 3.0) + r / 3.0;
        Q[n + i] = p * (-23.0 / 3.0 - 22.0 * S6 / 3.0) + q * (-23.0 / 3.0 + 22.0 * S6 / 3.0) - r * (8.0 / 3.0);
        Q[2 * n + i] = p * (10.0 / 3.0 + 5.0 * S6) + q * (10.0 / 3.0 - 5.0 * S6) + r * (10.0 / 3.0);
    }
    memcpy(run->K + RADAU_LAST * n, Z + 2 * n, (size_t)n * sizeof(double));
    a->state[RADAU_H] = h;
    run->y_old = run->y, run->y = y;
    run->t_old = run->t, run->t = t_new, run->step = h;
    run->interpolates = 0;
    run->steps++;
    eomgen_evaluate(run, t_new, run->y, run->f);
}

static int radau_step(eomgen_run *run)
{
    const int n = run->n;
    const newton_area area = newton_areas(run, RADAU_ROWS), *const a = &area;
    const double least = least_step(run), entered = run->h_abs;
    double h_abs = fmin(fmax(entered, least), eomgen_longest(run)), rate = -1.0, size;
    double h_old = a->state[RADAU_H_OLD], error_old = a->state[RADAU_ERROR_OLD];
    if (run->most_steps > 0 && run->steps >= run->most_steps) {
        return EOMGEN_TOO_MANY_STEPS;
    }
    if (h_abs != entered) {
        h_old = 0.0;
    }
    for (int rejected = 0, iterations = 0;;) {
        if (run->stopped || !(h_abs >= least)) {
            return run->stopped ? EOMGEN_STOPPED : EOMGEN_STEP_TOO_SMALL;
        }
        const double t_new = end_of_step(run, h_abs, 0.0), h = t_new - run->t;
        h_abs = fabs(h);
        if (!(fabs(h - a->state[RADAU_H_FACTORED]) <= RUNS_SAME * h_abs)) {
            a->state[RADAU_FACTORED] = 0.0;
        }
        if (!radau_converge(run, a, h, &iterations, &rate)) {
            h_abs *= 0.5, a->state[RADAU_FACTORED] = 0.0;
            run->rejected++;
            continue;
        }
        for (int i = 0; i < n; i++) {
            run->y_old[i] = run->y[i] + run->K[2 * n + i];
        }
        size = radau_error(run, a, h, run->y_old, rejected);
        const double safety = 0.9 * (2 * NEWTON_MOST + 1) / (2 * NEWTON_MOST + iterations);
        double factor = safety * radau_factor(h_abs, h_old, size, error_old);
        if (!(size <= 1.0)) {
            h_abs *= factor > 0.2 ? factor : 0.2;
            a->state[RADAU_FACTORED] = 0.0, rejected = 1;
            run->rejected++;
            continue;
        }
        const int renew = iterations > 2 && rate > RUNS_SLOW;
        factor = fmin(10.0, factor);
        if (!renew && factor < 1.2) {
            factor = 1.0;
        } else {
            a->state[RADAU_FACTORED] = 0.0;
        }
        radau_accept(run, a, h, t_new);
        a->state[RADAU_CURRENT] = 0.0;
        if (renew) {
            radau_differentiate(run, a, run->t, run->y, run->f);
        }
        a->state[RADAU_H_OLD] = entered, a->state[RADAU_ERROR_OLD] = size;
        run->h_abs = h_abs * factor;
        return 0;
    }
}

static void radau_prepare(eomgen_run *run)
{
    memcpy(run->F, run->K + RADAU_Q * run->n, (size_t)(3 * run->n) * sizeof(double));
}

static void radau_interpolate(const eomgen_run *run, double t, double *y)
{
    radau_poly(run->n, run->F, (t - run->t_old) / run->step, y);
    for (int i = 0; i < run->n; i++) {
        y[i] += run->y_old[i];
    }
}

const eomgen_method eomgen_radau = {"Radau", RADAU_ROWS, 3, 3, NULL, NULL, radau_prepare, radau_interpolate, 0, 4, 0,
                                    radau_begin, radau_step};

#if defined(__GNUC__) && !defined(__clang__) && defined(__OPTIMIZE__)
#pragma GCC pop_options
#endif
