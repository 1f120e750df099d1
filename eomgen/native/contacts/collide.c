/* Inertia and constraints at one position. With M = L^T L velocities v are z = L v, whose squares are twice the energy, and forces
   f are L^-T f. Rows of the constraints become orthonormal rows Q of z, so that what obeys them is z - Q^T Q z. */

typedef struct {
    int n, n_c;
    double *L, *Q, *R; /* R: C L^-1 = R^T Q */
} inertia;

/* M = L^T L in place, reciprocals of the pivots on the diagonal; from the last row on, so that zeros between branches of a tree
   stay (Featherstone, 2008, section 6.5). 1 where a pivot is small beside its own diagonal. */
DENSE static int factor_inertia(int n, double *restrict M, double *restrict sizes)
{
    for (int k = 0; k < n; k++) { sizes[k] = M[k*n + k]; }
    for (int k = n - 1; k >= 0; k--) {
        double *restrict const row = M + k*n;
        if (!(row[k] > RIGID_PIVOT*sizes[k]) || !isfinite(row[k])) {
            return 1;
        }
        const double inverse = 1.0/sqrt(row[k]);
        for (int i = 0; i < k; i++) { row[i] *= inverse; }
        row[k] = inverse;
        for (int i = 0; i < k; i++) {
            double *restrict const other = M + i*n;
            const double ratio = row[i];
            for (int j = 0; ratio != 0.0 && j <= i; j++) { other[j] -= ratio*row[j]; }
        }
    }
    return 0;
}

/* L^-T b in place: b has rows of as many columns. */
DENSE static void press(int n, const double *restrict L, int columns, double *restrict b)
{
    for (int k = n - 1; k >= 0; k--) {
        double *restrict const from = b + (ptrdiff_t)k*columns;
        for (int l = 0; l < columns; l++) { from[l] *= L[k*n + k]; }
        for (int i = 0; i < k; i++) {
            double *restrict const to = b + (ptrdiff_t)i*columns;
            const double ratio = L[k*n + i];
            for (int l = 0; ratio != 0.0 && l < columns; l++) { to[l] -= ratio*from[l]; }
        }
    }
}

/* The same of one column. */
DENSE static void press_one(int n, const double *restrict L, double *restrict b)
{
    for (int k = n - 1; k >= 0; k--) {
        const double x = b[k]*L[k*n + k];
        b[k] = x;
        for (int i = 0; x != 0.0 && i < k; i++) { b[i] -= x*L[k*n + i]; }
    }
}

/* v = L^-1 z in place. */
static void release(int n, const double *L, double *z)
{
    for (int i = 0; i < n; i++) { z[i] = (z[i] - dot(i, L + i*n, z))*L[i*n + i]; }
}

/* Orthonormal rows Q from rows of C, R[r][s] what row s has of Q_r; a row that depends on those before is left out. */
static void span_rows(const inertia *at, const double *C, const int *rows)
{
    const int n = at->n, n_c = at->n_c;
    memset(at->R, 0, (size_t)n_c*(size_t)n_c*sizeof(double));
    for (int r = 0; r < n_c; r++) {
        double *const x = at->Q + r*n;
        memcpy(x, C + rows[r]*n, (size_t)n*sizeof(double));
        press_one(n, at->L, x);
        const double before = length_of(n, x);
        for (int k = 0; k < 2*r; k++) { /* twice is enough (Parlett, The Symmetric Eigenvalue Problem, 1980, section 6.9) */
            const int q = k % r;
            const double part = dot(n, at->Q + q*n, x);
            at->R[q*n_c + r] += part;
            for (int i = 0; i < n; i++) { x[i] -= part*at->Q[q*n + i]; }
        }
        const double after = length_of(n, x), inverse = after > RIGID_DEPENDENT*before ? 1.0/after : 0.0;
        at->R[r*n_c + r] = inverse;
        for (int i = 0; i < n; i++) { x[i] *= inverse; }
    }
}

/* z less what the constraints take. */
static void hold(const inertia *at, double *z)
{
    for (int r = 0; r < at->n_c; r++) {
        const double part = dot(at->n, at->Q + r*at->n, z);
        for (int i = 0; i < at->n; i++) { z[i] -= part*at->Q[r*at->n + i]; }
    }
}

/* The same of columns; `parts` has as many numbers. */
DENSE static void hold_columns(int n, int n_c, const double *restrict Q, int columns, double *restrict X, double *restrict parts)
{
    for (int r = 0; r < n_c; r++) {
        for (int l = 0; l < columns; l++) { parts[l] = 0.0; }
        for (int i = 0; i < n; i++) {
            const double q = Q[r*n + i];
            for (int l = 0; q != 0.0 && l < columns; l++) { parts[l] += q*X[(ptrdiff_t)i*columns + l]; }
        }
        for (int i = 0; i < n; i++) {
            const double q = Q[r*n + i];
            for (int l = 0; q != 0.0 && l < columns; l++) { X[(ptrdiff_t)i*columns + l] -= q*parts[l]; }
        }
    }
}

/* The smallest velocities v (as the energy measures) with C v = wanted, of the first `count` rows; wanted is used up. */
static void meet_rows(const inertia *at, int count, double *wanted, double *v)
{
    memset(v, 0, (size_t)at->n*sizeof(double));
    for (int r = 0; r < at->n_c; r++) {
        double y = r < count ? wanted[r] : 0.0;
        for (int q = 0; q < r; q++) { y -= at->R[q*at->n_c + r]*wanted[q]; }
        y *= at->R[r*at->n_c + r];
        wanted[r] = y;
        for (int i = 0; i < at->n; i++) { v[i] += y*at->Q[r*at->n + i]; }
    }
    release(at->n, at->L, v);
}

/* W = X^T X. */
DENSE static void square(int n, int columns, const double *restrict X, double *restrict W)
{
    for (int a = 0; a < columns; a++) {
        double *restrict const row = W + (ptrdiff_t)a*columns;
        for (int l = a; l < columns; l++) { row[l] = 0.0; }
        for (int i = 0; i < n; i++) {
            const double *restrict const from = X + (ptrdiff_t)i*columns;
            const double x = from[a];
            for (int l = a; x != 0.0 && l < columns; l++) { row[l] += x*from[l]; }
        }
    }
    for (int a = 0; a < columns; a++) {
        for (int l = 0; l < a; l++) { W[(ptrdiff_t)a*columns + l] = W[(ptrdiff_t)l*columns + a]; }
    }
}

/* y = x^T X of n rows; the other way to = X y. */
DENSE static void across(int n, int columns, const double *restrict X, const double *restrict x, double *restrict y)
{
    for (int l = 0; l < columns; l++) { y[l] = 0.0; }
    for (int i = 0; i < n; i++) {
        for (int l = 0; x[i] != 0.0 && l < columns; l++) { y[l] += x[i]*X[(ptrdiff_t)i*columns + l]; }
    }
}

static void along(int n, int columns, const double *X, const double *y, double *to)
{
    for (int i = 0; i < n; i++) { to[i] = dot(columns, X + (ptrdiff_t)i*columns, y); }
}

/* Contacts that are near at one position, and the velocities that they see. */

enum { RECORD_OF = 14, ACTING = 14 }; /* numbers of eomgen's lists of near pairs, and of a contact that acts */

static void cross(const double *a, const double *b, double *to)
{
    to[0] = a[1]*b[2] - a[2]*b[1], to[1] = a[2]*b[0] - a[0]*b[2], to[2] = a[0]*b[1] - a[1]*b[0];
}

static int is_planar(const double *record)
{
    return record[9] != 0.0 || record[10] != 0.0 || record[11] != 0.0;
}

/* Directions of a contact: normal and across, the second across where it is in space, else 0. */
static void find_ways(const double *record, double ways[9])
{
    const double *const normal = record + 2, *const flat = record + 9;
    const int planar = is_planar(record);
    double lone[3] = {0.0, 0.0, 0.0};
    int least = 2;
    for (int k = 1; k >= 0; k--) { least = fabs(normal[k]) < fabs(normal[least]) ? k : least; }
    lone[least] = 1.0; /* an axis far from the normal */
    memcpy(ways, normal, 3*sizeof(double));
    cross(planar ? flat : lone, normal, ways + 3);
    const double size = fmax(sqrt(ways[3]*ways[3] + ways[4]*ways[4] + ways[5]*ways[5]), DBL_MIN);
    for (int k = 3; k < 6; k++) { ways[k] /= size; }
    cross(normal, ways + 3, ways + 6);
    for (int k = 6; planar && k < 9; k++) { ways[k] = 0.0; }
}

/* Gather the lists into records whose shapes are numbered over all, in place; how many there are, or
   -EOMGEN_TOO_MANY, -EOMGEN_NO_LAW. */
static int gather(eomgen_rigid *s, double *witnesses)
{
    const double *from = witnesses;
    int count = 0, shapes = 0;
    for (int l = 0; l < s->n_lists; l++) {
        const int numbers = s->lists[2*l], listed = (int)from[0];
        s->list = l;
        if (listed > (numbers - 1)/RECORD_OF) {
            s->needed = listed;
            return -EOMGEN_TOO_MANY;
        }
        for (int k = 0; k < listed; k++, count++) {
            double *const record = witnesses + RECORD_OF*count;
            memmove(record, from + 1 + RECORD_OF*k, RECORD_OF*sizeof(double));
            record[0] += shapes, record[1] += shapes;
            if (!(record[12] >= 0.0) || !(record[13] >= 0.0 && record[13] <= 1.0)) {
                memcpy(s->law, record + 12, sizeof s->law);
                return -EOMGEN_NO_LAW;
            }
        }
        from += numbers, shapes += s->lists[2*l + 1];
    }
    return count;
}

/* Velocities of the contacts of records, n_v rows of count d columns. */
static void find_columns(const eomgen_rigid *s, int count, const double *records, const double *axes, double *J)
{
    const int d = s->d, columns = count*d, n = s->n_v;
    memset(J, 0, (size_t)n*(size_t)columns*sizeof(double));
    for (int c = 0; c < count; c++) {
        const double *const record = records + RECORD_OF*c;
        const signed char *const a = s->moved + (ptrdiff_t)record[0]*n, *const b = s->moved + (ptrdiff_t)record[1]*n;
        double ways[9], turns[9];
        find_ways(record, ways);
        for (int k = 0; k < d; k++) { cross(record + 6, ways + 3*k, turns + 3*k); }
        for (int j = 0; j < n; j++) {
            const double *const axis = axes + 6*j;
            const int sign = b[j] - a[j];
            for (int k = 0; sign && k < d; k++) {
                const double *const way = ways + 3*k, *const turn = turns + 3*k;
                J[(ptrdiff_t)j*columns + c*d + k] = sign*(axis[0]*turn[0] + axis[1]*turn[1] + axis[2]*turn[2]
                                                          + axis[3]*way[0] + axis[4]*way[1] + axis[5]*way[2]);
            }
        }
    }
}

/* Keep the chosen columns, `to` of `count` contacts, in place. */
static void choose_columns(int n, int d, int count, const int *chosen, int kept, double *J)
{
    for (int i = 0; i < n; i++) {
        for (int c = 0; c < kept; c++) {
            for (int k = 0; k < d; k++) { J[((ptrdiff_t)i*kept + c)*d + k] = J[((ptrdiff_t)i*count + chosen[c])*d + k]; }
        }
    }
}

static double largest_of(int n, const double *x, int step)
{
    double found = 0.0;
    for (int k = 0; k < n; k += step) { found = fabs(x[k]) > found || isnan(x[k]) ? fabs(x[k]) : found; }
    return found;
}

/* Impulses of the contacts that act in one step. */

enum { BOUNCES, RESTS, LANDS }; /* LANDS: an impact without rebound, across a gap */

typedef struct {
    int m, n; /* contacts, their rows */
    double *records;                              /* in the order of the contacts */
    double *J, *X, *W;                            /* rows by velocities; L^-T J^T without what constraints take; X^T X */
    double *before, *undisturbed, *after, *c, *P; /* velocities, what the laws start from, impulses */
    double *friction, *arrive, *back, *out;
    double *work, scale;                          /* scale: what the tolerance of impulses is relative to */
    int *rests, *numbers;
} meeting;

/* Impulses of the same pairs in the last step, places of one pair numbered. */
static void recall(const eomgen_rigid *s, meeting *at, int *keys)
{
    int seek = 0;
    for (int c = 0; c < at->m; c++) {
        int *const key = keys + 3*c;
        key[0] = (int)at->records[RECORD_OF*c], key[1] = (int)at->records[RECORD_OF*c + 1], key[2] = 0;
        for (int other = c - 1; other >= 0; other--) {
            if (keys[3*other] == key[0] && keys[3*other + 1] == key[1]) {
                key[2] = keys[3*other + 2] + 1;
                break;
            }
        }
        for (int k = 0; k < s->d; k++) { at->P[c*s->d + k] = 0.0; }
        for (int tried = 0; tried < s->known; tried++, seek++) { /* both are in nearly the same order */
            seek = seek < s->known ? seek : 0;
            if (memcmp(s->keys + 3*seek, key, 3*sizeof(int)) == 0) {
                memcpy(at->P + c*s->d, s->last + 3*seek, (size_t)s->d*sizeof(double));
                seek++;
                break;
            }
        }
    }
}

/* Whether one of two contacts moves the other, and both have impulses, of P or of `whole`. */
static int linked(const meeting *at, const double *whole, int a, int b)
{
    const int d = at->n/at->m, n = at->n;
    int moves = 0, one = 0, other = 0;
    for (int i = 0; i < d; i++) {
        const int r = a*d + i;
        one = one || at->P[r] != 0.0 || whole[r] != 0.0;
        other = other || at->P[b*d + i] != 0.0 || whole[b*d + i] != 0.0;
        for (int k = 0; k < d; k++) {
            const int s = b*d + k;
            const double w = at->W[(ptrdiff_t)r*n + s];
            moves = moves || w*w > RIGID_LINKED*at->W[(ptrdiff_t)r*n + r]*at->W[(ptrdiff_t)s*n + s];
        }
    }
    return moves && one && other;
}

/* The part of an impact without rebound that leaves shapes as fast as they meet in the next middle: a part of all impulses,
   friction too, between those without the contacts that land and those of the whole impact, so that the rest, which comes then,
   ends as the whole would have. Contacts that act on each other have one part. 0 where the impulses are not found; at->c holds
   what the laws of the others start from then too. */
static int land(const eomgen_rigid *s, meeting *at, double tolerance, int *count, double *residual)
{
    const int m = at->m, d = s->d, n = at->n;
    double *const whole = at->after, *const part = at->work, rest = 0.0;
    int more = 0;
    for (int c = 0; c < m; c++) { at->c[c*d] = at->rests[c] == LANDS ? at->undisturbed[c*d] : at->c[c*d]; }
    memcpy(whole, at->out, (size_t)n*sizeof(double));
    CHOSEN(solve_contacts)(m, d, at->W, at->c, at->friction, whole, tolerance, s->most, at->work, at->numbers, count, residual);
    for (int c = 0; c < m; c++) { at->c[c*d] = at->rests[c] == LANDS ? RIGID_APART*at->scale : at->c[c*d]; }
    memcpy(at->P, at->out, (size_t)n*sizeof(double));
    CHOSEN(solve_contacts)(m, d, at->W, at->c, at->friction, at->P, tolerance, s->most, at->work, at->numbers, &more, &rest);
    *residual = fmax(*residual, rest), *count = more > *count ? more : *count;
    for (int c = 0; c < m; c++) {
        part[c] = 0.0;
        if (at->rests[c] == LANDS) {
            const double approach = at->undisturbed[c*d] + dot(n, at->W + (ptrdiff_t)c*d*n, at->P);
            part[c] = approach < 0.0 ? fmax(0.0, 1.0 + at->arrive[c]/-approach) : 0.0;
            at->c[c*d] = at->undisturbed[c*d] - at->arrive[c];
        }
    }
    for (int grows = 1; grows;) {
        grows = 0;
        for (int a = 0; a < m; a++) {
            for (int b = 0; b < m; b++) {
                if (part[a] < part[b] && linked(at, whole, a, b)) { part[a] = part[b], grows = 1; }
            }
        }
    }
    for (int r = 0; r < n; r++) { at->P[r] = (1.0 - part[r/d])*at->P[r] + part[r/d]*whole[r]; }
    return *residual <= tolerance;
}

/* Impulses and velocities `out` after them for velocities `free` without, to a tolerance so many times as large; what was reached. */
static void collide(const eomgen_rigid *s, const inertia *held, meeting *at, const double *free, double h, double rough, double *out,
                    eomgen_rigid *told)
{
    const int m = at->m, d = s->d, n = at->n;
    double scale, residual = 0.0;
    int rebounds = 0, lands = 0, count = 0;
    across(s->n_v, n, at->J, free, at->undisturbed);
    scale = at->scale = fmax(largest_of(n, at->before, 1), largest_of(n, at->undisturbed, 1));
    for (int c = 0; c < m; c++) {
        const double gap = -at->records[RECORD_OF*c + 5], e = at->records[RECORD_OF*c + 13];
        const double before = at->before[c*d], undisturbed = at->undisturbed[c*d];
        const int strikes = before < -RIGID_RESTING*fabs(undisturbed - before) && gap + h*undisturbed < 0.0;
        at->arrive[c] = gap > 0.0 ? -gap/h : 0.0;
        at->rests[c] = strikes && e > 0.0 ? BOUNCES : strikes && gap > 0.0 && before < -s->tolerance*scale ? LANDS : RESTS;
        at->back[c] = at->rests[c] == BOUNCES ? -e*before - at->arrive[c] : 0.0;
        lands = lands || at->rests[c] == LANDS;
        rebounds = rebounds || at->back[c] != 0.0;
    }
    memcpy(at->out, at->P, (size_t)n*sizeof(double)); /* what the solution starts from */
    for (int k = 0; k <= RIGID_GENTLER; k++) {
        const double part = k == RIGID_GENTLER ? 0.0 : ldexp(1.0, -k);
        double work = 0.0, moved = 0.0;
        memcpy(at->c, at->undisturbed, (size_t)n*sizeof(double));
        for (int c = 0; c < m; c++) { at->c[c*d] -= at->arrive[c] + part*at->back[c]; }
        if (!lands || k || !land(s, at, rough*s->tolerance*scale, &count, &residual)) {
            memcpy(at->P, at->out, (size_t)n*sizeof(double));
            CHOSEN(solve_contacts)(m, d, at->W, at->c, at->friction, at->P, rough*s->tolerance*scale, s->most, at->work,
                                  at->numbers, &count, &residual);
        }
        if (!rebounds) {
            break;
        }
        across(n, n, at->W, at->P, at->after);
        for (int r = 0; r < n; r++) {
            const double after = at->undisturbed[r] + at->after[r];
            work += at->P[r]*(after + at->before[r]); /* twice: forces act with the velocity of the middle */
            moved += fabs(at->P[r])*(fabs(after) + fabs(at->before[r]));
        }
        if (work <= RIGID_GROWN*moved && residual <= RIGID_UNSOLVED*scale) {
            break; /* else they give energy by Newton's law (Kane and Levinson, 1985), or friction jams the mechanism */
        }
    }
    if (rough == 1.0) { told->residual = fmax(told->residual, residual); }
    told->missed = told->missed || !(residual <= rough*s->tolerance*scale);
    told->iterations = count > told->iterations ? count : told->iterations;
    along(s->n_v, n, at->X, at->P, out);
    release(s->n_v, held->L, out);
    for (int i = 0; i < s->n_v; i++) { out[i] += free[i]; }
}

/* A displacement that removes a part of the penetration of contacts that last; whether there is one. */
static int push_out(const eomgen_rigid *s, const inertia *held, meeting *at, const double *next, double h, double *out,
                    eomgen_rigid *told)
{
    const int m = at->m, d = s->d, n = at->n;
    double *const W = at->W, *const wanted = at->c, *const P = at->after;
    double largest = 0.0, residual = 0.0;
    int *const lasts = at->rests;
    int count = 0, iterations = 0;
    across(s->n_v, n, at->J, next, at->undisturbed);
    for (int c = 0; c < m; c++) {
        const double gap = -at->records[RECORD_OF*c + 5], removed = -RIGID_REMOVED*gap;
        if (gap < -s->tolerance*h*at->scale && at->rests[c] != BOUNCES && (at->P[c*d] > 0.0 || h*at->undisturbed[c*d] < removed)) {
            wanted[count] = -removed, P[count] = 0.0, at->before[count] = 0.0;
            largest = fmax(largest, removed);
            lasts[count++] = c;
        }
    }
    if (!count) {
        return 0;
    }
    for (int a = 0; a < count; a++) { /* in place: W is not needed any more */
        for (int b = 0; b < count; b++) { W[a*count + b] = at->W[(ptrdiff_t)lasts[a]*d*n + lasts[b]*d]; }
        W[a*count + a] *= 1.0 + RIGID_YIELDING;
    }
    CHOSEN(solve_contacts)(count, 1, W, wanted, at->before, P, s->tolerance*largest, s->most, at->work, at->numbers, &iterations,
                          &residual);
    told->missed = told->missed || !(residual <= s->tolerance*largest);
    for (int i = 0; i < s->n_v; i++) {
        out[i] = 0.0;
        for (int a = 0; a < count; a++) { out[i] += at->X[(ptrdiff_t)i*n + lasts[a]*d]*P[a]; }
    }
    release(s->n_v, held->L, out);
    return 1;
}
