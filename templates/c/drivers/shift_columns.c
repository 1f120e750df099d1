#define SHIFT_BLOCK(what) what##_acceleration_block
typedef int block_function(double, const double *restrict, const double *restrict, const double *restrict,
                           double *restrict, double *restrict);

/* dx' for the unit change of each of the inputs or parameters; block: v' along such changes. */
static int shift_driver(block_function *block, int columns, double t, const double *restrict x,
                        const double *restrict u, const double *restrict c, double *restrict out, double *restrict w)
{
    enum { NX = NQ + N };
    double *const along = w + AT_X, *const da = w + AT_ALONG; /* q, v, du or dp */
    for (int column = 0; column < columns; column++) {
        for (int k = 0; k < NX; k++) {
            along[k] = x[k];
        }
        for (int k = 0; k < columns; k++) {
            along[NX + k] = k == column ? 1.0 : 0.0;
        }
        const int status = block(t, along, u, c, da, w);
        if (status != 0) {
            return status;
        }
        for (int k = 0; k < NX; k++) {
            out[k * columns + column] = k < NQ ? 0.0 : da[k - NQ];
        }
    }
    return 0;
}
