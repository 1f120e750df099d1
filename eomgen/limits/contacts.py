"""Limits: contacts, where their laws are written so that they stay finite."""

from __future__ import annotations

#: Part of the transition velocity that tanh(4 v / transition) / v is shifted by: its square, 1e-16, is lost beside 1 in
#: the value, and the slope, whose cancelling terms have errors of 1e-16 / v^2, stays finite at rest.
AT_REST = 1e-8
