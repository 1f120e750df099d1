"""Limits: positions that are followed along constraints, singular ones, guesses of them."""

from __future__ import annotations

#: Scaled way (rad, lengths) that a position is led along in small steps: 300 turns, 20,000 steps.
FOLLOWED = 2000.0
#: Relative difference of two directions that count as one.
ALIGNED = 1e-12
#: Quality, the smallest singular value over the largest, below which a position counts as singular: rates there
#: keep ten digits at most, and a minimum is found to the root of what positions are closed to, 1e-5 at worst.
SINGULAR = 1e-6
#: Quality below which an interpolant across a singular position gives more digits than the equations, which keep
#: EXACT / s^2 of velocities.
POOR = 1e-3
#: Parameters relative to the path that count as one.
SAME = 1e-10
#: Scaled motion too small to tell a direction by: positions are closed to 1e-10.
UNJUDGED = 1e-6
#: Scaled motion on either side of a singular position, tried in order.
JUMPS = (1e-3, 4e-3, 1.6e-2, 6e-2)
#: Step of the path's parameter, relative to the path, before the way counts as blocked: 500 roundings.
BLOCKED = 1e-13
#: By which a limit may be passed, for rounding and what positions are closed to.
SLACK = 1e-9
#: Distance from a singularity of Euler angles (rad) at which a failure is put down to it.
LOCKED = 1e-4
#: Sine of the angle between a disc's axle and its plane's normal below which it counts as flat.
FLAT = 1e-3
#: Part of the largest singular value below which one is none: C_q is known to so much in large mechanisms.
NULL = 1e-13
#: Scaled distance by which an interpolant across a singular position may miss a position on it: seven times the error
#: of its rates there.
ASTRAY = 1e-5
#: Part of a path in time over which constraints are differenced at a position that stands still: the root of rounding.
DRIFTED = 1e-6
#: Scaled distance (rad, lengths) between a guess and a closed position that lie beside each other: angles then turn
#: directions by less than a twentieth of a turn, and cosines, which close loops, by 5 %.
BESIDE = 0.3
#: Initial angle (rad) beyond which degrees are supposed: two turns.
MOST_ANGLE = 12.566370614359172
