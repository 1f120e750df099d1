/* Partition at q and its weakest pivot, 0 where rank is lost; leaves C and C_q, J and eliminated rows in w. */
static double find_weakest(double t, const double *restrict q, const double *restrict u, const double *restrict c,
                           partition *restrict parts, double *restrict w)
{
    (void)scales_block(t, q, u, c, w + AT_SCALES, w);
    (void)position_block(t, q, u, c, w + AT_POSITION, w);
    form_scaled(w + AT_POSITION + MH, w + AT_SCALES, w + AT_J);
    for (int i = 0; i < M; i++) {
        w[AT_E + i] = 0.0;
    }
    form_rows(w + AT_J, w + AT_E, N + 1, w);
    return split(N + 1, 0, parts, w) == 0 ? parts->weakest : 0.0;
}
