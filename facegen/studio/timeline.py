"""Edits of a clip's script as plain data: each gives a new script, or raises InputError, and what it was given stays.

Edits see to the script's form; what its words mean, which may depend on a person, `read` says.

A track is named by where it stands in the script: "keyframes" and "events" at the top, "tracks.0" and so on below them,
"speech". `NEW` is a track that the edit makes. Keyframes stay in order of time; a key that is set where one stands
takes its place. A script without anything left is empty.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from facegen.animation.clip import LONGEST, Clip
from facegen.animation.script import load_clip
from facegen.animation.timing import load_timing
from facegen.errors import InputError, TableError
from facegen.facs.expression_table import Person, load_expressions
from facegen.facs.validate import Entry
from facegen.studio.limits import LIMITS

NEW = "new"
"""The name of a track that is not there yet."""

NEW_LENGTH = 4.0
"""Seconds of a clip that begins with one key: time to set a few more."""

SAME = 0.0005
"""Seconds: keys nearer than this are one; times are kept to the millisecond."""

SHOWS = ("pose", "raw", "head", "eyes", "intensity")
"""What an entry may show."""

_WHEN = {"keyframes": "t", "events": "at"}
_PARTS = ("onset", "apex", "offset")
_ENTRIES = {"keyframes": (*SHOWS, "ease"), "events": (*SHOWS, "ease", "kind", *_PARTS)}
_KINDS = ("keyframes", "events", "speech")
_MOVES = (*_KINDS, "tracks", "idle")
TOP = ("about", "duration", "person", "intensity", *_MOVES)
"""What stands at the top of a script, in this order."""

Script = Mapping[str, Any]


@dataclass(frozen=True)
class TrackView:
    """A track as a person sees it. ``place``: its name in edits; ``kind``: "keyframes", "events" or "speech"."""

    place: str
    kind: str
    label: str
    items: tuple[Mapping[str, Any], ...]


def read(script: Script, person: Person | None = None) -> Clip:
    """Return the clip of a script; no file that it names is opened. TableError names the place in it."""
    return load_clip(dict(script), person=person, files=False)


def moves(script: Script) -> bool:
    """Whether there is anything to play."""
    return any(key in script for key in _MOVES)


def check_form(script: object) -> None:
    """Raise TableError if a script is none whose tracks can be listed and edited; what it means is for `read`."""
    fields = Entry(script, "clip").fields(optional=TOP)
    if "duration" in fields:
        fields["duration"].number(0.0, LONGEST)
    for kind in _WHEN:
        if kind in fields:
            _check_items(fields[kind], kind)
    for entry in fields["tracks"].each() if "tracks" in fields else ():
        inner = entry.fields(optional=("name", "replace", *_KINDS))
        kinds = [kind for kind in _KINDS if kind in inner]
        if len(kinds) != 1:
            raise entry.fail("a track has either keyframes or events or speech; write a track for each")
        if kinds[0] in _WHEN:
            _check_items(inner[kinds[0]], kinds[0])
    count = sum(len(one.items) for one in tracks(script))
    if count > LIMITS.items:
        raise TableError(f"clip: has {count:,} keys and events, the timeline takes up to {LIMITS.items:,}; the command "
                         "facegen animate takes any number")


def _check_items(several: Entry, kind: str) -> None:
    entries = several.each()
    if not entries:
        raise several.wrong("a list with something in it")
    for entry in entries:
        fields = entry.fields(required=(_WHEN[kind],), optional=_ENTRIES[kind])
        for name in (_WHEN[kind], *_PARTS):
            if name in fields:
                fields[name].number(0.0, LONGEST)


def tracks(script: Script) -> tuple[TrackView, ...]:
    """Return the tracks in the order in which they are laid over each other."""
    found = [TrackView(kind, kind, kind.capitalize(), tuple(script[kind]))
             for kind in ("keyframes", "events") if kind in script]
    for k, one in enumerate(script.get("tracks", ())):
        kind = next(kind for kind in _KINDS if kind in one)
        items = one[kind] if kind != "speech" else (one[kind],)
        found.append(TrackView(f"tracks.{k}", kind, str(one.get("name", f"track {k + 1}")), tuple(items)))
    if "speech" in script:
        found.append(TrackView("speech", "speech", "Speech", (script["speech"],)))
    return tuple(found)


def time_of(item: Mapping[str, Any]) -> float:
    """Return when a keyframe stands or an event begins, seconds."""
    return float(item["t"] if "t" in item else item["at"])


def event_times(event: Mapping[str, Any]) -> tuple[float, float, float, float]:
    """Return when an event begins, is whole, fades and is over, seconds; what it leaves out its kind gives."""
    timing, pose = load_timing(), event.get("pose")
    kind = timing.kinds.get(str(event["kind"])) if "kind" in event else None
    if kind is None:
        found = load_expressions().find(pose) if isinstance(pose, str) else None
        kind = timing.kind_of(found.name if found else None)
    times = [time_of(event)]
    for part in _PARTS:
        times.append(times[-1] + float(event.get(part, getattr(kind, part))))
    return times[0], times[1], times[2], times[3]


def set_key(script: Script, t: float, what: Mapping[str, Any], track: str = "keyframes", *, ease: str | None = None,
            name: str | None = None) -> tuple[dict[str, Any], str, int]:
    """Return the script with a key at a time, seconds, and its track and place there.

    what: pose, raw, intensity, head, eyes as a script has them. A key at the same time is replaced and keeps its ease.
    name: of a new track. A clip that would be over before is made longer.
    """
    item = {"t": _rounded(t), **what, **({} if ease is None else {"ease": ease})}
    return _put(script, track, "keyframes", item, name)


def add_event(script: Script, at: float, what: Mapping[str, Any], track: str = "events", *,
              name: str | None = None) -> tuple[dict[str, Any], str, int]:
    """Return the script with an event that begins at a time, seconds, and its track and place there.

    what: pose, kind, onset, apex, offset, intensity and so on, as a script has them.
    """
    return _put(script, track, "events", {"at": _rounded(at), **what}, name)


def move(script: Script, track: str, index: int, t: float) -> tuple[dict[str, Any], str, int]:
    """Return the script with an item at another time; InputError where another key stands."""
    kind, items = _items(script, track)
    item = {**_item(items, index), _WHEN[kind]: _rounded(t)}
    return _placed(script, track, kind, [*items[:index], *items[index + 1:]], item, replaces=False)


def duplicate(script: Script, track: str, index: int, t: float) -> tuple[dict[str, Any], str, int]:
    """Return the script with a copy of an item at another time; InputError where another key stands."""
    kind, items = _items(script, track)
    return _placed(script, track, kind, items, {**_item(items, index), _WHEN[kind]: _rounded(t)}, replaces=False)


def change(script: Script, track: str, index: int, **fields: Any) -> dict[str, Any]:
    """Return the script with other fields of an item; None takes one away. Times: see `move`."""
    kind, items = _items(script, track)
    _item(items, index)
    fields = {key: value for key, value in fields.items() if key != _WHEN[kind]}
    items[index] = {key: value for key, value in {**items[index], **fields}.items() if value is not None}
    return _checked(_with(script, track, kind, items))


def delete(script: Script, track: str, index: int) -> dict[str, Any]:
    """Return the script without an item; with the last of a track the track goes, with the last of all everything."""
    kind, items = _items(script, track)
    _item(items, index)
    return _left(_with(script, track, kind, [*items[:index], *items[index + 1:]]))


def delete_track(script: Script, track: str) -> dict[str, Any]:
    """Return the script without a track."""
    _found(script, track)
    return _left(_with(script, track, "", []))


def set_track(script: Script, track: str, *, name: str | None = None, replaces: str | None = None) -> dict[str, Any]:
    """Return the script with another name of a track, or other units that it replaces below it; "" for none."""
    _found(script, track)
    if not track.startswith("tracks."):
        raise InputError(f"track: '{track}' at the top of a script has no name of its own and replaces nothing; put "
                         "its keys into a new track")
    k = int(track.split(".")[1])
    fields = {"name": name, "replace": replaces}
    several = [dict(one) for one in script["tracks"]]
    for key, value in fields.items():
        if value == "":
            several[k].pop(key, None)
        elif value is not None:
            several[k][key] = value
    several[k] = {key: several[k][key] for key in ("name", "replace", *_KINDS) if key in several[k]}
    return _checked({**script, "tracks": several})


def set_top(script: Script, **fields: Any) -> dict[str, Any]:
    """Return the script with other entries at its top (duration, idle, speech, person ...); None takes one away."""
    return _left({key: value for key, value in {**script, **fields}.items() if value is not None})


def shorten(script: Script) -> dict[str, Any]:
    """Return the script that ends when all is over."""
    return _checked({key: value for key, value in script.items() if key != "duration"})


def item_text(item: Mapping[str, Any]) -> str:
    """Return what an item shows, in short."""
    said = [str(item["kind"])] if "kind" in item else []
    pose = item.get("pose")
    if pose is not None:
        said.append("+".join(f"{key}={value}" if not isinstance(value, Mapping) else str(key)
                             for key, value in pose.items()) if isinstance(pose, Mapping) else
                    "at rest" if str(pose) in ("0", "neutral") else str(pose))
    said += [part for part in ("raw", "head", "eyes") if part in item]
    return " ".join(said) or "pose"


# -- below ------------------------------------------------------------------------------------------------------
def _put(script: Script, track: str, kind: str, item: dict[str, Any], name: str | None
         ) -> tuple[dict[str, Any], str, int]:
    if track == NEW:
        several = [*script.get("tracks", ()), {"name": name or f"track {len(script.get('tracks', ())) + 1}", kind: []}]
        script, track = {**script, "tracks": several}, f"tracks.{len(several) - 1}"
        items: list[dict[str, Any]] = []
    elif track == kind and kind not in script:
        items = []
    else:
        found, items = _items(script, track)
        if found != kind:
            raise InputError(f"track: '{track}' holds {found}, no {kind}; take another or a new one")
    return _placed(script, track, kind, items, item, replaces=True)


def _placed(script: Script, track: str, kind: str, items: list[dict[str, Any]], item: dict[str, Any], *,
            replaces: bool) -> tuple[dict[str, Any], str, int]:
    """Return the script with an item among others, in order of time."""
    t = time_of(item)
    if kind == "keyframes":
        there = [one for one in items if abs(time_of(one) - t) < SAME]
        if there and not replaces:
            raise InputError(f"t: another key stands at {t:g} s; move or delete that one first")
        if there:
            item = {**({"ease": there[0]["ease"]} if "ease" in there[0] else {}), **item}
        items = [one for one in items if one not in there]
    index = sum(time_of(one) <= t for one in items)
    items = [*items[:index], item, *items[index:]]
    made = _long_enough(_with(script, track, kind, items))
    return _checked({key: made[key] for key in TOP if key in made}), track, index


def _long_enough(script: dict[str, Any]) -> dict[str, Any]:
    """Return a script that lasts until its keys stand and its events are over, and some seconds if it has only one."""
    ends = [time_of(item) if one.kind == "keyframes" else event_times(item)[-1]
            for one in tracks(script) if one.kind != "speech" for item in one.items]
    end = round(max(ends, default=0.0), 3)
    if "duration" in script:
        return {**script, "duration": max(script["duration"], end)}
    only = not script.get("speech") and not any(one.kind == "speech" for one in tracks(script))
    return {**script, "duration": max(NEW_LENGTH, end)} if only and len(ends) == 1 else script


def _found(script: Script, track: str) -> TrackView:
    for one in tracks(script):
        if one.place == track:
            return one
    raise InputError(f"track: there is no '{track}' in this clip (there are: "
                     f"{', '.join(one.place for one in tracks(script)) or 'none'})")


def _items(script: Script, track: str) -> tuple[str, list[dict[str, Any]]]:
    found = _found(script, track)
    if found.kind == "speech":
        raise InputError("track: speech has no keys; say another text instead")
    return found.kind, [dict(item) for item in found.items]


def _item(items: list[dict[str, Any]], index: int) -> dict[str, Any]:
    if not 0 <= index < len(items):
        raise InputError(f"key: the track has {len(items)}, there is no number {index + 1}")
    return items[index]


def _with(script: Script, track: str, kind: str, items: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the script with other items of a track; a track without any goes."""
    if not track.startswith("tracks."):
        made = {**script, track: items}
        return made if items else {key: value for key, value in made.items() if key != track}
    k = int(track.split(".")[1])
    several = [dict(one) for one in script["tracks"]]
    if items:
        several[k][kind] = items
    else:
        del several[k]
    made = {**script, "tracks": several}
    return made if several else {key: value for key, value in made.items() if key != "tracks"}


def _left(script: dict[str, Any]) -> dict[str, Any]:
    """Return a checked script, or an empty one if nothing moves any more."""
    return _checked({key: script[key] for key in TOP if key in script}) if moves(script) else {}


def _checked(script: dict[str, Any]) -> dict[str, Any]:
    check_form(script)
    return script


def _rounded(t: float) -> float:
    return round(float(t), 3)
