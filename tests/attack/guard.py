"""The guard: an audit hook (PEP 578) that refuses whatever a hostile case has no business to do, before it happens.

Allowed are reading the package, its templates and examples, Python's library and the folder of the case; writing inside
the folder of the case and the cache; parsing texts as Python syntax, which runs nothing; importing modules that are
installed; and running code that comes from those files.
"""

import os
import re
import sys
import sysconfig
from pathlib import Path
from typing import Any

import sympy

import eomgen

PACKAGE = Path(eomgen.__file__).resolve().parent
TEMPLATES = f"{PACKAGE.parent / 'templates'}{os.sep}"
#: Where code and data of the package and of Python lie.
ROOTS = tuple(
    os.path.realpath(path) + os.sep
    for path in {
        sys.prefix,
        sys.base_prefix,
        *sysconfig.get_paths().values(),
        str(Path(sympy.__file__).parents[1]),
        str(PACKAGE),
        str(PACKAGE.parent / "templates"),
        str(PACKAGE.parent / "examples"),
    }
    if os.path.realpath(path) not in ("/", "/usr")
)
#: What Python and the system read for themselves.
SYSTEM = ("/proc/self/", "/proc/cpuinfo", "/proc/meminfo", "/sys/", "/usr/lib/", "/usr/share/", "/lib/", "/etc/ld.so")
DEVICES = ("/dev/null", "/dev/full", "/dev/urandom", "/dev/tty")
#: Beginnings of events that no case may cause.
FORBIDDEN = (
    "os.system os.exec os.spawn os.startfile os.fork os.forkpty pty.spawn socket. urllib. http. ftplib. smtplib. imaplib. "
    "poplib. telnetlib. webbrowser. pickle. ctypes. sys.addaudithook sys.setprofile sys.settrace os.setxattr os.chflags "
    "os.chroot os.kill os.killpg resource. syslog. sqlite3. fcntl.ioctl mmap. gc.get_objects code.__new__"
).split()
#: Events whose first arguments, one or two, are paths that the case changes.
CHANGES = dict.fromkeys(
    "os.remove os.mkdir os.rmdir os.chmod os.chown os.truncate os.utime os.removexattr shutil.rmtree shutil.chown "
    "tempfile.mkstemp tempfile.mkdtemp shutil.make_archive".split(),
    1,
) | dict.fromkeys("os.rename os.link os.symlink shutil.move shutil.unpack_archive".split(), 2)
LOOKS = ("os.listdir", "os.scandir", "os.walk", "os.chdir", "glob.glob", "os.getxattr", "os.listxattr")
#: Python's own makers of classes, which run a text they wrote themselves.
_STANDARD = ("dataclasses.py", "collections/__init__.py", "enum.py", "functools.py", "typing.py", "inspect.py")
MAKERS = (
    *(os.path.join(sysconfig.get_paths()["stdlib"], name) for name in _STANDARD),
    os.path.join(os.path.dirname(sympy.__file__), "polys", "monomials.py"),  # a function for each number of symbols
)


class Escape(BaseException):
    """A case tried to reach what it must not; no Exception, so that no handler takes it for a failure."""


class Guard:
    """The audit hook; armed only while a case runs."""

    def __init__(self, folder: str, cache: str) -> None:
        self.cache = os.path.realpath(cache) + os.sep
        self.folders = (os.path.realpath(folder) + os.sep, self.cache)
        #: What the package makes and runs: exported by ``verify`` in a folder for temporary files; of a cache there.
        own = r"/(?:[^/]+/)*(?:tmp\w{8}/made/[\w/]+|entries/[0-9a-f]{64}/_core)\.py$"
        self.made = re.compile(re.escape(os.path.realpath(folder)) + own)
        self.programs: frozenset[str] = frozenset()
        self.armed = False
        self.escapes: list[str] = []
        sys.addaudithook(self._hook)

    def _hook(self, event: str, args: tuple[Any, ...]) -> None:
        if not self.armed:
            return
        self.armed = False  # looking at the event must not cause further ones
        try:
            fault = self._fault(event, args)
        finally:
            self.armed = True
        if fault:
            self.escapes.append(fault)
            raise Escape(fault)

    def _fault(self, event: str, args: tuple[Any, ...]) -> str | None:
        if event == "open":
            return self._opened(*args)
        if event == "import":
            return None if args[1] is None else self._read(args[1], "import")
        if event == "compile":
            return self._compiled(*args)
        if event == "exec":
            return self._executed(args[0])
        if event in CHANGES:
            return next((f"{event} {p!r}" for p in args[: CHANGES[event]] if not self._own(p)), None)
        if event in LOOKS:
            if (
                event == "os.listdir"
                and sys._getframe(2).f_code.co_filename == "<frozen importlib._bootstrap_external>"
            ):
                return None  # an import looks through the path
            return self._read(args[0], event)
        if event in ("subprocess.Popen", "os.posix_spawn"):
            return None if os.path.basename(str(args[0])) in self.programs else f"{event} {args[0]!r}"
        return f"{event} {args!r:.200}" if event.startswith(tuple(FORBIDDEN)) else None

    def _opened(self, path: Any, mode: Any, flags: Any) -> str | None:
        if isinstance(path, int):
            return None
        writes = isinstance(flags, int) and flags & (os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND)
        if writes:
            return None if self._own(path) or self._real(path) in DEVICES else f"open for writing {path!r}"
        return self._read(path, "open")

    def _real(self, path: Any) -> str:
        return os.path.realpath(os.fsdecode(path))

    def _own(self, path: Any) -> bool:
        if path is None or isinstance(path, int):
            return True
        return (self._real(path) + os.sep).startswith(self.folders)

    def _read(self, path: Any, event: str) -> str | None:
        if path is None or isinstance(path, int) or self._own(path):
            return None
        real = self._real(path)
        if (real + os.sep).startswith(ROOTS) or real.startswith(SYSTEM) or real in DEVICES:
            return None
        return f"{event} {path!r}"

    def _compiled(self, source: Any, filename: Any) -> str | None:
        caller = sys._getframe(3).f_code.co_filename
        if caller.startswith("<frozen importlib") or caller.endswith(os.sep + "ast.py") or caller in MAKERS:
            return None  # an import, a parse that runs nothing, a class
        if caller.endswith("jinja2/environment.py") and self._real(filename).startswith(TEMPLATES):
            return None  # a template of the package
        return None if source is None else f"compile {source!r:.120} as {filename!r} by {caller}"

    def _executed(self, code: Any) -> str | None:
        name = getattr(code, "co_filename", "")
        if name.startswith("<frozen"):
            return None
        if name.startswith("<"):
            cacheless = re.fullmatch(r"<eomgen\._\w+>", name)  # a NumPy core where no cache can be had
            return None if cacheless or sys._getframe(3).f_code.co_filename in MAKERS else f"exec of {name!r}"
        real = self._real(name)
        own = real.startswith((*ROOTS, self.cache)) or self.made.match(real)
        return None if own else f"exec {name!r}"
