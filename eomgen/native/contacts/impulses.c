/* Impulses of rigid contacts: first their laws as natural maps. */

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

/* Newton's method for the natural maps. Contacts that do not press lose their impulses at once; the equations of the others
   remain. */

/* The row of A for an equation g . (P + x): `own` rows of the contact i and the rows of velocities, by what they count. */
static void add_rows(const contacts *s, int i, int count, const double *own, const double *slopes, double *row, double *right)
{
    const int d = s->d;
    for (int k = 0; k < d; k++) {
        if (slopes[k] == 0.0 && own[k] == 0.0) {
            continue;
        }
        const double *const W = s->W + (ptrdiff_t)(i*d + k)*s->n;
        for (int a = 0; a < count; a++) {
            const int j = s->on[a];
            for (int l = 0; l < d; l++) { row[a*d + l] += slopes[k]*W[j*d + l]; }
            if (j == i) { row[a*d + k] += own[k] + slopes[k]*s->more[i*d + k]; }
        }
        for (int j = 0; j < s->m; j++) {
            if (s->pressed[j] > 0.0) {
                continue;
            }
            for (int l = 0; l < d; l++) { *right += slopes[k]*W[j*d + l]*s->misses[j*d + l]; } /* they change by -misses */
        }
    }
}

/* One step for the maps that find_misses left; 1 where it has no solution. */
static int newton_step(contacts *s, double *P)
{
    const int d = s->d;
    int count = 0;
    for (int i = 0; i < s->m; i++) {
        if (s->pressed[i] > 0.0) { s->on[count++] = i; }
    }
    const int n = count*d;
    memset(s->A, 0, (size_t)n*(size_t)n*sizeof(double));
    for (int a = 0; a < count; a++) {
        const int i = s->on[a];
        const double *const pulled = s->pulled + i*d;
        const double reach = s->friction[i]*s->pressed[i], size = length_of(d - 1, pulled + 1);
        for (int k = 0; k < d; k++) {
            double own[4] = {0.0}, slopes[4] = {0.0};
            s->b[a*d + k] = -s->misses[i*d + k];
            if (k == 0) {
                slopes[0] = 1.0/s->normal[i];
            } else if (size < reach) {
                slopes[k] = 1.0/s->across[i];
            } else {
                const double along = size > 0.0 ? pulled[k]/size : 0.0, turn = d > 2 && size > 0.0 ? reach/size : 0.0;
                own[k] = 1.0;
                own[0] = -s->friction[i]*along, slopes[0] = s->friction[i]*along/s->normal[i];
                for (int l = 1; turn > 0.0 && l < d; l++) {
                    const double part = turn*((l == k) - along*pulled[l]/size);
                    own[l] -= part, slopes[l] += part/s->across[i];
                }
            }
            add_rows(s, i, count, own, slopes, s->A + (ptrdiff_t)(a*d + k)*n, s->b + a*d + k);
        }
    }
    if (lu_factor(n, s->A, s->order)) {
        return 1;
    }
    lu_solve(n, s->A, s->order, s->b);
    for (int i = 0; i < s->m; i++) {
        for (int k = 0; k < d && !(s->pressed[i] > 0.0); k++) { P[i*d + k] -= s->misses[i*d + k]; }
    }
    for (int a = 0; a < count; a++) {
        for (int k = 0; k < d; k++) { P[s->on[a]*d + k] += s->b[a*d + k]; }
    }
    return 0;
}

/* Iterations for the softer contacts that are set, in place; NaN where they have no step. Returns how many there were. */
static int newton(contacts *s, double *P, double tolerance, int most)
{
    for (int count = 0; count < most; count++) {
        if (find_misses(s, P) <= tolerance) {
            return count;
        }
        if (newton_step(s, P)) {
            for (int k = 0; k < s->n; k++) { P[k] = (double)NAN; }
            return count;
        }
    }
    return most;
}

/* Laws rounded over a velocity: a Newton step in place, and the residual before it in *left; 1 where there is no step. */
static int rounded_step(contacts *s, double *P, double rounding, double *left)
{
    const int d = s->d, n = s->n;
    *left = 0.0;
    velocities(s, P);
    for (int i = 0; i < s->m; i++) {
        const double *const p = P + i*d, *const y = s->y + i*d;
        double pulled[4], slope[4], *const miss = s->b + i*d;
        const double near = rounding/s->normal[i], beside = rounding/s->across[i];
        const double x = p[0] - y[0]/s->normal[i], root = sqrt(x*x + 4.0*near*near);
        const double push = x < 0.0 ? 2.0*near*near/(fabs(x) + root) : 0.5*(x + root), rise = 0.5*(1.0 + x/root);
        double *const rows = s->A + (ptrdiff_t)i*d*n, square = beside*beside;
        miss[0] = p[0] - push;
        for (int k = 1; k < d; k++) {
            pulled[k] = p[k] - y[k]/s->across[i];
            square += pulled[k]*pulled[k];
        }
        const double size = sqrt(square), reach = s->friction[i]*push;
        const double edge = sqrt((size - reach)*(size - reach) + 4.0*beside*beside), larger = 0.5*(size + reach + edge);
        const double part = reach/larger, bend = (size - reach)/(2.0*edge);
        /* d part = (d reach - part d larger)/larger, d larger = (1/2 + bend) d size + (1/2 - bend) d reach */
        const double by_reach = (1.0 - part*(0.5 - bend))/larger, by_size = -part*(0.5 + bend)/larger;
        for (int k = 1; k < d; k++) { miss[k] = p[k] - part*pulled[k]; }
        for (int k = 0; k < d; k++) {
            /* slopes of the map k by x (k = 0) and by the pulled ones: rows of I minus these times rows of d x, d pulled */
            double *const row = rows + (ptrdiff_t)k*n;
            slope[0] = k ? pulled[k]*by_reach*s->friction[i]*rise : rise;
            for (int l = 1; l < d; l++) { slope[l] = k ? pulled[k]*by_size*pulled[l]/size + (k == l)*part : 0.0; }
            memset(row, 0, (size_t)n*sizeof(double));
            for (int l = 0; l < d; l++) {
                const double *const W = s->W + (ptrdiff_t)(i*d + l)*n, ratio = slope[l]/(l ? s->across[i] : s->normal[i]);
                for (int j = 0; ratio != 0.0 && j < n; j++) { row[j] += ratio*W[j]; }
                row[i*d + l] += ratio*s->more[i*d + l] - slope[l];
            }
            row[i*d + k] += 1.0;
            const double speed = fabs(miss[k])*(k ? s->across[i] : s->normal[i]);
            *left = speed > *left || isnan(speed) ? speed : *left;
        }
    }
    if (lu_factor(n, s->A, s->order)) {
        return 1;
    }
    lu_solve(n, s->A, s->order, s->b);
    for (int k = 0; k < n; k++) { P[k] -= s->b[k]; }
    return 0;
}

/* The residual of the contacts as given. */
static double residual_of(contacts *s, const double *P)
{
    soften(s, P, 0.0);
    return find_misses(s, P);
}

static void keep_better(contacts *s, const double *P, double *least)
{
    const double size = residual_of(s, P);
    if (size < *least) { *least = size, memcpy(s->best, P, (size_t)s->n*sizeof(double)); }
}

/* Impulses from laws whose rounding shrinks as Newton's method follows; the best are kept. Returns the iterations. */
static int follow(contacts *s, double *least, double tolerance, int most, double shrinks)
{
    double *const P = s->tried, speed = 0.0, rounding = 1.0, left = 0.0;
    int count = 0, still = 0;
    double reached = (double)INFINITY;
    for (int k = 0; k < s->n; k++) { P[k] = 0.0, speed = fmax(speed, fabs(s->given[k])); }
    while (reached > tolerance && count < most && rounding > RIGID_SHARP && still < RIGID_PATIENT) {
        soften(s, P, RIGID_SOFT);
        for (int k = 0; k < 2; k++) {
            if (rounded_step(s, P, rounding*speed, &left)) {
                return count + 1;
            }
            count++;
            if (left < 0.1*rounding*speed) {
                break;
            }
        }
        const double size = residual_of(s, P);
        if (size < reached) { reached = size; }
        if (size < *least) { *least = size, memcpy(s->best, P, (size_t)s->n*sizeof(double)); }
        still++;
        if (left < rounding*speed) { rounding *= shrinks, still = 0; }
    }
    return count;
}

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

/* A single contact in the plane: it opens, holds, or slides to either side; P is room. */
static void try_cases(contacts *s, double *P, double *least)
{
    const double a = s->W[0], b = s->W[1], d = s->W[3], normal = s->given[0], across = s->given[1], det = a*d - b*b;
    P[0] = P[1] = 0.0;
    keep_better(s, P, least);
    if (det > 0.0) {
        P[0] = (b*across - d*normal)/det, P[1] = (b*normal - a*across)/det;
        keep_better(s, P, least);
    }
    for (int k = 0; k < 2; k++) {
        const double side = k ? -s->friction[0] : s->friction[0], stiff = a + side*b;
        if (stiff > 0.0 && normal < 0.0) {
            P[0] = -normal/stiff, P[1] = side*P[0];
            keep_better(s, P, least);
        }
    }
}

/* Impulses P from a guess, by sweeps, Newton's method for softer contacts and, in the end, rounded laws. */
static int iterate(contacts *s, double *P, double tolerance, int most, double *residual)
{
    static const double softer[] = RIGID_SOFTER, shrinks[] = RIGID_SHRINKS;
    const size_t bytes = (size_t)s->n*sizeof(double);
    double least = residual_of(s, P);
    int count = 0;
    memcpy(s->best, P, bytes);
    const int tried = s->m >= RIGID_MANY && least > tolerance;
    const int sweeps = tried && (s->d > 2 || !solve_edges(s, P, &least, tolerance)) ? RIGID_WARM : 0;
    if (sweeps) { (void)residual_of(s, P); /* velocities */ }
    for (int k = 0; k < sweeps && least > tolerance; k++) {
        sweep(s, P, RIGID_SWEEPS);
        keep_better(s, P, &least);
    }
    memcpy(P, s->best, bytes);
    for (size_t k = 0; k < sizeof(softer)/sizeof(*softer) && least > tolerance && count < most; k++) {
        soften(s, P, softer[k]);
        const int steps = newton(s, P, 0.5*tolerance, RIGID_TRIED < most - count ? RIGID_TRIED : most - count);
        count += steps > 1 ? steps : 1;
        keep_better(s, P, &least);
        memcpy(P, s->best, bytes);
        if (least > tolerance) {
            (void)residual_of(s, P); /* velocities */
            sweep(s, P, RIGID_SWEEPS);
            keep_better(s, P, &least);
        }
    }
    if (s->n == 2 && s->m == 1 && least > tolerance) { try_cases(s, P, &least); }
    for (size_t k = 0; k < sizeof(shrinks)/sizeof(*shrinks) && least > tolerance && count < most; k++) {
        count += follow(s, &least, tolerance, most - count, shrinks[k]);
    }
    memcpy(P, s->best, bytes);
    *residual = least;
    return count;
}

void CHOSEN(solve_contacts)(int m, int d, const double *W, const double *c, const double *friction, double *P,
                           double tolerance, int most, double *work, int *numbers, int *count, double *residual)
{
    const int n = m*d;
    contacts s;
    double *next = work;
    double **const parts[] = {&s.c, &s.more, &s.y, &s.misses, &s.pulled, &s.b, &s.tried, &s.best};
    s.m = m, s.d = d, s.n = n, s.W = W, s.given = c, s.friction = friction;
    for (size_t k = 0; k < sizeof(parts)/sizeof(*parts); k++, next += n) { *parts[k] = next; }
    s.normal = next, s.across = next + m, s.pressed = next + 2*m, s.A = next + 3*m;
    s.order = numbers, s.on = numbers + n;
    for (int i = 0; i < m; i++) {
        double across = 0.0;
        for (int k = 1; k < d; k++) { across += W[(i*d + k)*(n + 1)]; }
        s.normal[i] = W[i*d*(n + 1)] > 0.0 ? W[i*d*(n + 1)] : 1.0;
        s.across[i] = across > 0.0 ? across : 1.0;
    }
    double fastest = 0.0;
    for (int i = 0; i < n; i++) { fastest = fmax(fastest, fabs(c[i])); }
    if (fastest == 0.0) { /* nothing moves: no residual is small beside that */
        memset(P, 0, (size_t)n*sizeof(double));
        *count = 0, *residual = 0.0;
        return;
    }
    *count = iterate(&s, P, tolerance, most, residual);
}
