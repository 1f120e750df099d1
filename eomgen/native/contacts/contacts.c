/* Contacts by text for processors with AVX2 (EOMGEN_WIDE), where rows are gone through four numbers at a time, and for any
   other; which text a processor takes. The bits are the same: no sum is taken in another order, and nothing is contracted. */
#include <float.h>
#include <math.h>
#include <stddef.h>
#include <string.h>

#include "eomgen_contacts.h"

#if defined(EOMGEN_WIDE) && !defined(EOMGEN_TWO_WIDTHS)
typedef int eomgen_no_wide_contacts; /* a file needs something */
#elif defined(EOMGEN_WIDE)
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
#define CHOSEN(name) eomgen_plain_##name
#include "eomgen_contact_steps.h"

#ifdef EOMGEN_TWO_WIDTHS
#define EOMGEN_ASKS_PROCESSOR
#include "eomgen_calls.h"
#define SUITED(wide, name) ((wide) ? eomgen_wide_##name : eomgen_plain_##name)
int eomgen_contacts_wide(void) { return eomgen_processor() != 0; }
#else
#define SUITED(wide, name) ((void)(wide), eomgen_plain_##name)
int eomgen_contacts_wide(void) { return 0; }
#endif

void eomgen_solve_contacts(int m, int d, const double *W, const double *c, const double *friction, double *P,
                           double tolerance, int most, double *work, int *numbers, int *count, double *residual)
{
    SUITED(eomgen_contacts_wide(), solve_contacts)(m, d, W, c, friction, P, tolerance, most, work, numbers, count, residual);
}

int eomgen_rigid_step(eomgen_rigid *s, double t, double h) { return SUITED(s->wide, rigid_step)(s, t, h); }
long eomgen_rigid_fixed(const eomgen_rigid *s) { return eomgen_plain_rigid_fixed(s); }
long eomgen_rigid_further(const eomgen_rigid *s) { return eomgen_plain_rigid_further(s); }
#endif
