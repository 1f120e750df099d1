"""Stage cli, options: what several verbs accept -> checked values."""

from __future__ import annotations

import functools
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ..base.files import kind_of, refuse_link
from ..base.names import closest
from ..errors import ModelError, UsageError, at_odds, bad_file, ill_chosen, ill_typed, no_number
from ..targets import TARGETS
from .number_option import NumberRange
from .sections import DERIVATION, INTEGRATION, ROBOTS, shared_option

if TYPE_CHECKING:
    from ..api.model import Model

model_argument = click.argument("model", metavar="MODEL", type=click.Path(path_type=Path))
json_option = click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
method_option = shared_option(
    DERIVATION,
    "--method",
    default="auto",
    show_default=True,
    metavar="M",
    help="Method of derivation: auto, embedding, lagrange, recursive, augmented, newton_euler, amalgamated, "
    "gibbs_appell, hamilton (for the integrator see --solver of run).",
)


def _pair(ctx: click.Context, param: click.Parameter, value: str | None) -> tuple[float, float] | None:
    if value is None:
        return None
    try:
        alpha, beta = (float(word) for word in value.split(","))
    except ValueError:
        raise click.BadParameter(f"{value!r} is not two numbers ALPHA,BETA") from None
    return alpha, beta


baumgarte_option = shared_option(
    DERIVATION,
    "--baumgarte",
    metavar="ALPHA,BETA",
    callback=_pair,
    help="With --method augmented: stabilise constraints by C'' + 2 ALPHA C' + BETA^2 C = 0 (1/s) instead of "
    "projecting.",
)


def _find_solver(ctx: click.Context, param: click.Parameter, value: str | None) -> str | None:
    """The integrator of a name, in whatever letters, before the work begins."""
    if value is None:
        return None
    from ..describe.fields import SOLVERS

    for solver in SOLVERS:
        if solver.lower() == value.lower():
            return solver
    raise click.BadParameter(f"no integrator {value!r}; there are {', '.join(SOLVERS)} (derivation: --method)")


_TOLERANCE = NumberRange(min=0, min_open=True)
_SOLVER = (
    shared_option(
        INTEGRATION,
        "--solver",
        metavar="NAME",
        callback=_find_solver,
        help="Integrator: DOP853, RK45, RK23, Radau, Taylor, BDF, LSODA; with --step RK4, moreau (rigid contact).",
    ),
    shared_option(INTEGRATION, "--step", type=_TOLERANCE, metavar="H", help="Step size of RK4 and of moreau in s."),
    shared_option(INTEGRATION, "--rtol", type=_TOLERANCE, metavar="X", help="Relative tolerance of the integrator."),
    shared_option(INTEGRATION, "--atol", type=_TOLERANCE, metavar="X", help="Absolute tolerance of the integrator."),
)


def solver_options(verb: Callable[..., Any]) -> Callable[..., Any]:
    """``--solver``, ``--step``, ``--rtol`` and ``--atol``, for ``simulate`` in one mapping ``solver``."""

    @functools.wraps(verb)
    def wrapped(*args: Any, **kwargs: Any) -> Any:
        names = {"solver": "method", "step": "step", "rtol": "rtol", "atol": "atol"}
        given = {name: value for key, name in names.items() if (value := kwargs.pop(key)) is not None}
        return verb(*args, solver=given, **kwargs)

    for option in reversed(_SOLVER):
        wrapped = option(wrapped)
    return wrapped


def target_option(*targets: str, default: str = "cython") -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """``--target`` with these choices."""
    return shared_option(
        DERIVATION,
        "--target",
        type=click.Choice(list(targets)),
        default=default,
        show_default=True,
        help="; ".join(f"{target}: {TARGETS[target].about}" for target in targets) + ".",
    )


def split_names(ctx: click.Context, param: click.Parameter, value: tuple[str, ...]) -> tuple[str, ...]:
    """Names that are given one by one or separated by commas."""
    return tuple(name.strip() for words in value for name in words.split(",") if name.strip())


independent_option = shared_option(
    DERIVATION,
    "--independent",
    multiple=True,
    callback=split_names,
    metavar="NAME",
    help="Independent coordinate of a mechanism with loops; for several repeat it, or separate names by commas.",
)


native_option = shared_option(
    DERIVATION,
    "--allow-native",
    is_flag=True,
    help="Compile and run the C (and Python) files that the model's native functions name; only for models you trust.",
)


@contextmanager
def blaming_option(independent: tuple[str, ...]) -> Iterator[None]:
    """Turn a complaint about ``--independent`` into a UsageError: the model file is not at fault."""
    try:
        yield
    except ModelError as error:
        if independent and all(p.path.startswith("independent") for p in error.problems):
            raise ill_chosen(
                "\n".join(str(p._replace(file="", path="--independent")) for p in error.problems)
            ) from None
        raise


_MIMIC, _ROTATIONS = ("independent", "coupling"), ("euler_angles", "euler_parameters")
_ROBOT = (
    shared_option(ROBOTS, "--floating", is_flag=True, help="The base moves freely (URDF)."),
    shared_option(
        ROBOTS,
        "--lock",
        multiple=True,
        metavar="JOINT[=VALUE]",
        help="Fix a joint at a value (0 by default); repeat it for more.",
    ),
    shared_option(
        ROBOTS,
        "--mimic",
        type=click.Choice(["independent", "coupling"]),
        help="Tie joints that mimic others by a coupling (the default), or leave them independent.",
    ),
    shared_option(
        ROBOTS,
        "--rotation",
        type=click.Choice(["euler_angles", "euler_parameters"]),
        help="Describe free and ball joints by euler_angles or euler_parameters.",
    ),
    shared_option(
        ROBOTS, "--actuate", is_flag=True, help="Add an input tau_<joint> to every joint of one degree of freedom."
    ),
    shared_option(
        ROBOTS,
        "--friction",
        type=NumberRange(min=0, min_open=True),
        metavar="VELOCITY",
        help="Let the dry friction of joints act, smoothed below this velocity (rad/s or m/s).",
    ),
    shared_option(ROBOTS, "--symbolic", is_flag=True, help="Make masses and inertias parameters."),
    shared_option(
        ROBOTS,
        "--check-inertia",
        type=click.Choice(["error", "note", "off"]),
        help="Refuse masses and inertias that no body can have and motions without inertia, note them, or accept them.",
    ),
    shared_option(
        ROBOTS,
        "--limits",
        type=click.Choice(["note", "stop", "off"]),
        help="At the limits of joints: a run warns (note), elastic stops act (stop), or nothing happens (off).",
    ),
    shared_option(ROBOTS, "--assets", metavar="DIR", help="Folder in which other files may be read (MJCF)."),
)


def robot_options(verb: Callable[..., Any]) -> Callable[..., Any]:
    """Options of robot files, handed to the verb as one mapping ``robot``."""
    keys = (
        "floating",
        "lock",
        "mimic",
        "rotation",
        "actuate",
        "friction",
        "symbolic",
        "check_inertia",
        "limits",
        "assets",
    )

    @functools.wraps(verb)
    def wrapped(*args: Any, **kwargs: Any) -> Any:
        given = {key: value for key in keys if (value := kwargs.pop(key))}
        return verb(*args, robot=given, **kwargs)

    for option in reversed(_ROBOT):
        wrapped = option(wrapped)
    return wrapped


def _locked(words: tuple[str, ...]) -> dict[str, float]:
    """``joint`` or ``joint=value`` -> the value at which it is held."""
    result: dict[str, float] = {}
    for word in words:
        name, equals, _ = word.rpartition("=")
        result |= dict([_parse_setting(word, "--lock")]) if equals and name else {word: 0.0}
    return result


def load_model(path: Path, allow_native: bool = False, robot: dict[str, Any] | None = None) -> Model:
    """The model of a file, ``-`` for standard input; what an import of a robot left out is told on stderr.

    Parameters
    ----------
    path : Path
    allow_native : bool, optional
        Whether its native functions may be compiled and run.

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
        from ..loading import load

        model = load(path, **options)
    else:
        raise bad_file(_missing(path))
    from .screen import say

    for note in model.notes:
        say(f"note: {note}", err=True)
    return model


def _read_stdin(options: dict[str, Any]) -> Model:
    """The model of a model file's text on the standard input."""
    from ..api.model import Model
    from ..describe.yaml_file import describe_yaml

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
    from ..describe.expressions import parse
    from ..errors import ExpressionError
    from ..graph.core import Graph

    def resolve(unknown: str) -> Any:
        raise ExpressionError(f"{unknown!r} is not a number", 1, "only numbers and pi are allowed here", text)

    try:
        value = parse(text, Graph(), resolve).value
    except ExpressionError as error:
        raise no_number(f"{error.message}; {error.remedy}") from None
    if value is None:
        raise no_number("the value is not a number")
    return value
