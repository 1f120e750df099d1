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
