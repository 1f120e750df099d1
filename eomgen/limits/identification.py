"""Limits of the identification: which parameters the measured motions determine."""

from __future__ import annotations

#: Smallest singular value of the derivatives, over the largest, each column of length 1, below which parameters cannot
#: be told apart: derivatives are integrated to 1e-8, so a smaller one is their error.
IDENTIFIED = 1e-7
#: Least part of its range to which a column counts as measured, where its noise is found from the residuals: without
#: it a simulated column without noise would outweigh all others.
MEASURED = 1e-9
#: Rounds in which the noise of the columns is found from the residuals and the fit repeated: the second changes weights
#: by what the first found, a third by less than the standard errors.
ROUNDS = 2
