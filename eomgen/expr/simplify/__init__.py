"""Expressions of a graph -> the forms in which a hand would write them, in SymPy.

The forms are for reading; compiled code keeps its own.
"""

from .equal_nodes import joined_nodes
from .form import WHOLE, Form, simplify

__all__ = ["WHOLE", "Form", "joined_nodes", "simplify"]
