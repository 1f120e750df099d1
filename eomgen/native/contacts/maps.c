/* The laws of contact as natural maps. This and what follows is compiled twice: plain.c and wide.c say as what. */

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

/* y = c + W P + more P, by rows of W, which is symmetric. */
DENSE static void find_velocities(int n, const double *restrict W, const double *restrict c, const double *restrict more,
                                        const double *restrict P, double *restrict y)
{
    for (int k = 0; k < n; k++) { y[k] = c[k] + more[k]*P[k]; }
    for (int j = 0; j < n; j++) {
        const double *restrict const row = W + (ptrdiff_t)j*n;
        for (int k = 0; P[j] != 0.0 && k < n; k++) { y[k] += P[j]*row[k]; }
    }
}

static void velocities(contacts *s, const double *P)
{
    find_velocities(s->n, s->W, s->c, s->more, P, s->y);
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

/* Each contact for itself, one after the other, as given; y are the velocities for P and stay so. */
DENSE static void sweep_all(int m, int d, const double *restrict given, const double *restrict normal,
                                  const double *restrict across, const double *restrict friction, double *restrict P,
                                  double *restrict y)
{
    const int n = m*d;
    for (int i = 0; i < m; i++) {
        const double *restrict const W = given + (ptrdiff_t)i*d*n;
        double *restrict const p = P + i*d, change[3] = {0.0, 0.0, 0.0}, pulled[3] = {0.0, 0.0, 0.0}, square = 0.0;
        const double pressed = p[0] - y[i*d]/normal[i], push = pressed > 0.0 ? pressed : 0.0, reach = friction[i]*push;
        change[0] = push - p[0];
        for (int k = 1; k < d; k++) {
            pulled[k] = p[k] - (y[i*d + k] + W[(ptrdiff_t)k*n + i*d]*change[0])/across[i];
            square += pulled[k]*pulled[k];
        }
        const double size = d == 2 ? fabs(pulled[1]) : sqrt(square), part = size > reach ? reach/size : 1.0;
        p[0] = push;
        for (int k = 1; k < d; k++) {
            change[k] = pulled[k]*part - p[k];
            p[k] = pulled[k]*part;
        }
        if (d == 2 && (change[0] != 0.0 || change[1] != 0.0)) {
            for (int k = 0; k < n; k++) { y[k] += change[0]*W[k] + change[1]*W[n + k]; }
            continue;
        }
        for (int l = 0; l < d; l++) {
            for (int k = 0; change[l] != 0.0 && k < n; k++) { y[k] += change[l]*W[(ptrdiff_t)l*n + k]; }
        }
    }
}

/* As many sweeps, from the velocities for P on. */
static void sweep(const contacts *s, double *P, int times)
{
    for (int k = 0; k < times; k++) { sweep_all(s->m, s->d, s->W, s->normal, s->across, s->friction, P, s->y); }
}
