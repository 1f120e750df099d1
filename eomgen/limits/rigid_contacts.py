"""Limits: rigid contacts, how well their impulses are found and what counts as resting."""

from __future__ import annotations

#: Residual of the contact laws, relative to the largest velocity of the contacts without impulses: rounding of W P and
#: of the free velocities, 1e-16 times a condition of 1e4 that stiff chains bring about, is below.
SOLVED = 1e-10
ITERATIONS = 100  #: of one step: Newton's method takes about as many as contacts change their state, and sweeps follow
SWEEPS = 20  #: sweeps over all contacts that count as one iteration: about the work of Newton's linear system
HALVINGS = 6  #: of a Newton step that does not lead to less: beyond, sweeps get on faster
#: Part of its own compliance that each contact is softer by in Newton's matrix, so that contacts more than there are
#: freedoms leave it regular: steps err by this part, which later steps remove, and rounding in the impulses that
#: nothing determines is 1e-16 / this = 1e-6 of them.
BLURRED = 1e-10
#: Approach below this multiple of what forces change in one step is rest, without a rebound: a body that rests
#: approaches at once the change of a step.
RESTING = 2.0
#: Part of a penetration that one step removes: an even part of it, so that pairs that share a body do not overshoot.
REMOVED = 0.2
GROWN = 1e-12  #: part of the energy that impacts move by which their sum may grow by rounding
#: Halvings of the restitution of one instant until impacts with friction take energy: below, it is 0.
GENTLER = 4
