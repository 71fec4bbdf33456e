"""Write a sequence of images as MP4, as GIF, or as numbered PNG files; whole or not at all.

Each writer is a context manager that yields a function `Add`, which is called with each image and
the seconds it is shown. If the block raises, or its generator is closed, no file is left.
"""

from __future__ import annotations

import re
import subprocess
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, suppress
from fractions import Fraction
from pathlib import Path
from typing import IO

import imageio_ffmpeg
import numpy as np
from numpy.typing import NDArray
from PIL import GifImagePlugin, Image

from slideviz.argument_types import frozen
from slideviz.errors import SlidevizError
from slideviz.export.offscreen import png_bytes
from slideviz.system.atomic import atomic_write, require_writable
from slideviz.system.cleanup import draft, killed_at_end
from slideviz.system.file_checks import require_no_input

Pixels = NDArray[np.uint8]
Add = Callable[[Pixels, float], None]
"""A function that writes an image (height, width, 3) to be shown for a number of seconds."""

SUFFIXES = (".mp4", ".gif", ".png")  # the kinds of films (see `film_kind`)
MIN_FPS = 10
"""Least frame rate of an MP4, as players fail with lower ones; images shown longer are repeated."""
MAX_FPS = {".mp4": 60.0, ".gif": 50.0, ".png": float("inf")}
"""Largest frame rate by kind: what screens show, and what browsers play of a GIF."""
_NUMBER = re.compile(r"(%(?:0\d)?d)")  # the place of the number in the name of numbered pictures


@frozen
class EncoderSettings:
    """The settings that a writer has to know before the first image."""

    size: tuple[int, int]  # (int, int): width and height in pixels
    count: int  # number of images
    fps: float  # images per second
    samples: Callable[[], Sequence[Pixels]]
    """Returns a few images from all over the film, by which a GIF's palette is chosen."""


def film_kind(file: Path) -> str:
    """Return the kind of a film by its name: ".mp4", ".gif", or ".png" for numbered pictures.

    ".png" is that of a folder, or of a name with one number such as ``step_%03d.png``. Raises
    SlidevizError if the name is not one of these.
    """
    suffix = file.suffix.lower()
    if file.is_dir() or not (suffix or file.exists()):
        return ".png"
    if not suffix:
        raise SlidevizError(f"{file} is not a folder; end the name of a film with .mp4 or .gif")
    if suffix not in SUFFIXES:
        raise SlidevizError(
            f"{file}: no film can be written as {file.suffix}; end the name with .mp4 or .gif, or "
            "give a folder or a pattern such as step_%03d.png for one picture each"
        )
    if suffix == ".png" and len(_NUMBER.findall(file.name)) != 1:
        raise SlidevizError(
            f"{file}: pictures of a film need one number in their name, such as step_%03d.png"
        )
    return suffix


def targets(file: Path, count: int) -> list[Path]:
    """Return the files of a film of ``count`` images: one file, or one per image."""
    if film_kind(file) != ".png":
        return [file]
    if file.is_dir() or not file.suffix:
        file = file / f"step_%0{max(len(str(count - 1)), 2)}d.png"
    before, number, after = _NUMBER.split(file.name)
    return [file.with_name(f"{before}{number % i}{after}") for i in range(count)]


def writer(file: Path, settings: EncoderSettings) -> AbstractContextManager[Add]:
    """Return the writer for the kind of a file (see `film_kind`)."""
    return _WRITERS[film_kind(file)](file, settings)


@contextmanager
def _mp4(file: Path, settings: EncoderSettings) -> Iterator[Add]:
    fps = Fraction(settings.fps).limit_denominator(1000)
    rate = fps * max(1, -(-MIN_FPS // fps))
    with atomic_write(file, SlidevizError) as out, tempfile.TemporaryFile() as log:
        process = _start_ffmpeg(out.name, settings.size, rate, log)
        pipe = process.stdin
        assert pipe is not None
        shown = Fraction(0)

        def add(image: Pixels, seconds: float) -> None:
            nonlocal shown
            before = round(shown * rate)
            shown = shown + Fraction(seconds).limit_denominator(1000)
            try:
                for _ in range(max(1, round(shown * rate) - before)):
                    pipe.write(image.data)
            except OSError:
                _raise_ffmpeg(file, process, log)

        with closing_pipe(pipe), killed_at_end(process):
            yield add
            try:
                pipe.close()
            except OSError:
                _raise_ffmpeg(file, process, log)
            if process.wait():
                _raise_ffmpeg(file, process, log)


@contextmanager
def closing_pipe(pipe: IO[bytes]) -> Iterator[None]:
    """Close a pipe at the end of the context; ignore errors, as its reader may have ended."""
    try:
        yield
    finally:
        with suppress(OSError):
            pipe.close()


def _start_ffmpeg(
    path: str, size: tuple[int, int], rate: Fraction, log: IO[bytes]
) -> subprocess.Popen[bytes]:
    """Return a process of ffmpeg that reads raw images and writes an MP4; its messages: ``log``."""
    source = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{size[0]}x{size[1]}", "-r", str(rate)]
    # BT.709 colors, declared in the file: otherwise players guess by the size.
    bt709 = ":".join(f"{name}=bt709" for name in ("colorspace", "color_primaries", "color_trc"))
    colors = f"scale=out_color_matrix=bt709:out_range=tv,format=yuv420p,setparams={bt709}"
    made = ["-vf", colors, "-c:v", "libx264", "-preset", "veryfast", "-crf", "16"]
    made += ["-movflags", "+faststart", "-f", "mp4"]
    try:
        return subprocess.Popen(
            [imageio_ffmpeg.get_ffmpeg_exe(), "-v", "error", "-y", *source, "-i", "-", *made, path],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=log,
            # Ctrl+C must not reach ffmpeg, which would end the film early without an error.
            start_new_session=True,
        )
    except (OSError, RuntimeError) as problem:
        raise SlidevizError(
            f"the program ffmpeg, which makes MP4 films, cannot be started ({problem}); install "
            "it again with `pip install --force-reinstall imageio-ffmpeg`, or write a .gif"
        ) from problem


def _raise_ffmpeg(file: Path, process: subprocess.Popen[bytes], log: IO[bytes]) -> None:
    """Stop ffmpeg and raise SlidevizError with the last line of its log."""
    process.kill()
    process.wait()
    log.seek(0)
    lines = log.read().decode(errors="replace").strip().splitlines() or ["it gave no reason"]
    raise SlidevizError(f"{file}: cannot be written: ffmpeg stopped: {lines[-1]}")


@contextmanager
def _gif(file: Path, settings: EncoderSettings) -> Iterator[Add]:
    """Write a GIF, of each image only the rectangle that differs from the one before."""
    palette = _palette(settings.samples())
    before: NDArray | None = None
    shown = 0.0
    ticks = 0
    with atomic_write(file, SlidevizError) as out:

        def add(pixels: Pixels, seconds: float) -> None:
            nonlocal before, shown, ticks
            image = Image.fromarray(pixels).quantize(palette=palette, dither=Image.Dither.NONE)
            colors = np.asarray(image)
            if before is None:
                for block in GifImagePlugin.getheader(image.copy(), info={"loop": 0})[0]:
                    out.write(block)
            box = _changed(colors, before)
            before = colors
            shown += seconds
            # A GIF counts hundredths of a second: round the sum, not each duration.
            duration = max(round(100 * shown) - ticks, 2)
            ticks += duration
            part = image.crop(box)
            length = 10 * min(duration, 65535)
            for block in GifImagePlugin.getdata(part, box[:2], duration=length):
                out.write(block)

        yield add
        out.write(b";")


def _changed(colors: NDArray, before: NDArray | None) -> tuple[int, int, int, int]:
    """Return left, top, right, bottom of the part that differs; one pixel if nothing does."""
    if before is None:
        return 0, 0, colors.shape[1], colors.shape[0]
    differs = colors != before
    rows = np.flatnonzero(differs.any(axis=1))
    columns = np.flatnonzero(differs.any(axis=0))
    if not len(rows):
        return 0, 0, 1, 1
    return int(columns[0]), int(rows[0]), int(columns[-1]) + 1, int(rows[-1]) + 1


def _palette(samples: Sequence[Pixels]) -> Image.Image:
    """Return an image whose palette of 256 colors suits all samples.

    One half covers the range of all colors, however rare (an inverted cell), the other has the
    most frequent ones (shades of the color map).
    """
    sheet = Image.fromarray(np.concatenate([image[::2, ::2] for image in samples]))
    rare = sheet.quantize(128, method=Image.Quantize.MAXCOVERAGE)
    many = sheet.quantize(128, method=Image.Quantize.MEDIANCUT, kmeans=3)
    palette = Image.new("P", (1, 1))
    palette.putpalette((rare.getpalette() or [])[:384] + (many.getpalette() or [])[:384])
    return palette


@contextmanager
def _pngs(file: Path, settings: EncoderSettings) -> Iterator[Add]:
    """Write numbered PNG files; existing ones are replaced only after the last image is drawn."""
    paths = targets(file, settings.count)
    folder = paths[0].parent
    is_new = not folder.exists()
    try:
        with _os_errors_as_slideviz(file):
            folder.mkdir(exist_ok=True)
        require_writable(paths[0], SlidevizError)
        for path in paths:
            require_no_input(path, SlidevizError)
        with draft(folder, is_folder=True) as drawer:
            drawn: list[Path] = []

            def add(image: Pixels, _: float) -> None:
                drawn.append(drawer / str(len(drawn)))
                with _os_errors_as_slideviz(file):
                    drawn[-1].write_bytes(png_bytes(image))

            yield add
            with _os_errors_as_slideviz(file):
                for done, path in zip(drawn, paths, strict=True):
                    done.replace(path)
    except BaseException:
        if is_new and folder.is_dir() and not any(folder.iterdir()):
            folder.rmdir()
        raise


@contextmanager
def _os_errors_as_slideviz(file: Path) -> Iterator[None]:
    try:
        yield
    except OSError as problem:
        raise SlidevizError(f"{file}: cannot be written: {problem.strerror}") from problem


_WRITERS: dict[str, Callable[[Path, EncoderSettings], AbstractContextManager[Add]]] = {
    ".mp4": _mp4,
    ".gif": _gif,
    ".png": _pngs,
}
"""The writer of each kind."""
