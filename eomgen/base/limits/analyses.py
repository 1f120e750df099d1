"""Limits: balance, motions without forces, identification, verification."""

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
#: Relative difference up to which K counts as symmetric where its modes are asked for.
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


# -- motions along constraints without forces, singular positions ------------------------------------------------------


#: Scaled way (rad, lengths) that a position is led along in small steps: 300 turns, 20,000 steps.
FOLLOWED = 2000.0
#: Scaled step along the constraints at which the nearest position is found, a thousand roundings.
NEAREST = 1e-12
#: Relative difference of two directions that count as one.
ALIGNED = 1e-12
#: Quality, the smallest singular value over the largest, below which a position counts as singular: rates there
#: keep ten digits at most, and a minimum is found to the root of what positions are closed to, 1e-5 at worst.
SINGULAR = 1e-6
#: Quality below which an interpolant across a singular position gives more digits than the equations, which keep
#: EXACT / s^2 of velocities.
POOR = 1e-3
#: Parameters relative to the path that count as one.
SAME = 1e-10
#: Scaled motion too small to tell a direction by: positions are closed to 1e-10.
UNJUDGED = 1e-6
#: Scaled motion on either side of a singular position, tried in order.
LEAPS = (1e-3, 4e-3, 1.6e-2, 6e-2)
#: Step of the path's parameter, relative to the path, before the way counts as blocked: 500 roundings.
BLOCKED = 1e-13
#: By which a limit may be passed, for rounding and what positions are closed to.
SLACK = 1e-9
#: Distance from a singularity of Euler angles (rad) at which a failure is put down to it.
LOCKED = 1e-4
#: Sine of the angle between a disc's axle and its plane's normal below which it counts as flat.
FLAT = 1e-3
#: Part of the largest singular value below which one is none: C_q is known to so much in large mechanisms.
NULL = 1e-13
#: Scaled distance by which an interpolant across a singular position may miss a position on it: seven times the error
#: of its rates there.
ASTRAY = 1e-5
#: Part of a path in time over which constraints are differenced at a position that stands still: the root of rounding.
DRIFTED = 1e-6
#: Scaled distance (rad, lengths) between a guess and a closed position that lie beside each other: angles then turn
#: directions by less than a twentieth of a turn, and cosines, which close loops, by 5 %.
BESIDE = 0.3
#: Initial angle (rad) beyond which degrees are supposed: two turns.
MOST_ANGLE = 12.566370614359172


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
#: Relative tolerances of a run by which Gauss's formula may miss it over one of its steps, over the largest state, for
#: its nodes to carry the derivatives too: a law that bends within a step misses by the step times the bend.
QUADRATURE = 10.0


# -- verification, by differences and runs of limited length -----------------------------------------------------------


# -- differences -----------------------------------------------------------------------------------------------------
#: Relative step by which a slope is estimated where only its size matters: the root of its rounding, and more.
NUDGE = 1e-6
#: Rounding of a sum over pairs of shapes, as a change of what is given, in units of one node: a pair takes some ten
#: operations in a row from the poses to its force, each of which is as a change of what it is given.
PAIR_ROUNDING = 16.0
#: Added to limits, relative to the size of the result: truncation of first differences in sixty digits is 1e-32, of
#: second differences 1e-24.
FIRST_DIFFERENCE, SECOND_DIFFERENCE = 1e-30, 1e-24
#: The same of a sum of such differences (in units of the force).
NO_FORCE = 1e-40
#: First step off the constraints.  The projection adds a term that grows with the residual: x' then has a part that
#: goes with the third power of the distance, without its sign, and farther away takes another number of passes.
OFF_CONSTRAINTS = 2.5e-3

# -- runs ------------------------------------------------------------------------------------------------------------
#: Relative tolerances of runs that are compared, of a stepper judged by itself, and of SciPy's run beside them.
COMPARED, TIGHT = 1e-10, 1e-13
#: Absolute ones, relative to them.
ABSOLUTE = 1e-3
#: Difference of the ends of two runs, in tolerances of one step, of which there are many.
COLLECTED = 1e3
LOOSE = 1e6  #: tolerance that accepts every step
LARGE = 1e-2  #: relative error from which on a step is too long to tell an order
SLOWEST = 1e-3  #: rate (1/s) below which nothing changes

# -- states ----------------------------------------------------------------------------------------------------------
CLOSED = 1e-9  #: scaled residual of a state that counts as closed
#: Least part of the largest singular value of J, and of the freedoms' in coordinates, of a state that is regular.
REGULAR = 1e-3
#: Rounding of a result over its size, at least: 45 eps.
ROUNDED = 1e-14

# -- figures that come with a package ----------------------------------------------------------------------------------
#: By how much results of two builds may differ, relative to the largest number: a projection that ends one Newton step
#: earlier leaves the square root of its tolerance, squared; and in terms of what a change by a few roundings changes,
#: for a thousand operations in another order.
BUILDS, SPREAD_OF_ROUNDING = 1e-9, 1e3
ZERO = 1e-11  #: and what one build may make of a zero (SI units): a sum of some terms of size 1e4 that cancel
