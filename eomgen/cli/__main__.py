"""``python -m eomgen.cli``: the ``eomgen`` command where its script is not on the path."""

from . import main

main()
