"""The exceptions of eomgen; generated packages carry a copy of this file.

::

    EomgenError
    |- ModelError            the description is wrong; .problems lists every fault found
    |  '- ParameterError            values given to parameters are not allowed; a UsageError too
    |- ExpressionError       a text is not an allowed expression; .column says where
    |- AssemblyError         the loops do not close at the given coordinates, or the given values contradict each other
    |- EvaluationError       a kernel could not be evaluated; .time and .state say where
    |  |- SingularMassMatrixError   a combination of coordinates has no inertia behind it
    |  |- ProjectionError           the state could not be brought onto the constraints
    |  |- PartitionError            the chosen independent coordinates cannot move the mechanism here
    |  |- UnsolvedError             rounding leaves the linear system of a method unsolved
    |  '- NonFiniteError            a result is not a finite number
    |- EquilibriumError      no equilibrium was found from the guess; .forces says what is left
    |- SimulationError       the integration ended early; its __cause__ is the last failure of a kernel
    |  |- ZenoError                 events that reset the state follow each other ever faster
    |  '- NoDerivativeError         a run has no derivative: an event grazes its surface, or two happen at once
    |- ToolchainError        no compiler, or the compiler failed; .command and .output say what it said
    |- MissingDependencyError       an optional package is needed; the message says what to install
    '- UsageError            a call with names or shapes that do not fit the model
       '- UnavailableError          an attribute that there is not; hasattr says so too

    KeyboardInterrupt
    '- SimulationInterrupted Ctrl-C during a run; .trajectory has what there was
"""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

from .base.texts import shortened, visible

#: What kinds of faults there are: the ``code`` of every error and problem, which stays as it is when texts change.
CODES = {
    "EG-USAGE": "A call or a command line has the wrong form.",
    "EG-UNSUPPORTED": "The model, the method or the target does not support this.",
    "EG-NAME-UNKNOWN": "A name is unknown.",
    "EG-NAME-TAKEN": "A name is already used, or reserved.",
    "EG-NAME-FORM": "A text cannot be a name.",
    "EG-TYPE": "A value has the wrong type.",
    "EG-SHAPE": "An array, a list or a table has the wrong number of entries.",
    "EG-NUMBER": "A value is not a finite number.",
    "EG-RANGE": "A value is outside the allowed range.",
    "EG-CHOICE": "A word is not one of the choices.",
    "EG-MISSING": "Something required is missing.",
    "EG-CONFLICT": "Arguments or keys contradict each other.",
    "EG-REFERENCE": "A name refers to something of the wrong kind.",
    "EG-CIRCLE": "Something contains itself, or depends on itself.",
    "EG-TOO-LARGE": "Something is larger, longer or deeper than allowed.",
    "EG-ENDLESS": "A run would take too many steps to end.",
    "EG-FILE": "A file or folder cannot be read or written, or has an unknown type.",
    "EG-FILE-DAMAGED": "A file is damaged, or its content does not match its type.",
    "EG-REFUSED": "Something that could do harm needs permission.",
    "EG-UNIT": "A unit is unknown, or cannot be used there.",
    "EG-DIMENSION": "The dimensions of quantities do not agree.",
    "EG-NOTATION": "A text is not the LaTeX of a symbol.",
    "EG-EXPRESSION": "A text is not an expression, or not of the required form.",
    "EG-TOPOLOGY": "The joints do not connect the bodies correctly.",
    "EG-UNDEFINED": "An angle, a direction or a length is not defined by its end points.",
    "EG-LOOP-OPEN": "The loops do not close from the guess.",
    "EG-CONTRADICTION": "Values contradict each other, or the constraints.",
    "EG-REDUNDANT": "A constraint or a driver has no effect, or repeats others.",
    "EG-UNDETERMINED": "The values do not determine the result.",
    "EG-PARTITION": "The chosen coordinates are not independent.",
    "EG-INERTIA": "No body can have this inertia.",
    "EG-NO-INERTIA": "A motion has no inertia.",
    "EG-SINGULAR": "The mass matrix is singular at a state.",
    "EG-PROJECTION": "A state could not be brought onto the constraints.",
    "EG-UNSOLVED": "Rounding leaves a linear system unsolved.",
    "EG-NOT-FINITE": "A result is not a finite number.",
    "EG-EVALUATION": "A kernel could not be evaluated for another reason.",
    "EG-JUMP": "A value jumps where it must be smooth.",
    "EG-EVENT": "An event, a gap or a switch cannot be used this way.",
    "EG-STALLED": "The integration ended early.",
    "EG-ZENO": "Events follow each other ever faster.",
    "EG-NO-DERIVATIVE": "A run has no derivative by its parameters.",
    "EG-NO-EQUILIBRIUM": "No equilibrium was found from the guess.",
    "EG-INTERRUPTED": "Ctrl-C stopped a run.",
    "EG-CACHE": "The cache of compiled code cannot be used.",
    "EG-COMPILER-MISSING": "A compiler, or something that it needs, is missing.",
    "EG-COMPILER-FAILED": "A compiler failed.",
    "EG-PACKAGE-MISSING": "An optional package is needed.",
    "EG-UNAVAILABLE": "An attribute or a call does not exist for this model.",
}
#: Characters of each part of a problem that are shown: names and expressions may be as long as the file.
LONGEST_PART = 2000
#: What to do where a value is not finite.
TO_BE_FINITE = "look for a division by zero, or a root or logarithm of a negative number"
#: Files that users do not write: installed packages and eomgen's own.
_INSTALLED = re.compile(
    rf"[/\\](site|dist)-packages[/\\]|^{re.escape(os.path.dirname(os.path.abspath(__file__)))}[/\\]|^<frozen"
)
#: How the names of modules begin whose calls are no user's own: those of the package and of what calls it.
_WITHIN = (__name__.rpartition("errors")[0], "numpy.", "scipy.", "functools.")


def calls_within(known: int = 0) -> int:
    """How many calls, this one's caller first, lie within the package, or in what calls it for the package.

    A warning's ``stacklevel`` is one more.  The first ``known`` of them need no look.
    """
    frame: Any = sys._getframe(known + 1)
    calls = known
    while frame is not None and f"{frame.f_globals.get('__name__')}.".startswith(_WITHIN):
        frame, calls = frame.f_back, calls + 1
    return calls


def calling_line() -> tuple[str, int]:
    """File and line of the nearest call that does not lie within the package; none if a thread begins within it."""
    try:
        frame = sys._getframe(calls_within(3))  # this one, the one that keeps the line, and the builder's method
    except ValueError:
        return "", 0
    return frame.f_code.co_filename, frame.f_lineno


def _cell(file: str) -> str:
    """``Cell In[3]`` of a file that is a cell of a notebook; else empty."""
    shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    naming = getattr(getattr(shell, "compile", None), "format_code_name", lambda _: None)
    return " ".join(naming(file) or ())


class EomgenError(Exception):
    """Base of every error eomgen raises on purpose; what does not print in a message is shown as its number.

    Attributes
    ----------
    code : str
        What kind of fault it is: a stable word such as ``EG-SHAPE``, one of ``eomgen.errors.CODES``.
    """

    code: str = ""

    def __init_subclass__(cls, code: str = "", **more: Any) -> None:
        super().__init_subclass__(**more)
        cls.code = code or cls.code

    def __init__(self, *args: object, code: str = "", **more: Any) -> None:
        super().__init__(*args, **more)
        self.code = code or self.code

    def __str__(self) -> str:
        return visible(super().__str__())

    def _render_traceback_(self) -> list[str]:
        """What IPython shows: the lines of the user's own code that led here, not those of eomgen and NumPy.

        ``%xmode Verbose`` shows all of them.
        """
        import traceback

        shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
        if getattr(getattr(shell, "InteractiveTB", None), "mode", "") == "Verbose":
            return "".join(traceback.format_exception(self)).splitlines()
        lines = []
        for one in traceback.extract_tb(self.__traceback__):
            if not _INSTALLED.search(one.filename):
                place = _cell(one.filename) or f'File "{one.filename}"'
                lines += [f"  {place}, line {one.lineno}, in {one.name}", f"    {one.line}"]
        head = "Traceback of your own lines (%xmode Verbose, then %tb, shows all):"
        return [*([head, *lines] if lines else []), f"{type(self).__name__}: {self}"]


class Problem(NamedTuple):
    """One fault of a model: where it is, what is wrong, and what is allowed or to be done."""

    path: str  #: dotted place, e.g. ``joints.A.axis``
    message: str  #: what is wrong
    remedy: str = ""  #: what is allowed, or what to do
    file: str = ""  #: model file, or the file of the Python call
    line: int = 0  #: 1-based line in that file, 0 if none
    code: str = ""  #: the kind of fault

    def __str__(self) -> str:
        place = f"{_cell(self.file) or self.file}:{self.line}: " if self.file else ""
        path, message, remedy = (shortened(part, LONGEST_PART) for part in (self.path, self.message, self.remedy))
        return visible(f"{place}{path}: {message}{f'; {remedy}' if remedy else ''}", lines=False)


class ModelError(EomgenError):
    """The description of a model is wrong.

    Attributes
    ----------
    problems : tuple of Problem
        Every fault found, in the order of the description; the ``code`` is that of the first.
    """

    def __init__(self, problems: Sequence[Problem]) -> None:
        self.problems = tuple(problems)
        super().__init__("\n".join(map(str, self.problems)), code=self.problems[0].code if self.problems else "")


class ExpressionError(EomgenError, ValueError, code="EG-EXPRESSION"):
    """A text is not an expression that a model may use.

    Attributes
    ----------
    message : str
        What is wrong.
    column : int
        1-based place in the text, 0 if none.
    remedy : str
        What is allowed.
    text : str
        The whole expression.
    """

    def __init__(self, message: str, column: int = 0, remedy: str = "", text: str = "", code: str = "") -> None:
        self.message, self.column, self.remedy, self.text = message, column, remedy, text
        tail = f"; {remedy}" if remedy else ""
        super().__init__(f"{self.place()}{tail}", code=code)

    def place(self) -> str:
        """The message with the column and the expression (shortened)."""
        text = self.text if len(self.text) <= 60 else self.text[:57] + "..."
        return f"{self.message} in column {self.column} of {text!r}" if self.column else self.message


class AssemblyError(EomgenError, code="EG-LOOP-OPEN"):
    """The loops do not close from the given guess, or given values contradict each other.

    Attributes
    ----------
    rows : tuple of str
        Labels of the constraint rows that stay open the most, such as ``C.r_x`` of joint C.
    """

    def __init__(self, message: str, rows: Sequence[str] = (), code: str = "") -> None:
        super().__init__(message, code=code)
        self.rows = tuple(rows)


class UsageError(EomgenError, ValueError, code="EG-USAGE"):
    """A call names something the model does not have, or passes an array of the wrong shape."""


class ParameterError(ModelError, UsageError):
    """Values given to the parameters of a module, such as a negative radius, that its elements do not allow.

    It is a :class:`ModelError`, as a model that declares these values is, and a :class:`UsageError`, as it ends a call.

    Attributes
    ----------
    problems : tuple of Problem
        Every fault found, at the place of the element in the model.
    """


class UnavailableError(UsageError, AttributeError, code="EG-UNAVAILABLE"):
    """An attribute that there is not, or that a module of this method or kind does not have, such as ``canonical``.

    It is an AttributeError too, so that ``hasattr``, ``inspect`` and the completion of notebooks pass over it.
    """


class EvaluationError(EomgenError, code="EG-EVALUATION"):
    """A kernel failed at a state; a recoverable failure, so integrators see NaN and shorten their step."""

    def __init__(self, message: str, time: float | None = None, state: object = None, code: str = "") -> None:
        super().__init__(message, code=code)
        self.time = time
        self.state = state


class SingularMassMatrixError(EvaluationError, code="EG-SINGULAR"):
    """The mass matrix of the degrees of freedom is not positive definite."""


class ProjectionError(EvaluationError, code="EG-PROJECTION"):
    """Newton's iteration onto the constraint manifold did not converge."""


class PartitionError(EvaluationError, code="EG-PARTITION"):
    """The chosen independent coordinates are not independent at this configuration."""


class UnsolvedError(EvaluationError, code="EG-UNSOLVED"):
    """Rounding leaves the linear system of a method unsolved: its accelerations would be wrong."""


class NonFiniteError(EvaluationError, code="EG-NOT-FINITE"):
    """A result is NaN or infinite."""


class EquilibriumError(EomgenError, code="EG-NO-EQUILIBRIUM"):
    """No equilibrium was found from the guess.

    Attributes
    ----------
    forces : dict of str to float
        What is left: the generalized force (N, N m) along each independent coordinate.
    """

    def __init__(self, message: str, forces: Mapping[str, float] | None = None) -> None:
        super().__init__(message)
        self.forces = dict(forces or {})


class SimulationError(EomgenError, code="EG-STALLED"):
    """The integration could not be finished."""


class ZenoError(SimulationError, code="EG-ZENO"):
    """Events that reset the state follow each other ever faster, or a reset leads nowhere."""


class NoDerivativeError(SimulationError, code="EG-NO-DERIVATIVE"):
    """A run has no derivative by its parameters: an event grazes its surface, or two happen at once."""


class SimulationInterrupted(KeyboardInterrupt):
    """Ctrl-C came during a run.

    Like every KeyboardInterrupt it is no Exception, so no ``except Exception`` takes it for a failure.

    Attributes
    ----------
    trajectory : Trajectory
        The run up to there, made when it is requested.
    """

    code = "EG-INTERRUPTED"

    def __init__(self, message: str, complete: Callable[[], Any]) -> None:
        super().__init__(message)
        self._complete = complete

    @property
    def trajectory(self) -> Any:
        """The run up to the interrupt."""
        return self._complete()


class ToolchainError(EomgenError, code="EG-COMPILER-FAILED"):
    """A compiler is missing or failed.

    Attributes
    ----------
    command : str
        The command line that was run, empty when no compiler was found.
    output : str
        What the compiler printed.
    """

    def __init__(self, message: str, command: str = "", output: str = "", code: str = "") -> None:
        super().__init__(message, code=code)
        self.command = command
        self.output = output


class MissingDependencyError(EomgenError, ImportError, code="EG-PACKAGE-MISSING"):
    """An optional package is needed for this call."""


# errors of the codes that calls meet most
cannot = partial(UsageError, code="EG-UNSUPPORTED")
no_such = partial(UsageError, code="EG-NAME-UNKNOWN")
ill_typed = partial(UsageError, code="EG-TYPE")
ill_shaped = partial(UsageError, code="EG-SHAPE")
ill_placed = partial(UsageError, code="EG-REFERENCE")
ill_chosen = partial(UsageError, code="EG-PARTITION")
no_number = partial(UsageError, code="EG-NUMBER")
not_finite = partial(UsageError, code="EG-NOT-FINITE")
off_range = partial(UsageError, code="EG-RANGE")
no_choice = partial(UsageError, code="EG-CHOICE")
incomplete = partial(UsageError, code="EG-MISSING")
at_odds = partial(UsageError, code="EG-CONFLICT")
untrue = partial(UsageError, code="EG-CONTRADICTION")
too_large = partial(UsageError, code="EG-TOO-LARGE")
bad_file = partial(UsageError, code="EG-FILE")
bad_data = partial(UsageError, code="EG-FILE-DAMAGED")
bad_cache = partial(ToolchainError, code="EG-CACHE")

#: What a kernel's status code means; 0 is success, positive codes are recoverable (the C header has the same table).
STATUS: dict[int, type[EvaluationError]] = {
    1: NonFiniteError,
    2: SingularMassMatrixError,
    3: ProjectionError,
    4: PartitionError,
    5: UnsolvedError,
}
