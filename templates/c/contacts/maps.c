/* The laws of contact as natural maps. */
#include <math.h>
#include <stddef.h>
#include <string.h>

#include "eomgen_contacts.h"

/* Contacts, n = m d rows; `more` is what the diagonal of W has besides, c the velocities that belong to it. */
typedef struct {
    int m, d, n;
    const double *W, *given, *friction;
    double *c, *more, *normal, *across, *y, *misses, *pressed, *pulled, *A, *b, *tried, *best;
    int *order, *on;
} contacts;

static double dot(int n, const double *restrict a, const double *restrict b)
{
    double sums[4] = {0.0, 0.0, 0.0, 0.0};
    int k = 0;
    for (; k + 4 <= n; k += 4) {
        for (int l = 0; l < 4; l++) { sums[l] += a[k + l]*b[k + l]; }
    }
    for (; k < n; k++) { sums[0] += a[k]*b[k]; }
    return (sums[0] + sums[1]) + (sums[2] + sums[3]);
}

/* What turns an entry of a map into a velocity. */
static double scale_of(const contacts *s, int row)
{
    return row % s->d ? s->across[row/s->d] : s->normal[row/s->d];
}

/* Each contact softer by a part of its compliance about impulses P; as it is for 0. */
static void soften(contacts *s, const double *P, double part)
{
    for (int k = 0; k < s->n; k++) {
        s->more[k] = part*scale_of(s, k);
        s->c[k] = s->given[k] - s->more[k]*P[k];
    }
}

static void velocities(contacts *s, const double *P)
{
    for (int k = 0; k < s->n; k++) { s->y[k] = s->c[k] + dot(s->n, s->W + (ptrdiff_t)k*s->n, P) + s->more[k]*P[k]; }
}

static double length_of(int n, const double *x)
{
    return sqrt(dot(n, x, x));
}

/* Both maps, and the largest entry as a velocity (m/s), NaN where there is one. */
static double find_misses(contacts *s, const double *P)
{
    const int d = s->d;
    double largest = 0.0;
    velocities(s, P);
    for (int i = 0; i < s->m; i++) {
        const double *const p = P + i*d, *const y = s->y + i*d;
        double *const pulled = s->pulled + i*d, *const miss = s->misses + i*d;
        const double pressed = p[0] - y[0]/s->normal[i], push = pressed <= 0.0 ? 0.0 : pressed; /* NaN stays */
        const double reach = s->friction[i]*push;
        s->pressed[i] = pressed;
        miss[0] = p[0] - push;
        for (int k = 1; k < d; k++) { pulled[k] = p[k] - y[k]/s->across[i]; }
        const double size = length_of(d - 1, pulled + 1), part = size > reach ? reach/size : 1.0;
        for (int k = 1; k < d; k++) { miss[k] = p[k] - part*pulled[k]; }
        for (int k = 0; k < d; k++) {
            const double speed = fabs(miss[k])*(k ? s->across[i] : s->normal[i]);
            largest = speed > largest || isnan(speed) ? speed : largest;
        }
    }
    return largest;
}

/* Each contact for itself, one after the other, as given. */
static void sweep(const contacts *s, double *P)
{
    const int d = s->d, n = s->n;
    for (int i = 0; i < s->m; i++) {
        const double *const W = s->W + (ptrdiff_t)i*d*n;
        double *const p = P + i*d, pulled[4], y[4];
        for (int k = 0; k < d; k++) { y[k] = s->given[i*d + k] + dot(n, W + (ptrdiff_t)k*n, P); }
        const double pressed = p[0] - y[0]/s->normal[i], push = pressed > 0.0 ? pressed : 0.0, change = push - p[0];
        p[0] = push;
        for (int k = 1; k < d; k++) { pulled[k] = p[k] - (y[k] + W[(ptrdiff_t)k*n + i*d]*change)/s->across[i]; }
        const double size = length_of(d - 1, pulled + 1), reach = s->friction[i]*push;
        for (int k = 1; k < d; k++) { p[k] = size > reach ? pulled[k]*(reach/size) : pulled[k]; }
    }
}
