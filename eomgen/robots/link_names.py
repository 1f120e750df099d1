"""Robots, names: whatever a robot file calls its links and joints -> names a model may use, and what became of each.

Characters other than letters, digits and underscores become underscores; a name that does not start with a letter gets
the prefix of its kind (``link_``, ``joint_``); words of Python, C and of expressions get an underscore after them; what
is then not unique gets a number.
"""

from __future__ import annotations

from collections.abc import Sequence

from ..describe.names import LONGEST, clean_name, fault_of_model_name, unique
from ..describe.scope import RATES


class RobotNames:
    """Gives out names: bodies and joints have a list each; coordinates, parameters and inputs share one."""

    def __init__(self) -> None:
        self.taken = {"ground link"}  # names of bodies and of joints with their kind behind, and symbols
        self.renamed: dict[str, dict[str, str]] = {}  # section of the model -> old name -> new

    def link(self, name: str) -> str:
        """The name of a body or marker."""
        return self._note("bodies", name, self.made(name))

    def joint(self, name: str, suffixes: Sequence[str]) -> str:
        """The name of a joint whose coordinates are that name with these suffixes."""
        return self._note("joints", name, self.made_joint(name, suffixes))

    def symbol(self, name: str) -> str:
        """The name of a parameter or an input."""
        return self._note("inputs", name, unique(name, "symbol", self.taken))

    def made(self, name: str) -> str:
        """The name of an element that the file does not name, told apart from others without a word about it."""
        return unique(name, "link", self.taken, (" link",))

    def made_joint(self, name: str, suffixes: Sequence[str]) -> str:
        """The name of a joint that the file does not have, told apart from others without a word about it."""
        symbols = (suffix + rate for suffix in suffixes for rate in RATES)
        return unique(name, "joint", self.taken, (" joint", *symbols))

    def _note(self, section: str, name: str, given: str) -> str:
        if given != name:
            self.renamed.setdefault(section, {})[name] = given
        return given


def clean_model_name(name: str) -> str:
    """The name of a model as near to a robot's as can be."""
    result = clean_name(name, "robot")[:LONGEST]
    return f"{result[: LONGEST - 6]}_model" if fault_of_model_name(result) else result
