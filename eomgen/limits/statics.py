"""Limits: balance of forces, stability, forces needed for a motion."""

from __future__ import annotations

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
#: Damping to begin with, relative to the square of each column (More, 1978), and the part of the foretold gain that a
#: step must bring.
DAMPING, GAINED = 1e-3, 1e-4
#: Least size of an unknown, relative to the largest, by which its column is scaled.
LEAST_UNKNOWN = 1e-3
