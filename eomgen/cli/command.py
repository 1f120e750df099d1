"""The first word of the command line -> the verb of that name, imported only now."""

from __future__ import annotations

import io
import os
import sys
import warnings
from collections.abc import Sequence
from importlib import import_module

import click

from ..base.texts import hint, visible
from ..errors import UsageError
from .output import USAGE, name_options, print_json, to_dict

#: Verb -> the file of this folder in which it is a command of the same name, and what it does.
VERBS = {
    "run": ("runs", "Derive, compile and simulate a model."),
    "ensemble": ("ensembles", "Run a model many times with different values."),
    "view": ("runs", "Show how a mechanism moves, in a browser or as a file."),
    "kinematics": ("runs", "Analyse the motion over a range, without forces."),
    "check": ("models", "Report a model's topology, mobility and errors."),
    "derive": ("models", "Derive the equations of motion and count their operations."),
    "explain": ("models", "Write the worked solution: every step to the equations, then numbers."),
    "linearize": ("analyses", "Linearize a model: A, B, C, D, eigenvalues."),
    "modes": ("analyses", "Find natural frequencies, mode shapes and damping ratios."),
    "equilibrium": ("analyses", "Find a static equilibrium, or parameters that balance a position."),
    "sensitivity": ("analyses", "Differentiate a run by parameters, inputs and initial values."),
    "consistent": ("analyses", "Find the consistent state nearest to a rough one."),
    "reactions": ("analyses", "Find forces and moments in all joints."),
    "inverse": ("analyses", "Find the forces of drives that produce a motion."),
    "impact": ("analyses", "Find the state after an impact, its impulses and energy loss."),
    "verify": ("analyses", "Check a compiled model against independent computations."),
    "generate": ("models", "Write a package that needs no eomgen."),
    "convert": ("models", "Write a robot (URDF, MJCF) as a model file."),
    "examples": ("installation", "List the example models, copy one here, or run them all."),
    "doctor": ("installation", "Check that this installation can derive, compile and simulate."),
    "cache": ("installation", "List, prune or clear the compiled modules."),
}


class Verbs(click.Group):
    """The group of all verbs, none of which is imported before it is requested."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(VERBS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in VERBS:
            return None
        result: click.Command = getattr(import_module(f".{VERBS[cmd_name][0]}", __package__), cmd_name)()
        return result

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        if args[0] not in VERBS:
            near = hint(args[0], VERBS, quoted=False) or f"there are: {', '.join(VERBS)}"
            ctx.fail(f"no verb {args[0]!r}; {near}")
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Verbs"):
            formatter.write_dl([(name, about) for name, (_, about) in VERBS.items()])


def _print_version(ctx: click.Context, param: click.Parameter, value: bool) -> None:
    if value and not ctx.resilient_parsing:
        from .. import __version__

        click.echo(f"eomgen {__version__}")
        ctx.exit()


@click.group(
    cls=Verbs,
    context_settings={"help_option_names": ["-h", "--help"]},
    epilog="`eomgen VERB --help` explains a verb.  Exit codes: 0 success; 1 error in the model; 2 usage or file not "
    "found; 3 compiler or package missing; 4 the integration failed; 5 verify found a difference.",
)
@click.option(
    "--version", is_flag=True, is_eager=True, expose_value=False, callback=_print_version, help="Show the version."
)
def eomgen() -> None:
    """Equations of motion of mechanisms: derived, compiled, simulated."""


def _check_file_name(line: Sequence[str]) -> None:
    """Refuse what cannot be part of a file's name; no file system takes it."""
    for word in line:
        try:
            bad = b"\0" in os.fsencode(word)
        except UnicodeEncodeError:
            bad = True
        if bad:
            raise click.UsageError(f"{word!a:.80} contains a character that command lines cannot have; remove it")


def _show_warning(message: Warning | str, *_: object, **__: object) -> None:
    """A warning without the place in Python, which is nothing of the user's."""
    click.echo(f"warning: {visible(name_options(str(message)))}", err=True)


def run_command(arguments: Sequence[str] | None = None) -> int:
    """Parse and run a command line; returns the exit code."""
    line = list(sys.argv[1:] if arguments is None else arguments)
    for stream in (sys.stdout, sys.stderr):  # where the terminal has no such characters, their numbers are shown
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    try:
        _check_file_name(line)
        with warnings.catch_warnings():
            warnings.showwarning = _show_warning
            code = eomgen.main(line, prog_name="eomgen", standalone_mode=False)
        sys.stdout.flush()
    except click.ClickException as error:  # wrong options, unknown verbs, files that cannot be read
        if "--json" in line:
            print_json(to_dict(UsageError(error.format_message())))
        vars(error)["message"] = visible(error.message)
        error.show()
        return USAGE
    except click.Abort:
        raise KeyboardInterrupt from None
    except BrokenPipeError:  # whoever read the output has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    return code if isinstance(code, int) else 0
