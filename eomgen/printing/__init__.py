"""Printing: SymPy expressions -> formulas in the order in which textbooks print them: LaTeX, text, MathML."""

from .factor_order import Order as Order
from .formula_latex import latex as latex
from .formula_mathml import mathml as mathml
from .formula_of import Formulas as Formulas
from .formula_of import number as number
from .formula_text import text as text
from .formula_width import PAGE as PAGE
from .formula_width import sums_in_lines as sums_in_lines
from .formula_width import width as width
from .given_latex import given_mathml as given_mathml
