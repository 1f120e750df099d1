/* Contacts of one or two directions by their edges: impulses are sums of multipliers, 0 or more, of the edges of the cones, and
   those that act are found one by one. An edge k is the normal and friction times the direction across, or against it. */

typedef struct {
    contacts *s;
    int count; /* edges that act: s->order */
    double *own, *acts, *row, *ratios, *none, *shift; /* multipliers; whether they act; scratch; zeros; mu |y_t| */
} edges;

static double lean_of(const edges *e, int k)
{
    const contacts *const s = e->s;
    return s->d == 1 ? 0.0 : (k % 2 ? -s->friction[k/2] : s->friction[k/2]);
}

/* What a row of contacts (velocities, or impulses at the place of an edge) is along an edge. */
static double along_edge(const edges *e, int k, const double *y)
{
    return e->s->d == 1 ? y[k] : y[k - k % 2] + lean_of(e, k)*y[k - k % 2 + 1];
}

/* Compliance between two edges. */
static double between(const edges *e, int k, int l)
{
    const contacts *const s = e->s;
    const double *const W = s->W + (ptrdiff_t)(k - k % s->d)*s->n;
    const double normal = along_edge(e, l, W);
    return s->d == 1 ? normal : normal + lean_of(e, k)*along_edge(e, l, W + s->n);
}

static double own_of(const edges *e, int k)
{
    return (1.0 + RIGID_FIRM)*between(e, k, k);
}

/* Solve L x = b for the edges that act, in place, and L^T x = b. */
static void enter(const edges *e, double *x)
{
    const double *const L = e->s->A;
    for (int i = 0; i < e->count; i++) { x[i] = (x[i] - dot(i, L + (ptrdiff_t)i*e->s->n, x))/L[(ptrdiff_t)i*(e->s->n + 1)]; }
}

static void leave(const edges *e, double *x)
{
    const ptrdiff_t n = e->s->n;
    const double *const L = e->s->A;
    for (int i = e->count - 1; i >= 0; i--) {
        x[i] /= L[i*(n + 1)];
        for (int j = 0; j < i; j++) { x[j] -= L[i*n + j]*x[i]; }
    }
}

/* An edge acts, whose row is solved; `rest` is what is left of its own compliance. */
static void append(edges *e, int k, const double *row, double rest)
{
    double *const last = e->s->A + (ptrdiff_t)e->count*e->s->n;
    memcpy(last, row, (size_t)e->count*sizeof(double));
    last[e->count] = sqrt(rest);
    e->s->order[e->count++] = k, e->acts[k] = 1.0;
}

static double rest_of(const edges *e, int k, const double *row)
{
    const double own = own_of(e, k);
    return fmax(own - dot(e->count, row, row), 0.5*RIGID_FIRM*own);
}

/* The edge at one place acts no more: rows behind it are turned back into a triangle. */
static void strike(edges *e, int at)
{
    const ptrdiff_t n = e->s->n;
    double *const L = e->s->A;
    e->acts[e->s->order[at]] = 0.0, e->own[e->s->order[at]] = 0.0, e->count--;
    for (int i = at; i < e->count; i++) {
        double *const row = L + i*n;
        e->s->order[i] = e->s->order[i + 1];
        memcpy(row, row + n, (size_t)(i + 2)*sizeof(double));
    }
    for (int i = at; i < e->count; i++) { /* row i has one number too many, at i + 1 */
        const double a = L[i*n + i], b = L[i*n + i + 1], size = sqrt(a*a + b*b), c = a/size, d = b/size;
        L[i*n + i] = size;
        for (int j = i + 1; j < e->count; j++) {
            double *const pair = L + j*n + i;
            const double x = pair[0], y = pair[1];
            pair[0] = c*x + d*y, pair[1] = c*y - d*x;
        }
    }
}

static void factor_edges(edges *e)
{
    const int listed = e->count;
    e->count = 0;
    for (int a = 0; a < listed; a++) {
        const int k = e->s->order[a];
        for (int b = 0; b < e->count; b++) { e->row[b] = between(e, k, e->s->order[b]); }
        enter(e, e->row);
        const double rest = rest_of(e, k, e->row);
        if (rest > 0.0) { append(e, k, e->row, rest); }
    }
}

/* Multipliers with which the edges that act have no velocity; those that would pull act no more. */
static void settle(edges *e)
{
    const contacts *const s = e->s;
    int pull = 1;
    while (pull) {
        pull = 0;
        for (int a = 0; a < e->count; a++) { e->row[a] = -along_edge(e, s->order[a], s->given) - e->shift[s->order[a]/s->d]; }
        enter(e, e->row);
        leave(e, e->row);
        for (int a = e->count - 1; a >= 0; a--) {
            e->own[s->order[a]] = e->row[a];
            if (!(e->row[a] >= 0.0)) { strike(e, a), pull = 1; }
        }
    }
}

static void press_edges(const edges *e, const double *own, double *P)
{
    const contacts *const s = e->s;
    memset(P, 0, (size_t)s->n*sizeof(double));
    for (int a = 0; a < e->count; a++) {
        const int k = s->order[a];
        P[k - k % s->d] += own[k];
        if (s->d == 2) { P[k - k % 2 + 1] += lean_of(e, k)*own[k]; }
    }
}

/* The edge that the velocities break most, beyond the tolerance; -1 for none. */
static int worst_edge(const edges *e, const double *y, double tolerance)
{
    const contacts *const s = e->s;
    int found = -1;
    double least = -tolerance;
    for (int k = 0; k < s->n; k++) {
        const double lean = fabs(lean_of(e, k)), lost = along_edge(e, k, y) + e->shift[k/s->d];
        const double speed = s->d == 2 ? lost/fmin(1.0, fmax(lean, RIGID_SLIPPERY)) : lost;
        if (e->acts[k] == 0.0 && speed < least && !(k % 2 && s->d == 2 && lean == 0.0)) { least = speed, found = k; }
    }
    return found;
}

/* Multipliers for the shifts that are set, in at most so many pivots; how many there were. */
static int pivot(edges *e, double *P, double tolerance, int most)
{
    contacts *const s = e->s;
    int count = 0, k;
    settle(e);
    press_edges(e, e->own, P);
    find_velocities(s->n, s->W, s->given, e->none, P, s->y);
    while (count < most && (k = worst_edge(e, s->y, tolerance)) >= 0) {
        double left = -along_edge(e, k, s->y) - e->shift[k/s->d]; /* velocity that is to go */
        int done = 0;
        e->own[k] = 0.0;
        while (!done && count < most) {
            double whole, reach = (double)INFINITY;
            int first = -1;
            for (int a = 0; a < e->count; a++) { e->row[a] = between(e, k, s->order[a]); }
            enter(e, e->row);
            const double rest = rest_of(e, k, e->row);
            if (!(rest > 0.0)) { /* what has no compliance takes no impulse */
                return most;
            }
            memcpy(e->ratios, e->row, (size_t)e->count*sizeof(double));
            leave(e, e->ratios);
            whole = left/rest;
            for (int a = 0; a < e->count; a++) {
                const double own = e->own[s->order[a]];
                if (e->ratios[a] > 0.0 && own < reach*e->ratios[a]) { reach = own/e->ratios[a], first = a; }
            }
            done = whole <= reach;
            const double part = done ? whole : reach;
            for (int a = 0; a < e->count; a++) { e->own[s->order[a]] -= part*e->ratios[a]; }
            e->own[k] += part, left -= part*rest, count++;
            if (done) {
                append(e, k, e->row, rest);
            } else {
                strike(e, first);
            }
        }
        if (!done) { /* it does not act, what has changed is forgotten */
            e->own[k] = 0.0;
        }
        press_edges(e, e->own, P);
        find_velocities(s->n, s->W, s->given, e->none, P, s->y);
    }
    return count;
}

/* From the guess P on, friction as if surfaces rose with mu |y_t| while they slide (De Saxce and Feng), so that multipliers are
   those of a convex problem, with what slides renewed until it is as it was. The best are kept; whether they are better. */
static int solve_edges(contacts *s, double *P, double *least, double tolerance)
{
    edges e;
    const double before = *least;
    int still = 0, left = RIGID_PIVOTS*s->n;
    e.s = s, e.count = 0, e.own = s->tried, e.acts = s->more, e.row = s->b, e.ratios = s->pulled;
    e.none = s->c, e.shift = s->pressed;
    for (int k = 0; k < s->n; k++) {
        const int i = k/s->d;
        const double reach = s->d == 2 ? s->friction[i]*P[2*i] : 0.0, across = k % s->d || s->d == 1 ? -P[k] : P[k + 1];
        const double own = s->d == 1 ? P[k] : (reach > 0.0 ? 0.5*(P[2*i] + across/s->friction[i]) : (k % 2 ? 0.0 : P[2*i]));
        e.own[k] = 0.0;
        if (own > RIGID_FIRM*P[k - k % s->d]) { s->order[e.count++] = k; }
    }
    for (int round = 0; round < RIGID_RENEWED && still < RIGID_VAIN && left > 0 && *least > tolerance; round++) {
        const double known = *least;
        for (int i = 0; i < s->m; i++) { e.shift[i] = s->d == 2 ? s->friction[i]*fabs(s->y[2*i + 1]) : 0.0; }
        for (int k = 0; k < s->n; k++) { e.acts[k] = 0.0, e.none[k] = 0.0; }
        for (int a = 0; a < e.count; a++) { e.acts[s->order[a]] = 1.0; }
        if (round == 0) { factor_edges(&e); }
        left -= pivot(&e, P, 0.5*tolerance, left);
        keep_better(s, P, least);
        still = *least < known ? 0 : still + 1;
    }
    memcpy(P, s->best, (size_t)s->n*sizeof(double));
    return *least < before;
}
