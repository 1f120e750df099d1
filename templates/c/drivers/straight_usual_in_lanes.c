/* As for one state. */
static flag step_directly(real t, const real *restrict q, const real *restrict u, const real *restrict c,
                          real *restrict found, real *restrict w)
{
    const flag none = { 0 };
    (void)closing_block(t, q, u, c, found, w);
    return none;
}

static flag accelerate_directly(real t, const real *restrict y, const real *restrict u, const real *restrict c,
                                flag known, real *restrict found, real *restrict w)
{
    (void)known;
    return dynamics_block(t, y, u, c, found, w);
}
