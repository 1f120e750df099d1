"""Limits: integrators, events and inputs over time."""

from __future__ import annotations

from .numbers import EPS

# -- tolerances ------------------------------------------------------------------------------------------------------
RTOL, ATOL = 1e-8, 1e-10  #: of a run, where nothing is said
SCIPY_RTOL, SCIPY_ATOL = 1e-3, 1e-6  #: of SciPy's solvers, where they are called as SciPy calls them
SENSITIVITY_RTOL, SENSITIVITY_ATOL = 1e-9, 1e-11  #: of runs whose derivatives are requested
LEAST_RTOL = 100.0 * EPS  #: as in SciPy: nothing smaller can be kept

# -- steps -----------------------------------------------------------------------------------------------------------
#: The first step (Hairer, Norsett and Wanner, Solving ODEs I, sec. II.4): norms of y and y' below which it is that of
#: nothing known, that step (s), norms of y' and y'' below which both are nothing, and the growth then.
UNKNOWN, FIRST, STRAIGHT, GROWTH = 1e-5, 1e-6, 1e-15, 1e-3
FINE = 2.5e-15  #: a step above this part of the time is longer than the spacing of numbers: eleven of it
SAME = 1e-9  #: part of a step by which two count as one
SLOPE, SIZE = 1.5e-8, 1e-3  #: part of a variable over which its slope is differenced, the root of eps; its least size
#: Steps of contacts between groups: part of the distance of two shapes that one step may go at their present motion,
#: where its far side is near; the same where there is no far side; and part of their thicknesses that it may always go.
#: In a body that is passed through there are then at least 1 / WITHIN steps, each with some ten stages.
UP_TO, BEYOND, WITHIN = 0.75, 2.0, 0.0625
#: Part of their thicknesses up to which two shapes that are apart are listed as near each other: twice WITHIN, so that
#: motions of at most that part, or of UP_TO of the distance, from where they are not listed do not touch; and the same
#: where a shape has no far side.  Second neighbours in heaps of equal discs (apart by 0.37 of both) and spheres (0.21)
#: are not listed.
NEAR, OUTSIDE = 2.0 * WITHIN, 0.5
#: Part of distances from the ground's origin by which shapes count as nearer while they are sorted out: rounding of
#: their places moves none across it, and the distance itself is tested after.
APART = 1e-12
UNHURRIED = 1e3  #: the least step, over which contacts shorten none further
SUNK = 0.1  #: penetration at the start, relative to the thickness of both shapes, that is no rest on a floor
#: Rate of coordinates by themselves (dq'/dq) times the step below which implicit systems are solved by parts: what the
#: series leaves out is its square, far below the rate at which Newton's iterations converge.
DRIFTING = 1e-2
#: Part of the terms of a pivot below which it is not taken without exchanges of rows: Newton's iterations bear an error
#: of the factors of a thousandth, and rounding grows by as much as is lost.
FAINT = 1e-8
SLOW = 1e-3  #: rate of Newton's iterations in a Radau step above which the Jacobian is renewed

# -- runs that stall -------------------------------------------------------------------------------------------------
SHORT = 5e-9  #: mean step relative to the span below which a run does not get on: 2e8 steps to its end
STILL = 1e-4  #: change of the state in a window of steps, relative to the largest yet, below which nothing happens
NOTICED = 1e-12  #: part of a state below which its change is rounding of the steps
STEEP = 1e-2  #: part of 1 / step, above which a force is steep for the integrator
GROWN = 1e6  #: of states over those at the start, of 1 at least, beyond which a run backwards is lost to damping

# -- size of a run ---------------------------------------------------------------------------------------------------
MOST_STEPS = 10**8  #: steps of limited size
MOST_NUMBERS = 5 * 10**7  #: kept by one call: 0.4 GB, of which results are copied two or three times
#: A run that has taken so many steps and needs so many more like them would not end.
ENOUGH, ENDLESS = 3000, 10**10
FEW, HOPELESS = 100, 10**15  #: the same, where fewer steps tell as much
MOST_STATES = 10_000  #: random states of one verification: each takes milliseconds

# -- events ----------------------------------------------------------------------------------------------------------
CROWDED, CROWD = 1e-9, 12  #: resets closer than this part of the run, so many in a row, accumulate at one time
TURNING = 1e-8  #: part of a step to which the place where a value turns is found: the root of its rounding
ASIDE = 1e-5  #: part of a step, or of 1 s where there is none, over which the rate of a value is taken
MOMENTARY = 1e-6  #: (s) stands for a step where none is chosen yet
STEP_END = 1e-4  #: part of a step, before its end, in which the next step may look for the same zero
TOUCHED = 1e-13  #: part of its largest size within which a value that comes to zero and back was there: 500 roundings
RESTING = 1000.0  #: times that, at both ends of a step, of a value that stays at zero and does not touch it
SAMPLED, HALVED = 16, 50  #: parts of a step in which a touch is looked for; times that it is halved after a reset
TOUCHING = 1e-9  #: part of its size at which the value of an event counts as zero, and its rate as none
INSTANT = 1e-14  #: part of the time within which two are one: 50 roundings of a step's end
WHOLE = 1e-6  #: a counter of samples this near to a whole number is one: rounding of times moves it by less
EARLIEST = 1e-3  #: (s) stands for the time where that is less

# -- inputs ----------------------------------------------------------------------------------------------------------
MOMENT = 1e-5  #: (s) over which the explicit part of a rate in time is differenced: the cube root of eps
CONTINUOUS = 1e-9  #: part of the largest value or slope of a table by which it may jump and count as continuous
CONTRADICTS = 1e-2  #: part of what an input changes in a run, by which a rate given beside it may be wrong
CONTRADICTS_TABLE = 1e-1  #: the same where one of them is a table, which is coarse between its points
DIFFERENCE = 1e-6  #: part of a variable over which a function of it is differenced
LOCATED = 1e-12  #: part of an interval to which the jump of a text is located: beside it lie 4,000 numbers
SPECTRUM = 1e-9  #: amplitudes that a spectrum shows at least, of the greatest
