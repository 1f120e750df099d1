/* The part of a long step that close_position takes, so that far states come to the same place; 0 where only rounding is
   left of the constraints, whose weak rows ask for a term that is not known here. */
static double kept_part(double t, const double *restrict q, const double *restrict u, const double *restrict c,
                        double *restrict w)
{
    const double *const found = w + AT_CLOSING;
    double *const dz = w + AT_STEP;
    if (!(found[0] > CONSTRAINTS_GENTLE) || !isfinite(found[2])) {
        return 0.0;
    }
    (void)scales_block(t, q, u, c, w + AT_SCALES, w);
    for (int k = 0; k < N; k++) {
        dz[k] = found[3 + k] / w[AT_SCALES + k];
    }
    return damping(dz, N);
}

/* The nearest q with C(q) = 0, in place; nonzero where that takes many steps. *known: whether short code knew the last. */
static int close_directly(double t, double *restrict q, const double *restrict u, const double *restrict c,
                          int *restrict known, double *restrict w)
{
    double *const found = w + AT_CLOSING;
    *known = 0;
    for (int step = 0, all = 0; step < 6 && all < 25; all++) {
        *known = step_directly(t, q, u, c, found, w);
        const double left = found[1], length = found[2];
        if (!(length <= 0.25)) { /* or not a number */
            const double part = kept_part(t, q, u, c, w);
            if (part == 0.0) {
                break;
            }
            for (int k = 0; k < N; k++) {
                found[3 + k] *= part;
            }
            move(q, found + 3);
            continue;
        }
        for (int k = 0; length == 0.0 && k < N; k++) {
            found[3 + k] = -0.0; /* adding -0 changes nothing, not even the sign of a zero */
        }
        step += !(found[0] > CONSTRAINTS_GENTLE); /* before, close_position makes the same steps, as many as it takes */
        move(q, found + 3);
        if (arrives(length, left)) {
            return 0;
        }
    }
    return EOMGEN_PROJECTION_FAILED;
}

/* The nearest q with C(q) = 0, in place. */
static int bring(double t, double *restrict q, const double *restrict u, const double *restrict c, double *restrict w)
{
    int known;
    return close_directly(t, q, u, c, &known, w) == 0 ? 0 : close_position(t, q, u, c, w);
}

/* x'; leaves the state on the constraints in w + AT_X. *weakest: as in partition, 1 where it is surely not small. */
static int rhs_here(double t, const double *restrict x, const double *restrict u, const double *restrict c,
                    double *restrict out, double *restrict weakest, double *restrict w)
{
    double *const y = w + AT_X;
    const double *const found = w + AT_DYNAMICS;
    partition parts;
    int known;
    parts.weakest = 1.0;
    for (int k = 0; k < NQ + N; k++) {
        y[k] = x[k];
    }
    if (close_directly(t, y, u, c, &known, w) == 0) {
        const int status = accelerate_directly(t, y, u, c, known, w + AT_DYNAMICS, w);
        if (status == 0 && found[2 * N] != 0.0) {
            form_rates(y, found, out);
            for (int k = 0; k < N; k++) {
                y[NQ + k] = found[k];
                out[NQ + k] = found[N + k];
            }
            *weakest = found[2 * N + 1] != 0.0 ? 1.0 : find_weakest(t, y, u, c, &parts, w);
            return 0;
        }
    }
    /* far away, or the preferred coordinates do not move the mechanism well here */
    int status = close_loops(t, x, u, c, w);
    if (status == 0) {
        status = accelerate(t, u, c, N + 1, &parts, out + NQ, w);
    }
    form_rates(w + AT_X, w + AT_V, out);
    *weakest = parts.weakest;
    return status;
}
