"""What several verbs accept -> checked values: numbers, names, files, and a model with how to derive and compile it.

An option is an argument of a verb, or of a group of options such as :class:`Source`, whose annotation has a text:
``end: Annotated[float, "T: End time in s."]``, what to write for its value and its help.
"""

from __future__ import annotations

import functools
import os
import re
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from inspect import Parameter, signature
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, NamedTuple, get_args, get_origin, get_type_hints

import click

from ..base.files import example_files, kind_of, refuse_link
from ..base.results import Result, ResultTable
from ..base.texts import closest, place_of_marker
from ..errors import ModelError, UsageError, at_odds, bad_file, ill_chosen, ill_typed, no_number, off_range
from ..runtime.argument_checks import check_names
from ..toolchain.targets import TARGETS
from .output import name_options, reports_failures, say, show, stage

if TYPE_CHECKING:
    from ..api.equations import Equations
    from ..api.model import Model
    from ..module import Module

# -- numbers -----------------------------------------------------------------------------------------------------------


def _number(value: Any) -> Any:
    """A number of a text, such as ``2*pi`` or ``deg(30)``, as in a model file."""
    try:
        return parse_number(value) if isinstance(value, str) else value
    except UsageError as error:
        raise click.BadParameter(str(error)) from None


class Number(click.types.FloatParamType):
    """Any number."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        return super().convert(_number(value), param, ctx)


class NumberRange(click.FloatRange):
    """A number within bounds."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        return super().convert(_number(value), param, ctx)


def parse_settings(settings: Sequence[str], option: str = "--set", example: str = "r=0.12") -> dict[str, float]:
    """``name=value`` words as numbers; a value may be an expression of numbers such as ``pi/3``.

    Errors name the option that has them, and an example of a word that it takes.
    """
    return dict(_parse_setting(word, option, example) for word in settings)


def _parse_setting(word: str, option: str = "--set", example: str = "r=0.12") -> tuple[str, float]:
    name, equals, text = (part.strip() for part in word.partition("="))
    if not equals or not name or not text:
        raise ill_typed(f"{option} {word}: write name=value, for example {option} {example}")
    try:
        return name, parse_number(text)
    except UsageError as error:
        raise no_number(f"{option} {word}: {error}") from None


def parse_number(text: str) -> float:
    """A number, or an expression of numbers such as ``pi/3``."""
    try:
        return float(text)
    except ValueError:
        pass
    from ..errors import ExpressionError
    from ..expr.core import Graph
    from ..model.expressions import parse

    def resolve(unknown: str) -> Any:
        raise ExpressionError(f"{unknown!r} is not a number", 1, "only numbers and pi are allowed here", text)

    try:
        value = parse(text, Graph(), resolve).value
    except ExpressionError as error:
        raise no_number(f"{error.message}; {error.remedy}") from None
    if value is None:
        raise no_number("the value is not a number")
    return value


MOST_POINTS = 10_000_000  #: of a range


class Span(NamedTuple):
    """A range of values of a name."""

    name: str
    low: float
    high: float
    points: int | None


def parse_spans(option: str, texts: Sequence[str], form: str, example: str) -> list[Span]:
    """Ranges ``NAME=LOW:HIGH``, with a count where the form has one; ``[:COUNT]`` may be left out; each name once."""
    spans = [_parse_span(option, word, form, example) for word in texts]
    names = [span.name for span in spans]
    if len(set(names)) < len(names):
        raise at_odds(f"{option}: {', '.join(names)}: give each name once")
    return spans


def _parse_span(option: str, word: str, form: str, example: str) -> Span:
    name, equals, text = word.partition("=")
    parts, most = text.split(":"), form.count(":") + 1
    if not equals or not name.strip() or len(parts) not in (most, most - form.count("[")):
        raise ill_typed(f"{option} {word}: write {form}, for example {example}")
    try:
        low, high = (parse_number(part) for part in parts[:2])
    except UsageError as error:
        remedy = "" if "[" in form else f"write {form} with two numbers; "
        raise no_number(f"{option} {word}: {remedy}{error}") from None
    count = parts[2].strip() if len(parts) == 3 else None
    if count is not None and not (count.isdecimal() and 1 <= int(count) <= MOST_POINTS):
        raise off_range(f"{option} {word}: the count must be a whole number from 1 to {MOST_POINTS}, not {count!r}")
    return Span(name.strip(), low, high, None if count is None else int(count))


# -- names and files ---------------------------------------------------------------------------------------------------


def split_names(ctx: click.Context, param: click.Parameter, value: tuple[str, ...]) -> tuple[str, ...]:
    """Names that are given one by one or separated by commas."""
    return tuple(name.strip() for text in value for name in text.split(",") if name.strip())


def require_folder(option: str, file: Path | None, exists: bool = False) -> None:
    """Fail before the work if a file cannot be written where it is requested; makes nothing.

    Its folder is made when it is written, unless it has to exist.
    """
    if file is None:
        return
    refuse_link(file)
    if file.is_dir():
        raise bad_file(f"{option} {file}: this is a folder; name a file in it")
    above = file.absolute().parents
    folder = next(parent for parent in above if parent.exists())
    if folder == Path(file.absolute().anchor) != above[0]:  # rather a slip than a wish for a new folder there
        raise bad_file(f"{option} {file}: there is no folder {above[-2]}")
    if not folder.is_dir():
        raise bad_file(f"{option} {file}: {folder} is a file, not a folder")
    if not os.access(folder, os.W_OK | os.X_OK):
        raise bad_file(f"{option} {file}: the folder {folder} cannot be written")
    if exists and folder != above[0]:
        raise bad_file(f"{option} {file}: there is no folder {above[0]}; make it, or name another one")


def _pair(ctx: click.Context, param: click.Parameter, value: str | None) -> tuple[float, float] | None:
    if value is None:
        return None
    try:
        alpha, beta = (float(word) for word in value.split(","))
    except ValueError:
        raise click.BadParameter(f"{value!r} is not two numbers ALPHA,BETA") from None
    return alpha, beta


def _find_solver(ctx: click.Context, param: click.Parameter, value: str | None) -> str | None:
    """The integrator of a name, in whatever letters, before the work begins."""
    if value is None:
        return None
    from ..model.fields import SOLVERS

    for solver in SOLVERS:
        if solver.lower() == value.lower():
            return solver
    raise click.BadParameter(f"no integrator {value!r}; there are {', '.join(SOLVERS)} (derivation: --method)")


# -- options -----------------------------------------------------------------------------------------------------------

# What an annotation says beside its type: a type of click, or a call that converts the value. A text makes an option.
Positive = Annotated[float, NumberRange(min=0, min_open=True)]
Count = Annotated[int, click.IntRange(min=1)]
Seed = Annotated[int, click.IntRange(min=0)]
Texts = tuple[str, ...]
Names = Annotated[Texts, split_names]
TYPES = {float: Number(), Path: click.Path(path_type=Path), int: click.INT}
Time = Annotated[float, "T: Time in s."]
End = Annotated[Positive | None, "T: End time in s."]

OPTIONS = "Options"
DERIVATION = "Derivation and compilation"
#: Sections of the help of a verb: its own options, and those that many verbs share.
SECTIONS = (OPTIONS, DERIVATION, "Integration", "Robot files (URDF, MJCF)")
#: Names of the options at the end of the verb's own.
LAST = ("--json", "--help")
#: Options that are not called as their arguments.
NAMES = {"settings": "--set", "ranges": "--range", "t": "--time", "form": "--format", "every": "--all"}
NAMES |= {"as_json": "--json"}


class Option(click.Option):
    """The option of an argument, in a section of ``--help``; the text of its annotation may begin with ``METAVAR:``."""

    def __init__(self, argument: str, hint: Any, default: Any, section: str = OPTIONS) -> None:
        self.section = section
        metavar, about = re.fullmatch("(?:([A-Z][A-Z=:|,[\\] ]*): )?(.*)", text_of(hint)).groups()  # type: ignore[union-attr]
        attributes: dict[str, Any] = {"metavar": metavar, "help": about}
        if default is Parameter.empty:
            attributes["required"] = True
        elif default is not None and default is not False and default != ():
            attributes |= {"default": default, "show_default": True}
        notes: list[Any] = []
        while get_origin(hint) is Annotated or type(None) in get_args(hint):
            hint, *more = get_args(hint)
            notes += more
        attributes["type"] = click.Choice(get_args(hint)) if get_origin(hint) is Literal else TYPES.get(hint)
        for note in notes:
            if callable(note) and note is not type(None):  # click's types are, too
                attributes["type" if isinstance(note, click.ParamType) else "callback"] = note
        if hint is bool:
            attributes["is_flag"] = True
        elif get_origin(hint) is tuple:
            attributes |= {"multiple": True} if ... in get_args(hint) else {"nargs": len(get_args(hint))}
        super().__init__([NAMES.get(argument) or f"--{argument.replace('_', '-')}", argument], **attributes)


def text_of(hint: Any) -> str:
    """The text of an option's annotation, empty of other arguments."""
    return next((note for note in getattr(hint, "__metadata__", ()) if isinstance(note, str)), "")


@functools.cache
def arguments(kind: Any) -> dict[str, tuple[Any, Any]]:
    """Annotation and default of each argument of a function, or of a group of options."""
    hints = get_type_hints(kind, include_extras=True)
    return {one.name: (hints[one.name], one.default) for one in signature(kind).parameters.values()}


def options_of(kind: Any, wanted: Sequence[str]) -> Iterator[Option]:
    """The options of a function and of its groups, which are classes with a section; of :class:`Source` the wanted."""
    section = getattr(kind, "SECTION", OPTIONS)
    shared_last = sorted(arguments(kind).items(), key=lambda one: hasattr(one[1][0], "SECTION") and one[0] != "source")
    for name, (hint, default) in shared_last:
        group = Source if hint is Prepared else hint
        if kind is Source and name not in wanted:
            continue
        if hasattr(group, "SECTION"):
            yield from options_of(group, wanted)
        elif text_of(hint):
            yield Option(name, hint, default, OPTIONS if name == "settings" else section)


def gather(kind: Any, values: dict[str, Any]) -> Any:
    """A group of options, out of the values of all."""
    groups = {name: gather(hint, values) for name, (hint, _) in arguments(kind).items() if hasattr(hint, "SECTION")}
    return kind(**groups, **{name: values.pop(name) for name in arguments(kind) if name in values})


def chosen(group: Any) -> dict[str, Any]:
    """The options of a group that a command line sets."""
    return {name: x for name, x in vars(group).items() if x not in (None, False, ())}


@dataclass(frozen=True)
class Integration:
    """Options of ``simulate``."""

    SECTION: ClassVar = "Integration"
    solver: Annotated[
        str | None,
        _find_solver,
        "NAME: Integrator: DOP853, RK45, RK23, Radau, Taylor, BDF, LSODA; with --step RK4, moreau (rigid contact).",
    ] = None
    step: Annotated[Positive | None, "H: Step size of RK4 and of moreau in s."] = None
    rtol: Annotated[Positive | None, "X: Relative tolerance of the integrator."] = None
    atol: Annotated[Positive | None, "X: Absolute tolerance of the integrator."] = None

    @property
    def keywords(self) -> dict[str, Any]:
        """The same as arguments of ``simulate``."""
        return {{"solver": "method"}.get(name, name): value for name, value in chosen(self).items()}


@dataclass(frozen=True)
class Robot:
    """Options of robot files."""

    SECTION: ClassVar = "Robot files (URDF, MJCF)"
    floating: Annotated[bool, "The base moves freely (URDF)."] = False
    lock: Annotated[Texts, "JOINT[=VALUE]: Fix a joint at a value (0 by default); repeat it for more."] = ()
    mimic: Annotated[
        Literal["independent", "coupling"] | None,
        "Tie joints that mimic others by a coupling (the default), or leave them independent.",
    ] = None
    rotation: Annotated[
        Literal["euler_angles", "euler_parameters"] | None,
        "Describe free and ball joints by euler_angles or euler_parameters.",
    ] = None
    actuate: Annotated[bool, "Add an input tau_<joint> to every joint of one degree of freedom."] = False
    friction: Annotated[
        Positive | None, "VELOCITY: Let the dry friction of joints act, smoothed below this velocity (rad/s or m/s)."
    ] = None
    symbolic: Annotated[bool, "Make masses and inertias parameters."] = False
    check_inertia: Annotated[
        Literal["error", "note", "off"] | None,
        "Refuse masses and inertias that no body can have and motions without inertia, note them, or accept them.",
    ] = None
    limits: Annotated[
        Literal["note", "stop", "off"] | None,
        "At the limits of joints: a run warns (note), elastic stops act (stop), or nothing happens (off).",
    ] = None
    assets: Annotated[str | None, "DIR: Folder in which other files may be read (MJCF)."] = None


@dataclass(frozen=True)
class Source:
    """A model file, and how it is derived and compiled."""

    SECTION: ClassVar = DERIVATION
    model: Path
    as_json: bool = False
    allow_native: Annotated[
        bool,
        "Compile and run the C (and Python) files that the model's native functions name; only for models you trust.",
    ] = False
    method: Annotated[
        str,
        "M: Method of derivation: auto, embedding, lagrange, recursive, augmented, newton_euler, amalgamated, "
        "gibbs_appell, hamilton (for the integrator see --solver of run).",
    ] = "auto"
    baumgarte: Annotated[
        Any,
        _pair,
        "ALPHA,BETA: With --method augmented: stabilise constraints by C'' + 2 ALPHA C' + BETA^2 C = 0 (1/s) instead "
        "of projecting.",
    ] = None
    independent: Annotated[
        Names,
        "NAME: Independent coordinate of a mechanism with loops; for several repeat it, or separate names by commas.",
    ] = ()
    target: str = "cython"
    settings: Annotated[
        Texts,
        "NAME=VALUE: Value of a parameter, an input, a coordinate or a rate in SI units, or of an output in its "
        "own unit; repeat it for more.",
    ] = ()
    robot: Robot = Robot()

    def load(self) -> Model:
        """The model; what an import of a robot left out is told on stderr."""
        return load_model(self.model, self.allow_native, self.robot)

    def derive(self, method: str | None = None) -> Equations:
        """The equations, where ``--set`` has values for parameters that the model leaves open."""
        settings = parse_settings(self.settings)
        with self.blamed(), stage("derive") as parts:
            model = self.load()
            for entry in model.description.sections["parameters"]:  # others change without compiling anew
                if entry.name in settings and entry.values.get("value") is None:
                    entry.values["value"] = settings[entry.name]
            equations = model.derive(method or self.method, self.independent or None, self.baumgarte)
            parts |= equations.seconds
        return equations

    def compile(self, method: str | None = None) -> Prepared:
        equations = self.derive(method)
        with stage("compile") as parts:
            before = set(equations.seconds)
            module = equations.compile(target=self.target)
            parts |= {part: seconds for part, seconds in equations.seconds.items() if part not in before}
        return Prepared(self, equations, module, *_sort_settings(module, parse_settings(self.settings)))

    @contextmanager
    def blamed(self) -> Iterator[None]:
        """Turn a complaint about ``--independent`` into a UsageError: the model file is not at fault."""
        try:
            yield
        except ModelError as error:
            if self.independent and all(p.path.startswith("independent") for p in error.problems):
                problems = (str(p._replace(file="", path="--independent")) for p in error.problems)
                raise ill_chosen("\n".join(problems)) from None
            raise

    def show(self, values: Any, *parts: Result | ResultTable | str, files: Any = None) -> None:
        show(self.as_json, values, *parts, files=files)


class Prepared(NamedTuple):
    """A compiled model, and the values of ``--set``."""

    source: Source
    equations: Equations
    module: Module
    initial: dict[str, float] | None
    parameters: dict[str, float] | None
    inputs: dict[str, float] | None

    def bound(self) -> Prepared:
        return self._replace(module=self.module.bind(self.parameters, self.inputs))

    def position(self) -> dict[str, float] | None:
        return {name: x for name, x in (self.initial or {}).items() if not name.endswith("_dot")} or None

    def show(self, t: float, *parts: Result | ResultTable | str, values: Any = None, files: Any = None) -> None:
        """Print what an analysis at a time found: its parts, or with --json the values, those of the result if none."""
        if not self.source.as_json:
            show(False, {}, *parts, files=files)
            return
        from ..runtime.identity import origin

        result = parts[0].to_dict() if values is None and isinstance(parts[0], Result) else values
        head = {"name": self.equations.name, "method": self.equations.method, "origin": origin(self.module), "t": t}
        show(True, head | result, files=files)


# -- verbs -------------------------------------------------------------------------------------------------------------


class Verb(click.Command):
    """A command whose help has a section for each kind of options, and which knows other words for them."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        try:
            return super().parse_args(ctx, args)
        except click.NoSuchOption as error:
            names = {opt.lstrip("-"): opt for p in self.get_params(ctx) for opt in p.opts if opt.startswith("--")}
            near = closest(error.option_name.lstrip("-"), names)
            if not near:
                raise
            meant = f"No such option {error.option_name!r}; did you mean {names[near[0]]}?"
            raise click.NoSuchOption(error.option_name, meant, ctx=ctx) from None

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        listed: dict[str, list[tuple[str, str]]] = {section: [] for section in SECTIONS}
        options = [p for p in self.get_params(ctx) if isinstance(p, click.Option)]
        for option in sorted(options, key=lambda p: LAST.index(p.opts[-1]) if p.opts[-1] in LAST else -1):
            record = option.get_help_record(ctx)
            if record is not None:
                listed[getattr(option, "section", OPTIONS)].append(record)
        for section, records in listed.items():
            if records:
                with formatter.section(section):
                    formatter.write_dl(records)


WANTED = ("settings", "allow_native", "method", "independent", "target", "robot")  #: of Source, by most verbs


def verb(
    wanted: Sequence[str] = WANTED, targets: Sequence[str] = ("cython", "numpy")
) -> Callable[[Callable[..., Any]], Callable[[], Verb]]:
    """Make a function a call that gives its verb, whose options are its arguments with a text, and those of its groups.

    An argument of type :class:`Source` is a model file with the ``wanted`` options, one of type :class:`Prepared` the
    same compiled, parameters and inputs bound.  The first of the ``targets`` is the default.
    """

    def decorate(function: Callable[..., Any]) -> Callable[[], Verb]:
        return functools.cache(lambda: make(function))

    def make(function: Callable[..., Any]) -> Verb:
        hints = {name: hint for name, (hint, _) in arguments(function).items()}
        source = bool({Source, Prepared} & {hint for hint in hints.values() if isinstance(hint, type)})

        @functools.wraps(function)
        def call(**values: Any) -> Any:
            groups = {name: hint for name, hint in hints.items() if hint is Prepared or hasattr(hint, "SECTION")}
            chosen = {name: values.pop(name) for name in hints.keys() - groups.keys() if name in values}  # first of all
            for name, hint in groups.items():
                chosen[name] = gather(Source, values).compile().bound() if hint is Prepared else gather(hint, values)
            return function(**chosen)

        params: list[click.Parameter] = list(options_of(function, wanted))
        if source:
            params.insert(0, click.Argument(["model"], metavar="MODEL", type=TYPES[Path]))
        if "target" in (wanted if source else hints):
            about = "; ".join(f"{target}: {TARGETS[target].about}" for target in targets)
            params.append(Option("target", Annotated[Literal[tuple(targets)], f"{about}."], targets[0], DERIVATION))
        params.append(Option("as_json", Annotated[bool, "Print one JSON object."], False))
        return click.command(cls=Verb, params=params)(reports_failures(call))

    return decorate


# -- models ------------------------------------------------------------------------------------------------------------


def _locked(text: tuple[str, ...]) -> dict[str, float]:
    """``joint`` or ``joint=value`` -> the value at which it is held."""
    result: dict[str, float] = {}
    for word in text:
        name, equals, _ = word.rpartition("=")
        result |= dict([_parse_setting(word, "--lock")]) if equals and name else {word: 0.0}
    return result


def load_model(path: Path, allow_native: bool, robot: Robot) -> Model:
    """The model of a file, ``-`` for standard input.

    Raises
    ------
    UsageError
        There is no such file; the message names what is near.
    ModelError
        The file is no model.
    """
    options = chosen(robot)
    if robot.lock:
        options["lock"] = _locked(robot.lock)
    if allow_native:
        options["allow_native"] = True
    if str(path) == "-":
        model = _read_stdin(options)
    elif path.is_file():
        from ..api.loading import load

        model = load(path, **options)
    else:
        raise bad_file(_missing(path))
    for note in model.notes:
        say(f"note: {name_options(note)}", err=True)
    return model


def _read_stdin(options: dict[str, Any]) -> Model:
    """The model of a model file's text on the standard input."""
    from ..api.model import Model
    from ..model.yaml_file import describe_yaml

    if options:
        raise at_odds(f"- reads a model file from the standard input and takes no {', '.join(options)}; name a file")
    return Model.from_description(describe_yaml(sys.stdin.read(), "<stdin>"))


def _missing(path: Path) -> str:
    if what := kind_of(path):
        return f"{path} is {what}, not a plain file; " + (
            "name a model file in it" if path.is_dir() else "copy its content into a file"
        )
    if path.stem in example_files():
        return f"{path}: no such file; there is an example of that name: eomgen examples {path.stem}"
    here = path.parent if path.parent.is_dir() else Path()
    files = [p for p in here.iterdir() if p.suffix in (".yaml", ".yml", ".urdf", ".xml")]
    stems = {p.stem: p for p in sorted(files, key=lambda p: p.suffix == path.suffix)}  # of one stem, the last
    near = closest(path.stem, stems)
    return f"{path}: no such file" + (f"; did you mean {stems[near[0]]}?" if near else "")


def _sort_settings(module: Module, settings: dict[str, float]) -> Iterator[dict[str, float] | None]:
    """Which settings are initial values, parameters and inputs, None for none; one namespace holds them all."""
    loops = [*module.loop_names, *(f"{name}_dot" for name in module.loop_names)]
    initial_names = [*module.x_names, *loops, *(name for name in module.y_names if name not in module.p_names)]
    groups = [[*initial_names, *filter(place_of_marker, settings)], module.p_names, module.u_names]
    known = [name for group in groups for name in group]
    settings = {module.layout.plain(name): value for name, value in settings.items()}  # leg1.hip of an instance
    check_names("parameter, input or initial value", settings, known)
    return ({n: v for n, v in settings.items() if n in group} or None for group in groups)
