/* Contacts by text for processors with AVX2: rows are gone through four numbers at a time. No sum is taken in another order, and
   nothing is contracted. */
#include <float.h>
#include <math.h>
#include <stddef.h>
#include <string.h>

#include "eomgen_contacts.h"

#ifdef EOMGEN_TWO_WIDTHS
#if defined(__clang__)
#pragma clang attribute push(__attribute__((target("avx2"))), apply_to = function)
#else
#pragma GCC target("avx2")
#endif

#define CHOSEN(name) eomgen_wide_##name
#include "eomgen_contact_steps.h"

#if defined(__clang__)
#pragma clang attribute pop
#endif
#else
typedef int eomgen_no_wide_contacts; /* a file needs something */
#endif
