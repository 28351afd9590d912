"""``facegen gallery``: contact sheets of every unit and expression, several views, the eyes and the mouth."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from facegen.cli.options import FaceName, PersonName, Quiet, progress
from facegen.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from facegen.face.rig import Rig
    from facegen.geometry.camera import Camera

BASIC = ("neutral", "happiness", "sadness", "surprise", "fear", "anger", "disgust", "contempt")
VIEWS = ((-60, 0), (-30, 0), (0, 0), (30, 0), (60, 0), (0, -25))
LIDS = ("0", "5E", "7E", "42E", "43E", "6E+43E", "L46E", "63E", "64E")
MOUTHS = ("0", "25E", "26E", "27E", "12E+25E", "10E+25E", "16E+25E", "22E+25E", "19E+25D+26D")
# What a close-up looks at, mm, and how many times larger than the whole head it is drawn.
CLOSE = {"eyes": ((0.0, 2.0, 20.0), 2.2), "mouth": ((0.0, -67.0, 20.0), 2.6)}
# ... and on an avatar: what the landmarks there are called, and the share of the picture that they take.
MARKS, CLOSE_SHARE = {"eyes": ("eye_",), "mouth": ("mouth_",)}, 0.65
FORMATS = ("webp", "png", "jpg")

Folder = Annotated[Path | None, typer.Option("--output", "-o", metavar="DIR",
                                             help="Folder for the sheets; made if need be. [required]")]
Pixels = Annotated[int, typer.Option("--size", min=64, max=1024, help="Pixels of each picture.")]
Format = Annotated[str, typer.Option("--format", help=f"{', '.join(FORMATS)}.")]


@dataclass(frozen=True)
class Picture:
    """One picture of a sheet; ``close`` names a close-up."""

    what: str
    label: str
    view: tuple[float, float] = (0.0, 0.0)
    close: str | None = None


@dataclass(frozen=True)
class Sheet:
    """Pictures that share a sheet."""

    name: str
    pictures: tuple[Picture, ...]
    columns: int = 6


def gallery(output: Folder = None, face: FaceName = "akimoto", person: PersonName = None, size: Pixels = 192,
            format: Format = "webp", quiet: Quiet = False) -> None:
    """Draw contact sheets of all that the face can do.

    All expressions, all action units, several views of the basic expressions, close-ups of eyes and mouth.
    """
    if output is None:
        raise InputError("-o: say which folder the sheets go to, for example -o gallery")
    if format not in FORMATS:
        raise InputError(f"--format: expected {', '.join(FORMATS)}, got '{format}'")
    from facegen.face.face import load_face
    from facegen.fileio.images import contact_sheet, save_image
    from facegen.fileio.textfile import make_folder

    rig = load_face(face)
    sheets = tuple(sheet for sheet in _sheets(person) if rig.landmarks or not any(one.close for one in sheet.pictures))
    folder = make_folder(output)
    with progress("pictures", sum(len(sheet.pictures) for sheet in sheets), quiet=quiet) as step:
        for sheet in sheets:
            pictures = []
            for one in sheet.pictures:
                pictures.append(_draw(rig, one, person, size))
                step()
            labels = [one.label for one in sheet.pictures]
            save_image(contact_sheet(pictures, labels, sheet.columns), folder / f"{sheet.name}.{format}")


# Because FACS sorts units so, the cheek raiser among the eyes' (it is their outer sphincter).
_FACS_PARTS = {"brows": "upper face", "eyes": "upper face", "nose": "lower face", "cheeks": "lower face",
               "mouth": "lower face"}


def _sheets(person: str | None) -> Iterator[Sheet]:
    """Yield every sheet."""
    from facegen.facs.expression_table import load_expressions, load_person
    from facegen.facs.units import load_catalogue

    own = load_person(person).expressions if person else {}
    names = tuple(dict.fromkeys([*load_expressions().expressions, *own]))
    per_sheet = 30
    for first in range(0, len(names), per_sheet):
        yield Sheet(f"expressions-{first // per_sheet + 1}",
                    tuple(Picture(name, name.replace("_", " ")) for name in names[first:first + per_sheet]))
    regions: dict[str, list[Picture]] = {}
    for unit in load_catalogue().units.values():
        codes = unit.codes if unit.sides == "direction" or unit.variants else (unit.number,)
        place = _FACS_PARTS.get(unit.region, "jaw head eyes") if unit.number != "6" else "upper face"
        regions.setdefault(place, []).extend(
            Picture(f"{code}E", f"{code} {unit.name.lower()}") for code in codes)
    for place, pictures in regions.items():
        yield Sheet(f"units-{place.replace(' ', '-')}", tuple(pictures))
    yield Sheet("views", tuple(Picture(name, f"{name} {view[0]},{view[1]}" if any(view) else name, view)
                               for name in BASIC for view in VIEWS), len(VIEWS))
    yield Sheet("basic", tuple(Picture(name, name) for name in BASIC), 4)
    for close, scripts in (("eyes", LIDS), ("mouth", MOUTHS)):
        yield Sheet(close, tuple(Picture(script, "neutral" if script == "0" else script, view, close)
                                 for script in scripts for view in ((0.0, 0.0), (35.0, 0.0))))


def _draw(rig: Rig, one: Picture, person: str | None, size: int) -> NDArray[Any]:
    """Return the picture (size, size, 4)."""
    from facegen.render import render

    detail = 2
    camera = _close_up(rig, one, size, detail) if one.close else None
    return render(rig, one.what, person=person, size=size, view=one.view, detail=detail, camera=camera)


def _close_up(rig: Rig, one: Picture, size: int, detail: int) -> Camera:
    """Return the camera of a close-up."""
    import numpy as np

    from facegen.geometry.camera import frame
    from facegen.render.dress import portrait

    target, zoom = CLOSE[str(one.close)]
    vertices = rig.mesh(detail).vertices
    whole = frame(portrait(rig, vertices), size=(size, size), view=one.view)
    if not hasattr(rig, "feature_points"):      # an avatar has its eyes and mouth elsewhere, and larger or smaller
        places = [at for name, at in rig.landmark_points(vertices, detail=detail).items()
                  if name.startswith(MARKS[str(one.close)])]
        target, zoom = np.mean(places, axis=0), CLOSE_SHARE * size / (whole.scale * np.ptp(places, axis=0).max())
    return replace(whole, target=np.array(target), scale=whole.scale * zoom, offset=(size / 2, size / 2))
