"""Limits: verification by differences and by runs of limited length, figures that come with a package."""

from __future__ import annotations

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
WELL_CONDITIONED = 1e-3
#: Rounding of a result over its size, at least: 45 eps.
ROUNDED = 1e-14

# -- figures that come with a package ----------------------------------------------------------------------------------
#: By how much results of two builds may differ, relative to the largest number: a projection that ends one Newton step
#: earlier leaves the square root of its tolerance, squared; and in terms of what a change by a few roundings changes,
#: for a thousand operations in another order.
BUILDS, SPREAD_OF_ROUNDING = 1e-9, 1e3
ZERO = 1e-11  #: and what one build may make of a zero (SI units): a sum of some terms of size 1e4 that cancel
