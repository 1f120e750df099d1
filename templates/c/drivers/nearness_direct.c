/* How near the state x on the constraints is to a change point: the weakest, 1 where the straight-line code, whose work
   grows with the bodies alone, says that none can be near. */
static double nearness(double t, const double *restrict x, const double *restrict u, const double *restrict c,
                       double *restrict w)
{
    const double *const found = w + AT_DYNAMICS;
    partition parts;
    if (accelerate_directly(t, x, u, c, 1, w + AT_DYNAMICS, w) == 0 && found[2 * N + 1] != 0.0) {
        return 1.0;
    }
    return find_weakest(t, x, u, c, &parts, w);
}
