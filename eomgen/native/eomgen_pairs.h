/* Contacts between groups of shapes: what all pairs exert, its derivatives, when shapes may meet, and which are near. Loops over
   the tables of a model, whose C file of a contact includes this behind its sizes and laws; eomgen/contact/pair_sums.py has the
   same on numbers of any kind, with what the results mean.

   Of each body: position, rotation by rows, velocity, angular velocity (POSE numbers); a shape as placed has these, its sizes, the
   radius within which it lies (-1: without bounds), its arm from the body's origin (3), its thickness and its body. */
#ifndef EOMGEN_PAIRS_H
#define EOMGEN_PAIRS_H

#include "eomgen_real.h"

#ifndef EOMGEN_INSIDE
#define EOMGEN_INSIDE static inline
#endif

/* Columns of a row before the sizes; numbers that a pair exerts, of a place where shapes touch, and of those in lists. */
enum { POSE = 18, PLACE = 13, EXERTED = 10, WITNESS = 12, RECORD = 2 + WITNESS, OF_STATE = 15, MEETING = 5 };
enum { COLUMNS_DOWN = 2 }; /* an extent: distances count beside columns that reach down along y of the first without end */

/* Rows written as runs: (rows, times), rows that come several times, each time further by the steps behind them. */
typedef struct {
    const int *rows, (*runs)[2], columns;
} pair_rows;

/* Shapes of one class: from `start` on in the work array, a shape to `length` numbers; `number`: of the first among all. */
typedef struct {
    pair_rows rows;
    int count, sizes, length, start, number, lined;
} pair_table;

/* Two tables whose shapes act on each other; see PairKind of eomgen/contact/pairs.py. */
typedef struct {
    const pair_table *first, *second;
    int extent, thin, sorted, turns, places, states, numbers, corners[2], lines;
    const int *law, (*line)[2];
    pair_rows held[2];
    int value, slope, touch, witness;      /* of the model's function call_pair */
} pair_kind;

EOMGEN_PIECE extern const pair_table TABLES[ALL_TABLES];
EOMGEN_PIECE extern const pair_kind KINDS[ALL_KINDS];

static inline void take_row(const pair_rows *table, int i, int *row)
{
    const int *rows = table->rows, (*runs)[2] = table->runs;
    const int columns = table->columns;
    for (; i >= runs[0][0]*runs[0][1]; runs++) {
        i -= runs[0][0]*runs[0][1];
        rows += columns*runs[0][0]*(runs[0][1] > 1 ? 2 : 1);
    }
    const int period = runs[0][0], times = i/period, *const first = rows + columns*(i%period);
    for (int k = 0; k < columns; k++) { row[k] = first[k] + (times > 0 ? times*first[columns*period + k] : 0); }
}

static inline void turn(const double *m, const double *a, double *out)
{
    for (int i = 0; i < 3; i++) { out[i] = m[3*i]*a[0] + m[3*i + 1]*a[1] + m[3*i + 2]*a[2]; }
}

static inline void add_cross(const double *a, const double *b, double *out)
{
    out[0] += a[1]*b[2] - a[2]*b[1];
    out[1] += a[2]*b[0] - a[0]*b[2];
    out[2] += a[0]*b[1] - a[1]*b[0];
}

static inline double dot(const double *a, const double *b)
{
    return a[0]*b[0] + a[1]*b[1] + a[2]*b[2];
}

/* -- shapes ------------------------------------------------------------------------------------------------------------ */

/* A place and a frame in a body, whose numbers stand where a row says: R local and R N. */
static inline void turn_frame(const double *body, const double *own, const int *row, double *arm, double *frame)
{
    const double local[3] = { own[row[1]], own[row[2]], own[row[3]] };
    turn(body + 3, local, arm);
    for (int i = 0; i < 3; i++) {
        const double *const r = body + 3 + 3*i;
        for (int j = 0; j < 3; j++) { frame[3*i + j] = r[0]*own[row[4 + j]] + r[1]*own[row[7 + j]] + r[2]*own[row[10 + j]]; }
    }
}

/* A shape from its row, whose places count from behind the bodies. */
static inline void place(const double *given, const int *row, int sizes, double *s)
{
    const double *const body = given + POSE*row[0], *const own = given + POSE*BODIES;
    double *const rest = s + POSE + sizes;
    turn_frame(body, own, row, rest + 1, s + 3);
    for (int i = 0; i < 3; i++) { s[i] = body[i] + rest[1 + i]; }
    memcpy(s + 12, body + 12, 6*sizeof *s);
    add_cross(body + 15, rest + 1, s + 12);
    for (int i = 0; i < sizes; i++) { s[POSE + i] = own[row[PLACE + i]]; }
    rest[0] = row[PLACE + sizes] < 0 ? -1.0 : own[row[PLACE + sizes]];
    rest[4] = own[row[PLACE + sizes + 1]];
    rest[5] = row[0];
}

/* The rates of a shape that is placed. */
EOMGEN_SHARED void place_rates(const double *given, const double *rates, const int *row, int sizes, const double *s, double *d)
{
    const double *const body = given + POSE*row[0], *const moves = rates + POSE*row[0], *const changes = rates + POSE*BODIES;
    double *const rest = d + POSE + sizes, arm[3], frame[9];
    turn_frame(moves, given + POSE*BODIES, row, rest + 1, d + 3);
    turn_frame(body, changes, row, arm, frame);
    for (int i = 0; i < 9; i++) { d[3 + i] += frame[i]; }
    for (int i = 0; i < 3; i++) {
        rest[1 + i] += arm[i];
        d[i] = moves[i] + rest[1 + i];
    }
    memcpy(d + 12, moves + 12, 6*sizeof *d);
    add_cross(moves + 15, s + POSE + sizes + 1, d + 12);
    add_cross(body + 15, rest + 1, d + 12);
    for (int i = 0; i < sizes; i++) { d[POSE + i] = changes[row[PLACE + i]]; }
    rest[0] = rest[4] = rest[5] = 0.0;
}

static inline double *place_shape(const double *given, const pair_table *table, int i, double *work)
{
    double *const s = work + table->start + table->length*i;
    int row[WIDEST];
    take_row(&table->rows, i, row);
    place(given, row, table->sizes, s);
    return s;
}

/* All shapes but the cells of lines, which are placed where they are met. */
static void place_all(const double *given, double *work)
{
    for (const pair_table *table = TABLES; table < TABLES + ALL_TABLES; table++) {
        const int columns = table->rows.columns, (*run)[2] = table->rows.runs, *rows = table->rows.rows;
        double *s = work + table->start, *const end = table->lined ? s : s + table->count*table->length;
        for (; s < end; rows += columns*run[0][0]*(run[0][1] > 1 ? 2 : 1), run++) {
            for (int n = 0; n < run[0][0]*run[0][1]; n++, s += table->length) {
                const int times = n/run[0][0], *const row = rows + columns*(n - times*run[0][0]), *const step = row + columns*run[0][0];
                int further[WIDEST];
                for (int k = 0; k < columns && times > 0; k++) { further[k] = row[k] + times*step[k]; }
                place(given, times > 0 ? further : row, table->sizes, s);
            }
        }
    }
}

static inline int body_of(const pair_table *table, const double *s)
{
    return (int)s[POSE + table->sizes + 5];
}

static inline double thickness_of(const pair_table *table, const double *s)
{
    return s[POSE + table->sizes + 4];
}

/* -- parts that matter ------------------------------------------------------------------------------------------------- */

/* Of two polygons the edges that face each other, the deepest corners below the edges of the least and of the next overlap, and
   whether an edge of the second has these; of each polygon a number, the first's first. */
typedef struct {
    int edges[2], corners[2], next_edges[2], next_corners[2], of_second, next_of_second;
} facing_edges;

/* Numbers of an edge and of a piece of an outline, and those of two polygons and of a piece that their laws read. */
enum { EDGE = 5, PIECE = 6, CHOSEN = 8, MATTERS = 18 };

/* The least overlap along the normals of edges but one. */
static int least_overlap(const double *overlaps, int count, int but)
{
    int best = -1;
    for (int i = 0; i < count; i++) {
        if (i != but && (best < 0 || overlaps[i] < overlaps[best])) { best = i; }
    }
    return best;
}

/* How deep corners are below each edge, and which is the deepest; x and y of corners, normals and corners of edges. */
static void find_overlaps(double (*edges)[4], int count, double (*others)[4], int corners, double *overlaps, int *deepest)
{
    for (int i = 0; i < count; i++) {
        for (int j = 0; j < corners; j++) {
            const double depth = edges[i][2]*(edges[i][0] - others[j][0]) + edges[i][3]*(edges[i][1] - others[j][1]);
            if (j == 0 || overlaps[i] < depth) { overlaps[i] = depth, deepest[i] = j; }
        }
    }
}

/* The edge whose normal is most against another. */
static int most_against(double (*edges)[4], int count, const double *normal)
{
    int best = 0;
    double least = 0.0;
    for (int i = 0; i < count; i++) {
        const double along = edges[i][2]*normal[0] + edges[i][3]*normal[1];
        if (i == 0 || along < least) { best = i, least = along; }
    }
    return best;
}

static void choose_edges(const double *a, int n, const double *b, int m, facing_edges *found)
{
    double own[CORNERS][4], others[CORNERS][4], overlaps[2][CORNERS], place[2] = { 0.0, 0.0 }, turn[2][2];
    int deepest[2][CORNERS];
    for (int i = 0; i < 2; i++) {
        turn[i][0] = turn[i][1] = 0.0;
        for (int k = 0; k < 3; k++) {
            place[i] += a[3 + 3*k + i]*(b[k] - a[k]);
            turn[i][0] += a[3 + 3*k + i]*b[3 + 3*k];
            turn[i][1] += a[3 + 3*k + i]*b[4 + 3*k];
        }
    }
    for (int i = 0; i < n; i++) {
        for (int k = 0; k < 4; k++) { own[i][k] = a[POSE + EDGE*i + k]; }
    }
    for (int j = 0; j < m; j++) {
        const double *const s = b + POSE + EDGE*j;
        for (int k = 0; k < 2; k++) { others[j][k] = place[k] + turn[k][0]*s[0] + turn[k][1]*s[1]; }
        others[j][2] = turn[1][1]*s[2] - turn[1][0]*s[3];
        others[j][3] = turn[0][0]*s[3] - turn[0][1]*s[2];
    }
    find_overlaps(own, n, others, m, overlaps[0], deepest[0]);
    find_overlaps(others, m, own, n, overlaps[1], deepest[1]);
    int first = least_overlap(overlaps[0], n, -1), second = least_overlap(overlaps[1], m, -1);
    found->of_second = overlaps[1][second] < overlaps[0][first];
    found->corners[0] = deepest[1][second], found->corners[1] = deepest[0][first];
    if (found->of_second) {
        first = most_against(own, n, others[second] + 2);
    } else {
        second = most_against(others, m, own[first] + 2);
    }
    found->edges[0] = first, found->edges[1] = second;
    first = least_overlap(overlaps[0], n, first), second = least_overlap(overlaps[1], m, second);
    found->next_edges[0] = first, found->next_edges[1] = second;
    found->next_corners[0] = deepest[1][second], found->next_corners[1] = deepest[0][first];
    found->next_of_second = overlaps[1][second] < overlaps[0][first];
}

/* The pose of a polygon and what of it matters, or the rates of these. */
static double *keep(const double *s, int count, const facing_edges *found, int which, double *out)
{
    const int edge = found->edges[which], before = (edge + count - 1) % count, after = (edge + 1) % count;
    const int from[9] = { EDGE*edge, EDGE*after, EDGE*edge + 2, EDGE*before + 2, EDGE*after + 2, EDGE*found->corners[which],
        EDGE*found->next_corners[which], EDGE*found->next_edges[which], EDGE*found->next_edges[which] + 2 };
    for (int k = 0; k < POSE; k++) { *out++ = s[k]; }
    for (int k = 0; k < 9; k++) { *out++ = s[POSE + from[k]], *out++ = s[POSE + from[k] + 1]; }
    return out;
}

/* The height of the ends of a piece over its middle, the sine and the cosine of its half angle. */
static double piece_bend(const double *s, double *sine, double *cosine)
{
    *sine = s[5]*s[4], *cosine = sqrt(fmax(0.0, 1.0 - *sine**sine));
    return s[4]**sine/(1.0 + *cosine);
}

/* Whether a point from the first corner of a piece is on the outer side there: along both normals together. */
static double side_of_corner(const double *s, const double *before, double wx, double wy)
{
    double sine, cosine;
    (void)piece_bend(s, &sine, &cosine);
    double side = wx*(s[2]*sine - s[3]*cosine) + wy*(s[3]*sine + s[2]*cosine);
    (void)piece_bend(before, &sine, &cosine);
    side += wy*(before[2]*cosine - before[3]*sine) - wx*(before[2]*sine + before[3]*cosine);
    return side;
}

/* The piece of an outline that is nearest to the centre of a shape, where this is deep inside it; else -1. Whether its first
   corner is nearest. A piece lies within 1.5 times its half chord of its origin; that of the nearest origin comes first. */
static int deep_piece(const double *a, int count, const double *b, int *corner)
{
    double x = 0.0, y = 0.0, least = HUGE_VAL, side = 0.0, sine, cosine;
    int best = 0, begin = 0;
    for (int k = 0; k < 3; k++) {
        x += a[3 + 3*k]*(b[k] - a[k]);
        y += a[4 + 3*k]*(b[k] - a[k]);
    }
    for (int i = 0; i < count; i++) {
        const double dx = x - a[POSE + PIECE*i], dy = y - a[POSE + PIECE*i + 1], square = dx*dx + dy*dy;
        if (square < least) { begin = i, least = square; }
    }
    least = HUGE_VAL, *corner = 0;
    for (int n = 0; n < count; n++) {
        const int i = begin + n < count ? begin + n : begin + n - count;
        const double *const s = a + POSE + PIECE*i;
        const double half = s[4], bend = s[5], dx = x - s[0], dy = y - s[1];
        if (fabs(dx) > least + 1.5*half || fabs(dy) > least + 1.5*half) {
            continue;
        }
        const double u = s[2]*dx + s[3]*dy, v = s[2]*dy - s[3]*dx, rise = piece_bend(s, &sine, &cosine), over = (v - rise)*sine;
        if (fmin((half + u)*cosine, (half - u)*cosine) >= over) {
            const double gap = (2.0*v - bend*(u*u + v*v))/(1.0 + sqrt(bend*bend*u*u + (1.0 - bend*v)*(1.0 - bend*v)));
            if (fabs(gap) < least) { best = i, least = fabs(gap), side = gap, *corner = 0; }
        }
        const double wx = s[2]*(u + half) - s[3]*(v - rise), wy = s[3]*(u + half) + s[2]*(v - rise), away = sqrt(wx*wx + wy*wy);
        if (away < least) {
            best = i, least = away, *corner = 1;
            side = side_of_corner(s, a + POSE + PIECE*((i + count - 1) % count), wx, wy);
        }
        if (least <= a[POSE + PIECE*count]) {
            return -1;
        }
    }
    return side < 0.0 ? best : -1;
}

/* Whether the first shapes are insides of outlines, which act on what is deep in them alone. */
static inline int is_inside(const pair_kind *kind)
{
    return OUTLINES && kind->corners[0] && !kind->corners[1];
}

/* A law of polygons or of the inside of an outline: that of what matters; its slope where rates stand behind a and b. */
static void call_parts(const pair_kind *kind, int called, const double *a, const double *b, const double *law, double *out)
{
    const int n = kind->corners[0], m = kind->corners[1], sloped = called == kind->slope;
    double first[2*(POSE + MATTERS + 2)] = { 0.0 }, second[2*(POSE + MATTERS + 1)] = { 0.0 }, square = 0.0;
    if (POLYGONS && !is_inside(kind)) {
        facing_edges found;
        choose_edges(a, n, b, m, &found);
        double *const flags = keep(a, n, &found, 0, first), *const reach = keep(b, m, &found, 1, second);
        flags[0] = found.of_second, flags[1] = found.next_of_second;
        for (int j = 0; j < m; j++) { square = fmax(square, b[POSE + EDGE*j]*b[POSE + EDGE*j] + b[POSE + EDGE*j + 1]*b[POSE + EDGE*j + 1]); }
        reach[0] = sqrt(square);
        if (sloped) {
            (void)keep(a + kind->first->length, n, &found, 0, flags + 2);
            (void)keep(b + kind->second->length, m, &found, 1, reach + 1);
        }
        a = first, b = second;
    } else if (OUTLINES) {
        int corner;
        const int deep = deep_piece(a, n, b, &corner), piece = deep < 0 ? 0 : deep;
        for (int k = 0; k <= sloped; k++) {
            const double *const s = a + k*kind->first->length;
            double *const kept = first + k*(POSE + CHOSEN);
            memcpy(kept, s, POSE*sizeof *s);
            memcpy(kept + POSE, s + POSE + PIECE*piece, PIECE*sizeof *s);
        }
        first[POSE + PIECE] = corner, first[POSE + PIECE + 1] = deep >= 0;
        a = first;
    }
    call_pair(called, a, b, law, out);
}

EOMGEN_INSIDE void call_law(const pair_kind *kind, int called, const double *a, const double *b, const double *law, double *out)
{
    if (kind->corners[0] != 0 && POLYGONS + OUTLINES > 0) {
        call_parts(kind, called, a, b, law, out);
    } else {
        call_pair(called, a, b, law, out);
    }
}

/* -- what is done with pairs ------------------------------------------------------------------------------------------- */

enum { SUM, SLOPE, KEEP, STATES, TOUCHING = STATES, LIST, MEET }; /* up to TOUCHING with pairs whose spheres meet */

/* What is done with pairs, and what for. */
typedef struct {
    int task, count, full;
    const double *given, *rates;
    double *work, *moving, *out;
    const int *moves;              /* which bodies have rates */
    const double *accelerations;
    double thickest, speed, gain;  /* of the second shapes of a kind; the greatest of both */
    int *rated;                    /* whether rates of a shape are placed */
} pair_search;

static pair_search begin(int task, const double *given, double *work, double *out)
{
    pair_search s;
    memset(&s, 0, sizeof s);
    s.task = task, s.given = given, s.work = work, s.out = out;
    return s;
}

/* How far apart two shapes may be to be listed. */
static double margin_of(const pair_kind *kind, const double *a, const double *b)
{
    const int open = a[POSE + kind->first->sizes] < 0.0 || b[POSE + kind->second->sizes] < 0.0;
    return (open ? PAIRS_OUTSIDE : PAIRS_NEAR)*(thickness_of(kind->first, a) + thickness_of(kind->second, b));
}

/* Where the states of a pair stand: the sum of a number of its first and one of its second shape. */
static inline int held_of(const pair_kind *kind, int i, int j)
{
    int first = 0, second = 0;
    if (kind->states) {
        take_row(&kind->held[0], i, &first);
        take_row(&kind->held[1], j, &second);
    }
    return first + second;
}

/* Numbers of the law of a pair and its states. */
static void take_law(const double *given, const pair_kind *kind, int held, double *law)
{
    for (int n = 0; n < kind->numbers; n++) { law[n] = given[kind->law[n]]; }
    for (int n = 0; n < kind->states; n++) { law[kind->numbers + n] = given[FIRST_STATE + held + n]; }
}

/* Adds what a pair exerts on both bodies, at these arms, its energy, and what it adds to the rates of its states. */
static void add_loads(const pair_kind *kind, const double *pair, const double *a, const double *b, int held, double *out)
{
    double *const body = out + 6*body_of(kind->first, a), *const other = out + 6*body_of(kind->second, b);
    for (int n = 0; n < 3; n++) {
        body[n] -= pair[n];
        other[n] += pair[n];
        body[3 + n] += pair[3 + n];
        other[3 + n] += pair[6 + n];
    }
    add_cross(pair, a + POSE + kind->first->sizes + 1, body + 3);
    add_cross(b + POSE + kind->second->sizes + 1, pair, other + 3);
    out[6*BODIES] += pair[9];
    for (int n = 0; n < kind->states; n++) { out[6*BODIES + 1 + held + n] += pair[EXERTED + n]; }
}

static void exert(const double *given, const pair_kind *kind, int held, const double *a, const double *b, double *pair)
{
    double law[LAWS + 1];
    law[0] = 0.0;
    take_law(given, kind, held, law);
    call_law(kind, kind->value, a, b, law, pair);
}

static void add_pair(pair_search *s, const pair_kind *kind, int i, int j, const double *a, const double *b)
{
    double pair[EXERTED + STATED + 1] = { 0.0 };
    const int held = held_of(kind, i, j);
    exert(s->given, kind, held, a, b, pair);
    add_loads(kind, pair, a, b, held, s->out);
}

/* -- derivatives ------------------------------------------------------------------------------------------------------- */

/* The rates of a shape, placed at the first use. */
static const double *rates_of(pair_search *s, const pair_table *table, int i, const double *a)
{
    static const double STILL[LONGEST] = { 0.0 };
    double *const d = s->moving + table->start + table->length*i;
    if (!s->moves[body_of(table, a)]) {
        return STILL;
    }
    if (!s->rated[table->number + i]) {
        int row[WIDEST];
        take_row(&table->rows, i, row);
        place_rates(s->given, s->rates, row, table->sizes, a, d);
        s->rated[table->number + i] = 1;
    }
    return d;
}

/* Whether rates change what a pair exerts. */
static int changes(const pair_search *s, const pair_kind *kind, int held, const double *a, const double *b)
{
    int some = s->moves[body_of(kind->first, a)];
    some = some || s->moves[body_of(kind->second, b)];
    for (int n = 0; n < kind->states; n++) { some = some || s->rates[FIRST_STATE + held + n] != 0.0; }
    return some;
}

/* Adds the change along rates of what a pair exerts, which is known. */
static void add_change(pair_search *s, const pair_kind *kind, int i, int j, const double *a, const double *b, int held, const double *pair)
{
    const int numbers = kind->numbers + kind->states, first = kind->first->length, second = kind->second->length;
    const double *const da = rates_of(s, kind->first, i, a), *const db = rates_of(s, kind->second, j, b);
    double law[2*LAWS + 1] = { 0.0 }, change[EXERTED + STATED + 1] = { 0.0 }, joined[4*LONGEST], *const other = joined + 2*first;
    take_law(s->given, kind, held, law);
    take_law(s->rates, kind, held, law + numbers);
    memcpy(joined, a, (size_t)first*sizeof *a), memcpy(joined + first, da, (size_t)first*sizeof *a);
    memcpy(other, b, (size_t)second*sizeof *b), memcpy(other + second, db, (size_t)second*sizeof *b);
    call_law(kind, kind->slope, joined, other, law, change);
    add_loads(kind, change, a, b, held, s->out);
    add_cross(pair, da + POSE + kind->first->sizes + 1, s->out + 6*body_of(kind->first, a) + 3);
    add_cross(db + POSE + kind->second->sizes + 1, pair, s->out + 6*body_of(kind->second, b) + 3);
}

static void change_pair(pair_search *s, const pair_kind *kind, int i, int j, const double *a, const double *b)
{
    double pair[EXERTED + STATED + 1] = { 0.0 };
    const int held = held_of(kind, i, j);
    if (changes(s, kind, held, a, b)) {
        exert(s->given, kind, held, a, b, pair);
        add_change(s, kind, i, j, a, b, held, pair);
    }
}

/* Which bodies have rates: all where numbers behind the bodies have. */
static void find_moves(const double *rates, int *moves)
{
    int all = 0;
    for (int i = POSE*BODIES; i < FIRST_STATE; i++) { all = all || rates[i] != 0.0; }
    for (int i = 0; i < BODIES; i++) {
        moves[i] = all;
        for (int k = 0; k < POSE; k++) { moves[i] = moves[i] || rates[POSE*i + k] != 0.0; }
    }
}

#ifdef PAIRS_AGAIN /* sums of which derivatives are taken along one direction after another at one place */

/* Places in what is kept: shapes, their rates, pairs; of each number of `rates` where its column of the derivative stands (as
   int, 0 before it is known); one direction, which bodies it moves and its results; calls so far; where the next column goes, -1
   where there is no room; the columns: how many bodies and further results, of each of those its place and what is read of it, of
   each of these place and number. A pair: its kind, both shapes, what it exerts. */
enum { KEPT = 3 + EXERTED + STATED, MOVING = SHAPES, PAIRS = MOVING + SHAPES, KNOWN = PAIRS + KEPT*ROOM, UNIT = KNOWN + GIVEN,
       MOVES = UNIT + GIVEN, FRESH = MOVES + BODIES, CALLS = FRESH + RESULTS, FREE = CALLS + 1, COLUMNS = FREE + 1 };

static void keep_pair(pair_search *s, const pair_kind *kind, int i, int j, const double *a, const double *b)
{
    double *const pair = s->work + PAIRS + KEPT*s->count;
    if (s->count == ROOM) {
        s->full = 1;
        return;
    }
    memset(pair, 0, KEPT*sizeof *pair);
    pair[0] = (double)(kind - KINDS), pair[1] = (double)i, pair[2] = (double)j;
    exert(s->given, kind, held_of(kind, i, j), a, b, pair + 3);
    s->count++;
}

/* Both shapes of a pair that is kept. */
static const pair_kind *kept_pair(const double *kept, int k, const double **a, const double **b)
{
    const double *const pair = kept + PAIRS + KEPT*k;
    const pair_kind *const kind = KINDS + (int)pair[0];
    *a = kept + kind->first->start + kind->first->length*(int)pair[1];
    *b = kept + kind->second->start + kind->second->length*(int)pair[2];
    return kind;
}

/* Adds the derivative along rates, by which bodies move as `moves` says, of the pairs that are kept. */
static void along(const double *given, const double *rates, const int *moves, int met, double *out, double *kept)
{
    int rated[ALL_SHAPES] = { 0 };
    pair_search s = begin(SLOPE, given, kept, out);
    s.rates = rates, s.moving = kept + MOVING, s.moves = moves, s.rated = rated;
    const double *a, *b;
    for (int k = 0; k < met; k++) {
        const pair_kind *const kind = kept_pair(kept, k, &a, &b);
        const double *const pair = kept + PAIRS + KEPT*k;
        const int i = (int)pair[1], j = (int)pair[2], held = held_of(kind, i, j);
        if (changes(&s, kind, held, a, b)) { add_change(&s, kind, i, j, a, b, held, pair + 3); }
    }
}

/* What a body gets of the direction in FRESH, if anything of it is read, as the next part of a column; zeros are left. */
static int take_body(int body, double *fresh, double *column)
{
    double *const found = fresh + 6*body;
    int some = 0;
    for (int n = 0; n < READ; n++) { some = some || found[COMPONENTS[n]] != 0.0; }
    for (int n = 0; n < NOT_READ; n++) { some = some && body != UNREAD[n]; }
    column[0] = 6.0*body;
    for (int n = 0; n < READ; n++) { column[1 + n] = found[COMPONENTS[n]]; }
    for (int n = 0; n < 6; n++) { found[n] = 0.0; }
    return some;
}

/* Makes the column of number e of `rates`; where there is no room for it, there are none from then on. */
static void make_column(const double *given, int e, int met, double *kept)
{
    double *const fresh = kept + FRESH, *const columns = kept + COLUMNS, *head;
    int *const moves = (int *)(kept + MOVES), used = (int)kept[FREE];
    const int whose = e < POSE*BODIES ? e/POSE : -1, all = whose < 0 && e < FIRST_STATE;
    if (used + 2 + 2*(1 + READ)*met + (1 + READ) + 2*(RESULTS - 6*BODIES) > SLOTS) {
        kept[FREE] = -1.0;
        return;
    }
    for (int i = all ? 0 : whose; i >= 0 && i < (all ? BODIES : whose + 1); i++) { moves[i] = 1; }
    kept[UNIT + e] = 1.0;
    along(given, kept + UNIT, moves, met, fresh, kept);
    kept[UNIT + e] = 0.0, ((int *)(kept + KNOWN))[e] = used;
    for (int i = all ? 0 : whose; i >= 0 && i < (all ? BODIES : whose + 1); i++) { moves[i] = 0; }
    head = columns + used, head[0] = head[1] = 0.0, used += 2;
    for (int k = 0; k < met; k++) {
        const double *a, *b;
        const pair_kind *const kind = kept_pair(kept, k, &a, &b);
        const int bodies[2] = { body_of(kind->first, a), body_of(kind->second, b) };
        for (int side = 0; side < 2 && (whose < 0 || bodies[0] == whose || bodies[1] == whose); side++) {
            const int some = take_body(bodies[side], fresh, columns + used);
            head[0] += some, used += (1 + READ)*some;
        }
    }
    for (int i = BEHIND; i < RESULTS; i++) {
        if (fresh[i] != 0.0) {
            columns[used] = (double)i, columns[used + 1] = fresh[i], head[1] += 1.0, fresh[i] = 0.0;
            used += 2;
        }
    }
    kept[FREE] = (double)used;
}

/* Adds the columns of the numbers that have rates, from those of a body on; the body where one is unknown. */
EOMGEN_ROWS static int add_columns(const double *restrict rates, const int *restrict known, const double *restrict columns,
                                   int from, double *restrict out)
{
    for (int body = from; body <= BODIES; body++) {
        const int begin = POSE*body, count = body < BODIES ? RATED : FURTHER;
        for (int r = 0; r < count; r++) {
            const int e = begin + (body < BODIES ? PATTERN[r] : r);
            if (rates[e] != 0.0 && known[e] == 0) {
                return body;
            }
        }
        for (int r = 0; r < count; r++) {
            const int e = begin + (body < BODIES ? PATTERN[r] : r);
            const double x = rates[e], *restrict column = columns + known[e];
            if (x == 0.0) {
                continue;
            }
            const int bodies = (int)column[0], singles = (int)column[1];
            column += 2;
            for (int k = 0; k < bodies; k++, column += 1 + READ) {
                double *restrict const force = out + (int)column[0];
                for (int n = 0; n < READ; n++) { force[COMPONENTS[n]] += x*column[1 + n]; }
            }
            for (int k = 0; k < singles; k++, column += 2) { out[(int)column[0]] += x*column[1]; }
        }
    }
    return BODIES + 1;
}

/* The derivative along rates as a sum of columns, those that are new made first; 0 where they find no room. */
static int by_columns(const double *given, const double *rates, int met, double *out, double *kept)
{
    const int *const known = (const int *)(kept + KNOWN);
    for (int body = 0; (body = add_columns(rates, known, kept + COLUMNS, body, out)) <= BODIES;) {
        const int begin = POSE*body, end = body < BODIES ? begin + POSE : GIVEN;
        for (int e = begin; e < end; e++) {
            if (rates[e] != 0.0 && known[e] == 0) {
                make_column(given, e, met, kept);
            }
            if (kept[FREE] < 0.0) {
                memset(out, 0, RESULTS*sizeof *out);
                return 0;
            }
        }
    }
    return 1;
}

#endif

static void change_states(pair_search *s, const pair_kind *kind, int i, int j, const double *a, const double *b)
{
    const int held = held_of(kind, i, j), own = kind->numbers + kind->states, first = kind->first->length;
    double joined[4*LONGEST] = { 0.0 }, law[2*LAWS + 1] = { 0.0 };
    if (s->full || !kind->states) {
        return;
    }
    take_law(s->given, kind, held, law);
    memcpy(joined, a, (size_t)first*sizeof *a), memcpy(joined + 2*first, b, (size_t)kind->second->length*sizeof *b);
    for (int e = 0; e < kind->states; e++) {
        double change[EXERTED + STATED + 1] = { 0.0 }, *const record = s->out + 1 + OF_STATE*s->count;
        int some = 0;
        law[own + kind->numbers + e] = 1.0;
        call_law(kind, kind->slope, joined, joined + 2*first, law, change);
        law[own + kind->numbers + e] = 0.0;
        for (int n = 0; n < 9; n++) { some = some || change[n] != 0.0; }
        if (!some) {
            continue;
        }
        if (s->count == ROOM*STATED) {
            s->full = 1;
            return;
        }
        record[0] = (double)(held + e), record[1] = (double)body_of(kind->first, a), record[2] = (double)body_of(kind->second, b);
        for (int n = 0; n < 3; n++) {
            record[3 + n] = -change[n], record[6 + n] = change[3 + n];
            record[9 + n] = change[n], record[12 + n] = change[6 + n];
        }
        add_cross(change, a + POSE + kind->first->sizes + 1, record + 6);
        add_cross(b + POSE + kind->second->sizes + 1, change, record + 12);
        s->count++;
    }
}

/* -- lists of near pairs, and the time until shapes may meet ----------------------------------------------------------- */

static void list_pair(pair_search *s, const pair_kind *kind, int i, int j, const double *a, const double *b)
{
    double law[LAWS + 1] = { 0.0 }, witnesses[2*WITNESS] = { 0.0 };
    for (int n = 0; n < kind->numbers; n++) { law[n] = s->given[kind->law[n]]; }
    call_law(kind, kind->witness, a, b, law, witnesses);
    for (const double *witness = witnesses; witness < witnesses + WITNESS*kind->places; witness += WITNESS) {
        if (!(witness[3] > -margin_of(kind, a, b))) {
            continue;
        }
        if (s->count < ROOM) {
            double *const record = s->out + 1 + RECORD*s->count;
            record[0] = kind->first->number + i, record[1] = kind->second->number + j;
            memcpy(record + 2, witness, WITNESS*sizeof *witness);
        }
        s->count++;
    }
}

/* The acceleration of a shape's centre, from that of its body. */
static void place_motion(const double *own, const double *s, int sizes, double *d)
{
    const double *const turning = s + 15, *const arm = s + POSE + sizes + 1;
    double whirl[3] = { 0.0, 0.0, 0.0 };
    add_cross(turning, arm, whirl);
    for (int i = 0; i < 3; i++) { d[i] = own[i]; }
    add_cross(own + 3, arm, d);
    add_cross(turning, whirl, d);
    for (int i = 0; i < 3; i++) { d[3 + i] = own[3 + i]; }
}

/* Position, velocity and acceleration of b against a, without parts along z of the first shape where only a plane counts. */
static void place_beside(const double *a, const double *b, const double *da, const double *db, int planar, double *reach)
{
    for (int i = 0; i < 3; i++) {
        reach[i] = b[i] - a[i];
        reach[3 + i] = b[12 + i] - a[12 + i];
        reach[6 + i] = db[i] - da[i];
    }
    for (int k = 0; planar && k < 9; k += 3) {
        const double along = reach[k]*a[5] + reach[k + 1]*a[8] + reach[k + 2]*a[11];
        for (int i = 0; i < 3; i++) { reach[k + i] -= along*a[5 + 3*i]; }
    }
}

/* The same as seen from a, which turns. */
static void see_from(const double *a, const double *da, double *reach)
{
    const double *const turning = a + 15, twice[3] = { 2.0*turning[0], 2.0*turning[1], 2.0*turning[2] };
    double whirl[3] = { 0.0, 0.0, 0.0 };
    add_cross(reach, turning, reach + 3);
    add_cross(reach, da + 3, reach + 6);
    add_cross(turning, reach, whirl);
    add_cross(whirl, turning, reach + 6);
    add_cross(reach + 3, twice, reach + 6);
}

/* What the turning of b in a adds to the speed of points of b within a radius, and to its change. */
static void add_turning(const double *a, const double *b, const double *da, const double *db, double radius, double *speed, double *gain)
{
    double turn[3], spin[3];
    for (int i = 0; i < 3; i++) { turn[i] = b[15 + i] - a[15 + i], spin[i] = db[3 + i] - da[3 + i]; }
    const double rate = sqrt(dot(turn, turn));
    *speed += radius*rate;
    *gain += radius*(sqrt(dot(spin, spin)) + rate*(sqrt(dot(a + 15, a + 15)) + rate));
}

/* The time in which they meet at the soonest, or go as far as a step may. */
static double soonest(double gap, double closing, double gain, double reach)
{
    const double root = sqrt(closing*closing + 2.0*gain*reach);
    const double time = closing > 0.0 ? 2.0*reach/(closing + root) : (root - closing)/gain;
    return gap > 0.0 && time > 0.0 && time < PAIRS_NEVER ? time : PAIRS_NEVER;
}

/* The length of the longest of some vectors. */
static double longest(const double *a, const pair_table *table)
{
    double square = 0.0;
    for (int i = 0; i < table->count; i++) { square = fmax(square, dot(a + table->start + i*table->length, a + table->start + i*table->length)); }
    return sqrt(square);
}

static const double *motion_of(pair_search *s, const pair_table *table, int i, const double *a)
{
    double *const d = s->moving + table->start + table->length*i;
    if (table->lined) { place_motion(s->accelerations + 6*body_of(table, a), a, table->sizes, d); }
    return d;
}

static void approach(pair_search *s, const pair_kind *kind, int i, int j, const double *a, const double *b)
{
    const double *const da = motion_of(s, kind->first, i, a), *const db = motion_of(s, kind->second, j, b);
    const double first = a[POSE + kind->first->sizes], second = b[POSE + kind->second->sizes];
    const double thin = thickness_of(kind->first, a), thick = thin + thickness_of(kind->second, b);
    const int open = first < 0.0 || second < 0.0;
    double reach[9], touch[5] = { 0.0 }, law[LAWS + 1] = { 0.0 }, more = 0.0;
    place_beside(a, b, da, db, kind->extent, reach);
    const double distance = sqrt(dot(reach, reach));
    double gap = distance - first - second, closing = -dot(reach, reach + 3)/(distance > 0.0 ? distance : 1.0);
    if (kind->lines || open || !(gap > 0.0)) {
        for (int n = 0; n < kind->numbers; n++) { law[n] = s->given[kind->law[n]]; }
        call_law(kind, kind->touch, a, b, law, touch);
        see_from(a, da, reach);
        gap = -touch[3];
        closing = -dot(touch, reach + 3);
        if (kind->turns) { add_turning(a, b, da, db, touch[4], &closing, &more); }
    } else if (is_inside(kind)) {
        return; /* it meets other parts before */
    }
    const double time = soonest(gap, closing, sqrt(dot(reach + 6, reach + 6)) + more,
        fmax((kind->thin || !open ? PAIRS_UP_TO : PAIRS_BEYOND)*gap, PAIRS_WITHIN*(kind->thin > 1 ? thin : thick)));
    s->out[0] = time < s->out[0] ? time : s->out[0];
    if (-gap > s->out[1]) {
        s->out[1] = -gap, s->out[2] = thick, s->out[3] = kind->first->number + i, s->out[4] = kind->second->number + j;
    }
}

/* -- pairs that are near ----------------------------------------------------------------------------------------------- */

/* Whether the spheres around two shapes are apart, in a plane across z of the first where `extent` is 1. */
EOMGEN_INSIDE int apart(const double *a, const double *b, double first, double second, int extent)
{
    const double reach[3] = { b[0] - a[0], b[1] - a[1], b[2] - a[2] };
    if (first < 0.0 || second < 0.0) {
        return 0;
    }
    if (LINED && extent == COLUMNS_DOWN) {
        const double x = reach[0]*a[3] + reach[1]*a[6] + reach[2]*a[9], y = reach[0]*a[4] + reach[1]*a[7] + reach[2]*a[10];
        const double wide = first + second + fmax(0.0, -y);
        return x*x + (y > 0.0 ? y*y : 0.0) > wide*wide;
    }
    const double square = dot(reach, reach), along = extent ? reach[0]*a[5] + reach[1]*a[8] + reach[2]*a[11] : 0.0;
    return square - along*along > (first + second)*(first + second);
}

EOMGEN_INSIDE void visit_pair(pair_search *s, const pair_kind *kind, int i, int j, const double *a, const double *b)
{
    const double *const own = a + POSE + kind->first->sizes, *const other = b + POSE + kind->second->sizes;
    const double more = s->task == LIST && own[0] >= 0.0 ? margin_of(kind, a, b) : 0.0;
    int corner;
    if (own[5] == other[5] || (s->task != MEET && apart(a, b, own[0] + more, other[0], kind->extent))
        || (s->task <= TOUCHING && is_inside(kind) && deep_piece(a, kind->corners[0], b, &corner) < 0)) {
        return;
    }
    switch (s->task) {
    case SUM: add_pair(s, kind, i, j, a, b); break;
    case SLOPE: if (SLOPES) { change_pair(s, kind, i, j, a, b); } break;
#ifdef PAIRS_AGAIN
    case KEEP: keep_pair(s, kind, i, j, a, b); break;
#endif
    case STATES: if (HELD) { change_states(s, kind, i, j, a, b); } break;
    case LIST: if (LISTS) { list_pair(s, kind, i, j, a, b); } break;
    default: if (MEETS) { approach(s, kind, i, j, a, b); }
    }
}

/* Cells of a line of columns, which reach down along y without end, that are beside a shape or next to that, from *low to
   below *high: the first cell, how many there are, and the radius within which the shape lies. */
static void find_columns(const double *cell, int count, const double *b, double radius, int *low, int *high)
{
    double x = 0.0, y = 0.0;
    for (int i = 0; i < 3; i++) {
        x += (b[i] - cell[i])*cell[3 + 3*i];
        y += (b[i] - cell[i])*cell[4 + 3*i];
    }
    const double chord = radius*radius - y*y, size = cell[POSE];
    const double wide = y > 0.0 ? sqrt(chord > 0.0 ? chord : 0.0) : radius - y;
    const double from = (x - wide)/size - 1.0, to = (x + wide)/size + 2.0;
    *low = from > 0.0 ? (from < count ? (int)from : count) : 0;
    *high = to < count ? (to > 0.0 ? (int)to : 0) : count;
}

/* Pairs of lines of columns with shapes: the cells beside these, or where none is the nearest one if shapes approach. */
static void visit_lines(pair_search *s, const pair_kind *kind)
{
    const pair_table *const first = kind->first, *const second = kind->second;
    for (int k = 0; k < kind->lines*second->count; k++) {
        const int *const line = kind->line[k/second->count], j = k%second->count;
        const double *const b = s->work + second->start + second->length*j;
        int low, high;
        find_columns(place_shape(s->given, first, line[0], s->work), line[1], b, b[POSE + second->sizes], &low, &high);
        if (s->task == MEET) { low = low < line[1] ? low : line[1] - 1, high = high > low ? high : low + 1; }
        for (int i = line[0] + low; i < line[0] + high; i++) { visit_pair(s, kind, i, j, place_shape(s->given, first, i, s->work), b); }
    }
}

/* Shapes of one table in the order of their centres along an axis of the ground; `most` is the largest of their radii. */
typedef struct {
    int axis, count;
    double most, farthest, places[MOST];
    int orders[2][MOST], *order, near[MOST];
} pair_order;

/* The axis along which shapes lie farthest apart: none (-1) where a centre or a radius is not finite, or where distances count
   across z of shapes that are not across the axis. */
static int widest_axis(const pair_kind *kind, const double *first, const double *second)
{
    const int length = kind->first->length, step = kind->second->length, count = kind->first->count, others = kind->second->count;
    double widest = -1.0, finite = 0.0;
    int best = -1;
    for (int i = 0; i < count; i++) {
        const double *const a = first + i*length;
        finite += (a[0] + a[1] + a[2] + a[POSE + kind->first->sizes])*0.0;
    }
    for (int axis = 0; axis < 3; axis++) {
        double low = second[axis], high = low;
        int across = 1;
        for (int j = 0; j < others; j++) {
            const double place = second[j*step + axis];
            low = place < low ? place : low, high = place > high ? place : high;
            finite += place*0.0;
        }
        for (int i = 0; kind->extent && i < count; i++) { across = across && first[i*length + 5 + 3*axis] == 0.0; }
        if (across && high - low > widest) { widest = high - low, best = axis; }
    }
    return finite == 0.0 ? best : -1;
}

/* Sort by merging, which keeps shapes at one place in their order. */
static void sort_shapes(pair_order *o, const double *shapes, int step, int sizes)
{
    int *from = o->orders[0], *to = o->orders[1];
    o->most = o->farthest = 0.0;
    for (int j = 0; j < o->count; j++) {
        const double *const s = shapes + j*step;
        o->most = fmax(o->most, s[POSE + sizes]), o->farthest = fmax(o->farthest, fabs(s[o->axis]));
        from[j] = j;
    }
    for (int width = 1; width < o->count; width *= 2) {
        for (int start = 0; start < o->count; start += 2*width) {
            const int middle = start + width < o->count ? start + width : o->count;
            const int end = middle + width < o->count ? middle + width : o->count;
            for (int a = start, b = middle, k = start; k < end; k++) {
                const int left = a < middle && (b >= end || shapes[from[a]*step + o->axis] <= shapes[from[b]*step + o->axis]);
                to[k] = left ? from[a++] : from[b++];
            }
        }
        int *const turn = from;
        from = to, to = turn;
    }
    for (int k = 0; k < o->count; k++) { o->places[k] = shapes[from[k]*step + o->axis]; }
    o->order = from;
}

/* Numbers of the shapes above `beyond` whose spheres may meet that of s, ascending, and how many; the distance is tested after,
   so that a little more than the radii does no harm. */
static int find_near(pair_order *o, const double *s, double radius, int beyond)
{
    const double middle = s[o->axis];
    const double reach = (radius + o->most) + PAIRS_APART*(fabs(middle) + o->farthest + radius + o->most);
    int low = 0, high = o->count, n = 0, *const found = o->near;
    while (low < high) {
        const int k = low + (high - low)/2;
        if (o->places[k] < middle - reach) { low = k + 1; } else { high = k; }
    }
    for (int k = low; k < o->count && o->places[k] <= middle + reach; k++) {
        int at = n;
        if (o->order[k] <= beyond) {
            continue;
        }
        for (; at > 0 && found[at - 1] > o->order[k]; at--) { found[at] = found[at - 1]; }
        found[at] = o->order[k];
        n++;
    }
    return n;
}

/* By how much the sphere of a shape is larger for those of many that are sought: shapes farther than the last do not meet before
   others do. */
static double wider(const pair_search *s, const pair_kind *kind, const double *a)
{
    return s->task <= TOUCHING ? 0.0
        : s->task == LIST ? PAIRS_NEAR*(thickness_of(kind->first, a) + s->thickest)
        : (s->speed + 0.5*s->gain*s->out[0])*s->out[0]/PAIRS_UP_TO;
}

/* All pairs of a kind, where they are many by their order along an axis. */
static void visit_kind(pair_search *s, const pair_kind *kind)
{
    const pair_table *const first = kind->first, *const second = kind->second;
    const double *const shapes = s->work + first->start, *const others = s->work + second->start;
    const int same = first == second;
    pair_order order;
    order.axis = -1, order.count = second->count;
    if (LINED && kind->lines) {
        visit_lines(s, kind);
        return;
    }
    if (MOST > 1 && kind->sorted && !(s->task == MEET && kind->turns)) { order.axis = widest_axis(kind, shapes, others); }
    if (MOST > 1 && order.axis >= 0) { sort_shapes(&order, others, second->length, second->sizes); }
    for (int i = 0; i < first->count; i++) {
        const double *const a = shapes + first->length*i;
        const int listed = MOST > 1 && order.axis >= 0;
        int count = second->count;
        if (listed) { count = find_near(&order, a, a[POSE + first->sizes] + wider(s, kind, a), same ? i : -1); }
        for (int k = listed || !same ? 0 : i + 1; k < count; k++) {
            const int j = listed ? order.near[k] : k;
            visit_pair(s, kind, i, j, a, others + second->length*j);
        }
    }
}

static void visit_all(pair_search *s)
{
    place_all(s->given, s->work);
    for (const pair_kind *kind = KINDS; kind < KINDS + ALL_KINDS && !s->full; kind++) { visit_kind(s, kind); }
}

/* -- sums, derivatives, lists and times -------------------------------------------------------------------------------- */

EOMGEN_SHARED void pairs_sum(const double *given, double *out, double *work)
{
    pair_search s = begin(SUM, given, work, out);
    memset(out, 0, RESULTS*sizeof *out);
    visit_all(&s);
}

/* The derivative along rates: of pairs with a body that has one, or of all where other numbers have. */
EOMGEN_SHARED void pairs_slope(const double *given, const double *rates, double *out, double *work)
{
    int moves[BODIES];
    int rated[ALL_SHAPES] = { 0 };
    pair_search s = begin(SLOPE, given, work, out);
    s.rates = rates, s.moving = work + SHAPES, s.moves = moves, s.rated = rated;
    memset(out, 0, RESULTS*sizeof *out);
    find_moves(rates, moves);
    visit_all(&s);
}

#ifdef PAIRS_AGAIN
/* Places the shapes and lists the pairs that are near, with what each exerts; their number, -1 where there is no room. */
static int meet(const double *given, double *kept)
{
    pair_search s = begin(KEEP, given, kept, NULL);
    visit_all(&s);
    return s.full ? -1 : s.count;
}

/* The same derivative along one direction after another at one place: *met is 0 before the first, and then one more than pairs
   are near, or -1 where they find no room; shapes, their rates and these pairs are kept. After as many directions as a body
   has numbers, columns of the derivative are made, so that a further direction costs a sum. */
static void pairs_again(const double *given, const double *rates, double *out, double *met, double *kept)
{
    int moves[BODIES];
    if (*met == 0.0) {
        const int found = meet(given, kept);
        *met = found < 0 ? -1.0 : found + 1.0;
        for (int i = KNOWN; i < COLUMNS; i++) { kept[i] = 0.0; }
        kept[FREE] = 1.0; /* 0 says that a column is not known */
    }
    if (*met < 0.0) {
        pairs_slope(given, rates, out, kept);
        return;
    }
    memset(out, 0, RESULTS*sizeof *out);
    kept[CALLS] += 1.0;
    if (kept[CALLS] > POSE && kept[FREE] > 0.0 && by_columns(given, rates, (int)*met - 1, out, kept)) {
        return;
    }
    find_moves(rates, moves);
    along(given, rates, moves, (int)*met - 1, out, kept);
}
#endif

/* What near pairs exert by each of their own states: how many records there are, -1 where there is no room for them, and of
   each the number of the state, both bodies, and force and torque on either. */
EOMGEN_SHARED void pairs_held(const double *given, double *out, double *work)
{
    pair_search s = begin(STATES, given, work, out);
    visit_all(&s);
    out[0] = s.full ? -1.0 : (double)s.count;
}

/* How many pairs are near each other, and of each both shapes and where they touch. */
EOMGEN_SHARED void pairs_witnesses(const double *given, double *out, double *work)
{
    pair_search s = begin(LIST, given, work, out);
    memset(out, 0, (1 + RECORD*ROOM)*sizeof *out);
    place_all(given, work);
    for (const pair_kind *kind = KINDS; kind < KINDS + ALL_KINDS; kind++) {
        const pair_table *const second = kind->second;
        s.thickest = 0.0;
        for (int j = 0; j < second->count; j++) {
            s.thickest = fmax(s.thickest, thickness_of(second, work + second->start + second->length*j));
        }
        visit_kind(&s, kind);
    }
    out[0] = s.count;
}

EOMGEN_SHARED void pairs_meeting(const double *given, const double *accelerations, double *out, double *work)
{
    double *const moving = work + SHAPES;
    pair_search s = begin(MEET, given, work, out);
    s.moving = moving, s.accelerations = accelerations;
    memset(out, 0, MEETING*sizeof *out);
    out[0] = PAIRS_NEVER;
    place_all(given, work);
    for (const pair_table *table = TABLES; table < TABLES + ALL_TABLES; table++) {
        for (int i = 0; i < table->count && !table->lined; i++) {
            const double *const a = work + table->start + table->length*i;
            place_motion(accelerations + 6*body_of(table, a), a, table->sizes, moving + table->start + table->length*i);
        }
    }
    for (const pair_kind *kind = KINDS; kind < KINDS + ALL_KINDS; kind++) {
        if (kind->sorted && !kind->turns) {
            s.speed = longest(work + 12, kind->first) + longest(work + 12, kind->second);
            s.gain = longest(moving, kind->first) + longest(moving, kind->second);
        }
        visit_kind(&s, kind);
    }
}

#endif
