/* Sums of products of coefficients: two at a time side by side in plain functions, one in lanes. */
#ifndef EOMGEN_SERIES_H
#define EOMGEN_SERIES_H

#include "eomgen_sincos.h"

#if defined(EOMGEN_PLAIN) && defined(EOMGEN_VECTORS)
typedef double part __attribute__((vector_size(16), aligned(8), may_alias));
enum { PARTS = 2 };
#define PART(at) (*(const part *)(at))
#define EMPTY { 0.0, 0.0 }
#define TOTAL(sum) ((sum)[0] + (sum)[1])
#else
typedef real part;
enum { PARTS = 1 };
#define PART(at) (*(at))
#define EMPTY same(0.0)
#define TOTAL(sum) (sum)
#endif

#endif
