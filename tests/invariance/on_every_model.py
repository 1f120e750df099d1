"""A plugin of pytest: every model that the chosen tests compile is compared with variants of itself.

``PYTHONPATH=tests python -m pytest -p invariance.on_every_model tests/mechanics`` ends with a table of breaches; tests
themselves run as always.  The published cases are models of such tests.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from eomgen import Model
from eomgen.errors import EomgenError
from eomgen.verification import Finding
from eomgen.verification.variants import CHANGES, NotApplicable
from eomgen.verification.variants.compare import compare
from eomgen.verification.variants.findings import original_of

#: Changes that are tried on each model.
TRIED = ("all at once", "another joint cut", "joints as chains", "joint as constraints", "joint as equations")
COMPILE = Model.compile
FOUND: dict[str, tuple[str, list[Finding]]] = {}
LEFT_OUT: dict[str, str] = {}
BUSY: list[str] = []


def compare_first(self: Model, *args: Any, **options: Any) -> Any:
    """``Model.compile``, after a comparison of each new model."""
    if not BUSY:
        BUSY.append(self.name)
        try:
            _try(self)
        finally:
            BUSY.clear()
    return COMPILE(self, *args, **options)


def _try(model: Model) -> None:
    try:
        text = model.to_yaml()
        if text in FOUND or text in LEFT_OUT:
            return
        original = original_of(model, 0)
    except (EomgenError, NotApplicable) as why:
        LEFT_OUT[model.name] = f"{type(why).__name__}: {' '.join(str(why).split())[:150]}"
        return
    random = np.random.default_rng(0)
    FOUND[text] = (model.name, [compare(name, original, CHANGES[name], random) for name in TRIED])


def pytest_configure(config: pytest.Config) -> None:
    """Put the comparison before every compilation."""
    Model.compile = compare_first  # type: ignore[method-assign]


def pytest_terminal_summary(terminalreporter: Any) -> None:
    """Say what was found."""
    write = terminalreporter.write_line
    tried = [f for _, found in FOUND.values() for f in found if not f.left_out]
    bad = [(name, f) for name, found in FOUND.values() for f in found if not f.ok]
    write(f"{len(FOUND)} models, {len(tried)} comparisons, {len(bad)} breaches, {len(LEFT_OUT)} models left out")
    for name, f in bad:
        write(f"{name}: {f.check}: {f.worst:.2g} > {f.limit:.2g} {f.where} {f.note}")
    for name, why in LEFT_OUT.items():
        write(f"left out: {name}: {why}")
