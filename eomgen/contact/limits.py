"""Limits of laws of contacts: where they are written so that they stay finite, and how near to their law soil is."""

from __future__ import annotations

#: Part of a profile's length over which neighbouring pieces share a circle: beside rounding, 1e-16 of the length, it is
#: wide, so that their shares add up to 1 within 1e-8, and beside the lengths of pieces it is nothing.
SHARED = 1e-8
#: Part of a sinkage by which a plate rises until soil that it was put into remembers that sinkage: after 12 such parts
#: z_m is z, so that a thousandth of a rebound of a tenth of the sinkage is lost.
CAUGHT_UP = 1e-5
#: Squared sine of the angle of two rods below which they count as parallel: nearest points of skew rods lose
#: 1e-16 / sine^2 of their place, which moves them along the rods, where the distance changes by the sine of that.
PARALLEL = 1e-12
#: Squared angle of two edges of a polygon below which a corner counts as flat: cosines near 1 have errors of 1e-16,
#: so that the squares of smaller angles lose a thousandth.
FLAT_CORNER = 1e-13
#: Cosine of half of the angle between two edges of an outline below which they lie in line: cosines have errors of
#: 1e-16, and a corner that is left out changes depths by 1e-9 of the distance from it, at most.
EVEN = 1e-9
#: Part of the room inside a smooth outline, measured between points of its arcs, that is taken to be there: of 12
#: points to an arc of up to 180 degrees the nearest two are 15 degrees apart, and 1 / cos(15 deg) is 1.035.
INSIDE = 0.9
#: (m) How far a shape is from a piece of a profile that is not its nearest, for those who look for what is near.
NOWHERE = 1e100
#: Times the depth of a profile down to which forces are undefined: stages of DOP853 and RK45 are at most 2.7 times as
#: far in a step as those before them, so that one of a step over 1 to 3 depths lies there.
BELOW = 3.0
#: Shear displacement by K below which (1 - exp(-x)) / x is its series to x^4: the next term, x^5 / 720, is 1e-18, where
#: the quotient's slope begins to lose 1e-16 / x^2.
SHORT_WAY = 1e-3
#: Part of the angle of entry that the greatest pressure of a wheel on soil is at, at most: published c1 + c2 reach 0.75
#: (compact sand, slip 1), and at 0.9 the greatest pressure is that of a fifth of the sinkage; at 1 it is none.
FOREMOST = 0.9
#: Steps of Newton's method for the point of an ellipsoid that is nearest to a centre.  Measured on 400,000 random
#: centres with known nearest points, the largest half axis 1: the distance is right to 2e-15 after 7 steps for centres
#: outside and axes up to 10 : 1, after 9 up to 30 : 1, and after 12 for centres inside, up to 0.95 of the least radius
#: of curvature below the surface, of axes up to 10 : 1 (4e-10 at half of it at 30 : 1).
NEAREST = 12
#: Part of the squared least half axis of an ellipsoid by which t stays above the value at which nearest points of its
#: inside are not unique: 1 / 1e-6 is lost of 16 digits there, and centres of spheres that touch it are outside or near
#: its surface.
FOCAL = 1e-6
#: Part of a wheel's radius beside its axle where the rim still presses a cell of soil: at 0.98 the rim stands at 11
#: degrees to the column, where the depth at which it crosses it changes five times as fast as the wheel moves ahead.
BESIDE = 0.98
#: Heights of a wheel's axle over a bed, by its radius, between which the sides of its rim come to press less;
#: their mean is that at which the rim comes to the ground at BESIDE, 0.199, so that nothing presses there.
SIDES = (0.3, 0.1)
#: Wedges by which points of a plate press soil: the radius of their tips, by the length of a cell, and the slope to
#: which their sides rise.  The tips round the ends of a plate, so that slopes of the depth change over part of a cell.
#: A level plate keeps its depth; one of the slope t lies m^2 r (1 - sqrt(1 - t^2 / m^2)) lower, 1.7 % of a cell at 20
#: degrees and 4.2 % at 30.
WEDGE, BLADE = 0.25, 3.0
#: Part of K over which shear of a cell of soil follows its sliding, and which it gives back.  With UNSHEARED the sum of
#: shear of a wheel is within 0.6 % of that of 1 - exp(-j / K) at slips of 0.1 to 0.6, within 1 % at 0.02, by quadrature
#: over the arc at 2 and 5 cm in dry sand and heavy clay; its stiffness, v / l, stays below 1000 / s up to 0.7 m/s.
GRIP = 0.03
#: Part of the strength of a cell of soil that is there before it has been sheared: GRIP / 2 is what grip lags behind by
#: the growth of d, and the rest of it what it lags behind by the growth of the load.
UNSHEARED = 0.025
#: Part of a cell of soil over which its greatest sinkage comes to follow what presses it.  It is far above the errors
#: of steps, 1e-6 of a cell, so that rates are continuous for integrators, and far below ruts, of which it is 1 / 200
#: where they are as deep as cells are long: a load that vibrates in a rut can deepen it by this and no more.
FOLLOWED = 0.005
#: Part of the depth to which the nearest place of an ellipsoid is unique at which its law ends: on end, at all of it,
#: the stiffness of that place has no limit.  Measured up to here on 4,800 random pairs each with known normals and half
#: axes of up to 10 : 1: depths are right to 1e-9 in all.
UNIQUE = 0.95
#: Steps of Newton's method for the common normal of two ellipsoids, the last of them that do not go back, and before
#: these towards the normal at which ellipsoids scaled by one factor touch.  Measured on 280,000 random pairs of up to
#: 0.94 of the unique depth, half axes of 10 : 1 : 1 among them: all depths are right to 1e-15, with one step less to
#: 3e-11; 12 steps that never go back leave 3 % undefined or wrong.
COMMON, PLAIN, TWICE = 15, 2, 3
#: Part of a step of these that is left where the gap fell in it.
BACK = 0.4
#: Square of the part of the size of two ellipsoids by which their deepest points may lie beside their common normal:
#: depths have errors of about this square.
ASIDE = 1e-8
#: Part of a rod's radius by which gaps differ from which on another place is nearer: gaps have errors of 1e-16, and
#: places of equal gaps are 1e-8 apart.
EQUAL = 1e-12
#: Steps of Newton's method for the normal of an ellipse behind those for the nearest point, whose distance is known to
#: 1e-15 and whose normal to the root of that: measured as above.
POLISHED = 3
#: Steps of Newton's method for the point of a height field that is nearest to a shape.  Measured on 40,000 random
#: places above and below waves of slopes up to 1.2: right to 1e-6 after 4 steps up to 0.5 and after 6 up to 0.7 of the
#: least radius of curvature; the error is squared with each further step.
FOOT = 7
#: Squared part of the distance of a shape from a point of a height field that may lie along the ground there: Newton's
#: method leaves 1e-16 where it converges, and about 1 where it does not.
ASTRAY = 1e-2
#: Least part of a distance straight down that the nearest ground of a height field is away: the cosine of its slope, of
#: grounds of up to 60 degrees.
STEEP = 0.5
