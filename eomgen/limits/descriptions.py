"""Limits: what a user wrote, in as many digits as people write, and what is shown to them."""

from __future__ import annotations

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
SHOWN = 1e-14
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
