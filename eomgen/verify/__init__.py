"""A compiled module or a model -> how far independent ways to the same figures differ."""

from __future__ import annotations

from .finding import Finding, Verification

__all__ = ["Finding", "Verification"]
