/* Impulses of rigid contacts (eomgen/numeric/contact_impulses.py says the laws and the methods). */
#ifndef EOMGEN_CONTACTS_H
#define EOMGEN_CONTACTS_H

#if defined(__cplusplus) && !defined(restrict)
#define restrict __restrict /* C++ has no such word */
#endif

/* Impulses P (m x d) of m contacts of d directions, the normal first, for the compliance W (m d x m d) and the velocities c
   without impulses (m x d). P holds a guess before, what was found after. work has n (n + 8) + 3 m numbers and numbers
   n + m, with n = m d. */
void eomgen_solve_contacts(int m, int d, const double *W, const double *c, const double *friction, double *P,
                           double tolerance, int most, double *work, int *numbers, int *count, double *residual);

#endif
