/* How near the state x on the constraints is to a change point: the weakest, 1 where it is surely not small. */
static double nearness(double t, const double *restrict x, const double *restrict u, const double *restrict c,
                       double *restrict w)
{
    partition parts;
    return find_weakest(t, x, u, c, &parts, w);
}
