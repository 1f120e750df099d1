"""Stage describe, the builder's elements: a method for every type in the tables; element_methods.pyi lists them."""

from ..constraints import CONSTRAINTS
from ..forces import FORCES
from .described import Described
from .methods import method_of


class ElementMethods(Described):
    """Methods of Model that add elements; bodies, markers and joints are handles or names.

    Where a joint is asked for, a coordinate (its SymPy symbol or its name) says which one of several is meant.
    """


for _section, _types in (("forces", FORCES), ("constraints", CONSTRAINTS)):
    for _found in _types.values():
        setattr(ElementMethods, _found.name, method_of(_section, _found))
