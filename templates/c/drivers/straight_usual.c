/* A Newton step onto the constraints: found = mean residual, what linear theory leaves of it, length, step (N). Returns
   whether short code knows it, which there is none of here. */
static int step_directly(double t, const double *restrict q, const double *restrict u, const double *restrict c,
                         double *restrict found, double *restrict w)
{
    if (closing_block(t, q, u, c, found, w) != 0) {
        memset(found, 0, (3 + N) * sizeof *found); /* only rounding is left of the constraints */
    }
    return 0;
}

/* found = velocities (N) on the constraints and accelerations (N), whether they are sound, whether no change point can be
   near. */
static int accelerate_directly(double t, const double *restrict y, const double *restrict u, const double *restrict c,
                               int known, double *restrict found, double *restrict w)
{
    (void)known;
    return dynamics_block(t, y, u, c, found, w);
}
