/* The nearest q with C(q) = 0, in place. */
#define bring(t, q, u, c, w) close_position(t, q, u, c, w)

/* x'; leaves the state on the constraints in w + AT_X. *weakest: as in partition. */
static int rhs_here(double t, const double *restrict x, const double *restrict u, const double *restrict c,
                    double *restrict out, double *restrict weakest, double *restrict w)
{
    partition parts;
    parts.weakest = 1.0;
    int status = close_loops(t, x, u, c, w);
    if (status == 0) {
        status = accelerate(t, u, c, N + 1, &parts, out + NQ, w);
    }
    form_rates(w + AT_X, w + AT_V, out);
    *weakest = parts.weakest;
    return status;
}
