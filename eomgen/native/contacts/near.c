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
static int gather(eomgen_rigid *s, double *spots)
{
    const double *from = spots;
    int count = 0, shapes = 0;
    for (int l = 0; l < s->n_lists; l++) {
        const int numbers = s->lists[2*l], listed = (int)from[0];
        s->list = l;
        if (listed > (numbers - 1)/RECORD_OF) {
            s->needed = listed;
            return -EOMGEN_TOO_MANY;
        }
        for (int k = 0; k < listed; k++, count++) {
            double *const record = spots + RECORD_OF*count;
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
