"""Stage cli, help: the options of a verb in sections, its own first, those that many verbs share after them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import click

from ..base.names import closest

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


def verb_command() -> Callable[[Callable[..., Any]], Verb]:
    """Make a function a verb."""
    return click.command(cls=Verb)
