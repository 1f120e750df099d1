"""Frames -> GIF, MP4, or PNG files in a folder, with few colours where a format has few."""

from __future__ import annotations

import io
import os
from base64 import b64encode
from collections.abc import Callable, Sequence
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.files import as_path, refuse_link, whole_file
from ..base.texts import quote
from ..errors import MissingDependencyError, at_odds, bad_file, no_choice
from .draw import matplotlib
from .frames import Frames

# -- palettes of GIF files ---------------------------------------------------------------------------------------------


Image = NDArray[np.uint8]

COLORS = 128  #: of a GIF: more make it larger, fewer are seen
ROUNDS = 3  #: of moving the colours to the middles of those that they stand for
SHADES = np.array([65536, 256, 1])


def palette_of(images: Sequence[Image], colors: int) -> Image:
    """At most so many colours (n, 3) that stand for those of pictures (height, width, 3).

    A colour counts by the root of its dots: by their number the background would take nearly all places, and a thin bar
    would get the colour of its neighbour.
    """
    from PIL import Image as Pictures

    packed, counts = np.unique(np.concatenate([_packed(image).ravel() for image in images]), return_counts=True)
    if len(packed) <= colors:
        return _unpacked(packed)
    often = np.repeat(_unpacked(packed), np.ceil(np.sqrt(counts)).astype(int), axis=0)
    result = Pictures.fromarray(often[None]).quantize(colors, Pictures.Quantize.MEDIANCUT, kmeans=ROUNDS)
    return np.array(result.getpalette(), dtype=np.uint8).reshape(-1, 3)[:colors]


def indices_in(palette: Image, image: Image) -> Image:
    """Index (height, width) of the colour of a palette that is nearest to each dot.

    Pillow's own search looks at six bits of a colour, which turns white into light grey.
    """
    packed, where = np.unique(_packed(image), return_inverse=True)
    colours, known = _unpacked(packed).astype(float), palette.astype(float)
    distances = (colours**2).sum(axis=1)[:, None] - 2 * colours @ known.T + (known**2).sum(axis=1)
    nearest: Image = distances.argmin(axis=1).astype(np.uint8)[where].reshape(image.shape[:2])
    return nearest


def _packed(image: Image) -> NDArray[np.int64]:
    packed: NDArray[np.int64] = (image.astype(float) @ SHADES).astype(np.int64)
    return packed


def _unpacked(packed: NDArray[np.int64]) -> Image:
    colors: Image = (packed[:, None] // SHADES % 256).astype(np.uint8)
    return colors


class InlineFilm:
    """A GIF or a film that a notebook shows.

    Attributes
    ----------
    data : bytes
        The file, as it would be written.
    format : {'gif', 'mp4'}
    """

    def __init__(self, data: bytes, format: str) -> None:
        self.data, self.format = data, format

    def __bytes__(self) -> bytes:
        return self.data

    def __repr__(self) -> str:
        return f"<InlineFilm: {self.format} of {len(self.data) / 1e6:.2f} MB>"

    def _repr_html_(self) -> str:
        text = b64encode(self.data).decode()
        if self.format == "gif":
            return f'<img alt="animation" src="data:image/gif;base64,{text}">'
        return f'<video controls loop autoplay muted src="data:video/{self.format};base64,{text}"></video>'


# -- files -------------------------------------------------------------------------------------------------------------


PALETTE_OF = 8  #: frames of a GIF from which its colours are taken
FOLDER = "a folder for PNG frames"


def kind_of(path: Path) -> str:
    """The ending of a file; a name without one is a folder."""
    return path.suffix.lower() if path.suffix and not path.is_dir() else FOLDER


def require_target(file: Any, format: Any) -> None:
    """Refuse a file or a format without a file that cannot be, before any work.

    Raises
    ------
    UsageError, MissingDependencyError
    """
    if format is None:
        if file is not None:
            require_kind(as_path("file", file))
        return
    if not isinstance(format, str) or format not in FORMATS:
        raise no_choice(f"format must be one of {', '.join(map(repr, FORMATS))}, not {quote(format)}")
    if file is not None:
        raise at_odds("format= is for an animation without a file; the ending of the file's name selects the kind")
    _require_libraries(f".{format}")


def require_kind(path: Path) -> None:
    """Refuse an ending that says no kind of animation, and a kind whose library is missing, before any work.

    Raises
    ------
    UsageError, MissingDependencyError
    """
    kind, word = kind_of(path), path.name.removeprefix(".").lower()
    if word in FORMATS and kind == FOLDER and not path.is_dir():
        raise bad_file(
            f"{str(path)!r} has no ending, so it would be a folder for PNG frames; give the name of a file such as "
            f"'run.{word}', or format={word!r} without a file for one that a notebook shows"
        )
    if kind not in (*WRITERS, ".html"):
        raise bad_file(
            f"{path}: the name of an animation must end in .gif, .mp4 or .html, or have no ending (a folder for PNG "
            "frames)"
        )
    if kind == FOLDER:
        refuse_link(path)
        if path.exists() and (not path.is_dir() or any(path.iterdir())):
            raise bad_file(
                f"{path}: the folder for frames must be new or empty; name another folder, or empty this one"
            )
    _require_libraries(kind)


def _require_libraries(kind: str) -> None:
    if kind == ".html":
        return
    matplotlib("figure", "an animation")
    if kind == ".mp4":
        _find_ffmpeg()


def _find_ffmpeg() -> str:
    """The program ffmpeg: on the path, or that of the package imageio-ffmpeg.

    Raises
    ------
    MissingDependencyError
    """
    if matplotlib("animation", "an animation").writers.is_available("ffmpeg"):
        return str(matplotlib("pyplot", "an animation").rcParams["animation.ffmpeg_path"])
    try:
        return str(import_module("imageio_ffmpeg").get_ffmpeg_exe())
    except (ImportError, RuntimeError):
        raise MissingDependencyError(
            "an animation as .mp4 needs ffmpeg: pip install imageio-ffmpeg, or install it on the system "
            "(Debian: apt install ffmpeg); .gif and .html do not need it"
        ) from None


def gif_bytes(frames: Frames, colors: int = COLORS) -> bytes:
    """All frames as a GIF of so many colours that goes round."""
    from PIL import Image

    images = [frames.image(k) for k in range(len(frames))]
    palette = palette_of(images[:: max(1, len(images) // PALETTE_OF)], colors)  # colours that only some frames have
    reduced = []
    for image in images:
        one = Image.fromarray(indices_in(palette, image), "P")
        one.putpalette(palette.tobytes())
        reduced.append(one)
    # a GIF counts hundredths of a second; pillow joins equal frames, which keeps the time
    duration = max(20, round(100.0 / frames.motion.fps) * 10)
    buffer = io.BytesIO()
    reduced[0].save(
        buffer, format="GIF", save_all=True, append_images=reduced[1:], duration=duration, loop=0, optimize=False
    )
    return buffer.getvalue()


def mp4_bytes(frames: Frames) -> bytes:
    """All frames as a film."""
    animation, pyplot = (matplotlib(part, "an animation") for part in ("animation", "pyplot"))
    with TemporaryDirectory() as folder, pyplot.rc_context({"animation.ffmpeg_path": _find_ffmpeg()}):
        part = os.path.join(folder, "part.mp4")
        # an even number of dots, and colours that every player knows
        even = ["-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2", "-pix_fmt", "yuv420p"]
        writer = animation.FFMpegWriter(fps=frames.motion.fps, codec="libx264", extra_args=even)
        with writer.saving(frames.figure, part, frames.figure.dpi):
            for k in range(len(frames)):
                frames.show(k)
                writer.grab_frame()
        return Path(part).read_bytes()


def _write_frames(path: Path, frames: Frames) -> None:
    path.mkdir(parents=True, exist_ok=True)
    from PIL import Image

    digits = len(str(len(frames) - 1))
    for k in range(len(frames)):
        buffer = io.BytesIO()
        Image.fromarray(frames.image(k)).save(buffer, format="PNG")
        with whole_file(path / f"frame_{k:0{digits}}.png") as handle:
            handle.write(buffer.getvalue())


def _whole(make: Callable[[Frames], bytes]) -> Callable[[Path, Frames], None]:
    """What writes the bytes of an animation as one file."""

    def write(path: Path, frames: Frames) -> None:
        data = make(frames)
        with whole_file(path) as handle:
            handle.write(data)

    return write


#: Formats of one file that matplotlib makes, and their bytes.
FILMS: dict[str, Callable[[Frames], bytes]] = {"gif": gif_bytes, "mp4": mp4_bytes}
FORMATS = (*FILMS, "html")
#: Endings of files that matplotlib makes.
WRITERS: dict[str, Callable[[Path, Any], None]] = {
    **{f".{name}": _whole(make) for name, make in FILMS.items()},
    FOLDER: _write_frames,
}
