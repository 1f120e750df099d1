"""Stage cli, analysis: what the verbs that analyse a model share: options, and a module with everything set."""

from __future__ import annotations

import functools
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from ..runtime.origin import origin
from .failures import reports_failures
from .number_option import Number
from .screen import stage
from .shared_options import (
    blaming_option,
    independent_option,
    json_option,
    load_model,
    method_option,
    model_argument,
    native_option,
    parse_settings,
    robot_options,
    target_option,
)
from .verb_run import complete_parameters, sort_settings

if TYPE_CHECKING:
    from ..api.equations import Equations
    from ..module import Module


class Prepared(NamedTuple):
    """A model ready to be analysed."""

    equations: Equations
    module: Module  #: with the parameters and inputs of ``--set`` bound
    initial: dict[str, float]  #: the values of ``--set`` that are coordinates or rates

    def heading(self, t: float) -> dict[str, Any]:
        """What every result of --json begins with."""
        return {"name": self.equations.name, "method": self.equations.method, "origin": origin(self.module), "t": t}


time_option = click.option("--time", "t", type=Number(), default=0.0, show_default=True, metavar="T", help="Time in s.")


_OPTIONS: tuple[Callable[..., Any], ...] = (
    robot_options,
    json_option,
    click.option(
        "--set",
        "settings",
        multiple=True,
        metavar="NAME=VALUE",
        help="Value of a parameter, an input, a coordinate or a rate; repeat it for more.",
    ),
    target_option("cython", "numpy"),
    independent_option,
    method_option,
    native_option,
    model_argument,
)


def analysis_options(verb: Callable[..., Any]) -> Callable[..., Any]:
    """The options of every analysis; the verb gets a :class:`Prepared` as its first argument."""

    @functools.wraps(verb)
    def prepared(**given: Any) -> Any:
        words = ("model", "allow_native", "method", "independent", "target", "settings", "robot")
        own = {key: value for key, value in given.items() if key not in words}
        return verb(prepare(*(given[word] for word in words)), **own)

    wrapped: Callable[..., Any] = reports_failures(prepared)
    for option in _OPTIONS:
        wrapped = option(wrapped)
    return wrapped


def prepare(
    model: Path,
    allow_native: bool,
    method: str,
    independent: tuple[str, ...],
    target: str,
    settings: tuple[str, ...],
    robot: dict[str, Any],
) -> Prepared:
    """Derive and compile a model, with settings bound."""

    chosen = parse_settings(settings)
    with blaming_option(independent), stage("derive"):
        described = load_model(model, allow_native, robot)
        complete_parameters(described, chosen)
        equations = described.derive(method, independent or None)
    with stage("compile"):
        module = equations.compile(target=target)
    initial, parameters, inputs = sort_settings(module, chosen)
    return Prepared(equations, module.bind(parameters, inputs), initial)


def pairs(values: Any) -> list[list[float]]:
    """Complex numbers as JSON has them: real and imaginary parts."""
    return [[float(value.real), float(value.imag)] for value in values]
