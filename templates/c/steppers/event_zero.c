#include <float.h>
#include <math.h>

#include "eomgen_loop.h"

/* The zero between a and b, where the values fa and fb differ in sign: R. P. Brent, Algorithms for Minimization without
   Derivatives, 1973, chapter 4; to four roundings, like SciPy's. Where the value jumps,
   the far side of the jump: a run that goes on from the near one would meet it again. */
static double zero_between(const eomgen_method *method, eomgen_run *run, eomgen_events *ev, int i, const double *bracket)
{
    double a = bracket[0], b = bracket[1], fa = bracket[2], fb = bracket[3], c = a, fc = fa, d = b - a, e = d;
    for (int k = 0; k < 100 && fb != 0.0; k++) {
        if (fb * fc > 0.0) {
            c = a, fc = fa, d = e = b - a;
        }
        if (fabs(fc) < fabs(fb)) {
            a = b, b = c, c = a;
            fa = fb, fb = fc, fc = fa;
        }
        if (fb == 0.0) {
            break;
        }
        const double tolerance = 2.0 * DBL_EPSILON * (1.0 + fabs(b)), m = 0.5 * (c - b);
        if (fabs(m) <= tolerance) {
            break;
        }
        d = fabs(e) < tolerance || fabs(fa) <= fabs(fb) ? (e = m) : d;
        if (d != m || e != m) {
            const double s = fb / fa, q0 = fa / fc, r = fb / fc;
            double p = a == c ? 2.0 * m * s : s * (2.0 * m * q0 * (q0 - r) - (b - a) * (r - 1.0));
            double q = a == c ? 1.0 - s : (q0 - 1.0) * (r - 1.0) * (s - 1.0);
            q = p > 0.0 ? -q : q, p = fabs(p);
            if (2.0 * p < 3.0 * m * q - fabs(tolerance * q) && p < fabs(0.5 * e * q)) {
                e = d, d = p / q;
            } else {
                d = e = m;
            }
        }
        a = b, fa = fb;
        b += fabs(d) > tolerance ? d : m > 0.0 ? tolerance : -tolerance;
        fb = value_at(method, run, ev, i, b);
    }
    const int jumps = fb * bracket[2] > 0.0 && fb * fc < 0.0 && fabs(fb) > RUNS_TOUCHING * ev->size[i];
    return jumps ? c : b;
}
