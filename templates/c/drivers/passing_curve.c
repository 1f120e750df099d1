/* Next to a change point: a curve on the branch of the motion, through the state and across the change point
   (eomgen/numeric/passing.py says why). Its points are closed, and T's coordinates of their distance linear. */
enum { PAIRS = 5, VALUES = 2 * (NQ + N) };

/* (T^T T)^-1 T^T in the last N columns of w + AT_INVERSE, from T (N x F) in w + AT_TANGENT. */
static void invert_tangent(double *restrict w)
{
    enum { WIDTH = F + N };
    const double *const T = w + AT_TANGENT;
    double *const a = w + AT_INVERSE;
    for (int i = 0; i < F; i++) {
        for (int k = 0; k < F; k++) {
            a[i * WIDTH + k] = 0.0;
            for (int j = 0; j < N; j++) {
                a[i * WIDTH + k] += T[j * F + i] * T[j * F + k];
            }
        }
        for (int k = 0; k < N; k++) {
            a[i * WIDTH + F + k] = T[k * F + i];
        }
    }
    for (int p = 0; p < F; p++) {
        const double pivot = a[p * WIDTH + p];
        for (int k = p; k < WIDTH; k++) {
            a[p * WIDTH + k] /= pivot;
        }
        for (int i = 0; i < F; i++) {
            const double factor = a[i * WIDTH + p];
            for (int k = p; k < WIDTH && i != p; k++) {
                a[i * WIDTH + k] -= factor * a[p * WIDTH + k];
            }
        }
    }
}

/* Heading y (F) and scaled direction d = T y from the scaled velocities in w + AT_DIRECTION; 0 where T leaves nothing. */
static int set_heading(double *restrict w)
{
    double *const d = w + AT_DIRECTION, *const y = w + AT_HEADING;
    const double *const T = w + AT_TANGENT, *const a = w + AT_INVERSE;
    double size = F > 0 ? 0.0 : 1.0;
    for (int i = 0; i < F; i++) {
        y[i] = 0.0;
        for (int k = 0; k < N; k++) {
            y[i] += a[i * (F + N) + F + k] * d[k];
        }
    }
    for (int k = 0; k < N && F > 0; k++) {
        d[k] = 0.0;
        for (int i = 0; i < F; i++) {
            d[k] += T[k * F + i] * y[i];
        }
        size = fmax(size, fabs(d[k]));
    }
    for (int i = 0; i < F; i++) {
        y[i] /= size;
    }
    for (int k = 0; k < N && F > 0; k++) {
        d[k] /= size;
    }
    return size > CROSSINGS_SLANT;
}
