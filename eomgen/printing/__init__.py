"""Printing: SymPy expressions -> formulas in the order in which textbooks print them: LaTeX, text, MathML."""

from .formulas import Formulas as Formulas
from .latex import latex as latex
from .mathml import mathml as mathml
from .order import Order as Order
from .text import text as text
