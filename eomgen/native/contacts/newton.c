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
