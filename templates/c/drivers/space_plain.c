/* q' = v: coordinates move as velocities say. Over `real`, because lanes of closed loops take this text too. */
EOMGEN_SHARED void move(real *restrict q, const real *restrict d)
{
    for (int k = 0; k < N; k++) {
        q[k] += d[k];
    }
}

EOMGEN_SHARED void form_rates(const real *restrict q, const real *restrict v, real *restrict rates)
{
    (void)q;
    for (int k = 0; k < N; k++) {
        rates[k] = v[k];
    }
}
