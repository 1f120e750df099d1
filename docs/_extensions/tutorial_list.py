"""The list of notebooks, each with its first picture and its first sentences: ``{eomgen-tutorials}``."""

from __future__ import annotations

import base64
import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx.util.docutils import SphinxDirective

FOLDER = Path(__file__).resolve().parents[1] / "tutorials"
INLINE = re.compile(r"data:image/png;base64,([\w+/=\s]+)")


def notebooks() -> list[Path]:
    """The notebooks by their numbers."""
    return sorted(FOLDER.glob("*.ipynb"), key=lambda path: (int(re.match(r"\d*", path.stem)[0] or 0), path.stem))


def _joined(text: str | list[str]) -> str:
    return text if isinstance(text, str) else "".join(text)


def pictures(cells: list[Any]) -> Iterator[str]:
    """The pictures among the outputs, as base64."""
    for cell in cells:
        for output in cell.get("outputs", ()):
            data = output.get("data", {})
            if "image/png" in data:
                yield _joined(data["image/png"])
            elif found := INLINE.search(_joined(data.get("text/html", ""))):
                yield found[1]


def entry(path: Path) -> str:
    """A notebook as an entry of a list in Markdown; its picture is written beside it."""
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    texts = [_joined(cell["source"]) for cell in cells if cell["cell_type"] == "markdown"]
    title, _, rest = texts[0].partition("\n")
    words = " ".join(rest.strip().partition("\n\n")[0].split())
    sentence = re.match(r"[^$`]*?\.(?=\s|$)", words)
    shown = next(pictures(cells), None)
    image = ""
    if shown is not None:
        (FOLDER / f"{path.stem}.png").write_bytes(base64.b64decode(shown))
        image = f"  ![First picture of the notebook]({path.stem}.png)\n\n"
    lines = f"- [{title.lstrip('# ')}]({path.name})\n\n{image}"
    return lines + (f"  {sentence[0]}\n" if sentence else "")


class Tutorials(SphinxDirective):
    """``{eomgen-tutorials}``."""

    def run(self) -> list[nodes.Node]:
        """The nodes in place of the directive."""
        for path in notebooks():
            self.env.note_dependency(str(path))
        return self.parse_text_to_nodes("\n".join(map(entry, notebooks())))


def setup(app: Any) -> dict[str, bool]:
    """Called by Sphinx."""
    app.add_directive("eomgen-tutorials", Tutorials)
    return {"parallel_read_safe": True}
