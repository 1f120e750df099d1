"""A number on the command line: ``0.5``, ``2*pi`` or ``deg(30)``, as in a model file."""

from __future__ import annotations

from typing import Any

import click

from ..errors import UsageError


def _read(value: Any, what: str) -> Any:
    if not isinstance(value, str):
        return value
    try:
        return float(value)
    except ValueError:
        from ..describe.constant_texts import constant

    try:
        return constant(value, what)
    except UsageError as error:
        raise click.BadParameter(str(error)) from None


class Number(click.types.FloatParamType):
    """Any number."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        return super().convert(_read(value, "it"), param, ctx)


class NumberRange(click.FloatRange):
    """A number within bounds."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        return super().convert(_read(value, "it"), param, ctx)
