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
