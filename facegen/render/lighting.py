"""Named lighting set-ups, read from ``tables/lights.yaml``."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from pathlib import Path

from facegen.data import tables_dir
from facegen.errors import InputError, nearest
from facegen.facs.validate import Entry
from facegen.facs.yamlfile import read_data
from facegen.render.scene import Light, Scene

DEFAULT = "portrait"
_BRIGHTEST = 100.0      # linear; a white surface is at 1
_SHARPEST = 1000.0


def light_names() -> tuple[str, ...]:
    """Return the names of the shipped set-ups."""
    return tuple(_shipped())


def load_light(name: str = DEFAULT) -> Scene:
    """Return the scene of a named set-up: its lights, with the usual materials.

    Raises InputError for an unknown name.
    """
    known = _shipped()
    if name not in known:
        raise InputError(f"light: expected {', '.join(known)}, got {name!r}{nearest(name, known)}")
    return known[name]


@cache
def _shipped() -> Mapping[str, Scene]:
    return read_lights(tables_dir() / "lights.yaml")


def read_lights(path: Path) -> dict[str, Scene]:
    """Return name -> scene of a file of set-ups. TableError or FileError name the file and the key."""
    top = Entry(read_data(path), str(path)).fields(required=("source", "lights"))
    return {name: _scene(entry) for name, entry in top["lights"].items()}


def _scene(entry: Entry) -> Scene:
    fields = entry.fields(required=("about", "lights", "window", "sky", "ground"))
    fields["about"].text()
    return Scene(lights=tuple(_light(one) for one in fields["lights"].each()), window=_direction(fields["window"]),
                 sky=_colour(fields["sky"]), ground=_colour(fields["ground"]))


def _light(entry: Entry) -> Light:
    fields = entry.fields(required=("towards", "colour", "spread", "highlight"))
    return Light(_direction(fields["towards"]), _colour(fields["colour"]), fields["spread"].number(0, _SHARPEST),
                 fields["highlight"].number(0, _BRIGHTEST))


def _direction(entry: Entry) -> tuple[float, float, float]:
    vector = entry.vector(_BRIGHTEST)
    if not any(vector):
        raise entry.wrong("a direction, not [0, 0, 0]")
    return vector


def _colour(entry: Entry) -> tuple[float, float, float]:
    colour = entry.vector(_BRIGHTEST)
    if min(colour) < 0:
        raise entry.wrong("three numbers of 0 or more: red, green, blue")
    return colour
