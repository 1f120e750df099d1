"""Limits: when constraints count as closed, rows as dependent, a change point as passed.  One error model for all.

Rows and coordinates are scaled so that entries of the Jacobian J are about 1, by the sizes of rows and coordinates.
Then C and J are known to EXACT, a few roundings of terms of size 1.  Along a direction of singular value s, relative to
the largest, this tells the position to EXACT / s, velocities of size V to V EXACT / s^2, since J turns with the
position, and accelerations to V^2 EXACT / s^3.  In mechanisms of hundreds of rows, or far from their origin, sums are
longer and a hundred to a thousand times more is lost.  The limits follow; factors of ten keep decisions apart.
"""

from __future__ import annotations

# -- closed ----------------------------------------------------------------------------------------------------------
EXACT = 1e-15  #: scaled residual of a row that is closed to its rounding, 4 to 5 eps
CONVERGED = 1000.0 * EXACT  #: at which to stop when it falls no longer: rounding of the largest mechanisms
ACCEPTED = 100.0 * CONVERGED  #: largest of a projected or assembled state: what users are told is closed
CONTRADICTION = 100.0 * ACCEPTED  #: of rows that no position closes, or whose rates differ by this part
SHORT = 1e-8  #: scaled Newton step, whose square, what the step leaves of a smooth row, is below EXACT
#: Scaled Newton step up to which the term in J J^T, which is as large as the residual, may be left out: with the term a
#: step d misses d^2 / s^2 along weak rows, which the next one mends but for d^3 / s^2, 1e-13 at an s of 0.1.
NEARBY = 1e-5
MEASURED = 1e-6  #: of gaps that a user says are closed, and of positions that count as one

# -- solved by J J^T -------------------------------------------------------------------------------------------------
#: Least term added to J J^T, relative to its largest diagonal entry: a hundred times the rounding of that, 1e-14.
TIKHONOV = 1e-12
#: The same where CasADi and JAX differentiate the solution: the rounding of a redundant row, 1e-16, is divided by it in
#: the derivative, 1e-9 then; four solutions of what the last one left make (1e-7 / s^2)^4 of the term, s the least
#: singular value of independent rows as a part of the greatest.
DIFFERENTIATED = 1e-7
#: The term to begin with: noise is blown up by 1 / (2 sqrt(1e-8)) = 5e3 at most.
GENTLE = 1e-8
#: The next term, relative to s^2 of the direction in which something is left: a pass leaves this part of it.
BELOW = 1e-4
#: A pass that leaves less than this part of what was there needs no smaller term.
FAST = 0.01
#: Part of the residual that a position step may leave because of the term; more asks for a smaller one.
HINDERED = 0.1
#: A residual below this part of s^2 is a step of a hundredth of s at most, over which s stays what it is.
NEAR = 0.01
#: Most that the last pass of straight-line code may leave of a correction, the same as CONVERGED of a position.
LEFT = CONVERGED

# -- dependent -------------------------------------------------------------------------------------------------------
#: Rank at one projected state: J is known to 1e-13 in large mechanisms; directions a thousand times stronger are held.
STATE = 1e-10
#: Rank of the mechanism, from configurations at random, few of which are near a singular one: closed to ACCEPTED, rows
#: that depend on each other when closed keep false ranks of that size, a hundred times below.
STRUCTURE = 100.0 * ACCEPTED
#: Least part of a best pivot at which one in a preferred column is taken, which costs two digits at most.
PREFERENCE = 0.01
#: Pivots of a coordinate that was chosen and may not be exchanged: dependent ones move at most 1e8 times as fast, which
#: leaves half of the digits.
CHOSEN = 1e-8
#: Square of the share of a coordinate in the motion that others leave it, below which derivatives along the independent
#: ones alone do not make up those of all: it costs four digits, and they are taken column by column.
SPANNING = 1e-4
#: Rank of the balance of all bodies, whose rows are products of two such matrices and of levers.
BALANCE = 10.0 * STATE
#: Rank of rows of velocities that users give beside the constraints, which are known to ACCEPTED.
FURTHER_ROWS = 10.0 * ACCEPTED
#: Part of its length that a further given value must keep when the others are taken out of it, or it contradicts them.
INDEPENDENT = 1e-6
#: Length of a scaled gradient that is rounding of entries of size 1: what it belongs to does not move.
UNMOVED = 1e-12

# -- moving ----------------------------------------------------------------------------------------------------------
#: Share of a motion below which a coordinate stands still: at a dead centre closed to 1e-9 it is the root of that.
STILL = 3e-5
#: Singular value at a passed change point: its minimum is found to the root of what stored states are closed to.
PASSED = 1e-4
#: Singular value that counts as lost where another one is: that of lengths that agree to rounding is its root, 1e-7.
GONE = 1e-6
#: What velocities of a branch at a change point may leave of second-order equations, over V^2: they turn by GONE there.
ONE_BRANCH = 10.0 * GONE
#: Least part of a direction across branches that these equations see, over V^2; along a branch they see ONE_BRANCH.
COUPLED, BRANCH_STEP = 100.0 * ONE_BRANCH, 1e-4  #: and the scaled motion to either side, over which rates are taken
#: Least square of the sine between a column of pivots and those before it, in straight-line code that may fall back to
#: pivoting: an angle of 3e-3, beyond which accelerations keep eight digits; and where it must not, of rounding alone.
LOST, VANISHED = 1e-5, 1e-20
#: The same for pivots of products of columns, which rounding makes 1e-16 of a column's: six digits are told, refined
#: solutions have ten.
ROUNDED = 1e-10
#: Least part of an inertia, or of what a constraint's multiplier moves, that elimination may leave of it in code that
#: may fall back to pivoting: accelerations keep eleven digits.
KEPT = 1e-5

# -- constraints that close and open ---------------------------------------------------------------------------------
#: Steps of explicit methods, times the rate at which errors of a closed equation die away, beyond which what rounding
#: moves off the equation grows within a step (DOP853 is stable up to 6, RK23 up to 2.5) and shows between its ends.
HELD_STEP = 2.5

# -- the same --------------------------------------------------------------------------------------------------------
ALIKE = 1e-13  #: relative difference of two inputs that count as one: 500 eps

#: Scaled slope below which a constraint may be a square: one that is closed to CONVERGED is off by its root, and has a
#: slope of twice that.  A circle closes with larger slopes, even where its radius is less than BESIDE.
FLAT = 2.0 * CONVERGED**0.5
#: Scaled step at which a constraint is judged to be a square: far beyond the root of what counts as closed, to which
#: its zero is found.
BESIDE = 1e-4
