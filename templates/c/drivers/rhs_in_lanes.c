/* x' of states side by side, each with Newton steps of its own: the same steps, on the same criteria, as rhs_here takes for
   one state, so that every lane has its bits. Returns the lanes that are left to the function of one state: far from the
   constraints, next to a change point, or where the straight-line accelerations are not sound. Leaves the states on the
   constraints in w + AT_X. */
static flag rhs_driver(real t, const real *restrict x, const real *restrict u, const real *restrict c, real *restrict out,
                       real *restrict w)
{
    const flag none = { 0 };
    real *const y = w + AT_X, *const found = w + AT_CLOSING, *const solved = w + AT_DYNAMICS;
    real step[N];
    flag open = ~none, left = none, known = none;
    for (int k = 0; k < NQ + N; k++) {
        y[k] = x[k];
    }
    for (int i = 0; i < 6 && any_of(open); i++) {
        const flag shown = step_directly(t, y, u, c, found, w);
        known = (known & ~open) | (shown & open);
        left |= open & ~(found[2] <= 0.25); /* or not a number */
        open &= ~left;
        for (int k = 0; k < N; k++) {
            step[k] = choose(open & (found[2] != 0.0), found[3 + k], same(-0.0)); /* adding -0 changes nothing */
        }
        move(y, step);
        open &= ~((found[2] <= CONSTRAINTS_SHORT) & (found[1] <= CONSTRAINTS_EXACT));
    }
    left |= open | accelerate_directly(t, y, u, c, known, solved, w);
    left |= (solved[2 * N] == 0.0) | (solved[2 * N + 1] == 0.0);
    form_rates(y, solved, out);
    for (int k = 0; k < N; k++) {
        y[NQ + k] = solved[k];
        out[NQ + k] = solved[N + k];
    }
    return left;
}
