/* The velocities of a change of q, whatever changes the length of Euler parameters left out. */
EOMGEN_SHARED void find_velocities(const double *restrict q, const double *restrict dq, double *restrict d)
{
    for (int k = 0; k < N; k++) {
        d[k] = COORDINATE[k] >= 0 ? dq[COORDINATE[k]] : 0.0;
    }
    for (int b = 0; b < QUATERNIONS; b++) {
        const double *const e = q + QUATERNION[b][0], *const de = dq + QUATERNION[b][0];
        double *const w = d + QUATERNION[b][1];
        const double scale = 2.0 / (e[0] * e[0] + e[1] * e[1] + e[2] * e[2] + e[3] * e[3]);
        w[0] = scale * (e[0] * de[1] - e[1] * de[0] + e[3] * de[2] - e[2] * de[3]);
        w[1] = scale * (e[0] * de[2] - e[2] * de[0] + e[1] * de[3] - e[3] * de[1]);
        w[2] = scale * (e[0] * de[3] - e[3] * de[0] + e[2] * de[1] - e[1] * de[2]);
    }
}

/* Replaces a change dq by that of the velocities d; the change of the length of Euler parameters stays. */
EOMGEN_SHARED void spread(const double *restrict q, const double *restrict d, double *restrict dq)
{
    double stretch[QUATERNIONS + 1];
    for (int b = 0; b < QUATERNIONS; b++) {
        const double *const e = q + QUATERNION[b][0], *const de = dq + QUATERNION[b][0];
        stretch[b] = (e[0] * de[0] + e[1] * de[1] + e[2] * de[2] + e[3] * de[3])
                     / (e[0] * e[0] + e[1] * e[1] + e[2] * e[2] + e[3] * e[3]);
    }
    form_rates(q, d, dq);
    for (int b = 0; b < QUATERNIONS; b++) {
        for (int i = 0; i < 4; i++) {
            dq[QUATERNION[b][0] + i] += stretch[b] * q[QUATERNION[b][0] + i];
        }
    }
}

EOMGEN_SHARED void normalise(double *restrict q)
{
    for (int b = 0; b < QUATERNIONS; b++) {
        double *const e = q + QUATERNION[b][0];
        const double length = sqrt(e[0] * e[0] + e[1] * e[1] + e[2] * e[2] + e[3] * e[3]);
        for (int i = 0; i < 4; i++) {
            e[i] /= length;
        }
    }
}
