"""Limits: balance and stability, forces needed for a motion, identification."""

from __future__ import annotations

# -- balance of forces, stability, forces needed for a motion ----------------------------------------------------------


#: Largest share of the needed forces that may be left over.
REACHED = 1e-8
#: Deviation from a straight line, relative, at which forces count as linear in an input.
AFFINE = 1e-9
#: Scaled rates below which a state counts as an equilibrium.
STILL = 1e-7
#: Entries of a matrix below this part of the largest count as zero: slopes keep eight digits.
COUPLED = 1e-8
#: Part of Newton's step below which it leads nowhere.
SHORTEST = 1e-5
#: Scaled step at which Newton's iteration has arrived: positions are closed no better.
ARRIVED = 1e-12
#: The same where rounding of the forces leaves no more.
CLOSE = 1e-6
#: Relative error of slopes taken from central differences.
DIFFERENCES = 1e-8
#: Scaled rate (1/s) that the constraints give to a displacement, above which an error speaks of it.
MOVING = 1e-9
#: Relative difference up to which K counts as symmetric where its modes are requested.
SYMMETRIC = 1e-9
#: Smallest component of a unit self-stress that counts.
SEEN = 1e-7
#: Part of a force, or of 1 N, that a model affine in its inputs may leave when they are solved for.
REMAINDER = 1e-6
#: Scaled displacement over which forces are differenced.
DISPLACED = 1e-5
#: A system whose condition is below this part of what its rank is told by is solved as it is, without its rank.
WELL_ABOVE = 0.01
#: Least size of an unknown, relative to the largest, by which its column is scaled.
LEAST_UNKNOWN = 1e-3
#: Scaled step along the constraints at which the nearest position is found, a thousand roundings.
NEAREST = 1e-12

# -- which parameters the measured motions determine -------------------------------------------------------------------


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
#: Relative part of each state by which Gauss's formula may miss a run over one of its steps, for its nodes to carry the
#: derivatives too; the tolerance of the run where that is less.
QUADRATURE = 1e-7
