/* Impulses of rigid contacts (eomgen/numeric/contact_impulses.py says the laws and the methods). */
#ifndef EOMGEN_CONTACTS_H
#define EOMGEN_CONTACTS_H

/* Impulses P (m x d) of m contacts of d directions, the normal first, for the compliance W (m d x m d) and the velocities c
   without impulses (m x d). P holds a guess before, what was found after; returns 1 where there is no memory. */
int eomgen_solve_contacts(int m, int d, const double *W, const double *c, const double *friction, double *P,
                          double tolerance, int most, int *count, double *residual);

#endif
