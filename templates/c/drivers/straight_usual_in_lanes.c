/* As for one state. */
static void step_directly(real t, const real *restrict q, const real *restrict u, const real *restrict c,
                          real *restrict found, real *restrict w)
{
    (void)closing_block(t, q, u, c, found, w);
}

static flag accelerate_directly(real t, const real *restrict y, const real *restrict u, const real *restrict c,
                                real *restrict found, real *restrict w)
{
    return dynamics_block(t, y, u, c, found, w);
}
