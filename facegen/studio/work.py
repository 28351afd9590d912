"""What a person makes on one page of the studio, as data: frozen, so that undoing is keeping the one before.

Nothing here knows the browser. A :class:`Work` goes to a JSON file and comes back the same; each panel has a section of
its own, and what a section holds is checked where it is made and again when a file is read.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from typing import Any, Self

from facegen.animation.streams.calibrate import Calibration
from facegen.animation.streams.smooth import OneEuro
from facegen.animation.streams.times import check_fps
from facegen.errors import InputError, TableError
from facegen.face.gaze import look_at
from facegen.facs.deformation import Deformation, deformation_from_dict
from facegen.facs.expression_table import HABITS, Person, person_from_data
from facegen.facs.expressions import Resolution, resolve
from facegen.facs.notation import canonical
from facegen.facs.person_file import check_count
from facegen.facs.tables import load_units
from facegen.facs.validate import Entry
from facegen.studio.avatar_checks import check_avatar
from facegen.studio.limits import LIMITS
from facegen.studio.recordings import safe_name
from facegen.studio.timeline import check_form

SPEED = (0.1, 4.0)
"""Least and most of a clip's speed, 1 as it is."""

SHOWN = ("clip", "recording")

VERSION = 1
"""Of the file's form."""

_FORM = "facegen_studio"

FARTHEST = 1e6
"""Millimetres to a point that is looked at."""


@dataclass(frozen=True)
class FaceWork:
    """What the face shows.

    rig: the name of a shipped face or avatar, or of what was opened on this page. person: whose habits, a shipped
    person's name or that of a file of the work's own (`Desk.people`), or None. units:
    unit code -> weight 0..1, as a script gives them. blend: expression -> share 0..1 that ``units`` came from; empty as
    soon as a unit is changed by hand. raw: movements on top, the form of a deformation file (docs/files.md). intensity:
    0..1, of units and raw data alike. gaze: {"x", "y", "z"}, mm, of the point at which the eyes look whatever else
    moves them, or nothing. apart: whether the sliders of left and right are apart.
    """

    rig: str = "akimoto"
    person: str | None = None
    units: Mapping[str, float] = field(default_factory=dict)
    blend: Mapping[str, float] = field(default_factory=dict)
    raw: Mapping[str, Any] = field(default_factory=dict)
    intensity: float = 1.0
    gaze: Mapping[str, float] = field(default_factory=dict)
    apart: bool = False

    @property
    def script(self) -> str:
        """The units as a FACS script; "0" where there are none."""
        return canonical(self.units)

    @property
    def deformation(self) -> Deformation:
        """The raw movements, intensity not applied."""
        return deformation_from_dict(self.raw) if self.raw else Deformation()

    def meaning(self, person: Person | None = None, rig: Any = None) -> Resolution:
        """Return what a rig is to show.

        person: who ``person`` is (`Desk.person`); their units move their way. rig: the face, whose eyes look at the
        point that ``gaze`` says; without one they do not. Feature points that it has not are left out.
        """
        gazes = bool(self.gaze) and rig is not None
        units = {code: weight for code, weight in self.units.items() if not (gazes and _turns_eyes(code))}
        found = resolve(units or "neutral", person=person, intensity=self.intensity)
        raw = self.deformation * self.intensity
        if hasattr(rig, "possible"):            # moved on another face; the tab of points says so
            raw = rig.possible(raw)
        if gazes:
            return _gazing(found, raw, self.gaze, rig)
        return replace(found, more=(*found.more, raw)) if raw else found

    def checked(self) -> Self:
        """Return itself, or raise InputError for what no face can show."""
        for name, share in self.blend.items():
            Entry(share, "face", f"blend.{name}").number(0.0, 1.0)
        if self.gaze:
            point = Entry(self.gaze, "face", "gaze").fields(required=("x", "y", "z"))
            for entry in point.values():
                entry.number(-FARTHEST, FARTHEST)
        self.meaning()
        return self


def _gazing(found: Resolution, raw: Deformation, gaze: Mapping[str, float], rig: Any) -> Resolution:
    """Return the meaning with other eyes: they look at a point, whatever units and raw data say of them."""
    units, raw = replace(found.deformation, eyes={}), replace(raw, eyes={})
    found = replace(found, deformation=units, more=(*found.more, *([raw] if raw else ())))
    eyes = look_at(rig, [gaze[axis] for axis in "xyz"], head=rig.head_angles(found))
    return replace(found, more=(*found.more, Deformation(eyes=eyes)))


def _turns_eyes(code: str) -> bool:
    """Return whether a unit turns an eye: a gaze takes its place, lids and all."""
    table = load_units()
    return any(table.basis[name].eyes for name in table.coefficients({code: 1.0}))


@dataclass(frozen=True)
class ClipWork:
    """The timeline: a clip's script as plain data (docs/clips.md), a recording, and how they are played.

    shown: which of `SHOWN` plays. recording: the name of the file in the work's folder, or None. recorded_fps: its
    frames a second if the file has no times, 0 if it has. face_id, calibrate, smooth: as `facegen.load_performance`
    takes them, "" for none; calibrate_head: head and gaze as well.
    """

    script: Mapping[str, Any] = field(default_factory=dict)
    speed: float = 1.0
    loop: bool = True
    shown: str = "clip"
    recording: str | None = None
    recorded_fps: float = 0.0
    face_id: str = ""
    calibrate: str = ""
    calibrate_head: bool = False
    smooth: str = ""

    def checked(self) -> Self:
        """Return itself, or raise InputError."""
        if self.script:
            check_form(dict(self.script))
        Entry(self.speed, "clip", "speed").number(*SPEED)
        Entry(self.shown, "clip", "shown").choice(SHOWN, "what is played")
        if self.recording is not None:
            safe_name(self.recording)
        check_fps(self.recorded_fps or None)
        Calibration.of(self.calibrate or None)
        OneEuro.of(self.smooth or None)
        return self


@dataclass(frozen=True)
class AvatarWork:
    """An avatar on its way to blendshapes.

    file: the name under which it was opened, or a shipped avatar's, or None. up, front: axes of the file, "y" or "-z",
    in which the head stands and looks. landmarks: name -> {"face": triangle, "barycentric": [a, b, c]}, what was
    clicked or confirmed. skipped: optional landmarks that are not wanted -> True. symmetric: whether a partner moves
    along. sets, opening, lid_closure, weights, pieces: as `facegen.rig` takes them, sets by commas.
    """

    file: str | None = None
    up: str = "y"
    front: str = "z"
    landmarks: Mapping[str, Any] = field(default_factory=dict)
    skipped: Mapping[str, bool] = field(default_factory=dict)
    symmetric: bool = True
    sets: str = "units,arkit,visemes"
    opening: float = 1.0
    lid_closure: float = 1.0
    weights: Mapping[str, Any] = field(default_factory=dict)
    pieces: Mapping[str, str] = field(default_factory=dict)

    def checked(self) -> Self:
        """Return itself, or raise InputError."""
        check_avatar(self)
        return self


@dataclass(frozen=True)
class TableWork:
    """A person's table on its way to a file.

    file: the name it is saved under among the work's people (`Desk.people`), or None while there is no person. data:
    the table as plain data (docs/tables.md); one without habits yet is no error here.
    """

    file: str | None = None
    data: Mapping[str, Any] = field(default_factory=dict)

    @property
    def person(self) -> Person | None:
        """Whose habits these are; nobody while there are none."""
        return person_from_data(self.data, self.file or "table") if any(map(self.data.get, HABITS)) else None

    def checked(self) -> Self:
        """Return itself, or raise InputError."""
        check_count(self.data, LIMITS.habits, self.file or "table")
        load_units().own_basis(self.person)
        return self


@dataclass(frozen=True)
class Work:
    """All of one page."""

    face: FaceWork = field(default_factory=FaceWork)
    clip: ClipWork = field(default_factory=ClipWork)
    avatar: AvatarWork = field(default_factory=AvatarWork)
    table: TableWork = field(default_factory=TableWork)

    def plain(self) -> dict[str, Any]:
        """Return it as what JSON can hold."""
        return {_FORM: VERSION, **asdict(self)}

    @classmethod
    def read(cls, data: object, source: str = "work") -> Self:
        """Return the work that `plain` gave; TableError names what is wrong and where."""
        found = Entry(data, source).fields(required=(_FORM,), optional=_SECTIONS)
        found.pop(_FORM).choice((str(VERSION),), "form of the studio's work")
        return cls(**{name: _section(_SECTIONS[name], entry) for name, entry in found.items()})


_SECTIONS = {"face": FaceWork, "clip": ClipWork, "avatar": AvatarWork, "table": TableWork}


def _section(kind: Any, entry: Entry) -> Any:
    """Return a section, each field of the type that it has when new."""
    plain, values = kind(), {}
    for name, one in entry.fields(optional=[each.name for each in fields(kind)]).items():
        usual = getattr(plain, name)
        if usual is None or isinstance(usual, str):
            values[name] = usual if one.value == usual else one.text()      # "" and None where that is usual
        elif isinstance(usual, bool):
            values[name] = one.flag()
        elif isinstance(usual, float):
            values[name] = one.number()
        else:
            values[name] = {key: each.value for key, each in one.items()}
    try:
        return kind(**values).checked()
    except TableError:
        raise
    except InputError as error:
        raise entry.fail(str(error)) from error
