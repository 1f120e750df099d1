"""SymPy expressions -> formulas in the order in which textbooks print them: LaTeX, text, MathML."""

from .formula import Formulas as Formulas
from .formula import Order as Order
from .formula import number as number
from .writers import PAGE as PAGE
from .writers import bare_mathml as bare_mathml
from .writers import latex as latex
from .writers import latex_lines as latex_lines
from .writers import mathml as mathml
from .writers import mathml_lines as mathml_lines
from .writers import text as text
from .writers import width as width
