/* K z = r by steps with the factors of the relaxed K: the proximal point method, which of all solutions with redundant
   constraints finds the one of least multipliers. Ends when the defect no longer halves,
   and says whether it is rounding. */
static int solve_system(const double *restrict r, const int *restrict plan, double *restrict z, double *restrict w)
{
    const double *const K = w + AT_SYSTEM, *const row = w + AT_ROW, *const column = w + AT_COLUMN;
    double *const d = w + AT_DEFECT;
    double before = HUGE_VAL;
    for (int i = 0; i < NZ; i++) {
        z[i] = 0.0;
    }
    for (int count = 0; count <= 30; count++) {
        double size = 0.0;
        for (int i = 0; i < NZ; i++) {
            d[i] = r[i];
        }
        for (int e = 0; e < PLACES; e++) {
            d[PLACE[e][0]] -= K[e] * z[PLACE[e][1]];
        }
        for (int i = 0; i < NZ; i++) {
            d[i] *= row[i];
            size = fabs(d[i]) <= size ? size : fabs(d[i]);
        }
        if (!isfinite(size)) {
            return EOMGEN_NON_FINITE;
        }
        if (size == 0.0 || count == 30 || (count > 1 && size > 0.5 * before)) {
            /* a step leaves RELAXATION / (s^2 + RELAXATION) along constraints of singular value s */
            const double weak = size > 0.0 ? SYSTEMS_RELAXATION * (before / size - 1.0) : 1.0;
            return is_solved(r, z, weak, w) ? 0 : EOMGEN_UNSOLVED;
        }
        before = size;
        substitute_system(w + AT_LU, plan, d);
        for (int i = 0; i < NZ; i++) {
            z[i] += column[i] * d[i];
        }
    }
    return 0;
}

/* Accelerations a (N) of the state in w + AT_X; leaves z behind q and v in w + AT_MOTION, and the factors. */
static int accelerate_system(double t, const double *restrict u, const double *restrict c, int *restrict plan,
                             double *restrict a, double *restrict w)
{
    (void)system_block(t, w + AT_X, u, c, w + AT_SYSTEM, w);
    balance_system(w);
    int status = factor_system(w, plan);
    if (status == 0) {
        status = solve_system(w + AT_SYSTEM + PLACES, plan, w + AT_MOTION + NQ + N, w);
    }
    for (int k = 0; k < NQ + N; k++) {
        w[AT_MOTION + k] = w[AT_X + k];
    }
    return status != 0 ? status : joint_accelerations_block(t, w + AT_MOTION, u, c, a, w);
}
