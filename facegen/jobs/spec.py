"""What pictures a data set is to have: read from a jobs file or plain data, and checked before any work.

A product names lists, and every combination of their members is a picture; ``pictures`` lists pictures one by one;
``random`` draws them, the same ones for the same seed. Several may stand in one file.
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any

from facegen.errors import FacegenError, InputError, TableError
from facegen.face.face import load_face
from facegen.face.named import face_names, is_face_name
from facegen.facs.expression_table import is_path
from facegen.facs.expressions import Resolution, full_name, resolve
from facegen.facs.tables import load_units
from facegen.facs.units import load_catalogue
from facegen.facs.validate import Entry
from facegen.facs.yamlfile import read_data
from facegen.geometry.camera import check_view
from facegen.render.backends import RENDERERS, choose
from facegen.render.lighting import light_names
from facegen.render.request import MAX_DETAIL, check_look, check_size
from facegen.render.wishes import parse_background, parse_size, parse_view

MOST = 1_000_000
"""Pictures that one batch may have: more is a slip, or wants several batches."""

FORMATS = ("png", "webp", "jpg")
# Key of a list -> key of one of its members, in the order in which they vary, the slowest first.
LISTS = {"faces": "face", "people": "person", "sizes": "size", "lights": "light", "backgrounds": "background",
         "views": "view", "poses": "pose", "intensities": "intensity"}
DEFAULTS: Mapping[str, Any] = {"face": "akimoto", "person": None, "size": 512, "light": "portrait",
                               "background": "plain", "view": (0.0, 0.0), "intensity": 1.0}
SETTINGS = ("format", "detail", "renderer", "orthographic", "masks", "feature_points")
_NOBODY = ("nobody", "none")        # as a person: the common tables
_RANGES = ("yaw", "pitch", "intensity")
_MOST_UNITS = 12
_MOST_LOOKED_AT = 300       # poses of units that a face is asked about: a million drawn ones would take an hour


@dataclass(frozen=True)
class Picture:
    """One picture: what is asked for, and what it means. ``units`` and ``deformation``: one of them is empty.

    ``own``: members of the unit table's basis that the person moves otherwise, of those in use. ``number``: its place
    among drawn pictures, 0 for others. ``called``: its own name, if it was given one.
    """

    pose: str
    kind: str
    caption: str
    units: tuple[tuple[str, float], ...]
    deformation: Any
    face: str
    person: str | None
    intensity: float
    size: tuple[int, int]
    view: tuple[float, float]
    light: str
    background: str | tuple[float, ...]
    own: Any = ()
    number: int = 0
    called: str | None = None


@dataclass(frozen=True)
class Settings:
    """What all pictures of a batch have in common."""

    format: str = "png"
    detail: int | None = None
    renderer: str = "auto"
    orthographic: bool = False
    masks: bool = False
    feature_points: bool = False


@dataclass(frozen=True)
class Batch:
    """A data set to be made."""

    settings: Settings
    pictures: tuple[Picture, ...]
    warnings: tuple[str, ...] = ()


def read_batch(jobs: str | Path | Mapping[str, Any]) -> Batch:
    """Return the batch that a jobs file (YAML or JSON) or plain data of the same form describes.

    Paths in a file are relative to it. Raises TableError (names file and key, and the nearest valid name) or
    FileError.
    """
    if isinstance(jobs, Mapping):
        return _Reader(Path(), "jobs").batch(Entry(jobs, "jobs"))
    if not isinstance(jobs, (str, Path)):
        raise InputError(f"jobs: expected a file or a mapping, got {type(jobs).__name__}")
    path = Path(jobs)
    return _Reader(path.parent, str(path)).batch(Entry(read_data(path), str(path)))


class _Reader:
    """Reads one file; what was looked up once is kept, for products repeat it."""

    def __init__(self, folder: Path, source: str) -> None:
        self.folder, self.source = folder, source
        self._meanings: dict[Any, Resolution] = {}
        self._points = False
        self._fitting: set[Any] = set()
        self._warnings: list[str] = []      # of faces that cannot show all of a pose

    def batch(self, top: Entry) -> Batch:
        """Return the whole batch."""
        fields = top.fields(optional=(*LISTS, *SETTINGS, "pictures", "products", "random"))
        settings = self._settings(fields)
        self._points = settings.feature_points
        own = {key: fields[key] for key in LISTS if key in fields}
        sections: list[tuple[int, Callable[[], Iterator[Picture]]]] = []
        if "poses" in own:
            sections.append(self._product(own, top))
        elif own and "products" not in fields:      # they would be passed over in silence
            raise top.fail(f"the key 'poses' is missing: {', '.join(own)} go with poses (or products) alone")
        for entry in fields["products"].each() if "products" in fields else ():
            lists = entry.fields(required=("poses",), optional=tuple(key for key in LISTS if key != "poses"))
            sections.append(self._product({**own, **lists}, entry))
        if "pictures" in fields:
            sections.append(self._listed(fields["pictures"]))
        if "random" in fields:
            drawn = fields["random"]
            for entry in drawn.each() if isinstance(drawn.value, list) else [drawn]:
                sections.append(self._drawn(entry))
        count = sum(number for number, _ in sections)
        if not count:
            raise top.fail("no pictures: give poses (with views, faces, people ...), pictures, products or random")
        if count > MOST:
            raise top.fail(f"{count:,} pictures are more than one batch may have ({MOST:,}); shorten a list, or make "
                           "several batches")
        pictures = [picture for _, section in sections for picture in section()]
        # Said twice is drawn once; drawn ones may repeat.
        warnings = [warning for meaning in self._meanings.values() for warning in meaning.warnings]
        return Batch(settings, tuple(dict.fromkeys(pictures)), tuple(dict.fromkeys([*warnings, *self._warnings])))

    def _settings(self, fields: Mapping[str, Entry]) -> Settings:
        asked: dict[str, Any] = {}
        if "format" in fields:
            asked["format"] = fields["format"].choice(FORMATS, "format")
        if "detail" in fields and fields["detail"].value is not None:
            asked["detail"] = fields["detail"].index(MAX_DETAIL + 1, "a subdivision level")
        for key in ("orthographic", "masks", "feature_points"):
            if key in fields:
                asked[key] = fields[key].flag()
        name = fields["renderer"].choice(RENDERERS, "renderer") if "renderer" in fields else "auto"
        self._checked(fields.get("renderer"), lambda: choose(name))
        asked["renderer"] = name
        return Settings(**asked)

    # -- sections -----------------------------------------------------------------------------------------------
    def _product(self, lists: Mapping[str, Entry], entry: Entry) -> tuple[int, Callable[[], Iterator[Picture]]]:
        members = {one: self._members(lists[key], key) if key in lists else [(DEFAULTS[one], entry)]
                   for key, one in LISTS.items()}
        return math.prod(map(len, members.values())), lambda: (
            self._picture(dict(zip(members, combination, strict=True)))
            for combination in product(*members.values()))

    def _listed(self, entry: Entry) -> tuple[int, Callable[[], Iterator[Picture]]]:
        wishes = []
        for one in entry.each():
            fields = one.fields(required=("pose",), optional=(*LISTS.values(), "name"))
            called = fields.pop("name").text() if "name" in fields else None
            wishes.append(({**{key: (value, one) for key, value in DEFAULTS.items()},
                            **{key: (self._value(key, field), field) for key, field in fields.items()}}, called))
        return len(wishes), lambda: (replace(self._picture(wish), called=called) for wish, called in wishes)

    def _drawn(self, entry: Entry) -> tuple[int, Callable[[], Iterator[Picture]]]:
        fields = entry.fields(required=("count", "seed"),
                              optional=("poses", "units", "faces", "people", "sizes", "lights", "backgrounds",
                                        *_RANGES))
        count, seed = fields["count"].index(10**12, "a number of pictures"), fields["seed"].index(2**53, "a seed")
        if ("poses" in fields) == ("units" in fields):
            raise entry.fail("give either poses to choose from or units to combine")
        ranges = {"yaw": (0.0, 0.0), "pitch": (0.0, 0.0), "intensity": (1.0, 1.0)}
        limits = {"yaw": (-360, 360), "pitch": (-90, 90), "intensity": (0, 1)}
        ranges.update({key: _range(fields[key], *limits[key]) for key in _RANGES if key in fields})
        members = {LISTS[key]: self._members(fields[key], key) for key in
                   ("faces", "people", "sizes", "lights", "backgrounds", "poses") if key in fields}
        units = self._unit_ranges(fields["units"]) if "units" in fields else None

        def pictures() -> Iterator[Picture]:
            dice = random.Random(seed)      # only its random() is used, which never changes from version to version
            for number in range(1, count + 1):
                wish = {key: (value, entry) for key, value in DEFAULTS.items()}
                for key, choices in members.items():
                    wish[key] = choices[int(dice.random() * len(choices))]
                at = {key: round(low + dice.random() * (high - low), 2) for key, (low, high) in ranges.items()}
                wish |= {"view": ((at["yaw"], at["pitch"]), entry), "intensity": (at["intensity"], entry)}
                if units is not None:
                    wish["pose"] = (_some_units(units, dice), fields["units"])
                yield replace(self._picture(wish), number=number)

        return count, pictures

    def _unit_ranges(self, entry: Entry) -> tuple[dict[str, tuple[float, float]], tuple[int, int]]:
        """Return code -> range of its weight, and how many are combined."""
        fields = dict(entry.items())
        few, many = _range(fields.pop("together"), 1, _MOST_UNITS, whole=True) if "together" in fields else (1, 3)
        known = load_catalogue()
        ranges = {}
        for code, one in fields.items():
            self._checked(one, lambda code=code: known.expand({code: 1.0}))
            ranges[code] = _range(one, 0, 1)
        if len(ranges) < many:
            raise entry.fail(f"{many} units are to be combined, but only {len(ranges)} are given")
        return ranges, (int(few), int(many))

    # -- members ------------------------------------------------------------------------------------------------
    def _members(self, entry: Entry, key: str) -> list[tuple[Any, Entry]]:
        """Return the members of a list, each with its entry; one alone may stand without brackets."""
        entries = entry.each() if isinstance(entry.value, (list, tuple)) else [entry]
        if not entries:
            raise entry.fail("expected one member or more, got an empty list: there would be no pictures")
        return [(self._value(LISTS[key], one), one) for one in entries]

    def _value(self, key: str, entry: Entry) -> Any:
        """Return one member, checked as far as it can be alone."""
        value = entry.value
        if key == "pose":
            if not isinstance(value, (str, int, Mapping)) or isinstance(value, bool):
                raise entry.wrong("an expression, a FACS script, a file, or a mapping of units or movements")
            return value if isinstance(value, Mapping) else self._at_home(full_name(str(value)))
        if key == "person":
            nobody = value is None or (isinstance(value, str) and value.strip().casefold() in _NOBODY)
            return None if nobody else self._at_home(entry.text())
        if key == "face":
            name = entry.text()
            face = name if is_face_name(name) else str((self.folder / name).resolve())
            if face != name and not Path(face).exists():
                entry.choice(face_names(), "face")
            rig = self._checked(entry, lambda: load_face(face))
            if self._points and not hasattr(rig, "feature_point_places"):
                raise entry.fail(f"feature_points: {rig.name} is an avatar and has none, only landmarks; leave "
                                 "feature_points out or take the base face")
            return face
        if key == "light":
            return entry.choice(light_names(), "light")
        if key == "intensity":
            return entry.number(0, 1)
        check = {"size": lambda: check_size(parse_size(value) if isinstance(value, str) else value),
                 "view": lambda: check_view(parse_view(value) if isinstance(value, str) else
                                            (value, 0) if isinstance(value, (int, float)) else value),
                 "background": lambda: check_look(background=parse_background(value) if isinstance(value, str)
                                                  else value).background}
        return self._checked(entry, check[key])

    def _at_home(self, text: str) -> str:
        """Return a text, as a path from here if it is a path of the file's folder."""
        return str(self.folder / text) if is_path(text) and not Path(text).is_absolute() else text

    def _picture(self, wish: Mapping[str, tuple[Any, Entry]]) -> Picture:
        """Return one picture, its pose understood."""
        value = {key: one for key, (one, _) in wish.items()}
        pose, entry = wish["pose"]
        said = _frozen(pose)
        meaning = self._meaning(said, pose, value["person"], value["intensity"], wish)
        if (said, value["face"]) not in self._fitting and (not meaning.units or len(self._fitting) < _MOST_LOOKED_AT):
            self._warnings += self._checked(entry, lambda: load_face(value["face"]).check(meaning))
            self._fitting.add((said, value["face"]))
        raw = None if meaning.kind != "deformation" else _frozen(meaning.deformation.as_dict())
        return Picture(pose=pose if isinstance(pose, str) else _spoken(pose), kind=meaning.kind, caption=meaning.name,
                       units=tuple(meaning.units.items()), deformation=raw, face=value["face"],
                       person=value["person"], intensity=value["intensity"], size=check_size(value["size"]),
                       view=value["view"], light=value["light"], background=value["background"],
                       own=_own(meaning))

    def _meaning(self, said: Any, pose: Any, person: str | None, intensity: float,
                 wish: Mapping[str, tuple[Any, Entry]]) -> Resolution:
        key = (said, person, intensity)
        if key not in self._meanings:
            if person is not None:      # so that the person's key is named if it is the person that is wrong
                self._checked(wish["person"][1], lambda: resolve("neutral", person=person))
            self._meanings[key] = self._checked(wish["pose"][1],
                                                lambda: resolve(pose, person=person, intensity=intensity))
        return self._meanings[key]

    def _checked(self, entry: Entry | None, check: Callable[[], Any]) -> Any:
        """Return what a check gives; its error gets the entry's key path."""
        try:
            return check()
        except FacegenError as error:
            if entry is None or entry.source != self.source:
                raise
            raise entry.fail(str(error)) from error
        except (TypeError, ValueError) as error:
            raise (entry.fail(str(error)) if entry else TableError(str(error))) from error


def _own(meaning: Resolution) -> Any:
    """Return what a person moves otherwise in this pose."""
    if not meaning.own:
        return ()
    used = load_units().coefficients(meaning.units)
    return _frozen({name: one.as_dict() for name, one in meaning.own.items() if name in used})


def _range(entry: Entry, low: float, high: float, *, whole: bool = False) -> tuple[float, float]:
    """Return [low, high] of an entry, or twice the same if it is one number."""
    pair = entry.each() if isinstance(entry.value, (list, tuple)) else [entry, entry]
    if len(pair) != 2:
        raise entry.wrong("one number or a range [from, to]")
    first, last = (one.number(low, high) for one in pair)
    if first > last or (whole and (first % 1 or last % 1)):
        raise entry.wrong("a range [from, to] of whole numbers" if whole else "a range [from, to], the smaller first")
    return first, last


def _some_units(units: tuple[dict[str, tuple[float, float]], tuple[int, int]], dice: random.Random
                ) -> dict[str, float]:
    ranges, (few, many) = units
    left, chosen = list(ranges), {}
    for _ in range(few + int(dice.random() * (many - few + 1))):
        code = left.pop(int(dice.random() * len(left)))
        low, high = ranges[code]
        chosen[code] = round(low + dice.random() * (high - low), 3)
    return {code: chosen[code] for code in ranges if code in chosen}


def _frozen(value: Any) -> Any:
    """Return plain data as something that can be a key; `thawed` gives it back."""
    if isinstance(value, Mapping):
        return ("map", *((str(k), _frozen(v)) for k, v in value.items()))
    if isinstance(value, (list, tuple)):
        return ("list", *map(_frozen, value))
    return value


def thawed(value: Any) -> Any:
    """Return plain data from its frozen form."""
    if isinstance(value, tuple):
        kind, *items = value
        return {k: thawed(v) for k, v in items} if kind == "map" else [thawed(v) for v in items]
    return value


def _spoken(pose: Mapping[str, Any]) -> str:
    import json

    return json.dumps(pose, ensure_ascii=False)
