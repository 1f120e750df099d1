/* As for one state; the long code runs where a lane needs it, and counts for these lanes alone. */
static flag step_directly(real t, const real *restrict q, const real *restrict u, const real *restrict c,
                          real *restrict found, real *restrict w)
{
    (void)regular_closing_block(t, q, u, c, found, w);
    const flag known = found[2] <= CONSTRAINTS_NEARBY;
    if (any_of(~known)) {
        real other[N + 3];
        (void)closing_block(t, q, u, c, other, w);
        for (int k = 0; k < N + 3; k++) {
            found[k] = choose(known, found[k], other[k]);
        }
    }
    return known;
}

static flag accelerate_directly(real t, const real *restrict y, const real *restrict u, const real *restrict c,
                                flag known, real *restrict found, real *restrict w)
{
    known &= ~regular_dynamics_block(t, y, u, c, found, w) & (found[2 * N] != 0.0);
    const flag none = { 0 };
    flag failed = none;
    if (any_of(~known)) {
        real other[2 * N + 2];
        failed = ~known & dynamics_block(t, y, u, c, other, w);
        for (int k = 0; k < 2 * N + 2; k++) {
            found[k] = choose(known, found[k], other[k]);
        }
    }
    return failed;
}
