/* Inputs over time: the value of a table or of an expression. */
#include <math.h>

#include "eomgen_steppers.h"

double eomgen_table_value(const eomgen_signal *s, double t, double hold)
{
    int low = 0, high = s->n - 1;
    const int size = s->order >= 3 ? 4 : 1;
    const double at = (s->order == 0 || s->order == 4) && !isnan(hold) ? hold : t; /* picks the piece */
    if (at <= s->times[0] || high == 0) {
        return s->values[0];
    }
    if (at >= s->times[high]) {
        return s->values[high * size];
    }
    while (high - low > 1) {
        const int middle = (low + high) / 2;
        if (s->times[middle] <= at) {
            low = middle;
        } else {
            high = middle;
        }
    }
    const double x = t - s->times[low], *const v = s->values + low * size;
    if (s->order == 0 || s->order == 2) {
        return v[0];
    }
    if (s->order == 1) {
        return v[0] + x * ((v[1] - v[0]) / (s->times[low + 1] - s->times[low]));
    }
    return v[0] + x * (v[1] + x * (v[2] + x * v[3]));
}

void eomgen_force(eomgen_run *run, double t, const double *y)
{
#ifndef EOMGEN_ALONE
    if (run->ask != NULL) {
        run->stopped = run->ask(run->callback_data, t, y, run->u, NULL) != 0 || run->stopped;
        return;
    }
#endif
    for (int i = 0; i < run->n_u; i++) {
        const eomgen_signal *const s = run->signals + i;
#ifndef EOMGEN_ALONE
        if (s->n > 0 && s->tape != NULL) {
            eomgen_play(s->tape, t, y, run->u, run->c, run->u + i);
            continue;
        }
#else
        (void)y;
#endif
        if (s->n > 0) {
            run->u[i] = eomgen_table_value(s, t, run->hold);
        }
    }
}
