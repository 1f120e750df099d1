#include <float.h>
#include <math.h>
#include <string.h>

#include "eomgen_loop.h"

/* The edge of the domain of a value, between a time where it is a number and one where it is none: the last time found
   where it is one, and its value there; no further than to where its sign is another. */
static void domain_edge(const eomgen_method *method, eomgen_run *run, eomgen_events *ev, int i, double *in, double *g, double out)
{
    const double first = *g;
    for (int k = 0; k < RUNS_HALVED && *g != 0.0 && (*g > 0.0) == (first > 0.0); k++) {
        const double t = 0.5 * (*in + out), value = value_at(method, run, ev, i, t);
        if (isnan(value)) {
            out = t;
        } else {
            *in = t, *g = value;
        }
    }
}

/* From a bracket within which, at a time, the value is no number, to one on either side of that gap; 0 if none is there. */
static int leave_gap(const eomgen_method *method, eomgen_run *run, eomgen_events *ev, int i, double *bracket, double gap)
{
    double first[4] = {bracket[0], bracket[0], bracket[2], bracket[2]};
    domain_edge(method, run, ev, i, &first[1], &first[3], gap);
    if (first[3] == 0.0 || (first[3] > 0.0) != (first[2] > 0.0)) {
        memcpy(bracket, first, sizeof first);
        return 1;
    }
    double last[4] = {bracket[1], bracket[1], bracket[3], bracket[3]};
    domain_edge(method, run, ev, i, &last[0], &last[2], gap);
    memcpy(bracket, last, sizeof last);
    return last[2] == 0.0 || (last[2] > 0.0) != (last[3] > 0.0);
}

/* The zero between a and b, where the values fa and fb differ in sign: R. P. Brent, Algorithms for Minimization without
   Derivatives, 1973, chapter 4; to four roundings, like SciPy's. Where the value jumps,
   the far side of the jump: a run that goes on from the near one would meet it again. NaN, and when, where the value is
   no number. */
static double zero_of_numbers(
    const eomgen_method *method, eomgen_run *run, eomgen_events *ev, int i, const double *bracket, double *gap)
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
        if (isnan(fb)) {
            *gap = b;
            return fb;
        }
    }
    const int jumps = fb * bracket[2] > 0.0 && fb * fc < 0.0 && fabs(fb) > RUNS_TOUCHING * ev->size[i];
    return jumps ? c : b;
}

/* The zero in a bracket; NaN if it lies where the value is no number. No recursion: a device has to know its stack. */
static double zero_between(const eomgen_method *method, eomgen_run *run, eomgen_events *ev, int i, const double *bracket)
{
    double own[4] = {bracket[0], bracket[1], bracket[2], bracket[3]}, gap = 0.0;
    for (;;) {
        const double zero = zero_of_numbers(method, run, ev, i, own, &gap);
        if (!isnan(zero) || !leave_gap(method, run, ev, i, own, gap)) {
            return zero;
        }
    }
}
