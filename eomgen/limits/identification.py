"""Limits of the identification: which parameters the measured motions determine."""

from __future__ import annotations

#: Smallest singular value of the derivatives, over the largest, each column of length 1, below which parameters cannot
#: be told apart: derivatives are integrated to 1e-8, so a smaller one is their error.
IDENTIFIED = 1e-7
#: Least part of its range to which a column counts as measured, where its noise is found from the residuals: without
#: it a simulated column without noise would outweigh all others.
MEASURED = 1e-9
#: Rounds in which the noise of the columns is found from the residuals and the fit repeated: the second changes weights
#: by what the first found, a third by less than the standard errors.
ROUNDS = 2
#: Least effect of an inertial parameter, over that of like ones and beside all others, that counts: of 38 robots the
#: least true one is 2e-2 (1e-7 of an axis that leans by the rounding of its file), rounding of sums over 40 bodies
#: leaves 2e-15.
EFFECT = 1e-10
#: A factor of a base parameter, columns at length 1, that is rounding: that of the regressor (1e-15) over the least
#: effect of its own among columns of robots (1e-2), and a hundred times more for the sums of the least squares.
ROUNDED_COEFFICIENT = 1e-11
#: By which forces may miss a straight line in a parameter that linear least squares find, over the largest force:
#: differences of three evaluations keep 14 digits, and what is not linear misses by a part of its own size.
LINEAR = 1e-10
#: By which Gauss's formula may miss a run over one of its steps, over the largest state, for its nodes to carry the
#: derivatives too: runs are integrated to 1e-8, a law that bends within a step misses by the step times the bend.
QUADRATURE = 1e-7
