"""What was derived -> every quantity of the equations by name, as graph expressions and as SymPy.

Reading happens in copies of the graph: nothing that is read changes what is compiled.
"""

from .readable import Readable, ReadingView

__all__ = ["Readable", "ReadingView"]
