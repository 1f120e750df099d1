"""Pictures: what is one point, one direction or nothing on a page, which no one sees below a thousandth of its size."""

#: Relative distance of points, directions and moments that count as one: rounding of poses, far below a line's width.
SAME = 1e-9
#: Relative step of coordinates for the displacements of points in a mode: about the cube root of rounding.
STEP = 1e-5
#: Relative difference of a coordinate between two branches that is printed in three digits.
SEEN = 1e-3
#: Relative size of rounding in numbers of order 1 that have gone through a few operations.
ROUNDED = 1e-12
#: Divisors below it are zero: the smallest numbers without subnormal ones.
NOTHING = 1e-300
