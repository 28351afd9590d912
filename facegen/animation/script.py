"""Read a clip from a YAML or JSON script (docs/clips.md), or make one of a few poses."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Mapping
from pathlib import Path

from facegen.animation.angles import AXES, turned
from facegen.animation.clip import LONGEST, Clip, Event, Keyframe, Pose, Track, joined, own_units, pose_of
from facegen.animation.coarticulation import SpeechTrack
from facegen.animation.easing import DEFAULT_EASE, EASES
from facegen.animation.idle import Idle
from facegen.animation.layer import Layer
from facegen.animation.speech_script import NO_FILES, read_speech_entry
from facegen.animation.timing import load_timing
from facegen.errors import FacegenError, InputError, TableError
from facegen.facs.deformation import deformation_from_entry
from facegen.facs.expression_table import Person, is_path, load_person
from facegen.facs.expressions import Resolution, resolve
from facegen.facs.tables import load_units
from facegen.facs.validate import Entry
from facegen.facs.yamlfile import read_data
from facegen.fileio.sound import Sound, mixed

_POSE = ("pose", "raw", "head", "eyes", "intensity")
_PARTS = ("onset", "apex", "offset")
_EYES = tuple(f"{mark}{number}" for number in range(61, 67) for mark in ("", "L", "R"))


def load_clip(script: str | os.PathLike[str] | Mapping[str, object], *,
              person: str | Path | Person | None = None, idle: int | Idle | None = None, files: bool = True) -> Clip:
    """Return the clip of a script: the path of a YAML or JSON file, or the same as plain data.

    person: whose habits, instead of the script's. idle: the seed of an idle layer, instead of the script's. files:
    whether the script may name files (poses, people, timings, sounds); say False for one that a stranger wrote.
    Raises FileError, or TableError that names the place in the script.
    """
    if isinstance(script, Mapping):
        return _Reader(Entry(script, "clip"), Path(), person, files).clip(idle)
    if not isinstance(script, (str, os.PathLike)):
        raise InputError(f"script: expected the path of a YAML or JSON file, or a mapping, got {type(script).__name__}")
    path = Path(script)
    return _Reader(Entry(read_data(path), str(path)), path.parent, person, files).clip(idle)


def morph(*poses: object, seconds: float = 1.0, hold: float = 0.5, back: bool = False, ease: str = DEFAULT_EASE,
          person: str | Path | Person | None = None, idle: int | Idle | None = None) -> Clip:
    """Return a clip from pose to pose, two or more, each anything that a face's ``pose`` takes.

    seconds: of each change. hold: seconds that each pose stands still. back: return to the first pose at the end, so
    that the clip can be shown round and round. Raises InputError.
    """
    if len(poses) < 2:
        raise InputError(f"poses: a morph needs two or more, got {len(poses)}")
    for name, value, low in (("seconds", seconds, 0.01), ("hold", hold, 0.0)):
        try:
            Entry(value, name).number(low, LONGEST)
        except TableError as error:
            raise InputError(str(error)) from error
    meanings = [resolve(pose, person=person) if not isinstance(pose, Resolution) else pose for pose in poses]
    stops = [pose_of(one) for one in meanings]
    if back:
        stops.append(stops[0])
    keys, t = [], 0.0
    for k, stop in enumerate(stops):
        keys.append(Keyframe(t, stop, ease))
        if hold and not (back and k == len(stops) - 1):
            t += hold
            keys.append(Keyframe(t, stop, ease))
        t += seconds
    warnings = tuple(dict.fromkeys(warning for one in meanings for warning in one.warnings))
    return Clip((Track("morph", tuple(keys)),), keys[-1].t, _idle(idle), warnings, own=own_units(meanings))


def _idle(idle: int | Idle | None) -> Idle | None:
    return idle if idle is None or isinstance(idle, Idle) else Idle(idle)


class _Reader:
    """One pass over a script."""

    def __init__(self, root: Entry, folder: Path, person: str | Path | Person | None, files: bool) -> None:
        self.root, self.folder, self.files = root, folder, files
        self.fields = root.fields(optional=("about", "duration", "person", "intensity", "idle", "keyframes", "events",
                                            "tracks", "speech"))
        self.person = load_person(person) if person is not None else self._person()
        self.intensity = self.fields["intensity"].number(0.0, 1.0) if "intensity" in self.fields else 1.0
        self.warnings: list[str] = []
        self.sounds: list[tuple[float, Sound]] = []

    def clip(self, idle: int | Idle | None) -> Clip:
        """Return the whole clip; ``idle`` goes before the script's own."""
        fields = self.fields
        if "about" in fields:
            fields["about"].text()
        tracks: list[Layer] = [self._track(key, {key: fields[key]}) for key in ("keyframes", "events")
                               if key in fields]
        for k, entry in enumerate(fields["tracks"].each() if "tracks" in fields else ()):
            inner = entry.fields(optional=("name", "replace", "keyframes", "events", "speech"))
            if sum(key in inner for key in ("keyframes", "events", "speech")) != 1:
                raise entry.fail("a track has either keyframes or events or speech; write a track for each")
            name = inner["name"].text() if "name" in inner else f"track {k + 1}"
            tracks.append(self._speech(name, inner) if "speech" in inner else self._track(name, inner))
        if "speech" in fields:
            tracks.append(self._speech("speech", {"speech": fields["speech"]}))
        moved = any(atom in _EYES for track in tracks for pose in track.poses for atom in pose.atoms) \
            or any(pose.raw is not None and pose.raw.eyes for track in tracks for pose in track.poses)
        layer = _idle(idle) if idle is not None else self._idle()
        if layer is not None and moved:
            layer = dataclasses.replace(layer, glances=False)       # the script says where the eyes go
        if not tracks and layer is None:
            raise self.root.fail("nothing happens: give keyframes, events, speech, tracks or idle")
        return Clip(tuple(tracks), self._duration(tracks), layer, tuple(dict.fromkeys(self.warnings)),
                    mixed(self.sounds), load_units().own_basis(self.person))

    def _duration(self, tracks: list[Layer]) -> float:
        """Return the clip's length, by default until all is over."""
        end = max((track.end for track in tracks), default=0.0)
        if "duration" not in self.fields:
            if end > 0.0:
                return end
            raise self.root.fail("a clip of 0 seconds: give duration, or a keyframe after t: 0")
        entry = self.fields["duration"]
        duration = entry.number(0.0, LONGEST)
        if duration == 0.0:
            raise entry.wrong("a number of seconds above 0")
        for track in tracks:
            late = track.begins
            if late > duration:
                raise entry.fail(f"the clip ends at {duration:g} s, but in {track.name} something begins at "
                                 f"{late:g} s: raise duration or leave it out")
        return duration

    def _speech(self, name: str, fields: Mapping[str, Entry]) -> SpeechTrack:
        said = read_speech_entry(fields["speech"], self.folder, files=self.files)
        self.warnings += said.speech.warnings
        if said.sound is not None:
            self.sounds.append((said.at, said.sound))
        replaces = self._replaces(fields) if "replace" in fields else None
        return SpeechTrack(name, said.speech.later(said.at), said.effort, replaces)

    def _track(self, name: str, fields: Mapping[str, Entry]) -> Track:
        kind = "keyframes" if "keyframes" in fields else "events"
        entries = fields[kind].each()
        if not entries:
            raise fields[kind].wrong("a list with something in it")
        if kind == "events":
            return Track(name, events=tuple(map(self._event, entries)), replaces=self._replaces(fields))
        keys = tuple(map(self._keyframe, entries))
        for entry, before, after in zip(entries[1:], keys, keys[1:], strict=False):
            if after.t <= before.t:
                raise Entry(after.t, entry.source, entry.child("t")).fail(
                    f"keyframes go in order of time: {after.t:g} s comes after {before.t:g} s"
                    + ("; for a jump, let the second be later and say ease: step" if after.t == before.t else ""))
        return Track(name, keyframes=keys, replaces=self._replaces(fields))

    def _replaces(self, fields: Mapping[str, Entry]) -> str | frozenset[str]:
        if "replace" not in fields:
            return frozenset()
        entry = fields["replace"]
        if entry.value == "all":
            return "all"
        try:
            found = resolve(self._no_file(entry, str(entry.value) if type(entry.value) is int else entry.text()))
        except FacegenError as error:
            raise entry.fail(f"expected all, or units such as 24+25+26: {error}") from error
        if not found.units:
            raise entry.wrong("all, or units such as 24+25+26")
        return frozenset(load_units().catalogue.expand(found.units))

    def _keyframe(self, entry: Entry) -> Keyframe:
        fields = entry.fields(required=("t",), optional=(*_POSE, "ease"))
        ease = fields["ease"].choice(EASES, "ease") if "ease" in fields else DEFAULT_EASE
        pose, _ = self._pose(entry, fields, None)
        return Keyframe(fields["t"].number(0.0, LONGEST), pose, ease)

    def _event(self, entry: Entry) -> Event:
        fields = entry.fields(required=("at",), optional=(*_POSE, "kind", "ease", *_PARTS))
        timing = load_timing()
        kind = timing.kinds[fields["kind"].choice(timing.kinds, "kind of event")] if "kind" in fields else None
        pose, name = self._pose(entry, fields, kind.pose if kind else None)
        kind = kind or timing.kind_of(name)
        times = {part: fields[part].number(0.0, LONGEST) if part in fields else getattr(kind, part) for part in _PARTS}
        if not any(times.values()):
            raise entry.fail("onset, apex and offset are all 0: an event takes time")
        if "ease" in fields:
            both = fields["ease"].choice(EASES, "ease")
            eases = {"onset_ease": both, "offset_ease": both}
        else:
            eases = {"onset_ease": kind.onset_ease, "offset_ease": kind.offset_ease}
        return Event(fields["at"].number(0.0, LONGEST), pose, **times, **eases)

    def _pose(self, entry: Entry, fields: Mapping[str, Entry], default: str | None) -> tuple[Pose, str | None]:
        """Return what an entry shows, and the name of its expression; ``default`` is the pose of its kind."""
        if not any(key in fields for key in ("pose", "raw", "head", "eyes")) and default is None:
            raise entry.fail("nothing to show: give pose, raw, head or eyes")
        poses, name = [], None
        intensity = self.intensity * (fields["intensity"].number(0.0, 1.0) if "intensity" in fields else 1.0)
        if "pose" in fields or not any(key in fields for key in ("raw", "head", "eyes")):
            at = fields.get("pose", entry)
            found = self._meaning(at, at.value if "pose" in fields else default, intensity)
            self.warnings += found.warnings
            poses.append(pose_of(found))
            name = found.expression.name if found.expression else None
        elif "intensity" in fields and "raw" not in fields:
            raise fields["intensity"].fail("intensity belongs to a pose; angles are degrees as they are")
        if "raw" in fields:
            raw = deformation_from_entry(fields["raw"]) * intensity
            if any(pose.raw is not None for pose in poses):
                raise fields["raw"].fail("the pose is raw data already; give it units, or leave one of the two out")
            poses.append(Pose(raw=raw))
        for part in ("head", "eyes"):
            if part in fields:
                poses.append(self._turned(part, fields[part]))
        try:
            return joined(poses), name
        except InputError as error:
            raise entry.fail(str(error)) from error

    def _meaning(self, entry: Entry, what: object, intensity: float) -> Resolution:
        if type(what) is int:                       # a bare 12 reads as a number
            what = str(what)
        if isinstance(what, str) and is_path(what) and not Path(what).expanduser().is_absolute():
            what = str(self.folder / what)          # files lie beside the script
        if isinstance(what, str):
            self._no_file(entry, what)
        try:
            return resolve(what, person=self.person, intensity=intensity)
        except FacegenError as error:
            raise entry.fail(str(error).removeprefix("what: ")) from error

    def _no_file(self, entry: Entry, text: str) -> str:
        """Return a text; an error if it names a file where none may be named."""
        if not self.files and is_path(text):
            raise entry.fail(NO_FILES)
        return text

    def _turned(self, part: str, entry: Entry) -> Pose:
        angles = {axis: one.number(-360.0, 360.0) for axis, one in entry.fields(optional=AXES[part]).items()}
        try:
            return Pose(load_units().catalogue.expand(turned(part, angles)))
        except InputError as error:
            raise entry.fail(str(error)) from error

    def _person(self) -> Person | None:
        if "person" not in self.fields:
            return None
        entry = self.fields["person"]
        name = self._no_file(entry, entry.text())
        try:
            return load_person(self.folder / name if is_path(name) else name)
        except FacegenError as error:
            raise entry.fail(str(error).removeprefix("person: ")) from error

    def _idle(self) -> Idle | None:
        """Return the script's idle layer: a seed, or a mapping with parts switched off."""
        if "idle" not in self.fields:
            return None
        entry = self.fields["idle"]
        parts = ("blink", "gaze", "head")
        fields = {"seed": entry}
        if isinstance(entry.value, Mapping):
            fields = entry.fields(required=("seed",), optional=parts)
        seed = fields["seed"].number(0, 2**53)
        if seed != int(seed):
            raise fields["seed"].wrong("a whole number as the seed")
        return Idle(int(seed), **{part: fields[part].flag() for part in parts if part in fields})
