"""Robots, names: whatever a robot file calls its links and joints -> names a model may use, and what became of each.

Characters other than letters, digits and underscores become underscores; a name that does not start with a letter gets
the prefix of its kind (``link_``, ``joint_``); words of Python, C and of expressions get an underscore after them; what
is then not unique gets a number.
"""

from __future__ import annotations

from collections.abc import Sequence

from ..describe.names import LONGEST, clean_name, fault_of_model_name
from ..describe.scope import RATES


class RobotNames:
    """Gives out names: bodies and joints have a list each; coordinates, parameters and inputs share one."""

    def __init__(self) -> None:
        self.taken: dict[str, set[str]] = {"link": {"ground"}, "joint": set(), "symbol": set()}
        self.renamed: dict[str, dict[str, str]] = {}  # section of the model -> old name -> new

    def link(self, name: str) -> str:
        """The name of a body or marker."""
        return self._note("bodies", name, self._fresh(name, "link", ("",)))

    def joint(self, name: str, suffixes: Sequence[str]) -> str:
        """The name of a joint whose coordinates are that name with these suffixes."""
        return self._note("joints", name, self._fresh(name, "joint", suffixes))

    def symbol(self, name: str) -> str:
        """The name of a parameter or an input."""
        return self._note("inputs", name, self._fresh(name, "symbol", ("",)))

    def made(self, name: str) -> str:
        """The name of an element that the file does not name, told apart from others without a word about it."""
        return self._fresh(name, "link", ("",))

    def _note(self, section: str, name: str, given: str) -> str:
        if given != name:
            self.renamed.setdefault(section, {})[name] = given
        return given

    def _fresh(self, name: str, kind: str, suffixes: Sequence[str]) -> str:
        base = clean_name(name, kind)
        base = base[: LONGEST - 12]  # room for a number and _ddot
        count = 1
        while True:
            given = base if count == 1 else f"{base}_{count}"
            symbols = [] if kind == "link" else [given + suffix for suffix in suffixes]
            rates = [s + rate for s in symbols for rate in (RATES if kind == "joint" else ("",))]
            if given not in self.taken[kind] and not self.taken["symbol"].intersection(rates):
                self.taken[kind].add(given)
                self.taken["symbol"].update(rates)
                return given
            count += 1


def clean_model_name(name: str) -> str:
    """The name of a model as near to a robot's as can be."""
    result = clean_name(name, "robot")[:LONGEST]
    return f"{result[: LONGEST - 6]}_model" if fault_of_model_name(result) else result
