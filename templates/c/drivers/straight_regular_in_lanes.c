/* As for one state; the long code runs where a lane needs it, and counts for these lanes alone. */
static void step_directly(real t, const real *restrict q, const real *restrict u, const real *restrict c,
                          real *restrict found, real *restrict w)
{
    (void)regular_closing_block(t, q, u, c, found, w);
    const flag far = ~(found[2] <= CONSTRAINTS_NEARBY); /* or not a number */
    if (any_of(far)) {
        real other[N + 3];
        (void)closing_block(t, q, u, c, other, w);
        for (int k = 0; k < N + 3; k++) {
            found[k] = choose(far, other[k], found[k]);
        }
    }
}

static flag accelerate_directly(real t, const real *restrict y, const real *restrict u, const real *restrict c,
                                real *restrict found, real *restrict w)
{
    flag failed = regular_dynamics_block(t, y, u, c, found, w);
    const flag unsound = failed | (found[2 * N] == 0.0);
    if (any_of(unsound)) {
        real other[2 * N + 2];
        failed = unsound & dynamics_block(t, y, u, c, other, w);
        for (int k = 0; k < 2 * N + 2; k++) {
            found[k] = choose(unsound, other[k], found[k]);
        }
    }
    return failed;
}
