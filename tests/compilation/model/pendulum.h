/* A pendulum: x = [theta, theta_dot], p = [m, l, g], u = [tau]; c adds c[3] = m l^2 and c[4] = m g l. */
#ifndef PENDULUM_H
#define PENDULUM_H

#include "eomgen.h"

#define PENDULUM_N_WORK 2000

int pendulum_precompute(const double *restrict p, double *restrict c);

#endif
