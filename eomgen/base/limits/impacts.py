"""Limits: impacts, sensitivities through events, rigid contacts."""

from __future__ import annotations

from .numbers import EPS

#: Scaled distance from the constraints up to which coordinates of a reset count as on them.
OFF = 1e-9
#: Gaps of a run at most this open, in lengths of the model or rad, take part in an impact: event times keep
#: eight digits.
TOUCHING = 1e-8
#: Relative rounding of a rate and of a normal: sums of a few products.
ROUNDED = 16.0 * EPS
#: Part of a normal, along which nothing is free to move, that is rounding.
FIXED = 1e-9
#: Part of the rates below which one counts as 0.
STILL = 1e-12
#: Part of the first approach that is left if the impacts of an instant do not die away.
ENDLESS = 1e-3
#: Rate after an impact, relative to the largest so far, at which a gap counts as closed.
RESTING = 1e-6
#: Negative gaps of this size, in lengths of the model or rad, are an error.
BEYOND = 1e-6
#: Time (s) over which the acceleration of a gap is differenced.
MOMENT = 1e-6
#: What is added to a gap that begins at 0 and opens, as part of the size at which one counts as closed.
STARTED = 1e-5
#: Part of the span by which the rates on one side of an event are looked at.
ASIDE = 1e-7
#: Part of the slopes after a reset by which errors of closed equations may grow: those of differences over ASIDE, 1e-8.
CONTRADICTS = 1e-5
#: Part of the rates by which they may differ on both sides of an event and count as continuous.
SMOOTH = 1e-9
#: Part of the span within which events are simultaneous.
SIMULTANEOUS = 1e-12
#: Part of the rates that may be left against the constraints after an impact.
LEFT = 1e-8
#: Length of a normal, in the metric of the mass matrix, above which something is free to move along it.
FREE = 1e-10
#: Inverse mass along a normal below which an impulse moves nothing.
PUSHES = 1e-14
#: Part of C_p along the direction of lost rank that opens a change point: the direction is known to the singular
#: value at a point that was found, 1e-4.
OPENS = 1e-3
#: Change of a state by which an input is asked whether it depends on it.
ELSEWHERE = 1e-3
#: Cosine, in the metric of the mass matrix, up to which impulses of one contact do not move another: rounding of M^-1,
#: 1e-16 times a condition of 1e4.
COUPLED = 1e-12
#: Part of the inverse mass along a normal below which impulses with friction do not open a gap: rounding of it.
STRUCK = 1e-12
#: Residual of the laws of impact with friction, relative to the fastest contact, at which Newton's method is done.
REACHED = 1e-13
#: Residual of these laws that is accepted where contacts depend on each other: rounding over their softness, 1e-8.
GIVES = 1e-9
#: Part of the energy that impulses with friction move by which their sum may grow by rounding.
GAINS = 1e-12

# -- rigid contacts, as runs are told of them --------------------------------------------------------------------------

#: Residual of the contact laws, relative to the largest velocity of the contacts without impulses: rounding of W P and
#: of the free velocities, 1e-16 times a condition of 1e6 that chains and redundant contacts bring about, is below.
SOLVED = 1e-9
ITERATIONS = 600  #: of one step: rounded laws take up to 200 in each of their rounds
#: Halvings of one step until no shapes pass each other in its halves: speeds of 65,000 times what the step suits.
HALVINGS = 16
