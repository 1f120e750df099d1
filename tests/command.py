"""The command ``eomgen`` called in this process: ``run("check", file)`` -> its exit code and what it wrote."""

import io
import json
import os
import sys
from contextlib import ExitStack, chdir, redirect_stderr, redirect_stdout
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any, NamedTuple
from unittest.mock import patch

(SCRIPT,) = entry_points(group="console_scripts", name="eomgen")


class Result(NamedTuple):
    """What a call of the command left behind."""

    code: int
    out: str
    err: str

    @property
    def json(self) -> Any:
        return json.loads(self.out)


def run(
    *words: object, cwd: Path | str | None = None, stdin: str | bytes | None = None, columns: str | None = None
) -> Result:
    """Call the command with these words, in the folder cwd; stdin is what it can read, columns the terminal's width."""
    given = stdin.encode() if isinstance(stdin, str) else stdin or b""
    out, err = (io.TextIOWrapper(io.BytesIO(), encoding="utf-8", write_through=True) for _ in range(2))
    with ExitStack() as stack:
        stack.enter_context(patch.dict(os.environ))
        os.environ.pop("COLUMNS", None)  # readline, which pytest imports, sets it
        if columns is not None:
            os.environ["COLUMNS"] = columns
        if cwd is not None:
            stack.enter_context(chdir(cwd))
        stack.enter_context(patch.object(sys, "stdin", io.TextIOWrapper(io.BytesIO(given), encoding="utf-8")))
        stack.enter_context(redirect_stdout(out))
        stack.enter_context(redirect_stderr(err))
        try:
            SCRIPT.load()([str(word) for word in words])
        except SystemExit as left:
            code = int(left.code or 0)
        else:
            raise AssertionError("the command returned instead of leaving with an exit code")
    return Result(code, *(stream.buffer.getvalue().decode() for stream in (out, err)))
