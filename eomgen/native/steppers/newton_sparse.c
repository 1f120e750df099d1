/* Systems (g - J) x = r where J has few numbers: P (g - J) P^T = L U on the pattern of both and what fills it, in the order of
   least degree (W. F. Tinney, J. W. Walker, Proc. IEEE 55 (1967) 1801-1809), without exchanges of rows. The unknowns of
   bodies and elements that do not touch stay apart; elements that only their bodies know are eliminated first. */
#include <math.h>
#include <stdint.h>
#include <string.h>

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
