"""Derived equations -> the worked solution as HTML, Markdown, LaTeX or PDF.

Every formula comes from :mod:`eomgen.reading`, is printed by :mod:`eomgen.expr.notation`, and is compared with the
compiled module at the end.
"""

from __future__ import annotations

from .explanation import Explanation, explain

__all__ = ["Explanation", "explain"]
