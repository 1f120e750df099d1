"""From the suffix of a file, or the name of an example, to a Model: through describe, or through importers."""

from __future__ import annotations

import os
from contextlib import suppress
from typing import TYPE_CHECKING, Unpack

from ..base.files import as_name, example_files, find_example
from ..base.texts import hint, quote
from ..base.value_rules import CHECKS, word_of_check
from ..errors import ModelError, at_odds, bad_file, no_choice, no_such
from ..model import describe_yaml_file
from .model import Model

if TYPE_CHECKING:
    from ..importers.robot import LoadOptions, RobotKeywords

#: Suffix of a file -> what it is; the table of what can be loaded.
SUFFIXES = {".yaml": "a model file (YAML 1.2)", ".yml": "a model file (YAML 1.2)"}
ROBOTS = {".urdf": "a robot (URDF)", ".xml": "a robot (MJCF or URDF)"}


def load(
    path: str | os.PathLike[str],
    *,
    allow_native: bool = False,
    check_inertia: bool | str | None = None,
    **robot: Unpack[RobotKeywords],
) -> Model:
    """Load a model from a file; the ending of its name says what it is.

    Parameters
    ----------
    path : str or path
        A model file ``.yaml`` or ``.yml``, or a robot ``.urdf`` or ``.xml`` (MJCF).
    allow_native : bool, optional
        Whether native functions of the file are compiled and run; else each is a fault of the model, and the files it
        names are not read.
    check_inertia : {'error', 'note', 'off'} or bool, optional
        What happens to masses and inertias that no body can have, and to motions without inertia: they are refused
        ('error', True), noted in ``Model.notes`` ('note'), or accepted silently ('off', False).  By default
        as the file says; if it says nothing, they are refused.
    **robot
        For robots: ``mimic`` ('coupling', the default, or 'independent'), ``limits`` ('note', the default, 'stop' or
        'off'), ``floating``, ``lock`` and the other fields of
        :class:`eomgen.importers.RobotOptions`.

    Returns
    -------
    Model

    Raises
    ------
    UsageError
        The suffix is not one that can be loaded, an option is not one of it, or the path is that of no plain file (a
        folder, a pipe, a device).
    FileNotFoundError
        There is no such file.
    ModelError
        The file cannot be read as a model; what can only be judged as a whole is told by ``Model.mechanism``.
    """
    path = as_name("path", path)
    suffix = os.path.splitext(path)[1].lower()
    if suffix in ROBOTS:
        from ..importers import describe_file  # only where it is needed: MJCF brings its own compiler

        checks = {} if check_inertia is None else {"check_inertia": check_inertia}
        return _with_notes(Model.from_description(describe_file(path, **checks, **robot)))
    if suffix not in SUFFIXES:
        known = ", ".join(f"{s} {what}" for s, what in {**SUFFIXES, **ROBOTS}.items())
        example = f"; the example is load_example({path!r})" if find_example(path, example_files()) else ""
        from ..importers.robot import CONVERTED

        if suffix in CONVERTED:
            raise bad_file(f"{path}: files with the ending {suffix} cannot be loaded; {CONVERTED[suffix]}")
        ending = suffix or "(none)"
        raise bad_file(f"{path}: files with the ending {ending} cannot be loaded; supported are {known}{example}")
    if robot:
        raise at_odds(f"{path} is a model file; only robot files take the options {', '.join(robot)}")
    model = Model.from_description(describe_yaml_file(path, allow_native=allow_native))
    if check_inertia is not None:
        word = word_of_check(check_inertia)
        if word is None:
            raise no_choice(f"check_inertia must be one of {', '.join(CHECKS)}, True, False, not {check_inertia!r}")
        model.check_inertia = word
    return _with_notes(model)


def load_example(name: str, **options: Unpack[LoadOptions]) -> Model:
    """One of the examples that come with eomgen; ``eomgen examples`` and the gallery list them.

    Parameters
    ----------
    name : str
        Such as ``"slider_crank"``, or ``"arm.urdf"``.
    **options
        As for :func:`load`.

    Returns
    -------
    Model

    Raises
    ------
    UsageError
        There is no such example, or it is a script.
    """
    result = example_files()
    file = find_example(name, result) if isinstance(name, str) else None
    if file is None:
        models = [key for key in result if not key.endswith(".py")]
        near = hint(str(name), models, quoted=False) or f"there are: {', '.join(models)}"
        raise no_such(f"no example {quote(name)}; {near}")
    if file.suffix == ".py":
        raise bad_file(f"{name} is a script, not a model; copy it by 'eomgen examples {name}' and run it")
    return load(file, **options)


def _with_notes(model: Model) -> Model:
    """The model, whose notes tell what its ``check_inertia: note`` takes; other faults are told when it is checked."""
    bodies = model.description.sections["bodies"]
    if "note" in (model.check_inertia, *(entry.values.get("check_inertia") for entry in bodies)):
        with suppress(ModelError):
            model.description.notes += model.mechanism().presentation.notes
    return model
