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
