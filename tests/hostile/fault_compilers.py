"""Faults of compilers: missing, broken, hanging, endless, silent, lying."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from hostile.fault_work import BUILD, LIBRARY, Result, Work, script

VERSION = '[ "$1" = --version ] && exec gcc --version'
#: The file after -o.
OUTPUT = 'out=; last=; for word; do [ "$last" = -o ] && out=$word; last=$word; done'
LINKS = 'case " $* " in *" -c "*) exec gcc "$@";; esac'


def compilers(work: Work) -> dict[str, str]:
    """What is wrong -> the command."""
    folder = work.folder / "compilers"
    folder.mkdir(exist_ok=True)
    (folder / "plain").write_text("no program")
    (folder / "not_run").write_text("#!/bin/sh\n")
    (folder / "binary").write_bytes(b"\x7fELF nonsense")
    (folder / "binary").chmod(0o755)
    other = folder / "other.so"
    other.write_bytes(work.library.path.read_bytes().replace(work.library.key.encode(), b"0" * 64))
    foreign = bytearray(work.library.path.read_bytes())
    foreign[18:20] = b"\xb7\x00" if foreign[18:20] != b"\xb7\x00" else b"\x3e\x00"  # AArch64, else x86-64
    (folder / "foreign.so").write_bytes(foreign)
    shells = {
        "exits with 1": "exit 1",
        "dies of a signal": "kill -SEGV $$",
        "says nothing": "exit 0",
        "hangs when asked for its version": "sleep 600",
        "hangs behind a child": "sleep 600 & wait",
        "prints without end": "exec yes",
        "hangs in compiling": f"{VERSION}\nsleep 600",
        "prints without end in compiling": f"{VERSION}\nexec yes nonsense",
        "fails in compiling": f"{VERSION}\necho no >&2; exit 1",
        "dies in compiling": f"{VERSION}\nkill -SEGV $$",
        "leaves a child that holds its output": 'sleep 600 &\nexec gcc "$@"',
        "makes nothing": f"{VERSION}\nexit 0",
        "makes nothing when linking": f"{VERSION}\n{LINKS}\nexit 0",
        "makes empty files": f'{VERSION}\n{OUTPUT}\n: > "$out"',
        "makes garbage": f'{VERSION}\n{OUTPUT}\necho garbage > "$out"',
        "makes garbage when linking": f'{VERSION}\n{LINKS}\n{OUTPUT}\necho garbage > "$out"',
        "links for another machine": f'{VERSION}\n{LINKS}\n{OUTPUT}\ncp {folder}/foreign.so "$out"',
        "links another model": f'{VERSION}\n{LINKS}\n{OUTPUT}\ncp {other} "$out"',
        "compiles another source": f'{VERSION}\ncase " $* " in *" -c "*) ;; *) exec gcc "$@";; esac\n{OUTPUT}\n'
        f'echo "int other;" | gcc -x c -c - -o "$out"',
        "leaves out a function": f'{VERSION}\n{LINKS}\nexec gcc "$@" -Wl,--wrap=sin',
    }
    found = {name: script(folder / f"cc{k}", text) for k, (name, text) in enumerate(shells.items())}
    return found | {
        "is missing": "/nowhere/cc", "is a folder": str(folder), "is not executable": str(folder / "not_run"),
        "is no program": str(folder / "binary"), "has an open quotation": "gcc 'x", "is blank": " ",
        "is a relative path": f"./{Path(found['exits with 1']).name}", "has a wrong flag": "gcc --no-such-flag",
    }  # fmt: skip


FEW = ("hangs behind a child", "hangs in compiling", "makes nothing", "links another model", "has an open quotation",
       "is blank", "links for another machine")  # fmt: skip
UNLOADABLE = "leaves out a function"  #: from the link on, so that only loading shows it
#: Those that meet the Cython layer too, which takes half a minute.
OF_LAYER = (UNLOADABLE, "fails in compiling", "makes nothing", "makes garbage", "compiles another source")


def broken_compilers(work: Work, fast: bool) -> Iterator[Result]:
    """Each of them; then gcc on the same cache."""
    for name, command in compilers(work).items():
        if fast and name not in FEW:
            continue
        cache = work.cache()
        changes: dict[str, str | None] = {"CC": command, "EOMGEN_COMPILER_SECONDS": "3"}
        if name != UNLOADABLE:
            yield work.try_fault(f"a compiler that {name}", cache, code=LIBRARY, changes=changes, patience=40.0)
        if not fast and name in OF_LAYER:
            changes["EOMGEN_COMPILER_SECONDS"] = "60"
            yield work.try_fault(f"a compiler of the layer that {name}", cache, changes=changes, patience=150.0)


def lied_once(work: Work, fast: bool) -> Iterator[Result]:
    """A compiler that lies and is mended afterwards, under the same name and version: nothing of the lie is kept."""
    names = ("makes garbage when linking", "makes garbage", "links another model", "leaves out a function")
    for name in names[:1] if fast else names:
        cache = work.cache()
        command = compilers(work)[name]
        lie = Path(command).read_text()
        for code in (LIBRARY,) if fast else (BUILD,) if name == UNLOADABLE else (LIBRARY, BUILD):
            outcome = work.run(cache, code, changes={"CC": command}, patience=300.0)
            script(Path(command), 'exec gcc "$@"')
            after = work.run(cache, code, changes={"CC": command}, patience=300.0)
            yield Result(f"a compiler that {name} once", outcome, after)
            Path(command).write_text(lie)
