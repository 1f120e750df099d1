/* The nearest q with C(q) = 0, in place. */
#define bring(t, q, u, c, w) close_position(t, q, u, c, w)

/* x'; leaves the state on the constraints in w + AT_X. *weakest: as in partition. */
static int rhs_here(double t, const double *restrict x, const double *restrict u, const double *restrict c,
                    double *restrict out, double *restrict weakest, double *restrict w)
{
    int plan[3 * NZ];
    partition parts;
    int status = close_loops(t, x, u, c, w);
    *weakest = status == 0 ? find_weakest(t, w + AT_X, u, c, &parts, w) : 1.0;
    if (status == 0) {
        status = accelerate_system(t, u, c, plan, out + NQ, w);
    }
    form_rates(w + AT_X, w + AT_V, out);
    return status;
}
