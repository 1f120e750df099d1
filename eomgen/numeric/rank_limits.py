"""Stage numeric: below which part of the largest a singular value or pivot of scaled rows counts as zero, and why.

One matrix is asked four questions, whose answers are spoilt by different things.
"""

from __future__ import annotations

#: Rank of the mechanism, from configurations drawn at random, where few are near a singular one: closed to 1e-10, the
#: rows that depend on each other when closed keep false ranks up to that; a hundred times more tells both apart.
STRUCTURE = 1e-8
#: Pivots of a coordinate that was chosen and may not be exchanged: dependent ones move at most 1e8 times as fast, which
#: leaves half of the digits.
CHOSEN = 1e-8
#: Rank at one projected state, which is closed to 1e-15: directions weaker than this are not told from rounding of C_q
#: (1e-13 of large mechanisms), those stronger are held.
STATE = 1e-10
#: The same of the balance of all bodies, whose rows are products of two such matrices and of levers.
BALANCE = 1e-9
#: A change point along a motion, found where the smallest singular value has a minimum between two stored states: it
#: is reached to about the square root of their accuracy, 1e-8.
PASSED = 1e-4
