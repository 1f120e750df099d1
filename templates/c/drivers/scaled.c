/* Scaled quantities: q / s_q, C / s_c, J = diag(1/s_c) C_q diag(s_q). */
EOMGEN_SHARED void form_scaled(const double *restrict C_q, const double *restrict s, double *restrict J)
{
    for (int i = 0; i < M; i++) {
        for (int k = 0; k < N; k++) {
            J[i * N + k] = C_q[i * N + k] * s[k] / s[N + i];
        }
    }
}

/* The largest |C / s_c|; NaN if an entry is NaN. */
EOMGEN_SHARED double largest_residual(const double *restrict C, const double *restrict s)
{
    double largest = 0.0;
    for (int i = 0; i < MH; i++) {
        const double size = fabs(C[i] / s[N + i]);
        if (!(size <= largest)) {
            largest = size;
        }
        if (!isfinite(size)) {
            return (double)NAN;
        }
    }
    return largest;
}

/* Whether each |C / s_c| is within the limit, or within what rounding of q leaves of it: that part of |J| |q / s_q|. */
EOMGEN_SHARED int is_within(double limit, double roundings, const double *restrict C, const double *restrict J,
                            const double *restrict q, const double *restrict s)
{
    for (int i = 0; i < MH; i++) {
        double rounded = 0.0;
        for (int k = 0; k < N; k++) {
            rounded += fabs(J[i * N + k] * coordinate_of(q, k)) / s[k];
        }
        if (!(fabs(C[i] / s[N + i]) <= fmax(limit, roundings * rounded))) {
            return 0;
        }
    }
    return 1;
}

/* Newton has arrived, at rounding or within SETTLED and no longer getting closer; one step at least is always made,
   because near configurations where rows depend on each other a small residual is not a small distance. */
EOMGEN_SHARED int has_settled(int step, double size, double before, const double *restrict C, const double *restrict J,
                              const double *restrict q, const double *restrict s)
{
    return size == 0.0 || (step > 0 && (size <= CONSTRAINTS_EXACT
        || (size > 0.5 * before && is_within(CONSTRAINTS_SETTLED, ROUNDING_ROUNDED, C, J, q, s))));
}

/* A full step of this scaled length that leaves so much of the residual, by linear theory, is the last one needed. */
EOMGEN_SHARED int arrives(double longest, double left)
{
    return longest <= CONSTRAINTS_SHORT && left <= CONSTRAINTS_EXACT;
}

EOMGEN_SHARED double longest_of(const double *restrict step, int length)
{
    double longest = 0.0;
    for (int k = 0; k < length; k++) {
        longest = fabs(step[k]) > longest ? fabs(step[k]) : longest;
    }
    return longest;
}

/* Limits the largest entry of a scaled Newton step to 0.5. */
EOMGEN_SHARED double damping(const double *restrict step, int length)
{
    const double longest = longest_of(step, length);
    return longest > 0.5 ? 0.5 / longest : 1.0;
}
