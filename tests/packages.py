"""Exported packages of target cython, made ready in their folder without pip: ``built(folder)`` compiles them there."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

#: A compiler that takes object files of this run's other packages, whose texts are the same but for the model's.
COMPILER = """
import glob, hashlib, os, shutil, subprocess, sys
words, kept = sys.argv[1:], os.environ["KEPT_OBJECTS"]
source = next((word for word in words if word.endswith(".c")), None)
if "-c" not in words or source is None:
    sys.exit(subprocess.call(["cc", *words]))
texts = [open(file, "rb").read() for file in (source, *sorted(glob.glob("*.h")))]
place = os.path.join(kept, hashlib.sha256(b"\\n".join([source.encode(), *texts])).hexdigest())
made = words[words.index("-o") + 1]
if not os.path.exists(place):
    if code := subprocess.call(["cc", *words]):
        sys.exit(code)
    shutil.copy(made, f"{place}-{os.getpid()}")
    os.replace(f"{place}-{os.getpid()}", place)
shutil.copy(place, made)
"""


def built(folder: Path) -> Path:
    """Compile the extension module of a package where it lies, so that the package can be imported; return it."""
    kept = Path(os.environ["EOMGEN_CACHE_DIR"], "packages")
    kept.mkdir(exist_ok=True)
    (kept / "cc.py").write_text(COMPILER)
    compiler = f"{sys.executable} {kept / 'cc.py'}"
    env = os.environ | {"CC": compiler, "LDSHARED": f"{compiler} -shared", "CFLAGS": "-O0", "KEPT_OBJECTS": str(kept)}
    words = [sys.executable, "setup.py", "-q", "build_ext", "--inplace"]
    done = subprocess.run(words, cwd=folder, env=env, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    shutil.rmtree(folder / "build")
    return folder
