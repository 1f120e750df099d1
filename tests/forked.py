"""Fresh processes of Python for tests that need one each: copies of a process that has loaded eomgen already.

Loading takes longer than most of what such tests do.  A copy has its own arguments, folder, environment and filters of
warnings, and nothing that another one did; what can be seen in a process that loads eomgen itself alone (its import,
what is loaded when) has to be tested in one.
"""

from __future__ import annotations

import atexit
import json
import os
import subprocess
import sys
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

#: Reads what to run, a line each; copies itself, which runs it, and tells the exit status.
PARENT = """
import importlib, json, os, pkgutil, runpy, sys, traceback
import eomgen
for name in sys.argv[1:]:
    importlib.import_module(name)

def end(told):
    os.chdir(told["cwd"])
    os.environ.clear()
    os.environ.update(told["env"])
    for stream, path in ((0, os.devnull), (1, told["out"]), (2, told["err"])):
        opened = os.open(path, os.O_RDWR | os.O_CREAT | os.O_TRUNC, 0o600)
        os.dup2(opened, stream)
        os.close(opened)
    sys.argv = told["argv"]
    try:
        if told["argv"][0] == "-m":
            sys.argv = told["argv"][1:]
            sys.path[0] = told["cwd"]
            runpy.run_module(sys.argv[0], run_name="__main__", alter_sys=True)
        else:
            sys.path[0] = os.path.dirname(sys.argv[0])
            runpy.run_path(sys.argv[0], run_name="__main__")
    except SystemExit as left:
        if left.code is None or isinstance(left.code, int):
            return left.code or 0
        print(left.code, file=sys.stderr)
        return 1
    except BaseException:
        traceback.print_exc()
        return 1
    return 0

for line in sys.stdin:
    told = json.loads(line)
    process = os.fork()
    if not process:
        status = end(told)
        import atexit
        atexit._run_exitfuncs()
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(status)
    print(os.waitstatus_to_exitcode(os.waitpid(process, 0)[1]), flush=True)
"""
#: What a model is read, derived, compiled, run and drawn with.
LOADED = (
    *("eomgen.api.model", "eomgen.api.equations", "eomgen.api.module", "eomgen.loading", "eomgen.cli.command"),
    *("eomgen.pipeline", "eomgen.generation", "eomgen.show.draw", "eomgen.show.animate", "eomgen.verification"),
    *("scipy.integrate", "scipy.optimize", "scipy.linalg", "sympy", "matplotlib.pyplot"),
)


@cache
def _parent(*options: str) -> subprocess.Popen[str]:
    words = [sys.executable, *options, "-c", PARENT, *LOADED]
    parent = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    atexit.register(parent.communicate)  # no further line: it ends
    return parent


def run_python(
    *words: object, options: Sequence[str] = (), cwd: Path | None = None, env: Mapping[str, str] | None = None
) -> subprocess.CompletedProcess[str]:
    """What ``subprocess.run([sys.executable, *options, *words])`` gives, from a copy of a loaded process.

    Parameters
    ----------
    words
        A script or ``-m`` and a module, and arguments.
    options
        Of Python, such as ``-W error``.
    cwd, env
        Those of this process by default.
    """
    parent = _parent(*options)
    assert parent.stdin is not None
    assert parent.stdout is not None
    argv: list[str] = [str(word) for word in words]
    with TemporaryDirectory() as folder:
        out, err = Path(folder, "out"), Path(folder, "err")
        told = {"argv": argv, "cwd": str(cwd or Path.cwd()), "env": dict(env or os.environ)}
        told |= {"out": str(out), "err": str(err)}
        parent.stdin.write(json.dumps(told) + "\n")
        parent.stdin.flush()
        answer = parent.stdout.readline()
        assert answer, "the process that is copied has ended"
        texts = [path.read_text(encoding="utf-8") if path.exists() else "" for path in (out, err)]
    return subprocess.CompletedProcess(argv, int(answer), *texts)
