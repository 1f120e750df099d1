"""Robots, joints tied together: a law between sums of joint coordinates -> the entry of a coupling.

A tie holds y = a0 + a1 x + a2 x^2 + ..., where y and x are sums of factors times coordinates.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..records import dataclass

Parts = tuple[tuple[str, float], ...]


@dataclass(frozen=True)
class Sum:
    """``constant`` + the sum of factors times joint coordinates."""

    parts: Parts
    constant: float = 0.0


@dataclass(frozen=True)
class Tie:
    """``left`` = a0 + a1 ``right`` + a2 ``right``^2 + ..., the a_k in ``law``."""

    name: str
    left: Sum
    right: Sum
    law: tuple[float, ...]
    place: tuple[str, int]


def describe_tie(tie: Tie, coordinates: Mapping[str, str], locked: Mapping[str, float]) -> dict[str, Any] | None:
    """The keys of a coupling, a linear one by its factors; None where no joint is left to tie.

    Parameters
    ----------
    tie : Tie
    coordinates : mapping
        Joint -> coordinate, of joints that move.
    locked : mapping
        Joint -> value at which it is held.
    """
    (left, y), (right, x) = (_collect(s, coordinates, locked) for s in (tie.left, tie.right))
    _, slope, *higher = (*tie.law, 0.0, 0.0)
    if not any(higher) or not right:
        value = 0.0
        for a in reversed(tie.law):
            value = a + x * value
        factors = dict(left)
        for q, c in right.items():
            factors[q] = factors.get(q, 0.0) - slope * c
        factors = {q: c for q, c in factors.items() if c}
        if not factors:
            return None
        offset = value - y
        return {"type": "coupling", "coordinates": factors} | ({"offset": offset} if offset else {})
    inner, text = _text(right, x), ""
    for a in reversed(tie.law):
        text = f"({a!r})" + (f" + ({inner})*({text})" if text else "")
    return {"type": "coupling", "equation": f"{_text(left, y)} - ({text})"}


def _collect(given: Sum, coordinates: Mapping[str, str], locked: Mapping[str, float]) -> tuple[dict[str, float], float]:
    """Coordinate -> factor, and the constant with what locked joints add."""
    factors: dict[str, float] = {}
    constant = given.constant
    for joint, factor in given.parts:
        q = coordinates.get(joint)
        if q is None:
            constant += factor * locked.get(joint, 0.0)
        elif factor:
            factors[q] = factors.get(q, 0.0) + factor
    return factors, constant


def _text(factors: Mapping[str, float], constant: float) -> str:
    terms = [q if c == 1.0 else f"({c!r})*{q}" for q, c in factors.items()]
    return " + ".join(terms + [f"({constant!r})"] * bool(constant or not terms))
