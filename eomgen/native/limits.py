"""Limits that C takes, from here by their names there, or from the floor: the text of a C file -> definitions."""

from __future__ import annotations

import re
from itertools import pairwise

from ..base.limits import constraints, numbers, runs
from ..base.limits.numbers import SMALL_LOOP

#: What stands before a name of the floor in C -> where it is.
FLOOR = {"ROUNDING": numbers, "INERTIA": numbers, "CONSTRAINTS": constraints, "RUNS": runs}
#: All that stand before names: those of the floor, change points, linear systems of a method, rigid contacts.
KINDS = (*FLOOR, "CROSSINGS", "SYSTEMS", "RIGID")
_NAME = re.compile(r"[A-Z][A-Z_]*\b")


def definitions(text: str) -> str:
    """``#define`` lines, one for each limit that a text names; empty if it names none."""
    used = set()
    for kind in KINDS:  # one pattern for all takes six times as long, in every process of a clone
        for before, after in pairwise(text.split(f"{kind}_")):
            if not (before[-1:].isalnum() or before.endswith("_")) and (match := _NAME.match(after)):
                used.add((kind, match[0]))
    return "".join(f"#define {kind}_{name} {_in_c(_find(kind, name))}\n" for kind, name in sorted(used))


def _find(kind: str, name: str) -> object:
    return getattr(FLOOR[kind], name) if kind in FLOOR else globals()[f"{kind}_{name}"]


def _in_c(limit: object) -> str:
    return "{" + ", ".join(map(repr, limit)) + "}" if isinstance(limit, tuple) else repr(limit)


# -- interpolation across a change point (eomgen/native/right_hand_side.c) ---------------------------------------------
#: A crossing is looked for where the weakest pivot is smaller; accelerations, known to V^2 EXACT / pivot^3, keep 1e-11
#: there. NEAR_SQUARE: the same of squares of sines between columns.
CROSSINGS_NEAR = 0.05
CROSSINGS_NEAR_SQUARE = CROSSINGS_NEAR * CROSSINGS_NEAR
#: Least size of a gap's rows: smaller loops have row sizes of their own, the rest is rounding.
CROSSINGS_SMALL = SMALL_LOOP
CROSSINGS_REACH = 0.1  #: scaled motion to the first points on either side; halved while that promises a smaller error
CROSSINGS_SHORTEST = 0.01  #: least reach
#: The pivots at the first points are together so many times that here: the crossing is within 0.4 reaches.
CROSSINGS_MIDDLE = 5.0
#: Scaled residual of the interpolated position: a mechanism that only comes near misses by more.
CROSSINGS_CLOSED = 1e-12
CROSSINGS_NOISE = 1e-16  #: of C; a solution at the state has NOISE V^2 / pivot^3 in accelerations for velocities V
CROSSINGS_GOOD = 1e-11  #: error of an interpolation, over V^2, that no shorter reach can better
#: Weakest pivot s below which a state alone tells no acceleration: closures are known to 1e-16, so that a state on no
#: branch counts as closed where it misses its branch by 1e-16 / s, which is 1e-16 / s^2 = 1 % of s here.
CROSSINGS_UNTOLD = 1e-7
CROSSINGS_WEAKEST = 1e-4  #: below this pivot the solution at the state gets no worse: its weak part is left out
CROSSINGS_STILL = 1e-9  #: scaled velocity that tells no direction
CROSSINGS_SLANT = 1e-3  #: least part of the motion that the tangent coordinates must keep
CROSSINGS_ARRIVED = 1e-14  #: distance along the curve at which the search for a point ends
CROSSINGS_ENOUGH = 1e-12  #: distance along the curve that is good enough where the search gets no nearer
CROSSINGS_ROUNDS = 30  #: of that search; each leaves the square of the sine of the angle between tangent and curve

# -- the linear system K z = r of a method that keeps reactions as unknowns, K balanced to entries of 1 ----------------
#: Subtracted from K at the places of constraints: far above the rounding of a pivot (1e-14), so that redundant rows do
#: not spoil it, and so small that two or three passes leave nothing of it.
SYSTEMS_RELAXATION = 1e-10
#: K counts as singular where it answers more than 1 / PIVOT times what is asked: nothing is left of sixteen digits.
SYSTEMS_PIVOT = 1e-14
#: Most that may be left of an equation relative to the sum of its own terms: 5e4 eps, for sums of thousands of terms.
SYSTEMS_LEFT = 1e-11
#: The same relative to the largest sum of terms of any equation, which feeds its rounding to all others: 50 eps.
SYSTEMS_ROUNDED = 1e-14
#: The same of constraints along a weak direction, over its s^2: velocities are known to EXACT / s^2 there.
SYSTEMS_FAINT = 1e-15
#: Least s^2 in that: below it, FAINT would allow more than a hundredth.
SYSTEMS_WEAKEST = 1e-13
#: Most by which forces of laws of reactions may miss their laws, relative to the sum of their sizes: 5e4 eps, as LEFT.
SYSTEMS_FIXED = 1e-11
#: Below it a component of a reaction vanishes whatever the state is: 5e3 eps, of symbols between 0.5 and 1.5.
SYSTEMS_UNTOUCHED = 1e-12

# -- how well impulses of rigid contacts are found and what counts as resting ------------------------------------------
#: Parts of their own compliance by which contacts are softer in the rounds of Newton's method, by turns: errors shrink
#: by about this part in a round, and rounding in impulses that nothing determines is 1e-16 over it.
RIGID_SOFTER = (1e-8, 1e-6)
RIGID_TRIED = 10  #: iterations of a round: states of contacts that change still are in a circle
RIGID_SWEEPS = 5  #: over all contacts, after a round that led nowhere
#: From so many contacts up to WARM times as many sweeps come first: a sweep takes (m d)^2 operations, a step of
#: Newton's method (m d)^3/3.
RIGID_MANY, RIGID_WARM = 8, 20
#: Part of its own compliance by which an edge of a cone is softer where edges are found one by one, as in SOFTER; edges
#: whose part beside those that act is half of it depend on them.
RIGID_FIRM = 1e-8
#: Friction below which the tolerance of an edge does not shrink with it: of a direction across that holds by so little,
#: nothing is asked that rounding does not tell.
RIGID_SLIPPERY = 0.01
#: Times the edges: each comes and goes about once from a cold start, fewer from impulses of the last step.
RIGID_PIVOTS = 3
#: Rounds in which what slides is renewed: errors shrink by the friction or so in each, to 1e-15 at 0.5. They grow first
#: where another contact is about to slide, seldom over more than ten rounds, after which it leads nowhere.
RIGID_RENEWED, RIGID_VAIN = 50, 12
#: The same in Newton's method for rounded laws, whose impulses go on farther in each step; the part by which the
#: rounding shrinks when a step was good, at first and where that leads nowhere; and the part of the velocities at which
#: laws count as sharp.
RIGID_SOFT, RIGID_SHRINKS, RIGID_SHARP = 1e-10, (0.2, 0.5, 0.8), 1e-14
#: Roundings tried in vain, two iterations each, after which a smaller one is not reached: those that are reached take
#: one or two.
RIGID_PATIENT = 8
#: Approach below this multiple of what forces change in one step is rest, without a rebound: a body that rests
#: approaches at once the change of a step.
RIGID_RESTING = 2.0
#: Velocity, in those of the contacts, by which contacts are taken to part where they should not act at all: impulses of
#: others move none so fast.
RIGID_APART = 4.0
#: Part of a penetration that one step removes: an even part of it, so that pairs that share a body do not overshoot.
RIGID_REMOVED = 0.2
#: Square of the compliance between two contacts, as a part of the product of their own, up to which it is rounding: the
#: square of 1e-16 times a condition of 1e6, as above.
RIGID_LINKED = 1e-20
#: Part of its compliance by which a contact is softer where penetrations are removed: jams have an end.
RIGID_YIELDING = 1e-3
RIGID_GROWN = 1e-12  #: part of the energy that impacts move by which their sum may grow by rounding
#: Halvings of the restitution of one instant until impacts with friction take energy and can be: below, it is 0.
RIGID_GENTLER = 4
RIGID_UNSOLVED = 1e-5  #: part of the velocities that a solution leaves where there is none
#: A pivot of the inertia below this part of its own diagonal is no more than rounding, 1e-16 times a condition of 1e6
#: as above: constraint rows then stand in for it.
RIGID_PIVOT = 1e-10
#: A constraint row whose part beside the others is smaller than this holds nothing of its own: squares of it are the
#: rounding, 1e-15, below which the pseudo-inverse of C M^-1 C^T leaves singular values out.
RIGID_DEPENDENT = 3e-8
#: Times the tolerance to which impulses are found at first: they only say with which velocities forces act, and of an
#: error in these no more than the change of forces within a step, a hundredth, comes back.
RIGID_ROUGH = 10.0
#: Solutions of one step at most, until contacts do not feel the projection of velocities onto the constraints at its
#: end: it shrinks by h times a speed of turning in each, 0.03 to 0.003, at an impact from the size of velocities on.
#: Forces that change with velocities take two.
RIGID_ROUNDS = 12
#: Newton steps at most that close loops at the end of a step, by the factors of its middle: errors shrink as above.
RIGID_CLOSINGS = 8
