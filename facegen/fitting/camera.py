"""Cameras as people write them: weak, fov=60, focal=1200, or a file."""

from __future__ import annotations

from pathlib import Path

from facegen.errors import InputError, nearest
from facegen.facs.validate import Entry
from facegen.facs.yamlfile import SUFFIXES, read_data
from facegen.fitting.views import Camera, Pinhole, WeakCamera

_KEYS = ("fov", "focal", "centre")
_MOST = 1e6


def parse_camera(text: str, picture: tuple[int, int] | None = None) -> Camera:
    """Return a camera. picture: width and height in pixels, which says where its middle is.

    text: "weak"; "fov=60", degrees across the picture; "focal=1200" or "focal=1200x1210", pixels, with
    "centre=640x360" if that is not the picture's middle; or the path of a YAML or JSON file with these keys and
    `picture`. Raises InputError.
    """
    if text.strip() == "weak":
        return WeakCamera((0.0, 0.0) if picture is None else (picture[0] / 2.0, picture[1] / 2.0))
    if Path(text).suffix.lower() in SUFFIXES:
        return _file(Path(text), picture)
    given: dict[str, list[float]] = {}
    for part in text.split(","):
        key, equals, value = part.partition("=")
        if not equals or key.strip() not in _KEYS:
            raise InputError(f"camera: expected weak, fov=60, focal=1200 or a file of a camera, got {text!r}"
                             f"{nearest(key.strip(), ('weak', *_KEYS))}")
        try:
            given[key.strip()] = [float(one) for one in value.lower().split("x")]
        except ValueError:
            raise InputError(f"camera: {key.strip()}: expected a number, or two such as 640x360, "
                             f"got {value!r}") from None
    return _made(given, picture)


def _file(path: Path, picture: tuple[int, int] | None) -> Camera:
    fields = Entry(read_data(path), str(path)).fields(optional=(*_KEYS, "picture", "about", "source"))

    def numbers(entry: Entry) -> list[float]:
        several = entry.each() if isinstance(entry.value, list) else [entry]
        return [one.number(-_MOST, _MOST) for one in several]

    size = numbers(fields["picture"]) if "picture" in fields else picture
    try:
        return _made({key: numbers(fields[key]) for key in _KEYS if key in fields}, size)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def _made(given: dict[str, list[float]], picture: tuple[float, ...] | list[float] | None) -> Camera:
    if ("fov" in given) == ("focal" in given):
        raise InputError("camera: expected either fov or focal")
    if any(len(value) not in (1, 2) for value in given.values()) or (picture is not None and len(picture) != 2):
        raise InputError("camera: expected one number or two")
    if "fov" in given:
        if picture is None or len(given["fov"]) != 1:
            raise InputError("camera: fov says nothing without the picture's size: give that too, such as 1280x720")
        return Pinhole.of_view(given["fov"][0], tuple(picture))
    centre = given.get("centre") or (None if picture is None else [picture[0] / 2.0, picture[1] / 2.0])
    if centre is None or len(centre) != 2:
        raise InputError("camera: focal needs where the camera looks: centre=640x360, or the picture's size")
    focal = given["focal"]
    return Pinhole((focal[0], focal[-1]), tuple(centre))
