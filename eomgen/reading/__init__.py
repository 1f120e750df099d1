"""What was derived -> every quantity of the equations by name, as graph expressions and as SymPy.

Reading happens in copies of the graph: nothing that is read changes what is compiled.
"""

from .displayed import Displayed, ReadingView
from .readable import Readable

__all__ = ["Displayed", "Readable", "ReadingView"]
