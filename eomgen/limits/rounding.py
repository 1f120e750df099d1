"""Limits: what double precision leaves of a number that should be zero."""

from __future__ import annotations

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
#: Width of a bracket relative to its place at which nothing lies between: two numbers.
NEXT = 4e-16
#: By which an angle may miss a multiple of a quarter turn, relative to it, and an entry of a rotation a whole number: 4
#: to 5 eps, what pi / 2 written in sixteen digits leaves.
QUARTER = 1e-15
#: Numbers that agree to this, relative to them, are compared by their bounds of rounding; others are different in any
#: case: half of all digits is far more than a formula loses.
ALIKE = 1e-7

# -- single precision, in libraries of C -------------------------------------------------------------------------------
SINGLE_COARSE = 5e-5  #: limits above have nothing to do with rounding, and stay as they are
SINGLE_FAR = 1e-100  #: numbers below stand for zero, and those above its inverse for infinity
