"""Limits: when a mass matrix counts as positive definite, and a tensor as that of a body."""

from __future__ import annotations

from .rounding import ROUNDED

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
ACROSS = 1e-9
