"""The text of a model file -> plain values, with the line of every dotted path.

Only what a model file needs is read: mappings with plain keys, sequences and scalars of YAML 1.2.  Anchors, aliases,
tags and duplicate keys are refused; size, depth and number of nodes are bounded.
"""

from __future__ import annotations

import re
from typing import Any

from ..base.texts import WHOLE, join_surrogates, lone_surrogate, visible
from ..errors import ModelError, Problem

SIZE = 1_000_000  #: bytes of a file
DEPTH = 12  #: nesting
NODES = 100_000  #: scalars, sequences and mappings
DAMAGED = "EG-FILE-DAMAGED"

_INT = re.compile(r"[-+]?[0-9]+\Z", re.ASCII)
_BASED = re.compile(r"0o[0-7]+\Z|0x[0-9a-fA-F]+\Z", re.ASCII)
_FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?\Z", re.ASCII)
_SPECIAL = {
    **dict.fromkeys(("", "~", "null", "Null", "NULL"), None),
    **dict.fromkeys(("true", "True", "TRUE"), True),
    **dict.fromkeys(("false", "False", "FALSE"), False),
    **{sign + word: float(sign + "inf") for sign in ("", "+", "-") for word in (".inf", ".Inf", ".INF")},
    **dict.fromkeys((".nan", ".NaN", ".NAN"), float("nan")),
}


def scalar(text: str) -> Any:
    """The value of a plain scalar by YAML 1.2's core schema."""
    if text in _SPECIAL:
        return _SPECIAL[text]
    if _INT.match(text) and len(text) <= 40:
        return int(text)
    if _FLOAT.match(text):
        return float(text)
    if _BASED.match(text) and len(text) <= 40:
        return int(text, 0)
    return text


class Document:
    """A model file as plain values.

    Attributes
    ----------
    value : object
        Mappings, lists and scalars.
    lines : dict of str to (str, int)
        File and line of each dotted path; the empty path is the file itself.
    problems : list of Problem
        Anchors, tags, duplicate keys and other things a model file does not have.
    """

    def __init__(self, text: str, file: str) -> None:
        self.file = file
        self.lines: dict[str, tuple[str, int]] = {"": (file, 1)}
        self.problems: list[Problem] = []
        self.count = 0
        self.value = self._read(text)

    def _stop(self, line: int, message: str, remedy: str = "", path: str = "", code: str = DAMAGED) -> ModelError:
        """An error after which reading on makes no sense."""
        problem = Problem(path or "file", message, remedy, self.file, line, code)
        return ModelError([*self.problems, problem])

    def _note(self, path: str, line: int, message: str, remedy: str) -> None:
        self.problems.append(Problem(path, message, remedy, self.file, line, DAMAGED))

    def _read(self, text: str) -> Any:
        from ruamel.yaml import YAML
        from ruamel.yaml.error import MarkedYAMLError, YAMLError

        if len(text) > SIZE:
            raise self._stop(1, f"the file has {len(text)} characters", f"at most {SIZE}", code="EG-TOO-LARGE")
        reader = YAML(typ="safe", pure=True)
        try:
            self._events = iter(reader.parse(text))
            documents = self._documents()
        except MarkedYAMLError as error:
            mark = error.problem_mark or error.context_mark
            what = " ".join(part for part in (error.context, error.problem) if part)
            raise self._stop(
                mark.line + 1 if mark else 1, f"not YAML: {what}", "check indents, colons and brackets"
            ) from None
        except (YAMLError, RecursionError, ValueError) as error:
            what = str(getattr(error, "reason", "") or error).split("\n")[0]
            raise self._stop(_line_of(error, text), f"not YAML: {what}") from None
        if not documents:
            raise self._stop(1, "the file is empty", "write a name, bodies and joints, or a name and a lagrangian")
        return documents[0]

    def _documents(self) -> list[Any]:
        documents: list[Any] = []
        for event in self._events:
            kind = type(event).__name__
            if kind in ("ScalarEvent", "SequenceStartEvent", "MappingStartEvent", "AliasEvent"):
                if documents:
                    raise self._stop(
                        event.start_mark.line + 1, "a second YAML document begins here", "write one model per file"
                    )
                documents.append(self._value(event, "", 0))
        return documents

    def _value(self, event: Any, path: str, depth: int) -> Any:
        kind, line = type(event).__name__, event.start_mark.line + 1
        self.count += 1
        if self.count > NODES:
            raise self._stop(line, "the file has too many values", f"at most {NODES}", path, "EG-TOO-LARGE")
        if depth > DEPTH:
            raise self._stop(line, "nested too deeply", f"at most {DEPTH} levels", path, "EG-TOO-LARGE")
        if kind == "AliasEvent":
            self._note(
                path or "file", line, f"the alias *{event.anchor}", "aliases are not supported: write the value itself"
            )
            return None
        if event.anchor is not None:
            self._note(path or "file", line, f"the anchor &{event.anchor}", "anchors are not supported: leave it out")
        if event.ctag is not None:
            self._note(path or "file", line, f"the tag {event.ctag}", "tags are not supported: leave it out")
        if kind == "ScalarEvent":
            text = self._whole(path, line, event.value)
            plain = event.style is None or event.style == ""
            return scalar(text) if plain else text
        if kind == "SequenceStartEvent":
            return self._sequence(path, depth)
        return self._mapping(path, depth)

    def _whole(self, path: str, line: int, text: str) -> str:
        """The text with its pairs of surrogates, as JSON escapes them, as characters; half a pair is a fault."""
        half = lone_surrogate(text)
        if half:
            self._note(path or "file", line, f"contains {half}, which is half of a character pair", WHOLE)
            return visible(text)
        return join_surrogates(text)

    def _sequence(self, path: str, depth: int) -> list[Any]:
        result: list[Any] = []
        for event in self._events:
            if type(event).__name__ == "SequenceEndEvent":
                break
            inner = f"{path}[{len(result)}]"
            self.lines[inner] = (self.file, event.start_mark.line + 1)
            result.append(self._value(event, inner, depth + 1))
        return result

    def _mapping(self, path: str, depth: int) -> dict[str, Any]:
        result: dict[str, Any] = {}
        for event in self._events:
            if type(event).__name__ == "MappingEndEvent":
                break
            line = event.start_mark.line + 1
            if type(event).__name__ != "ScalarEvent":
                self._note(path or "file", line, "a key is not a name", "keys must be plain names")
                self._value(event, path, depth + 1)
                self._value(next(self._events), f"{path}.?", depth + 1)
                continue
            key = self._whole(path, line, str(event.value))
            inner = f"{path}.{key}" if path else key
            if event.anchor is not None or event.ctag is not None:
                self._note(inner, line, "a key has an anchor or a tag", "keys must be plain names")
            repeated = key in result
            if repeated:
                first = self.lines[inner][1]
                self._note(inner, line, f"is given twice, first in line {first}", "remove or rename one of them")
            else:
                self.lines[inner] = (self.file, line)
            value = self._value(next(self._events), f"{inner} (again)" if repeated else inner, depth + 1)
            if not repeated:
                result[key] = value
        return result


def _line_of(error: BaseException, text: str) -> int:
    position = getattr(error, "position", None)
    return text.count("\n", 0, position) + 1 if isinstance(position, int) else 1
