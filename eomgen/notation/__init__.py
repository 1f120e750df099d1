"""Notation: the name of a quantity -> how it is printed: LaTeX, text, HTML, MathML, Matplotlib's mathtext.

``theta1`` is printed as ``\\theta_1``, ``m_c`` as ``m_c``, ``bend`` as ``\\mathrm{bend}``, ``theta1_dot`` as
``\\dot{\\theta}_1``.  A model may give the LaTeX of a name itself (``latex=``); all other forms follow from it.
Exported packages carry these files, which import neither NumPy nor SymPy.
"""

from .latex_tree import NotationError as NotationError
from .latex_tree import read_latex as read_latex
from .notation import Notation as Notation
from .notation import dotted as dotted
from .notation import raised as raised
from .notation import with_instance as with_instance
