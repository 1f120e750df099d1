"""Limits: rounding, what a user wrote, inertia."""

from __future__ import annotations

# -- what double precision leaves of a number that should be zero ------------------------------------------------------


EPS = 2.0**-52  #: distance from 1 to the next number
#: A sum counts as zero within so many times eps of its terms: the numbers of a description are rounded before they come
#: here, entries of a turned frame from three angles by up to nine products, a turned tensor from some 30.
ROUNDED = 64.0 * EPS
#: A bound in which all roundings add up counts as at most so many times that of independent ones, the root of their
#: squares: at each of hundreds of rotations the first grows with abs(cos) + abs(sin), up to 1.41, the second by eps.
#: Both are within it for sums of a thousand terms alike, the root of which it is.
CHANCE = 32.0
#: The same of a sum of products formed here, of which each is rounded once and the sum once.
SUMMED = 4.0 * EPS
#: The same of a constraint row over its own terms, each known to half of eps: what is smaller is noise for certain.
ROW = 2.0 * EPS
#: Stands for a size that is zero, where it divides: far below any size, far above the least number (2.2e-308).
TINY = 1e-300
#: A product above this keeps all digits: numbers below 2.2e-308 do not.
NORMAL = 1e-290
#: The same of sizes that are squared.
TINY_ROOT = 1e-150
LARGE_ROOT = 1e150  #: a number whose square is beyond double precision
#: By which an angle may miss a multiple of a quarter turn, relative to it, and an entry of a rotation a whole number: 4
#: to 5 eps, what pi / 2 written in sixteen digits leaves.
QUARTER = 1e-15
#: Numbers that agree to this, relative to them, are compared by their bounds of rounding; others are different in any
#: case: half of all digits is far more than a formula loses.
ALIKE = 1e-7

# -- single precision, in libraries of C -------------------------------------------------------------------------------
SINGLE_COARSE = 5e-5  #: limits above have nothing to do with rounding, and stay as they are
SINGLE_FAR = 1e-100  #: numbers below stand for zero, and those above its inverse for infinity


# -- what a user wrote, in as many digits as people write, and what is shown to them -----------------------------------


#: Part of a law's range that counts as zero where it begins and ends.
ZERO = 1e-9
#: How near to the ends of a turn a law is looked at, inside it (rad).
EDGE = 1e-10
#: Rounding of a law, relative to its largest value.
LAW = 1e-12
#: Part of its range by which a law, or its slope, may miss its own beginning after a turn: six digits written.
CLOSING = 1e-6
#: Relative difference of the first and last value of a periodic table that counts as rounding.
PERIODIC = 1e-12
#: Part of the largest force or moment below which a component is shown as 0.
SHOWN_FORCE = 1e-13
#: Part of the largest value of a unit below which one is shown as 0: the rounding of a zero.
ROUNDED_ZERO = 1e-14
#: A state that never gets beyond so many times the integrator's absolute tolerance rests: it is shown as 0 below that.
RESTING = 100.0
#: By which slopes of an angle may miss whole numbers in a loop that counts as plane: axes are written to nine digits.
PLANE = 1e-9
#: A gap whose gradient is below this part of its kind's size is of a loop that small: more digits would be lost.
SMALL_LOOP = 1e-3
#: A gap whose columns are so many lengths long, as a root of mean squares, is of a loop that large: of more than twenty
#: links.  Residuals beside these lengths would count as far from closed long before the loop does, and rows of
#: directions, whose entries are 1, be lost beside its rows.
LARGE_LOOP = 5.0
#: Gradients at the initial values that are this part of those beside them vanish there by chance.
BY_CHANCE = 1e-3
#: How far given Euler parameters may be from length 1: six digits written.
UNIT = 1e-6
#: Cosine of two unit vectors that count as being at right angles: six digits written.
PERPENDICULAR = 1e-6
#: Relative difference of entries that should be alike, such as those across the diagonal of a tensor.
TENSOR, TENSOR_TERMS = 1e-9, 1e-12
#: Distance of two points of a table, relative to their place, below which they are one.
APART = 1e-12
#: Length scale (m) below which a mechanism has none.
NO_LENGTH = 1e-9
#: The same as part of the bodies' radius of gyration: inertias of translations, measured in it, are compared with those
#: of rotations to 1e-13 (`SINGULAR`), and its square must stay far above that.
HAIR = 1e-5
#: Imaginary part, relative to the value, below which a number is shown as real.
SHOWN_COMPLEX = 1e-12
#: By which powers of a dimension may differ: 1/3 + 1/3 + 1/3 misses 1 by less.
POWERS = 1e-9
#: Part of a body's size below which a radius of curvature counts as 0: second derivatives lose half of the digits.
SHARP = 1e-8
MESH = 100_000_000  #: bytes of an STL file: two million triangles, which take 15 s and 1e9 bytes to measure
#: Part of the transition velocity that tanh(4 v / transition) / v is shifted by: its square, 1e-16, is lost beside 1 in
#: the value, and the slope, whose cancelling terms have errors of 1e-16 / v^2, stays finite at rest.
AT_REST = 1e-8
#: Slip of a tyre that counts as none, and part of the velocity below which a wheel counts as locked: a brush adheres up
#: to slips of 3 mu F_z / C, hundredths, beside which it is nothing, and its square, 1e-18, is a number.
NO_SLIP = 1e-9


# -- when a mass matrix counts as positive definite, and a tensor as that of a body ------------------------------------


#: Smallest pivot of M relative to its own diagonal entry, which is a sum of rounded terms: 500 eps.  Each pivot is
#: compared with its own entry, so that scales do not interact.
SINGULAR = 1e-13
#: The same relative to the largest diagonal entry: the square of SINGULAR and some, what rounding leaves of a zero.
NOTHING = 1e-22
#: Smallest pivot of an indefinite matrix relative to the terms it is the sum of: where it is small nothing bounds the
#: entries that follow (those of a definite matrix never grow), so that half of the digits must be left.
FAINT = 1e-8
#: Least inertia of the only freedom relative to that of all it moves: the square of SINGULAR, since what should stand
#: still at a dead centre moves by rounding, and inertia has the square of that.
STILL = 1e-26
#: Smallest eigenvalue of M with its diagonal scaled to 1, at configurations that are known to 1e-10.
LEAST = 1e-12

#: The same below which `check` says how many digits rounding leaves: 1e-6 leaves ten of sixteen, more than runs use.
WORTH_A_WORD = 1e-6

#: A moment may exceed the sum of the other two by this part of it before it counts as wrong: published inertias of real
#: machines, measured or rounded, exceed it by up to a tenth (PUMA 560, link 3).
TRIANGLE = 0.1
#: A moment may be negative by this part of the largest one, from the digits that files keep.
DIGITS = 1e-6
#: Rounding of a moment that a program in double precision computed, as part of m l^2: a tensor that is turned and
#: shifted to the centre of mass is a sum of some 30 products of at most about m l^2.
COMPUTED = ROUNDED
#: Part of the largest principal moment below which the second says nothing of the triangle of three.
MOMENT = 1e-9
#: Angular velocity of a body across the axis of its only moment, at velocities of about 1 rad/s; rounding leaves 1e-15.
TRANSVERSE = 1e-9
