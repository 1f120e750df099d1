"""Limits: the linear system K z = r of a method that keeps reactions as unknowns, K balanced to entries of 1."""

from __future__ import annotations

#: Subtracted from K at the places of constraints: far above the rounding of a pivot (1e-14), so that redundant rows do
#: not spoil it, and so small that two or three passes leave nothing of it.
RELAXATION = 1e-10
#: The same in the first pass, whose rounding leaves eps / this in the reactions of redundant rows; what later passes
#: correct is as much smaller.
FIRST = 1e-6
#: K counts as singular where it answers more than 1 / PIVOT times what is asked: nothing is left of sixteen digits.
PIVOT = 1e-14
#: A largest entry up to this factor from 1 counts as balanced: a power of two costs no digits.
BALANCED = 2.0
#: Most that may be left of an equation relative to the sum of its own terms: 5e4 eps, for sums of thousands of terms.
LEFT = 1e-11
#: The same relative to the largest sum of terms of any equation, which feeds its rounding to all others: 50 eps.
ROUNDED = 1e-14
#: The same of constraints along a weak direction, over its s^2: velocities are known to EXACT / s^2 there.
FAINT = 1e-15
#: Least s^2 in that: below it, FAINT would allow more than a hundredth.
WEAKEST = 1e-13
#: Most by which forces of laws of reactions may miss their laws, relative to the sum of their sizes: 5e4 eps, as LEFT.
FIXED = 1e-11
#: Below it a component of a reaction vanishes whatever the state is: 5e3 eps, of symbols between 0.5 and 1.5.
UNTOUCHED = 1e-12
