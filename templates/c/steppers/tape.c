/* Expressions given at run time, one instruction after the other: the operations of the graph that models are made of. */
#include <math.h>

#include "eomgen_steppers.h"

/* The names in the order of the codes: leaves first. */
const char *const eomgen_operations[] = {"const", "t", "x", "u", "p", "add", "sub", "mul", "div", "neg", "pow", "sqrt",
    "exp", "log", "sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "asinh", "acosh", "atanh", "atan2", "abs",
    "sign", "min", "max", "lt", "le", "eq", "not", "and", "or", "select", NULL};

enum { TAPE_CONST, TAPE_T, TAPE_X, TAPE_U, TAPE_P, TAPE_ADD, TAPE_SUB, TAPE_MUL, TAPE_DIV, TAPE_NEG, TAPE_POW, TAPE_SQRT,
    TAPE_EXP, TAPE_LOG, TAPE_SIN, TAPE_COS, TAPE_TAN, TAPE_ASIN, TAPE_ACOS, TAPE_ATAN, TAPE_SINH, TAPE_COSH, TAPE_TANH,
    TAPE_ASINH, TAPE_ACOSH, TAPE_ATANH, TAPE_ATAN2, TAPE_ABS, TAPE_SIGN, TAPE_MIN, TAPE_MAX, TAPE_LT, TAPE_LE, TAPE_EQ,
    TAPE_NOT, TAPE_AND, TAPE_OR, TAPE_SELECT };

void eomgen_play(const eomgen_tape *tape, double t, const double *y, const double *u, const double *p, double *out)
{
    double *const r = tape->results;
    for (int k = 0; k < tape->n; k++) {
        const int *const at = tape->code + 4 * k;
        const int i = at[1];
        const double a = at[0] > TAPE_P ? r[i] : 0.0, b = r[at[2]]; /* unused operands name an earlier result */
        switch (at[0]) {
        case TAPE_CONST: r[k] = tape->numbers[i]; break;
        case TAPE_T: r[k] = t; break;
        case TAPE_X: r[k] = y[i]; break;
        case TAPE_U: r[k] = u[i]; break;
        case TAPE_P: r[k] = p[i]; break;
        case TAPE_ADD: r[k] = a + b; break;
        case TAPE_SUB: r[k] = a - b; break;
        case TAPE_MUL: r[k] = a * b; break;
        case TAPE_DIV: r[k] = a / b; break;
        case TAPE_NEG: r[k] = -a; break;
        case TAPE_POW: r[k] = pow(a, b); break;
        case TAPE_SQRT: r[k] = sqrt(a); break;
        case TAPE_EXP: r[k] = exp(a); break;
        case TAPE_LOG: r[k] = log(a); break;
        case TAPE_SIN: r[k] = sin(a); break;
        case TAPE_COS: r[k] = cos(a); break;
        case TAPE_TAN: r[k] = tan(a); break;
        case TAPE_ASIN: r[k] = asin(a); break;
        case TAPE_ACOS: r[k] = acos(a); break;
        case TAPE_ATAN: r[k] = atan(a); break;
        case TAPE_SINH: r[k] = sinh(a); break;
        case TAPE_COSH: r[k] = cosh(a); break;
        case TAPE_TANH: r[k] = tanh(a); break;
        case TAPE_ASINH: r[k] = asinh(a); break;
        case TAPE_ACOSH: r[k] = acosh(a); break;
        case TAPE_ATANH: r[k] = atanh(a); break;
        case TAPE_ATAN2: r[k] = atan2(a, b); break;
        case TAPE_ABS: r[k] = fabs(a); break;
        case TAPE_SIGN: r[k] = isnan(a) ? a : (a > 0.0) - (a < 0.0); break;
        case TAPE_MIN: r[k] = a <= b || isnan(a) ? a : b; break;
        case TAPE_MAX: r[k] = a >= b || isnan(a) ? a : b; break;
        case TAPE_LT: r[k] = a < b; break;
        case TAPE_LE: r[k] = a <= b; break;
        case TAPE_EQ: r[k] = a == b; break;
        case TAPE_NOT: r[k] = a == 0.0; break;
        case TAPE_AND: r[k] = a != 0.0 && b != 0.0; break;
        case TAPE_OR: r[k] = a != 0.0 || b != 0.0; break;
        case TAPE_SELECT: r[k] = a != 0.0 ? b : r[at[3]]; break;
        default: r[k] = (double)NAN;
        }
    }
    for (int k = 0; k < tape->n_out; k++) {
        out[k] = r[tape->out[k]];
    }
}
