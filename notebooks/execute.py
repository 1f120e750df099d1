"""Notebooks -> the same notebooks with the outputs of a fresh kernel: ``python notebooks/execute.py [--out DIR] [FILE ...]``.

Without ``--out`` each notebook is stored where it lies; without files, all of this folder.  Each runs in an empty folder
of its own.  What changes from run to run without meaning (times, versions, how text was cut into pieces, notes of a slow
compilation) is not stored.
"""

from __future__ import annotations

import argparse
import base64
import io
import re
import tempfile
from pathlib import Path
from typing import Any

import nbformat
from nbclient import NotebookClient
from PIL import Image, ImageSequence

INLINE = re.compile(r"(data:(image/(?:png|gif));base64,)([\w+/=]+)")


def executed(notebook: Any, timeout: float, raw: bool) -> Any:
    """The notebook with the outputs of all its cells; raises at an unexpected error of a cell, or if it left files."""
    with tempfile.TemporaryDirectory() as folder:
        resources = {"metadata": {"path": folder}}
        NotebookClient(
            notebook, timeout=timeout, kernel_name="python3", resources=resources, record_timing=False
        ).execute()
        if files := sorted(path.name for path in Path(folder).iterdir()):
            raise RuntimeError(f"the notebook left files in its folder: {', '.join(files)}")
    return notebook if raw else tidied(notebook)


def tidied(notebook: Any) -> Any:
    """The notebook as it is stored."""
    for cell in notebook.cells:
        cell.metadata.pop("execution", None)
        if cell.cell_type == "code":
            cell.outputs = joined(cell.outputs)
            for output in cell.outputs:
                for kind, value in output.get("data", {}).items():
                    if kind in ("image/png", "image/gif"):
                        output.data[kind] = smaller(kind, value)
                    elif kind == "text/html":
                        output.data[kind] = INLINE.sub(lambda one: one[1] + smaller(one[2], one[3]), value)
    notebook.metadata = {
        "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
        "language_info": {"name": "python"},
    }
    return notebook


def joined(outputs: list[Any]) -> list[Any]:
    """The outputs of a cell; text of one stream that came in several pieces is one, and empty ones are left out."""
    kept: list[Any] = []
    for output in outputs:
        slow = output.get("name") == "stderr" and output.text.startswith("eomgen: compiling")
        if slow or not "".join(output.get("data", {"": "something"}).values()):  # where a progress bar was
            continue
        last = kept[-1] if kept else None
        if output.output_type == "stream" and last is not None and last.get("name") == output.name:
            last.text += output.text
        else:
            kept.append(output)
    return kept


def smaller(kind: str, picture: str) -> str:
    """A picture of few colours in the place of one of many: a third of the size, and a plot needs no more."""
    image, buffer = Image.open(io.BytesIO(base64.b64decode(picture))), io.BytesIO()
    if kind == "image/png":
        image.convert("RGB").quantize(128, dither=Image.Dither.NONE).save(buffer, format="PNG", optimize=True)
    else:
        frames, times = [], []
        for frame in ImageSequence.Iterator(image):
            frames.append(frame.convert("RGB"))
            times.append(frame.info["duration"])
        sheet = Image.new("RGB", (image.width, 4 * image.height))  # some of the frames, which have all colours
        for k in range(4):
            sheet.paste(frames[k * (len(frames) - 1) // 3], (0, k * image.height))
        palette = sheet.quantize(64)
        first, *rest = (frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames)
        first.save(buffer, format="GIF", save_all=True, append_images=rest, duration=times, loop=0, optimize=True)
    return base64.b64encode(buffer.getvalue()).decode()


def main() -> None:
    """Read the command line, execute and store."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="*", type=Path, metavar="FILE", help="notebooks; all of this folder if none")
    parser.add_argument("--out", type=Path, metavar="DIR", help="store them there instead")
    parser.add_argument("--timeout", type=float, default=300.0, help="seconds for one cell (300)")
    parser.add_argument("--raw", action="store_true", help="keep outputs as they came")
    options = parser.parse_args()
    for path in options.files or sorted(Path(__file__).parent.glob("*.ipynb")):
        done = executed(nbformat.read(path, as_version=4), options.timeout, options.raw)
        target = path if options.out is None else options.out / path.name
        nbformat.write(done, target)
        print(f"{path.name}: {target.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
