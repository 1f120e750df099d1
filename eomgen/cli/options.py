"""What several verbs accept -> checked values: numbers, names, files, and a model with how to derive and compile it."""

from __future__ import annotations

import functools
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import click

from ..base.files import kind_of, refuse_link
from ..base.names import closest, place_of_marker
from ..base.results import Result, ResultTable
from ..errors import ModelError, UsageError, at_odds, bad_file, ill_chosen, ill_typed, no_number, off_range
from ..runtime.argument_checks import unknown
from ..toolchain.targets import TARGETS
from .output import name_options, reports_failures, say, show, stage

if TYPE_CHECKING:
    from ..api.equations import Equations
    from ..api.model import Model
    from ..module import Module

# -- the help of a verb: its options in sections, its own first, those that many verbs share after them ----------------

DERIVATION = "Derivation and compilation"
INTEGRATION = "Integration"
ROBOTS = "Robot files (URDF, MJCF)"
#: Sections after the verb's own options, in this order.
SHARED = (DERIVATION, INTEGRATION, ROBOTS)
#: Names of the options at the end of the verb's own.
LAST = ("--json", "--help")

F = TypeVar("F", bound=Callable[..., Any])


class SharedOption(click.Option):
    """An option of several verbs, which ``--help`` lists in a section of its own."""

    def __init__(self, *args: Any, section: str, **attributes: Any) -> None:
        super().__init__(*args, **attributes)
        self.section = section


def shared_option(section: str, *names: str, **attributes: Any) -> Callable[[F], F]:
    """Like ``click.option``, listed in this section."""
    return click.option(*names, cls=SharedOption, section=section, **attributes)


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
        listed: dict[str, list[tuple[str, str]]] = {section: [] for section in ("Options", *SHARED)}
        options = [p for p in self.get_params(ctx) if isinstance(p, click.Option)]
        for option in sorted(options, key=lambda p: LAST.index(p.opts[-1]) if p.opts[-1] in LAST else -1):
            record = option.get_help_record(ctx)
            if record is not None:
                listed[getattr(option, "section", "Options")].append(record)
        for section, records in listed.items():
            if records:
                with formatter.section(section):
                    formatter.write_dl(records)


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


POSITIVE = NumberRange(min=0, min_open=True)


def parse_settings(settings: tuple[str, ...], option: str = "--set", example: str = "r=0.12") -> dict[str, float]:
    """``name=value`` words as numbers; a value may be an expression of numbers such as ``pi/3``.

    Parameters
    ----------
    settings : tuple of str
    option, example : str, optional
        Which option has them, for errors, and a word that it takes.

    Raises
    ------
    UsageError
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
    """A number, or an expression of numbers such as ``pi/3``.

    Raises
    ------
    UsageError
    """
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


def parse_span(option: str, word: str, form: str, example: str) -> tuple[str, float, float, int | None]:
    """Name, ends and count of ``NAME=LOW:HIGH``, with a count where the form has one; ``[:COUNT]`` may be left out.

    Raises
    ------
    UsageError
    """
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
    return name.strip(), low, high, None if count is None else int(count)


def require_once(option: str, names: Sequence[str]) -> None:
    """Refuse a name that several options of a kind give.

    Raises
    ------
    UsageError
    """
    if len(set(names)) < len(names):
        raise at_odds(f"{option}: {', '.join(names)}: give each name once")


# -- names and files ---------------------------------------------------------------------------------------------------


def split_names(ctx: click.Context, param: click.Parameter, value: tuple[str, ...]) -> tuple[str, ...]:
    """Names that are given one by one or separated by commas."""
    return tuple(name.strip() for text in value for name in text.split(",") if name.strip())


def require_folder(option: str, file: Path | None) -> None:
    """Fail before the work if a file cannot be written where it is asked for; makes nothing.

    Raises
    ------
    UsageError
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


def require_document_folder(option: str, file: Path | None) -> None:
    """Fail before the work if a text cannot be written where it is asked for: its folder has to be there.

    Raises
    ------
    UsageError
    """
    require_folder(option, file)
    if file is not None and not file.absolute().parent.is_dir():
        raise bad_file(f"{option} {file}: there is no folder {file.absolute().parent}; make it, or name another one")


# -- options -----------------------------------------------------------------------------------------------------------

Decorator = Callable[[Callable[..., Any]], Callable[..., Any]]

json_option = click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
end_option = click.option("--end", type=POSITIVE, metavar="T", help="End time in s.")


def file_option(name: str, text: str, **attributes: Any) -> Decorator:
    """An option that names a file."""
    return click.option(name, type=click.Path(path_type=Path), metavar="FILE", help=text, **attributes)


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


def _gathered(section: str, name: str, keys: dict[str, str], options: dict[str, dict[str, Any]]) -> Decorator:
    """Options of a section; those that are set reach the verb in one mapping `name`, under `keys` or their names."""

    def decorate(verb: Callable[..., Any]) -> Callable[..., Any]:
        @functools.wraps(verb)
        def wrapped(*args: Any, **kwargs: Any) -> Any:
            values = {option.removeprefix("--").replace("-", "_"): None for option in options}
            values = {key: kwargs.pop(key) for key in values}
            gathered = {keys.get(key, key): x for key, x in values.items() if x not in (None, False, ())}
            return verb(*args, **{name: gathered}, **kwargs)

        for option, attributes in reversed(options.items()):
            wrapped = shared_option(section, option, **attributes)(wrapped)
        return wrapped

    return decorate


#: For ``simulate``, in one mapping ``solver``.
solver_options = _gathered(
    INTEGRATION, "solver", {"solver": "method"},
    {
        "--solver": {
            "metavar": "NAME", "callback": _find_solver,
            "help": "Integrator: DOP853, RK45, RK23, Radau, Taylor, BDF, LSODA; with --step RK4, moreau (rigid "
            "contact).",
        },
        "--step": {"type": POSITIVE, "metavar": "H", "help": "Step size of RK4 and of moreau in s."},
        "--rtol": {"type": POSITIVE, "metavar": "X", "help": "Relative tolerance of the integrator."},
        "--atol": {"type": POSITIVE, "metavar": "X", "help": "Absolute tolerance of the integrator."},
    },
)  # fmt: skip
_robot_options = _gathered(
    ROBOTS, "robot", {},
    {
        "--floating": {"is_flag": True, "help": "The base moves freely (URDF)."},
        "--lock": {
            "multiple": True, "metavar": "JOINT[=VALUE]",
            "help": "Fix a joint at a value (0 by default); repeat it for more.",
        },
        "--mimic": {
            "type": click.Choice(["independent", "coupling"]),
            "help": "Tie joints that mimic others by a coupling (the default), or leave them independent.",
        },
        "--rotation": {
            "type": click.Choice(["euler_angles", "euler_parameters"]),
            "help": "Describe free and ball joints by euler_angles or euler_parameters.",
        },
        "--actuate": {"is_flag": True, "help": "Add an input tau_<joint> to every joint of one degree of freedom."},
        "--friction": {
            "type": POSITIVE, "metavar": "VELOCITY",
            "help": "Let the dry friction of joints act, smoothed below this velocity (rad/s or m/s).",
        },
        "--symbolic": {"is_flag": True, "help": "Make masses and inertias parameters."},
        "--check-inertia": {
            "type": click.Choice(["error", "note", "off"]),
            "help": "Refuse masses and inertias that no body can have and motions without inertia, note them, or "
            "accept them.",
        },
        "--limits": {
            "type": click.Choice(["note", "stop", "off"]),
            "help": "At the limits of joints: a run warns (note), elastic stops act (stop), or nothing happens (off).",
        },
        "--assets": {"metavar": "DIR", "help": "Folder in which other files may be read (MJCF)."},
    },
)  # fmt: skip


def target_option(*targets: str, default: str = "cython") -> Decorator:
    """``--target`` with these choices."""
    return shared_option(
        DERIVATION,
        "--target",
        type=click.Choice(list(targets)),
        default=default,
        show_default=True,
        help="; ".join(f"{target}: {TARGETS[target].about}" for target in targets) + ".",
    )


#: Options of a model by what :class:`Source` calls them, in the order of ``--help``.
_SOURCE: dict[str, Decorator] = {
    "model": click.argument("model", metavar="MODEL", type=click.Path(path_type=Path)),
    "allow_native": shared_option(
        DERIVATION,
        "--allow-native",
        is_flag=True,
        help="Compile and run the C (and Python) files that the model's native functions name; only for models you "
        "trust.",
    ),
    "method": shared_option(
        DERIVATION,
        "--method",
        default="auto",
        show_default=True,
        metavar="M",
        help="Method of derivation: auto, embedding, lagrange, recursive, augmented, newton_euler, amalgamated, "
        "gibbs_appell, hamilton (for the integrator see --solver of run).",
    ),
    "baumgarte": shared_option(
        DERIVATION,
        "--baumgarte",
        metavar="ALPHA,BETA",
        callback=_pair,
        help="With --method augmented: stabilise constraints by C'' + 2 ALPHA C' + BETA^2 C = 0 (1/s) instead of "
        "projecting.",
    ),
    "independent": shared_option(
        DERIVATION,
        "--independent",
        multiple=True,
        callback=split_names,
        metavar="NAME",
        help="Independent coordinate of a mechanism with loops; for several repeat it, or separate names by commas.",
    ),
    "target": target_option("cython", "numpy"),
    "settings": click.option(
        "--set",
        "settings",
        multiple=True,
        metavar="NAME=VALUE",
        help="Value of a parameter, an input, a coordinate or a rate; repeat it for more.",
    ),
    "robot": _robot_options,
}


# -- models ------------------------------------------------------------------------------------------------------------


class Source(NamedTuple):
    """A model file, and how it is derived and compiled."""

    model: Path
    allow_native: bool = False
    method: str = "auto"
    baumgarte: tuple[float, float] | None = None
    independent: tuple[str, ...] = ()
    target: str = "cython"
    settings: tuple[str, ...] = ()
    robot: dict[str, Any] | None = None

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
        """The module of the equations, and what ``--set`` sets."""
        equations = self.derive(method)
        with stage("compile") as parts:
            before = set(equations.seconds)
            module = equations.compile(target=self.target)
            parts |= {part: seconds for part, seconds in equations.seconds.items() if part not in before}
        return Prepared(equations, module, *_sort_settings(module, parse_settings(self.settings)))

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


class Prepared(NamedTuple):
    """A compiled model, and the values of ``--set``."""

    equations: Equations
    module: Module
    initial: dict[str, float] | None
    parameters: dict[str, float] | None
    inputs: dict[str, float] | None

    def bound(self) -> Prepared:
        """The same with parameters and inputs bound."""
        return self._replace(module=self.module.bind(self.parameters, self.inputs))

    def position(self) -> dict[str, float] | None:
        """Initial values that are coordinates."""
        return {name: x for name, x in (self.initial or {}).items() if not name.endswith("_dot")} or None

    def show(
        self, as_json: bool, t: float, *parts: Result | ResultTable | str, values: Any = None, files: Any = None
    ) -> None:
        """Print what an analysis at a time found: its parts, or with --json the values, those of the result if none."""
        from ..runtime.identity import origin

        if not as_json:
            show(False, {}, *parts, files=files)
            return
        result = parts[0].to_dict() if values is None and isinstance(parts[0], Result) else values
        head = {"name": self.equations.name, "method": self.equations.method, "origin": origin(self.module), "t": t}
        show(True, head | result, files=files)


def model_verb(*names: str, target: Decorator | None = None) -> Callable[[Callable[..., Any]], Verb]:
    """Make a function a verb that takes a :class:`Source` of these options as its first argument, and ``as_json``."""

    def decorate(verb: Callable[..., Any]) -> Verb:
        @functools.wraps(verb)
        def prepared(**values: Any) -> Any:
            source = Source(**{name: values.pop(name) for name in Source._fields if name in values})
            return verb(source, **values)

        wrapped: Callable[..., Any] = json_option(reports_failures(prepared))
        for name in reversed([name for name in _SOURCE if name in ("model", *names)]):
            wrapped = (target if name == "target" and target else _SOURCE[name])(wrapped)
        return click.command(cls=Verb)(wrapped)

    return decorate


def analysis_verb(verb: Callable[..., Any]) -> Verb:
    """Make a function a verb that takes a :class:`Prepared` with everything bound as its first argument."""

    @functools.wraps(verb)
    def compiled(source: Source, **values: Any) -> Any:
        return verb(source.compile().bound(), **values)

    return model_verb("allow_native", "method", "independent", "target", "settings", "robot")(compiled)


def _locked(text: tuple[str, ...]) -> dict[str, float]:
    """``joint`` or ``joint=value`` -> the value at which it is held."""
    result: dict[str, float] = {}
    for word in text:
        name, equals, _ = word.rpartition("=")
        result |= dict([_parse_setting(word, "--lock")]) if equals and name else {word: 0.0}
    return result


def load_model(path: Path, allow_native: bool = False, robot: dict[str, Any] | None = None) -> Model:
    """The model of a file, ``-`` for standard input.

    Raises
    ------
    UsageError
        There is no such file; the message names what is near.
    ModelError
        The file is no model.
    """
    options = dict(robot or {})
    if "lock" in options:
        options["lock"] = _locked(options["lock"])
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
    from ..base.files import example_files

    if path.stem in example_files():
        return f"{path}: no such file; there is an example of that name: eomgen examples {path.stem}"
    here = path.parent if path.parent.is_dir() else Path()
    names = [p.name for p in here.iterdir() if p.suffix in (".yaml", ".yml", ".urdf", ".xml")]
    near = closest(path.name, names)
    return f"{path}: no such file" + (f"; did you mean {here / near[0]}?" if near else "")


def _sort_settings(module: Module, settings: dict[str, float]) -> Iterator[dict[str, float] | None]:
    """Which settings are initial values, parameters and inputs, None for none; one namespace holds them all."""
    loops = [*module.loop_names, *(f"{name}_dot" for name in module.loop_names)]
    initial_names = [*module.x_names, *loops, *(name for name in module.y_names if name not in module.p_names)]
    groups = [[*initial_names, *filter(place_of_marker, settings)], module.p_names, module.u_names]
    known = [name for group in groups for name in group]
    settings = {module.layout.plain(name): value for name, value in settings.items()}  # leg1.hip of an instance
    for name in settings:
        if name not in known:
            raise unknown("parameter, input or initial value", name, known)
    return ({n: v for n, v in settings.items() if n in group} or None for group in groups)
