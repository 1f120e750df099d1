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

/* A step of a mechanism with rigid contacts. */

static int call(eomgen_rigid *s, const eomgen_source *source, double t, const double *x, double *out)
{
    const int status = source->call(t, x, s->u, source->c, out, s->w);
    if (status) { s->source = source, s->status = status, s->when = t, s->where = x; }
    return status ? EOMGEN_FAILED : EOMGEN_STEPPED;
}

/* Where velocities part*d lead to in unit time. */
static void move(const eomgen_rigid *s, const double *q, double part, const double *d, double *to)
{
    for (int k = 0; k < s->n_plain; k++) { to[s->plain[2*k]] = q[s->plain[2*k]] + part*d[s->plain[2*k + 1]]; }
    for (int k = 0; k < s->n_balls; k++) {
        const double *const e = q + s->balls[2*k], *const w = d + s->balls[2*k + 1];
        double *const f = to + s->balls[2*k];
        const double x = 0.5*part*w[0], y = 0.5*part*w[1], z = 0.5*part*w[2], half = sqrt(x*x + y*y + z*z);
        const double a = cos(half), b = half > 0.0 ? sin(half)/half : 1.0;
        const double moved[4] = {
            a*e[0] - b*(e[1]*x + e[2]*y + e[3]*z), a*e[1] + b*(e[0]*x - e[3]*y + e[2]*z),
            a*e[2] + b*(e[3]*x + e[0]*y - e[1]*z), a*e[3] + b*(e[1]*y - e[2]*x + e[0]*z),
        };
        const double size = length_of(4, moved);
        for (int l = 0; l < 4; l++) { f[l] = moved[l]/size; }
    }
}

/* Whether shapes that are apart may meet within h, or go far by their size; x holds the velocities, and 0 behind them. */
static int passes(eomgen_rigid *s, double t, double h, double *x, int *failed)
{
    double found[5];
    memset(x + s->n_q + s->n_v, 0, (size_t)s->n_v*sizeof(double));
    if (s->meeting.call == NULL) {
        return 0;
    }
    *failed = call(s, &s->meeting, t, x, found);
    return !*failed && found[0] < h;
}

/* Inertia and constraints at the middle; `drift` is C_t of the independent rows. */
static int find_inertia(eomgen_rigid *s, double t, inertia *at, double *C, double *sizes, double *x, double *drift)
{
    const int n = s->n_v;
    int failed = call(s, &s->mass, t, x, at->L);
    if (!failed && s->n_c) { failed = call(s, &s->jacobian, t, x, C); }
    if (failed) {
        return failed;
    }
    if (factor_inertia(n, at->L, sizes)) { /* constraints may hold what has no inertia */
        double trace = 0.0, squares = 0.0;
        if (!s->n_c || call(s, &s->mass, t, x, at->L)) {
            return EOMGEN_FAILED;
        }
        for (int i = 0; i < n; i++) { trace += at->L[i*n + i]; }
        for (int r = 0; r < s->n_c; r++) { squares += dot(n, C + s->rows[r]*n, C + s->rows[r]*n); }
        for (int r = 0; r < s->n_c; r++) {
            const double *const row = C + s->rows[r]*n;
            for (int i = 0; i < n; i++) {
                for (int j = 0; j < n; j++) { at->L[i*n + j] += trace/fmax(squares, DBL_MIN)*row[i]*row[j]; }
            }
        }
        if (factor_inertia(n, at->L, sizes)) {
            return EOMGEN_FAILED;
        }
    }
    if (s->n_c) {
        double *const every = sizes;
        span_rows(at, C, s->rows);
        memset(x + s->n_q, 0, (size_t)n*sizeof(double));
        failed = call(s, &s->drift, t, x, every);
        for (int r = 0; r < s->n_c; r++) { drift[r] = every[s->rows[r]]; }
    }
    return failed;
}

/* Velocities without contacts with C v+ = aim, from v and a step of h of the forces b. */
static void fall(const inertia *at, const double *C, const int *rows, const double *aim, const double *v, double h,
                 const double *b, double *work, double *out)
{
    const int n = at->n;
    double *const wanted = work + n;
    memcpy(work, b, (size_t)n*sizeof(double));
    press_one(n, at->L, work);
    hold(at, work);
    release(n, at->L, work);
    for (int i = 0; i < n; i++) { work[i] = v[i] - h*work[i]; }
    for (int r = 0; r < at->n_c; r++) { wanted[r] = aim[r] - dot(n, C + rows[r]*n, work); }
    meet_rows(at, at->n_c, wanted, out);
    for (int i = 0; i < n; i++) { out[i] += work[i]; }
}

/* Contacts near the middle that may act: their rows, what they see and their compliance. */
static int find_contacts(eomgen_rigid *s, double t, const inertia *held, double h, const double *free, double *witnesses,
                         double *axes, meeting *at, int *keys, eomgen_rigid *told)
{
    const int n_v = s->n_v;
    double fastest;
    int failed = call(s, &s->near, t, s->x_m, witnesses), count, kept = 0;
    at->m = at->n = 0;
    count = failed ? -failed : gather(s, witnesses);
    if (count < 0) {
        return -count;
    }
    if (count == 0) {
        return EOMGEN_STEPPED;
    }
    if (count > s->room) {
        s->needed = count;
        return EOMGEN_MORE_ROOM;
    }
    s->d = 2;
    for (int c = 0; c < count; c++) {
        s->d = is_planar(witnesses + RECORD_OF*c) ? s->d : 3;
        told->depth = fmax(told->depth, witnesses[RECORD_OF*c + 5]);
    }
    if (call(s, &s->axes, t, s->x_m, axes)) {
        return EOMGEN_FAILED;
    }
    find_columns(s, count, witnesses, axes, at->J);
    across(n_v, count*s->d, at->J, s->x + s->n_q, at->before);
    across(n_v, count*s->d, at->J, free, at->undisturbed);
    fastest = fmax(largest_of(count*s->d, at->before, 1), largest_of(count*s->d, at->undisturbed, 1));
    for (int c = 0; c < count; c++) {
        if (-witnesses[RECORD_OF*c + 5] <= 2.0*h*fastest) {
            memmove(witnesses + RECORD_OF*kept, witnesses + RECORD_OF*c, RECORD_OF*sizeof(double));
            at->friction[kept] = witnesses[RECORD_OF*kept + 12];
            at->numbers[kept++] = c;
        }
    }
    choose_columns(n_v, s->d, count, at->numbers, kept, at->J);
    at->m = kept, at->n = kept*s->d, at->records = witnesses;
    if (kept) {
        across(n_v, at->n, at->J, s->x + s->n_q, at->before);
        memcpy(at->X, at->J, (size_t)n_v*(size_t)at->n*sizeof(double));
        press(n_v, held->L, at->n, at->X);
        hold_columns(n_v, held->n_c, held->Q, at->n, at->X, at->c);
        square(n_v, at->n, at->X, at->W);
        recall(s, at, keys);
    }
    return EOMGEN_STEPPED;
}

/* What acted, for the next step and for those who ask. */
static void keep_impulses(eomgen_rigid *s, const meeting *at, const int *keys)
{
    s->known = at->m;
    memcpy(s->keys, keys, (size_t)(3*at->m)*sizeof(int));
    for (int c = 0; c < at->m; c++) {
        double *const acting = s->acting + ACTING*c, ways[9];
        find_ways(at->records + RECORD_OF*c, ways);
        memcpy(acting, at->records + RECORD_OF*c, 2*sizeof(double));
        memcpy(acting + 2, ways, 6*sizeof(double));
        memcpy(acting + 8, at->records + RECORD_OF*c + 6, 3*sizeof(double));
        for (int k = 0; k < 3; k++) { acting[11 + k] = s->last[3*c + k] = k < s->d ? at->P[c*s->d + k] : 0.0; }
    }
}

/* Inputs at t and s->next. */
static int find_inputs(eomgen_rigid *s, double t)
{
    return s->inputs != NULL && s->inputs(s->forcing, t, s->next, s->u) ? EOMGEN_NO_INPUT : EOMGEN_STEPPED;
}

/* A Newton step that closes the loops at s->next, by the factors of the middle; its largest part. */
static double close_loops(eomgen_rigid *s, const inertia *held, double t, double *work, double *d, int *failed)
{
    *failed = *failed ? *failed : call(s, &s->closure, t, s->next, work + s->n_v);
    if (*failed) {
        return 0.0;
    }
    for (int r = 0; r < s->n_h; r++) { work[r] = -work[s->n_v + s->rows[r]]; }
    meet_rows(held, s->n_h, work, d);
    return largest_of(s->n_v, d, 1);
}

/* What the velocities of s->next have too much for the constraints there, and how much of it rows see; the largest part. */
static double find_excess(eomgen_rigid *s, const inertia *held, double t, double *work, double *seen, double *d, int *failed)
{
    *failed = *failed ? *failed : call(s, &s->drift, t, s->next, work + s->n_v);
    if (*failed) {
        return 0.0;
    }
    for (int r = 0; r < s->n_c; r++) { work[r] = seen[r] = work[s->n_v + s->rows[r]]; }
    meet_rows(held, s->n_c, work, d);
    return largest_of(s->n_v, d, 1);
}

/* Position and velocities of s->next onto the constraints to rounding. */
static void close_all(eomgen_rigid *s, const inertia *held, double t, double *work, double *seen, double *d, int *failed)
{
    double before = DBL_MAX, size = 0.0;
    for (int k = 0; k < RIGID_CLOSINGS && s->n_h; k++, before = size) {
        size = close_loops(s, held, t, work, d, failed);
        if (*failed || !(size < 0.5*before)) {
            break;
        }
        move(s, s->next, 1.0, d, s->next);
    }
    before = DBL_MAX;
    for (int k = 0; k < RIGID_CLOSINGS; k++, before = size) {
        size = find_excess(s, held, t, work, seen, d, failed);
        if (*failed || !(size < 0.5*before)) {
            break;
        }
        for (int i = 0; i < s->n_v; i++) { s->next[s->n_q + i] -= d[i]; }
    }
}

/* Whether contacts do not feel that velocities are projected onto the constraints at the end, at which the next solution aims. */
static int bears(eomgen_rigid *s, const inertia *held, meeting *at, double t, double h, const double *v, int last, double *work,
                 double *seen, double *aim, double *d, eomgen_rigid *told, int *failed)
{
    double felt;
    move(s, s->x_m, 0.5*h, v, s->next);
    memcpy(s->next + s->n_q, v, (size_t)s->n_v*sizeof(double));
    *failed = *failed ? *failed : find_inputs(s, t);
    if (s->n_h) {
        close_loops(s, held, t, work, d, failed);
        if (!*failed) { move(s, s->next, 1.0, d, s->next); }
    }
    find_excess(s, held, t, work, seen, d, failed);
    for (int r = 0; r < s->n_c; r++) { aim[r] -= seen[r]; }
    if (*failed || !at->m) {
        return 1;
    }
    across(s->n_v, at->n, at->J, d, at->undisturbed);
    felt = largest_of(at->n, at->undisturbed, 1);
    if (felt <= s->tolerance*at->scale) {
        return 1;
    }
    if (last) { told->missed = 1, told->residual = fmax(told->residual, felt); }
    return 0;
}

static long sum_of(const long *sizes, int count)
{
    long sum = 0;
    for (int k = 0; k < count; k++) { sum += sizes[k]; }
    return sum;
}

/* Places of all that a step needs, whatever its contacts. */
enum { OF_L, OF_Q, OF_R, OF_C, OF_SIZES, OF_DRIFT, OF_BIAS, OF_AGAIN, OF_FREE, OF_NEW, OF_AWAY, OF_WORK, OF_WITNESSES, OF_AXES, OF_AIM,
       OF_SEEN, OF_INPUTS, FIXED };

static void fixed_sizes(const eomgen_rigid *s, long sizes[FIXED])
{
    const long n = s->n_v, n_c = s->n_c, wide = n + s->n_rows;
    const long found[FIXED] = {n*n, n_c*n, n_c*n_c, s->n_rows*n, wide, n_c, n, n, n, n, n, 2*wide, s->n_witnesses, 6*n, n_c, n_c,
                                s->n_u};
    memcpy(sizes, found, sizeof found);
}

long CHOSEN(rigid_fixed)(const eomgen_rigid *s)
{
    long sizes[FIXED];
    fixed_sizes(s, sizes);
    return sum_of(sizes, FIXED);
}

/* The same of contacts, with three directions. */
long CHOSEN(rigid_further)(const eomgen_rigid *s)
{
    const long m = s->room, n = 3*m;
    return 2*n*s->n_v + n*n + 6*n + 3*m + n*(n + 8) + 3*m;
}

static void place_meeting(const eomgen_rigid *s, meeting *at)
{
    const ptrdiff_t m = s->room, n = 3*m;
    double *next = s->many;
    double **const rows[] = {&at->before, &at->undisturbed, &at->after, &at->c, &at->P, &at->out};
    at->J = next, at->X = next + n*s->n_v, at->W = next + 2*n*s->n_v, next += 2*n*s->n_v + n*n;
    for (size_t k = 0; k < sizeof(rows)/sizeof(*rows); k++, next += n) { *rows[k] = next; }
    at->friction = next, at->arrive = next + m, at->back = next + 2*m, at->work = next + 3*m;
    at->rests = s->numbers + 3*m, at->numbers = s->numbers + 4*m;
}

int CHOSEN(rigid_step)(eomgen_rigid *s, double t, double h)
{
    const int n_q = s->n_q, n = s->n_v;
    const double middle = t + 0.5*h, *const v = s->x + n_q;
    double *part[FIXED], *next = s->held, *const x_m = s->x_m, rough;
    long sizes[FIXED];
    eomgen_rigid told = *s;
    inertia held;
    meeting at;
    int failed = 0, *const keys = s->numbers;
    s->source = NULL;
    fixed_sizes(s, sizes);
    for (int k = 0; k < FIXED; k++) { part[k] = next, next += sizes[k]; }
    held.n = n, held.n_c = s->n_c, held.L = part[OF_L], held.Q = part[OF_Q], held.R = part[OF_R];
    place_meeting(s, &at);
    told.residual = told.depth = 0.0, told.missed = told.iterations = 0;

    move(s, s->x, 0.5*h, v, x_m);
    memcpy(x_m + n_q, v, (size_t)n*sizeof(double));
    if (s->inputs != NULL && s->inputs(s->forcing, middle, x_m, s->u)) {
        return EOMGEN_NO_INPUT;
    }
    if (passes(s, t, 0.5*h, s->x, &failed)) {
        return EOMGEN_TOO_LONG;
    }
    if (s->begins && !failed) { /* shapes that touch at the start and approach: later steps end with velocities that part them */
        memcpy(s->next + n_q, v, (size_t)n*sizeof(double));
        move(s, s->x, -0.5*h, v, s->next);
        if (passes(s, t, 0.5*h, s->next, &failed)) {
            return EOMGEN_TOO_LONG;
        }
    }
    if (failed || call(s, &s->bias, middle, x_m, part[OF_BIAS])
        || find_inertia(s, middle, &held, part[OF_C], part[OF_SIZES], x_m, part[OF_DRIFT])) {
        return EOMGEN_FAILED;
    }
    for (int r = 0; r < s->n_c; r++) { /* constraints hold for the mean of the velocities at first */
        part[OF_AIM][r] = -2.0*part[OF_DRIFT][r] - dot(n, part[OF_C] + s->rows[r]*n, v);
    }
    memcpy(part[OF_INPUTS], s->u, (size_t)s->n_u*sizeof(double));
    fall(&held, part[OF_C], s->rows, part[OF_AIM], v, h, part[OF_BIAS], part[OF_WORK], part[OF_FREE]);
    failed = find_contacts(s, middle, &held, h, part[OF_FREE], part[OF_WITNESSES], part[OF_AXES], &at, keys, &told);
    for (int i = 0; i < n; i++) { x_m[n_q + i] = 0.5*(v[i] + part[OF_FREE][i]); }
    failed = failed ? failed : call(s, &s->bias, middle, x_m, part[OF_AGAIN]);
    /* forces that do not change with velocities need one solution, which then is the one that counts */
    rough = memcmp(part[OF_AGAIN], part[OF_BIAS], (size_t)n*sizeof(double)) ? RIGID_ROUGH : 1.0;
    for (int round = 0; round < RIGID_ROUNDS && !failed; round++) {
        int settled = round > 0;
        if (at.m) {
            collide(s, &held, &at, part[OF_FREE], h, round ? 1.0 : rough, part[OF_NEW], &told);
        } else {
            memcpy(part[OF_NEW], part[OF_FREE], (size_t)n*sizeof(double));
        }
        if (!settled || s->n_c) {
            for (int i = 0; i < n; i++) { x_m[n_q + i] = 0.5*(v[i] + part[OF_NEW][i]); }
            failed = call(s, &s->bias, middle, x_m, part[OF_AGAIN]);
            settled = settled || (rough == 1.0 && memcmp(part[OF_AGAIN], part[OF_BIAS], (size_t)n*sizeof(double)) == 0);
        }
        if (s->n_c && !failed) {
            settled = bears(s, &held, &at, t + h, h, part[OF_NEW], round == RIGID_ROUNDS - 1, part[OF_WORK], part[OF_SEEN],
                            part[OF_AIM], part[OF_AWAY], &told, &failed) && settled;
            if (!failed) { memcpy(s->u, part[OF_INPUTS], (size_t)s->n_u*sizeof(double)); }
        }
        if (settled) {
            break;
        }
        fall(&held, part[OF_C], s->rows, part[OF_AIM], v, h, part[OF_AGAIN], part[OF_WORK], part[OF_FREE]);
    }
    if (failed) {
        return failed;
    }
    memcpy(x_m + n_q, part[OF_NEW], (size_t)n*sizeof(double));
    if (passes(s, middle, 0.5*h, x_m, &failed)) {
        return EOMGEN_TOO_LONG;
    }
    move(s, x_m, 0.5*h, part[OF_NEW], s->next);
    memcpy(s->next + n_q, part[OF_NEW], (size_t)n*sizeof(double));
    s->m = at.m;
    if (at.m) { keep_impulses(s, &at, keys); }
    if (at.m && push_out(s, &held, &at, part[OF_NEW], h, part[OF_AWAY], &told)) {
        move(s, s->next, 1.0, part[OF_AWAY], s->next);
    }
    if (s->n_c && !failed) {
        failed = find_inputs(s, t + h);
        if (failed) {
            return failed;
        }
        close_all(s, &held, t + h, part[OF_WORK], part[OF_SEEN], part[OF_AWAY], &failed);
    }
    if (failed) {
        return EOMGEN_FAILED;
    }
    s->residual = fmax(s->residual, told.residual), s->depth = fmax(s->depth, told.depth);
    s->missed += told.missed, s->iterations = told.iterations > s->iterations ? told.iterations : s->iterations;
    s->contacts = at.m > s->contacts ? at.m : s->contacts;
    s->begins = 0;
    return EOMGEN_STEPPED;
}
