"""Stage describe, names of SymPy's symbols and functions of time -> names that a model may use, LaTeX kept."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import suppress
from typing import Any
from unicodedata import normalize

from ..base.latex import GREEK, NotationError, read_latex
from ..base.notation import split_rate
from ..graph.shown import parts_of
from .description import Description, items
from .names import fault_of_name, unique
from .scope import RATES
from .sympy_face import is_sympy, one_or_several

_WORDS = {sign: word for word, sign in GREEK.items()}


class SympyNames:
    """What SymPy's names are called in a model; only those that it cannot use are changed.

    Parameters
    ----------
    given : nested lists and mappings
        Everything in which names stand.
    coordinates : sequence
        Where they are functions, their argument is the time, whatever it is called.
    """

    def __init__(self, given: Any, coordinates: Any) -> None:
        import sympy
        from sympy.core.function import AppliedUndef

        found: dict[Any, str] = {}
        listed = [x for x in one_or_several(coordinates) if isinstance(x, AppliedUndef) and len(x.args) == 1]
        time = sympy.Symbol("t")
        clock = next((x.args[0] for x in listed if isinstance(x.args[0], sympy.Symbol) and x.args[0].name != "t"), time)
        self.replaced: dict[Any, Any] = {} if clock == time else {clock: time}
        for expression in _expressions(given):
            for part in parts_of(expression):
                if isinstance(part, sympy.Symbol) and part.name != clock.name:
                    found[part] = part.name
                elif isinstance(part, AppliedUndef) and [getattr(x, "name", "") for x in part.args] == [clock.name]:
                    found[part] = part.func.__name__
        self.renamed: dict[str, str] = {}
        taken = {name + rate for name in found.values() if not fault_of_name(name, symbol=True) for rate in RATES}
        for name in sorted(set(found.values())):
            if fault_of_name(name, symbol=True):
                stem = split_rate(name)[0]
                self.renamed[stem] = self.renamed.get(stem) or unique(_plain(stem), "symbol", taken, RATES)
        for part, name in found.items():
            if (new := self.name(name)) != name:
                if isinstance(part, sympy.Symbol):
                    self.replaced[part] = sympy.Symbol(new, **part.assumptions0)
                else:
                    self.replaced[part] = sympy.Function(new)(time)

    def name(self, name: str) -> str:
        """The name in the model; of a rate by that of its coordinate."""
        stem = name if name in self.renamed else split_rate(name)[0]
        return self.renamed[stem] + name[len(stem) :] if stem in self.renamed else name

    def put(self, value: Any) -> Any:
        """A value with the names of the model; texts are left as they are, unless they are keys."""
        if not self.replaced:
            return value
        if isinstance(value, Mapping):
            keys = (self.name(key) if isinstance(key, str) else self.put(key) for key in value)
            return dict(zip(keys, map(self.put, value.values()), strict=True))
        if hasattr(value, "xreplace"):  # SymPy's matrices too, which keep their shape
            return value.xreplace(self.replaced)
        listed = items(value)
        return value if listed is None else [self.put(part) for part in listed]

    def latex(self, given: Any = None) -> Any:
        """The LaTeX of names: as it is given, else what the names were in SymPy where that is LaTeX."""
        own: dict[str, str] = {}
        for old, new in self.renamed.items():
            text = "".join(f"\\{_WORDS[c]} " if c in _WORDS else c for c in normalize("NFKC", old)).strip()
            with suppress(NotationError):
                if text.startswith("\\"):
                    read_latex(text)
                    own[new] = text
        return own | self.put(dict(given or {})) if own else self.put(given)

    def noted(self, description: Description) -> Description:
        """The description with a note of what was renamed."""
        places, given = ("outputs", "parameters", "inputs"), description.values.get("equations", {})
        homes = {entry.name: place for place in places for entry in description.sections[place]}
        for name in (*given.get("coordinates", ()), *given.get("velocities", ())):  # which outputs may repeat
            homes.pop(name, None)
        renamed: dict[str, dict[str, str]] = {}
        for old, new in self.renamed.items():
            renamed.setdefault(homes.get(new, "coordinates"), {})[old] = new
        description.note_renamed(renamed)
        return description


def _expressions(given: Any) -> Iterator[Any]:
    """All SymPy expressions in lists, matrices, and keys and values of mappings."""
    if is_sympy(given):
        yield given
    elif isinstance(given, Mapping):
        for part in (*given, *given.values()):
            yield from _expressions(part)
    else:
        for part in items(given) or ():
            yield from _expressions(part)


def _plain(name: str) -> str:
    """Letters like ``theta_1`` of ``\\theta_{1}``."""
    words = "".join(_WORDS.get(c, c) for c in normalize("NFKC", name)).replace("_{", "_")
    return words.translate({ord(c): None for c in "\\{}$"}).strip()
