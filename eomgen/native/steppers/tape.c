/* Expressions given at run time, one instruction after the other: the operations of the graph that models are made of. */
#include <math.h>

#include "eomgen_real.h"
#include "eomgen_steppers.h"

/* EOMGEN_TAPE(X) lists X(name, value of a, b, c) for each row of the table of operations; leaves come before. */
#define NAME_OF(NAME, VALUE) #NAME,
#define CODE_OF(NAME, VALUE) TAPE_##NAME,
#define CASE_OF(NAME, VALUE) case TAPE_##NAME: r[k] = (VALUE); break;

/* The names in the order of the codes. */
const char *const eomgen_operations[] = {"const", "t", "x", "u", "p", EOMGEN_TAPE(NAME_OF) NULL};

enum { TAPE_CONST, TAPE_T, TAPE_X, TAPE_U, TAPE_P, EOMGEN_TAPE(CODE_OF) TAPE_END };

void eomgen_play(const eomgen_tape *tape, double t, const double *y, const double *u, const double *p, double *out)
{
    double *const r = tape->results;
    for (int k = 0; k < tape->n; k++) {
        const int *const at = tape->code + 4 * k;
        const int i = at[1];
        const double a = at[0] > TAPE_P ? r[i] : 0.0, b = r[at[2]], c = r[at[3]]; /* unused operands name an earlier result */
        switch (at[0]) {
        case TAPE_CONST: r[k] = tape->numbers[i]; break;
        case TAPE_T: r[k] = t; break;
        case TAPE_X: r[k] = y[i]; break;
        case TAPE_U: r[k] = u[i]; break;
        case TAPE_P: r[k] = p[i]; break;
        EOMGEN_TAPE(CASE_OF)
        default: r[k] = (double)NAN;
        }
    }
    for (int k = 0; k < tape->n_out; k++) {
        out[k] = r[tape->out[k]];
    }
}
