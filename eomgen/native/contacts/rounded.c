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
