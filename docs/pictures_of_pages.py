"""Pictures that the pages' own blocks of code save: ``python docs/pictures_of_pages.py PAGE ...`` makes them anew.

A block that saves ``theory_loop.png`` makes ``docs/pictures/theory_loop.png``.  The tests run the same blocks and
compare what they save with the pictures stored.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).parent
SHOWN = re.compile(r"!\[[^\]]*\]\((?:\.\./)?pictures/([^)]+)\)")


def blocks(path: Path, language: str) -> list[str]:
    """Fenced blocks of one language."""
    return re.findall(rf"^```{language}\n(.*?)^```$", path.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)


def shown(path: Path) -> list[str]:
    """Names of the pictures that a page shows."""
    return SHOWN.findall(path.read_text(encoding="utf-8"))


def main(names: list[str]) -> None:
    """Run the blocks of pages, and keep the pictures that the pages show."""
    for path in [HERE / name for name in names] or sorted(HERE.rglob("*.md")):
        if not shown(path):
            continue
        with tempfile.TemporaryDirectory() as folder:
            script = Path(folder) / "page.py"
            script.write_text("\n".join(blocks(path, "python")), encoding="utf-8")
            subprocess.run([sys.executable, script], cwd=folder, check=True)
            for name in shown(path):
                if (Path(folder) / name).exists():
                    shutil.copyfile(Path(folder) / name, HERE / "pictures" / name)
                    print(name, (HERE / "pictures" / name).stat().st_size)


if __name__ == "__main__":
    main(sys.argv[1:])
