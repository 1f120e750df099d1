/* d = (L U)^-1 d */
static void substitute_system(const double *restrict lu, const int *restrict plan, double *restrict d)
{
    const int *const last = plan + NZ, *const deep = plan + 2 * NZ;
    for (int k = 0; k < NZ; k++) {
        const double entry = d[plan[k]];
        d[plan[k]] = d[k];
        d[k] = entry;
        for (int i = k + 1; i <= deep[k]; i++) {
            d[i] -= lu[i * NZ + k] * entry;
        }
    }
    for (int i = NZ - 1; i >= 0; i--) {
        for (int j = i + 1; j <= last[i]; j++) {
            d[i] -= lu[i * NZ + j] * d[j];
        }
        d[i] /= lu[i * NZ + i];
    }
}

/* Whether K z = r holds but for rounding: no more is left of any equation than LEFT of its terms, or ROUNDED of the
   largest terms of all; of constraints along which K has the singular value s (s^2 = weak) FAINT / s^2, which is what
   rounding of the position makes of their accelerations. The defect is in w + AT_DEFECT, balanced. */
static int is_solved(const double *restrict r, const double *restrict z, double weak, double *restrict w)
{
    const double *const K = w + AT_SYSTEM, *const row = w + AT_ROW, *const d = w + AT_DEFECT;
    double *const terms = w + AT_DEFECT + NZ;
    double most = 0.0;
    for (int i = 0; i < NZ; i++) {
        terms[i] = fabs(r[i]);
    }
    for (int e = 0; e < PLACES; e++) {
        terms[PLACE[e][0]] += fabs(K[e] * z[PLACE[e][1]]);
    }
    for (int i = 0; i < NZ; i++) {
        terms[i] *= row[i];
        most = fmax(most, terms[i]);
    }
    for (int e = 0; e < RELAXED; e++) {
        terms[RELAX[e][0]] *= fmax(1.0, SYSTEMS_FAINT / SYSTEMS_LEFT / fmax(weak, SYSTEMS_WEAKEST));
    }
    for (int i = 0; i < NZ; i++) {
        if (!(fabs(d[i]) <= SYSTEMS_LEFT * terms[i] + SYSTEMS_ROUNDED * most)) {
            return 0;
        }
    }
    return 1;
}
