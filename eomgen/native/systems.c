/* The sparse linear system K z = r of methods whose accelerations and multipliers follow together. */

#define NZ (MODEL->n_unknowns)
#define PLACES (MODEL->n_places)
#define PLACE (MODEL->place)
#define RELAXED (MODEL->n_relaxed)
#define RELAX (MODEL->relax)

/* Scales of rows and columns that bring the entries of K to about 1, from the units of both on (D. Ruiz, A scaling
   algorithm to equilibrate both rows and columns norms in matrices, RAL-TR-2001-034). Those of constraints get one
   common factor beside their units, since a redundant constraint may have no entries but rounding. */
static void balance_system(const eom_at *at)
{
    const double *const K = AT(SYSTEM), *const sizes = K + PLACES + NZ;
    double *const largest = AT(DEFECT), *const row = AT(ROW), *const column = AT(COLUMN);
    int calm = 0;
    for (int i = 0; i < NZ; i++) {
        row[i] = 1.0 / sizes[i];
        column[i] = sizes[NZ + i];
    }
    for (int pass = 0; pass < 40 && calm < 2; pass++) {
        const int side = pass % 2;
        double *const scale = side ? column : row;
        double common = 0.0;
        fill(NZ, 0.0, largest);
        for (int e = 0; e < PLACES; e++) {
            const double size = fabs(K[e]) * row[PLACE[e][0]] * column[PLACE[e][1]];
            if (size > largest[PLACE[e][side]]) {
                largest[PLACE[e][side]] = size;
            }
        }
        for (int e = 0; e < RELAXED; e++) {
            common = largest[RELAX[e][side]] > common ? largest[RELAX[e][side]] : common;
        }
        for (int e = 0; e < RELAXED; e++) {
            largest[RELAX[e][side]] = common;
        }
        calm++;
        for (int i = 0; i < NZ; i++) {
            const double size = largest[i] > 0.0 ? largest[i] : 1.0;
            calm = size > 2.0 || size < 0.5 ? 0 : calm;
            scale[i] /= sqrt(size);
        }
    }
}

/* The larger of two indices, one of them kept as a number. */
static double later(int index, double other)
{
    return (double)index > other ? (double)index : other;
}

/* Balanced K, less a little where redundant constraints may leave it singular, as L U with row exchanges; status 2
   where a pivot vanishes: no inertia is behind a motion. The plan keeps rows exchanged, last column of each row of U,
   last row of each column of L, so that what is zero in the sparse K costs little. */
static int factor_system(const eom_at *at)
{
    const double *const K = AT(SYSTEM), *const row = AT(ROW), *const column = AT(COLUMN);
    double *const lu = AT(LU), *const plan = AT(PLAN), *const last = plan + NZ, *const deep = last + NZ;
    double sum = 0.0;
    fill(NZ * NZ, 0.0, lu);
    for (int i = 0; i < NZ; i++) {
        last[i] = deep[i] = (double)i;
    }
    for (int e = 0; e < PLACES; e++) {
        const int i = PLACE[e][0], j = PLACE[e][1];
        lu[i * NZ + j] = K[e] * row[i] * column[j];
        last[i] = later(j, last[i]);
        sum += K[e] * 0.0;
    }
    if (sum != 0.0) {
        return EOMGEN_NON_FINITE;
    }
    for (int e = 0; e < RELAXED; e++) {
        const int i = RELAX[e][0], j = RELAX[e][1];
        lu[i * NZ + j] -= SYSTEMS_RELAXATION;
        last[i] = later(j, last[i]);
    }
    for (int k = 0; k < NZ; k++) {
        int best = k;
        for (int i = k + 1; i < NZ; i++) {
            best = fabs(lu[i * NZ + k]) > fabs(lu[best * NZ + k]) ? i : best;
        }
        plan[k] = (double)best;
        if (!(fabs(lu[best * NZ + k]) > SYSTEMS_PIVOT)) {
            return EOMGEN_SINGULAR_MASS_MATRIX;
        }
        if (best != k) {
            const double end = last[k];
            last[k] = last[best];
            last[best] = end;
            for (int j = k; j < NZ; j++) {
                const double entry = lu[k * NZ + j];
                lu[k * NZ + j] = lu[best * NZ + j];
                lu[best * NZ + j] = entry;
            }
        }
        const int end = (int)last[k];
        for (int i = k + 1; i < NZ; i++) {
            if (lu[i * NZ + k] != 0.0) {
                const double ratio = lu[i * NZ + k] / lu[k * NZ + k];
                lu[i * NZ + k] = ratio;
                for (int j = k + 1; j <= end; j++) {
                    lu[i * NZ + j] -= ratio * lu[k * NZ + j];
                }
                last[i] = later(end, last[i]);
                deep[k] = (double)i;
            }
        }
    }
    return 0;
}

/* d = (L U)^-1 d */
static void substitute_system(const eom_at *at, double *restrict d)
{
    const double *const lu = AT(LU), *const plan = AT(PLAN), *const last = plan + NZ, *const deep = last + NZ;
    for (int k = 0; k < NZ; k++) {
        const int pivot = (int)plan[k], end = (int)deep[k];
        const double entry = d[pivot];
        d[pivot] = d[k];
        d[k] = entry;
        for (int i = k + 1; i <= end; i++) {
            d[i] -= lu[i * NZ + k] * entry;
        }
    }
    for (int i = NZ - 1; i >= 0; i--) {
        const int end = (int)last[i];
        for (int j = i + 1; j <= end; j++) {
            d[i] -= lu[i * NZ + j] * d[j];
        }
        d[i] /= lu[i * NZ + i];
    }
}

/* Whether K z = r holds but for rounding: no more is left of any equation than LEFT of its terms, or ROUNDED of the
   largest terms of all; of constraints along which K has the singular value s (s^2 = weak) FAINT / s^2, which is what
   rounding of the position makes of their accelerations. The defect is balanced. */
static int is_solved(const eom_at *at, const double *restrict r, const double *restrict z, double weak)
{
    const double *const K = AT(SYSTEM), *const row = AT(ROW), *const d = AT(DEFECT);
    double *const terms = AT(DEFECT) + NZ;
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

/* K z = r by steps with the factors of the relaxed K: the proximal point method, which of all solutions with
   redundant constraints finds the one of least multipliers. Ends when the defect no longer halves, and says whether
   it is rounding. */
static int solve_system(const eom_at *at, const double *restrict r, double *restrict z)
{
    const double *const K = AT(SYSTEM), *const row = AT(ROW), *const column = AT(COLUMN);
    double *const d = AT(DEFECT);
    double before = HUGE_VAL;
    fill(NZ, 0.0, z);
    for (int count = 0; count <= 30; count++) {
        double size = 0.0;
        copy(NZ, r, d);
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
            return is_solved(at, r, z, weak) ? 0 : EOMGEN_UNSOLVED;
        }
        before = size;
        substitute_system(at, d);
        for (int i = 0; i < NZ; i++) {
            z[i] += column[i] * d[i];
        }
    }
    return 0;
}

/* Accelerations a (N) of the state in AT(X); leaves z behind q and v in AT(MOTION), and the factors. */
static int accelerate_system(const eom_at *at, double *restrict a)
{
    double *const motion = AT(MOTION);
    (void)EVALUATE(system, AT(X), AT(SYSTEM));
    balance_system(at);
    int status = factor_system(at);
    if (status == 0) {
        status = solve_system(at, AT(SYSTEM) + PLACES, motion + NX);
    }
    copy(NX, AT(X), motion);
    return status != 0 ? status : EVALUATE(joint_accelerations, motion, a);
}
