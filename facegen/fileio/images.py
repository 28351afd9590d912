"""Pictures as files, and labelled contact sheets."""

from __future__ import annotations

import os
import unicodedata
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from facegen.errors import FileError, InputError
from facegen.fileio.textfile import check_place, whole_file

if TYPE_CHECKING:
    from PIL.Image import Image

# Pillow's name and settings for each suffix. PNG at level 6: a third smaller than level 1, 15 ms more.
_FORMATS = {
    ".png": ("PNG", {"compress_level": 6}),
    ".jpg": ("JPEG", {"quality": 92, "subsampling": 0}),
    ".jpeg": ("JPEG", {"quality": 92, "subsampling": 0}),
    ".webp": ("WEBP", {"quality": 92, "method": 4}),
}
_PAPER = (255, 255, 255)
_INK = (40, 42, 46)


def save_image(pixels: ArrayLike, path: str | os.PathLike[str]) -> Path:
    """Write a picture (h, w, 3) or (h, w, 4) uint8 as PNG, JPEG or WebP by the path's suffix; return the
    path.

    The file appears whole or not at all: it is written beside its place and renamed. JPEG knows no
    transparency and gets white behind. A fully opaque alpha is dropped. Raises InputError for the pixels,
    FileError for the path.
    """
    pixels = without_full_alpha(check_pixels(pixels))
    path = check_image_path(path)
    kind, settings = _FORMATS[path.suffix.lower()]
    if kind == "JPEG":
        pixels = over_colour(pixels, _PAPER)

    from PIL import Image  # lazy: most of facegen works without it

    write_whole(Image.fromarray(pixels), path, "picture", kind, **settings)
    return path


def save_mask(labels: ArrayLike, path: str | os.PathLike[str]) -> Path:
    """Write labels (h, w) uint8 as a grey PNG, value for value, and return the path; it appears whole or not at all.

    Raises InputError for the labels, FileError for the path.
    """
    labels = np.asarray(labels)
    if labels.dtype != np.uint8 or labels.ndim != 2 or 0 in labels.shape:
        raise InputError(f"labels: expected shape (h, w) and type uint8, got {labels.shape} {labels.dtype}")
    path = check_image_path(path)
    if path.suffix.lower() != ".png":
        raise FileError(f"{path}: a mask must keep its values: expected a name that ends in .png")

    from PIL import Image

    write_whole(Image.fromarray(labels), path, "mask", compress_level=6)
    return path


def check_image_path(path: str | os.PathLike[str]) -> Path:
    """Return a path that a picture can be written to, or raise FileError: ask before long work."""
    return check_place(path, _FORMATS)


def write_whole(picture: Image, path: Path, what: str, kind: str = "PNG", **settings: Any) -> None:
    """Write a Pillow picture, whole; ``what`` is its name in a FileError."""
    with whole_file(path, f"the {what} ") as draft, open(draft, "wb") as file:
        picture.save(file, kind, **settings)


def without_full_alpha(pixels: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return a picture (h, w, 3) if every pixel of it is opaque, else as it is."""
    if pixels.shape[2] == 4 and (pixels[..., 3] == 255).all():
        return np.ascontiguousarray(pixels[..., :3])
    return pixels


def contact_sheet(images: Sequence[ArrayLike], labels: Sequence[str], columns: int = 6, *, gap: int = 8
                  ) -> NDArray[np.uint8]:
    """Return one picture (H, W, 3) uint8 of many, in rows of ``columns``, each with its label below on white.

    images: (h, w, 3) or (h, w, 4) uint8, all of one height and width. labels: one each; a label wider than
    its picture is set smaller, then cut. gap: pixels between pictures.
    """
    pictures = [check_pixels(image) for image in images]
    if not pictures or len(pictures) != len(labels):
        raise InputError(f"labels: expected one for each picture and at least one picture, "
                         f"got {len(pictures)} pictures and {len(labels)} labels")
    if isinstance(columns, bool) or not isinstance(columns, (int, np.integer)) or columns < 1:
        raise InputError(f"columns: expected a whole number of 1 or more, got {columns!r}")
    sizes = {picture.shape[:2] for picture in pictures}
    if len(sizes) > 1:
        raise InputError(f"images: expected one height and width for all, got {sorted(sizes)}")

    from PIL import Image, ImageDraw

    height, width = sizes.pop()
    columns = min(int(columns), len(pictures))
    rows = -(-len(pictures) // columns)
    letters = max(9, round(width / 13))
    strip = round(letters * 1.5)
    sheet = Image.new("RGB", (gap + columns * (width + gap), gap + rows * (height + strip + gap)), _PAPER)
    draw = ImageDraw.Draw(sheet)
    for k, (picture, label) in enumerate(zip(pictures, labels, strict=True)):
        left, top = gap + (k % columns) * (width + gap), gap + (k // columns) * (height + strip + gap)
        sheet.paste(Image.fromarray(over_colour(picture, _PAPER)), (left, top))
        text, font = _fitted(str(label), letters, width)
        draw.text((left + width / 2, top + height + strip / 2), text, fill=_INK, font=font, anchor="mm")
    return np.asarray(sheet).copy()


# Fonts that have the letters of the IPA, where a system has them; Pillow's own font has little more than ASCII.
_FONTS = ("DejaVuSans.ttf", "NotoSans-Regular.ttf", "Arial.ttf", "segoeui.ttf")


def captioned(picture: ArrayLike, text: str, height: int) -> NDArray[np.uint8]:
    """Return a picture (h + height, w, 3) with a line of text below it on white.

    Letters beyond ASCII are drawn where the system has a font with them, else without their accents or left out.
    """
    from PIL import Image, ImageDraw, ImageFont

    pixels = over_colour(check_pixels(picture), _PAPER)
    sheet = Image.new("RGB", (pixels.shape[1], pixels.shape[0] + height), _PAPER)
    sheet.paste(Image.fromarray(pixels), (0, 0))
    letters, load = round(0.62 * height), None
    for name in _FONTS:
        with suppress(OSError):
            ImageFont.truetype(name, letters)
            load = partial(ImageFont.truetype, name)
            break
    if load is None:
        text = unicodedata.normalize("NFKD", text).encode("ascii", "ignore").decode()
    text, font = _fitted(text, letters, pixels.shape[1] - height, load)
    ImageDraw.Draw(sheet).text((height / 2, pixels.shape[0] + height / 2), text, fill=_INK, font=font, anchor="lm")
    return np.asarray(sheet).copy()


def _fitted(text: str, letters: int, width: int, load: Callable[[int], Any] | None = None):
    """Return the text and a font at which it fits the width: first smaller letters, then fewer.

    load: makes the font of a size; Pillow's own by default.
    """
    from PIL import ImageFont

    load = load or ImageFont.load_default
    for size in range(letters, 7, -1):
        font = load(size)
        if font.getlength(text) <= width:
            return text, font
    while text and font.getlength(text + "…") > width:
        text = text[:-1]
    return text + "…", font


def check_pixels(pixels: ArrayLike) -> NDArray[np.uint8]:
    """Return a picture (h, w, 3) or (h, w, 4) uint8, contiguous, or raise InputError."""
    pixels = np.asarray(pixels)
    if pixels.dtype != np.uint8 or pixels.ndim != 3 or pixels.shape[2] not in (3, 4) or 0 in pixels.shape:
        raise InputError("pixels: expected a picture of shape (h, w, 3) or (h, w, 4) and type uint8, "
                         f"got {pixels.shape} {pixels.dtype}")
    return np.ascontiguousarray(pixels)


def over_colour(pixels: NDArray[np.uint8], behind: tuple[int, int, int]) -> NDArray[np.uint8]:
    """Return a picture (h, w, 3) over a plain colour."""
    if pixels.shape[2] == 3:
        return pixels
    cover = pixels[..., 3:].astype(np.float32) / 255
    return np.rint(pixels[..., :3] * cover + np.array(behind, np.float32) * (1 - cover)).astype(np.uint8)
