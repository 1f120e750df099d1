/* A Newton step onto the constraints: found = mean residual, what linear theory leaves of it, length, step (N). The short
   code knows steps from states near the constraints, away from change points. */
static void step_directly(double t, const double *restrict q, const double *restrict u, const double *restrict c,
                          double *restrict found, double *restrict w)
{
    (void)regular_closing_block(t, q, u, c, found, w);
    if (!(found[2] <= CONSTRAINTS_NEARBY)) { /* or not a number */
        (void)closing_block(t, q, u, c, found, w);
    }
}

/* found = velocities (N) on the constraints and accelerations (N), whether they are sound, whether no change point can be
   near. */
static int accelerate_directly(double t, const double *restrict y, const double *restrict u, const double *restrict c,
                               double *restrict found, double *restrict w)
{
    const int status = regular_dynamics_block(t, y, u, c, found, w);
    return status == 0 && found[2 * N] != 0.0 ? 0 : dynamics_block(t, y, u, c, found, w);
}
