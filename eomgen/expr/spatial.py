"""Spatial vectors, an angular and a linear part, of expressions (Featherstone, RBDA, ch. 2)."""

from __future__ import annotations

from . import vectors as vec
from .core import Expr
from .vectors import Vec3

Twist = tuple[Vec3, Vec3]  # angular, linear: a velocity or an acceleration, or a column of a motion subspace
Wrench = tuple[Vec3, Vec3]  # moment about the origin, force


def add(a: Twist, b: Twist) -> Twist:
    """a + b"""
    return vec.add(a[0], b[0]), vec.add(a[1], b[1])


def sub(a: Twist, b: Twist) -> Twist:
    """a - b"""
    return vec.sub(a[0], b[0]), vec.sub(a[1], b[1])


def scaled(s: Expr, a: Twist) -> Twist:
    """s a"""
    return vec.scale(s, a[0]), vec.scale(s, a[1])


def dot(a: Twist, b: Twist) -> Expr:
    """Power of a wrench on a twist."""
    return vec.dot(a[0], b[0]) + vec.dot(a[1], b[1])


def cross_motion(v: Twist, m: Twist) -> Twist:
    """v x m of a twist v and a motion vector m (Featherstone, RBDA, eq. 2.31)."""
    return vec.cross(v[0], m[0]), vec.add(vec.cross(v[0], m[1]), vec.cross(v[1], m[0]))


def cross_wrench(v: Twist, f: Wrench) -> Wrench:
    """v x* f of a twist v and a wrench f (Featherstone, RBDA, eq. 2.32)."""
    return vec.add(vec.cross(v[0], f[0]), vec.cross(v[1], f[1])), vec.cross(v[0], f[1])
