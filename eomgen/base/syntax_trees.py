"""Python's text -> its syntax tree, one thread at a time.

CPython 3.11 counts the depth of trees that it builds for all threads together, so two at once may fail with
SystemError: AST constructor recursion depth mismatch (python/cpython issue 106905).
"""

from __future__ import annotations

import ast
import threading

_LOCK = threading.Lock()


def parse_module(text: str) -> ast.Module:
    """As :func:`ast.parse`."""
    with _LOCK:
        return ast.parse(text)


def parse_statement(text: str) -> ast.Interactive:
    """As :func:`ast.parse` of one interactive statement: for a module Python would look for a file to quote from."""
    with _LOCK:
        return ast.parse(text, mode="single")
