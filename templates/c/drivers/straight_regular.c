/* A Newton step onto the constraints: found = mean residual, what linear theory leaves of it, length, step (N). Returns
   whether the short code knows it: near the constraints, away from change points. */
static int step_directly(double t, const double *restrict q, const double *restrict u, const double *restrict c,
                         double *restrict found, double *restrict w)
{
    if (regular_closing_block(t, q, u, c, found, w) != 0) {
        memset(found, 0, (3 + N) * sizeof *found); /* only rounding is left of the constraints */
        return 1;
    }
    if (found[2] <= CONSTRAINTS_NEARBY) {
        return 1;
    }
    (void)closing_block(t, q, u, c, found, w);
    return 0;
}

/* found = velocities (N) on the constraints and accelerations (N), whether they are sound, whether no change point can be
   near. known: whether the short code may know them. */
static int accelerate_directly(double t, const double *restrict y, const double *restrict u, const double *restrict c,
                               int known, double *restrict found, double *restrict w)
{
    if (known && regular_dynamics_block(t, y, u, c, found, w) == 0 && found[2 * N] != 0.0) {
        return 0;
    }
    return dynamics_block(t, y, u, c, found, w);
}
