"""Limits: how well impulses of rigid contacts are found and what counts as resting."""

from __future__ import annotations

from ...base.limits.impacts import HALVINGS, ITERATIONS, SOLVED  # noqa: F401 - which C takes from here

#: Parts of their own compliance by which contacts are softer in the rounds of Newton's method, by turns: errors shrink
#: by about this part in a round, and rounding in impulses that nothing determines is 1e-16 over it.
SOFTER = (1e-8, 1e-6)
TRIED = 10  #: iterations of a round: states of contacts that change still are in a circle
SWEEPS = 5  #: over all contacts, after a round that led nowhere
#: From so many contacts up to WARM times as many sweeps come first: a sweep takes (m d)^2 operations, a step of
#: Newton's method (m d)^3/3.
MANY, WARM = 8, 20
#: Part of its own compliance by which an edge of a cone is softer where edges are found one by one, as in SOFTER; edges
#: whose part beside those that act is half of it depend on them.
FIRM = 1e-8
#: Friction below which the tolerance of an edge does not shrink with it: of a direction across that holds by so little,
#: nothing is asked that rounding does not tell.
SLIPPERY = 0.01
PIVOTS = 3  #: times the edges: each comes and goes about once from a cold start, fewer from impulses of the last step
#: Rounds in which what slides is renewed: errors shrink by the friction or so in each, to 1e-15 at 0.5. They grow first
#: where another contact is about to slide, seldom over more than ten rounds, after which it leads nowhere.
RENEWED, VAIN = 50, 12
#: The same in Newton's method for rounded laws, whose impulses go on farther in each step; the part by which the
#: rounding shrinks when a step was good, at first and where that leads nowhere; and the part of the velocities at which
#: laws count as sharp.
SOFT, SHRINKS, SHARP = 1e-10, (0.2, 0.5, 0.8), 1e-14
#: Roundings tried in vain, two iterations each, after which a smaller one is not reached: those that are reached take
#: one or two.
PATIENT = 8
#: Approach below this multiple of what forces change in one step is rest, without a rebound: a body that rests
#: approaches at once the change of a step.
RESTING = 2.0
#: Velocity, in those of the contacts, by which contacts are taken to part where they should not act at all: impulses of
#: others move none so fast.
APART = 4.0
#: Part of a penetration that one step removes: an even part of it, so that pairs that share a body do not overshoot.
REMOVED = 0.2
#: Square of the compliance between two contacts, as a part of the product of their own, up to which it is rounding: the
#: square of 1e-16 times a condition of 1e6, as above.
LINKED = 1e-20
YIELDING = 1e-3  #: part of its compliance by which a contact is softer where penetrations are removed: jams have an end
GROWN = 1e-12  #: part of the energy that impacts move by which their sum may grow by rounding
#: Halvings of the restitution of one instant until impacts with friction take energy and can be: below, it is 0.
GENTLER = 4
UNSOLVED = 1e-5  #: part of the velocities that a solution leaves where there is none
#: A pivot of the inertia below this part of its own diagonal is no more than rounding, 1e-16 times a condition of 1e6
#: as above: constraint rows then stand in for it.
PIVOT = 1e-10
#: A constraint row whose part beside the others is smaller than this holds nothing of its own: squares of it are the
#: rounding, 1e-15, below which the pseudo-inverse of C M^-1 C^T leaves singular values out.
DEPENDENT = 3e-8
#: Times the tolerance to which impulses are found at first: they only say with which velocities forces act, and of an
#: error in these no more than the change of forces within a step, a hundredth, comes back.
ROUGH = 10.0
#: Solutions of one step at most, until contacts do not feel the projection of velocities onto the constraints at its
#: end: it shrinks by h times a speed of turning in each, 0.03 to 0.003, at an impact from the size of velocities on.
#: Forces that change with velocities take two.
ROUNDS = 12
#: Newton steps at most that close loops at the end of a step, by the factors of its middle: errors shrink as above.
CLOSINGS = 8
