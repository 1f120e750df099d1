"""Limits: interpolation across a change point (eomgen/native/singular.c)."""

from __future__ import annotations

from ...base.limits.numbers import SMALL_LOOP

#: A crossing is looked for where the weakest pivot is smaller; accelerations, known to V^2 EXACT / pivot^3, keep 1e-11
#: there. NEAR_SQUARE: the same of squares of sines between columns.
NEAR = 0.05
NEAR_SQUARE = NEAR * NEAR
SMALL = SMALL_LOOP  #: least size of a gap's rows: smaller loops have row sizes of their own, the rest is rounding
REACH = 0.1  #: scaled motion to the first points on either side; halved while that promises a smaller error
SHORTEST = 0.01  #: least reach
MIDDLE = 5.0  #: the pivots at the first points are together so many times that here: the crossing is within 0.4 reaches
CLOSED = 1e-12  #: scaled residual of the interpolated position: a mechanism that only comes near misses by more
NOISE = 1e-16  #: of C; a solution at the state has NOISE V^2 / pivot^3 in accelerations for velocities V
GOOD = 1e-11  #: error of an interpolation, over V^2, that no shorter reach can better
#: Weakest pivot s below which a state alone tells no acceleration: closures are known to 1e-16, so that a state on no
#: branch counts as closed where it misses its branch by 1e-16 / s, which is 1e-16 / s^2 = 1 % of s here.
UNTOLD = 1e-7
WEAKEST = 1e-4  #: below this pivot the solution at the state gets no worse: its weak part is left out
STILL = 1e-9  #: scaled velocity that tells no direction
SLANT = 1e-3  #: least part of the motion that the tangent coordinates must keep
ARRIVED = 1e-14  #: distance along the curve at which the search for a point ends
ENOUGH = 1e-12  #: distance along the curve that is good enough where the search gets no nearer
ROUNDS = 30  #: of that search; each leaves the square of the sine of the angle between tangent and curve
