"""Keys and events of the clip: set, chosen from a list, changed one by one."""

from __future__ import annotations

from functools import partial
from typing import Any, Protocol

from facegen.animation.easing import DEFAULT_EASE
from facegen.animation.idle import Idle
from facegen.animation.timing import load_timing
from facegen.studio import keying, timeline
from facegen.studio.page import Page
from facegen.studio.text_box import TextBox
from facegen.studio.timeline_picture import Chosen
from facegen.studio.vocabulary import plain
from facegen.studio.work import Work

EASES = {"as a face moves": DEFAULT_EASE, "evenly": "linear", "slow at first": "ease_in", "slow at last": "ease_out",
         "with a jump": "step"}
_NONE = "none"
_FIRST, _FRESH = "Keyframes", "A new track"
_NOW = "The face as it is now"
_PARTS = {"onset": ("Comes in (s)", "Seconds until it is whole."),
          "apex": ("Stays (s)", "Seconds that it stays whole."),
          "offset": ("Goes in (s)", "Seconds until it is gone.")}
_ACTS = ("Face of now", "Copy to this time", "Delete")


class Host(Protocol):
    """What the views ask of the panel."""

    page: Page
    chosen: Chosen | None
    head: float
    script: dict[str, Any]

    def edit(self, label: str, script: dict[str, Any], chosen: Chosen | None = None, *,
             thing: str | None = None) -> None:
        """Have another script, one step of undo."""

    def choose(self, chosen: Chosen | None) -> None:
        """Edit another key."""


class KeysView:
    """Below the transport: the button that keys, what stands there, and what is changed of one."""

    def __init__(self, host: Host, gui: Any) -> None:
        self._host = host
        self._places: dict[str, str] = {}                   # what the list of tracks shows -> place
        self._listed: dict[str, Chosen] = {}                # what the list of keys shows -> which it is
        calls = host.page.calls
        gui.add_button("Key the face as it is now", hint="The clip shows this face at this time. A key that stands "
                                                         "there is replaced.").on_click(calls(self._key))
        with gui.add_folder("Keys and movements"):
            self._list = gui.add_dropdown("Key", (_NONE,), initial_value=_NONE,
                                          hint="All keys and events in order of time. Choose one to change it.")
            self._list.on_update(calls(lambda: host.choose(self._listed.get(self._list.value))))
            self._make_item(gui)
        with gui.add_folder("Add a movement that comes and goes", expand_by_default=False):
            self._make_event(gui)
        with gui.add_folder("Tracks", expand_by_default=False):
            self._make_tracks(gui)
        with gui.add_folder("Length and life", expand_by_default=False):
            self._make_whole(gui)

    def _make_item(self, gui: Any) -> None:
        calls = self._host.page.calls
        self._at = gui.add_number("Time of the key (s)", 0.0, min=0.0, step=0.01)
        self._at.on_update(calls(self._moved))
        self._pose = TextBox(self._host.page, "Shows", "", read=keying.read_pose, write=keying.write_pose,
                             changed=self._posed, hint="An expression's name or a FACS script, such as 6C+12D.")
        self._strength = gui.add_slider("Strength", 0.0, 1.0, 0.01, 1.0, marks=())
        self._strength.on_update(calls(lambda: self._set("strength", intensity=float(self._strength.value))))
        self._ease = gui.add_dropdown("Gets there", tuple(EASES), hint="How the face gets to this key from the one "
                                                                       "before; of an event, how it comes and goes.")
        self._ease.on_update(calls(lambda: self._set("way to a key", ease=EASES[self._ease.value])))
        self._times = {}
        for part, (label, hint) in _PARTS.items():
            self._times[part] = number = gui.add_number(label, 0.0, min=0.0, step=0.005, hint=hint)
            number.on_update(calls(partial(self._timed, part)))
        self._acts = gui.add_button_group("", _ACTS, hint="Show the face of the Face tab here; copy this key to the "
                                                          "time of the slider; delete it.")
        self._acts.on_click(calls(self._act))
        self._take = gui.add_button("Change it in the Face tab", color="gray",
                                    hint="The Face tab gets what this key shows. Key it again when it is as you like.")
        self._take.on_click(calls(self._taken))

    def _make_event(self, gui: Any) -> None:
        kinds = [name for name, kind in load_timing().kinds.items() if kind.pose is not None]
        self._kinds = {_NOW: None, **{plain(name).capitalize(): name for name in kinds}}
        self._kind = gui.add_dropdown("What", tuple(self._kinds), initial_value="Blink",
                                      hint="It grows, stays and fades: a blink in a quarter of a second.")
        gui.add_button("Add it at this time").on_click(self._host.page.calls(self._add))

    def _make_tracks(self, gui: Any) -> None:
        calls = self._host.page.calls
        self._track = gui.add_dropdown("Keys go to", (_FIRST, _FRESH), initial_value=_FIRST,
                                       hint="Tracks are laid over each other and add up: a smile below, a look above.")
        self._track.on_update(calls(lambda: self._host.choose(self._host.chosen)))
        self._name = gui.add_text("Its name", "")
        self._name.on_update(calls(lambda: self._set_track("name of a track", name=self._name.value)))
        self._replaces = gui.add_text("Replaces below", "", hint="Units that fade below it while it is there, such as "
                                      "25+26, or all; nothing: it adds.")
        self._replaces.on_update(calls(lambda: self._set_track("what a track replaces", replaces=self._replaces.value)))
        self._drop = gui.add_button("Delete the track", color="gray")
        self._drop.on_click(calls(self._dropped))

    def _make_whole(self, gui: Any) -> None:
        calls = self._host.page.calls
        self._length = gui.add_number("Length (s)", timeline.NEW_LENGTH, min=0.01, step=0.1)
        self._length.on_update(calls(lambda: self._host.edit(
            "length", timeline.set_top(self._host.script, duration=round(float(self._length.value), 3)),
            self._host.chosen, thing="length")))
        self._cut = gui.add_button("End when all is over", color="gray")
        self._cut.on_click(calls(lambda: self._host.edit("end when all is over", timeline.shorten(self._host.script),
                                                         self._host.chosen)))
        self._idle = gui.add_checkbox("Blinks and small movements", False, hint="Of eyes and head, as if alive.")
        self._idle.on_update(calls(self._lives))
        self._seed = gui.add_number("Seed", 1, min=0, max=9999, step=1, hint="The same number, the same blinks.")
        self._seed.on_update(calls(self._lives))

    # -- what is shown ------------------------------------------------------------------------------------------
    def refresh(self, work: Work) -> None:
        """Show a work."""
        script, several = work.clip.script, timeline.tracks(work.clip.script)
        self._list_keys(several)
        self._list_tracks(several)
        self._show_item(script)
        self._length.value = float(script.get("duration", self._host.clip.duration if self._host.clip
                                              else timeline.NEW_LENGTH))
        self._length.disabled = not script
        self._cut.visible = "duration" in script
        idle = script.get("idle")
        self._idle.value, self._seed.visible = idle is not None, idle is not None
        if idle is not None:
            self._seed.value = int(idle["seed"] if isinstance(idle, dict) else idle)

    def _list_keys(self, several: tuple[timeline.TrackView, ...]) -> None:
        found = [(timeline.time_of(item), Chosen(one.place, k), timeline.item_text(item), one)
                 for one in several if one.kind != "speech" for k, item in enumerate(one.items)]
        found.sort(key=lambda each: each[0])
        self._listed = {}
        for number, (t, chosen, text, one) in enumerate(found, 1):
            where = "" if one.place == "keyframes" else f"  ({one.label[:20]})"
            self._listed[f"{number}.  {t:.2f} s  {text[:40]}{where}"] = chosen
        options = (_NONE, *self._listed)
        if tuple(self._list.options) != options:
            self._list.options = options
        shown = [label for label, chosen in self._listed.items() if chosen == self._host.chosen]
        self._list.value = shown[0] if shown else _NONE

    def _list_tracks(self, several: tuple[timeline.TrackView, ...]) -> None:
        self._places = {_FIRST: "keyframes"}
        for one in several:
            if one.kind == "keyframes" and one.place != "keyframes":
                label = one.label if one.label not in (*self._places, _FRESH) else f"{one.label} ({one.place})"
                self._places[label] = one.place
        self._places[_FRESH] = timeline.NEW
        now = self._track.value if self._track.value in self._places else _FIRST
        if tuple(self._track.options) != tuple(self._places):
            self._track.options = tuple(self._places)
        self._track.value = now
        place = self._places[now]
        own = next((one for one in several if one.place == place), None)
        for handle in (self._name, self._replaces):
            handle.visible = place.startswith("tracks.")
        self._drop.visible = own is not None
        if place.startswith("tracks.") and own is not None:
            entry = self._host.script["tracks"][int(place.split(".")[1])]
            self._name.value, self._replaces.value = own.label, str(entry.get("replace", ""))

    def _show_item(self, script: Any) -> None:
        item = self._item()
        event = item is not None and "at" in item
        for handle in (self._at, self._pose.box, self._strength, self._ease, self._acts, self._take):
            handle.visible = item is not None
        for number in self._times.values():
            number.visible = event
        if item is None:
            return
        self._at.value = timeline.time_of(item)
        kind = load_timing().kinds.get(item.get("kind", ""))
        self._pose.refresh(item.get("pose", (kind.pose or "") if kind and "raw" not in item else ""))
        self._strength.value = float(item.get("intensity", 1.0))
        names = {value: label for label, value in EASES.items()}
        self._ease.value = names.get({"hold": "step"}.get(item.get("ease"), item.get("ease")), names[DEFAULT_EASE])
        if event:
            at, onset, apex, end = timeline.event_times(item)
            for part, value in (("onset", onset - at), ("apex", apex - onset), ("offset", end - apex)):
                self._times[part].value = round(value, 3)

    def _item(self) -> Any:
        chosen = self._host.chosen
        for one in timeline.tracks(self._host.script):
            if chosen is not None and one.place == chosen.track and one.kind != "speech":
                return one.items[chosen.index] if chosen.index < len(one.items) else None
        return None

    # -- what is done -------------------------------------------------------------------------------------------
    def _key(self) -> None:
        t = self._host.head
        place = self._places.get(self._track.value, "keyframes")
        script, track, index = timeline.set_key(self._host.script, t, keying.face_key(self._host.page), place)
        if place == timeline.NEW:
            self._track.options = (*self._track.options, timeline.tracks(script)[-1].label)
            self._track.value = self._track.options[-1]
        self._host.edit(f"key at {t:g} s", script, Chosen(track, index))

    def _add(self) -> None:
        t, kind = self._host.head, self._kinds[self._kind.value]
        what = keying.face_key(self._host.page) if kind is None else {"kind": kind}
        script, track, index = timeline.add_event(self._host.script, t, what)
        self._host.edit(f"{self._kind.value.lower()} at {t:g} s", script, Chosen(track, index))

    def _moved(self) -> None:
        chosen = self._host.chosen
        script, track, index = timeline.move(self._host.script, chosen.track, chosen.index, float(self._at.value))
        self._host.edit("move a key", script, Chosen(track, index), thing="move a key")

    def _posed(self, pose: Any) -> None:
        self._set("what a key shows", pose=pose)

    def _set(self, label: str, **fields: Any) -> None:
        chosen = self._host.chosen
        script = timeline.change(self._host.script, chosen.track, chosen.index, **fields)
        self._host.edit(label, script, chosen, thing=label)

    def _timed(self, part: str) -> None:
        self._set(part, **{part: float(self._times[part].value)})

    def _act(self) -> None:
        chosen, act = self._host.chosen, self._acts.value
        if act == "Delete":
            self._host.edit("delete a key", timeline.delete(self._host.script, chosen.track, chosen.index))
        elif act == "Face of now":
            none = dict.fromkeys(timeline.SHOWS)
            script = timeline.change(self._host.script, chosen.track, chosen.index,
                                     **{**none, **keying.face_key(self._host.page)})
            self._host.edit("key the face again", script, chosen)
        else:
            script, track, index = timeline.duplicate(self._host.script, chosen.track, chosen.index, self._host.head)
            self._host.edit("copy a key", script, Chosen(track, index))

    def _taken(self) -> None:
        item = self._item()
        kind = load_timing().kinds.get(item.get("kind", ""))
        face = keying.key_face(item, self._host.page.work.face, kind.pose if kind else None)
        self._host.page.change("face of a key", face=face)
        self._host.page.show_face()                 # also where it is the face that was there

    def _set_track(self, label: str, **fields: str) -> None:
        place = self._places[self._track.value]
        script = timeline.set_track(self._host.script, place, **fields)
        if fields.get("name"):
            self._track.options = (*self._track.options, fields["name"])
            self._track.value = fields["name"]
        self._host.edit(label, script, self._host.chosen)

    def _dropped(self) -> None:
        self._host.edit("delete a track", timeline.delete_track(self._host.script, self._places[self._track.value]))

    def _lives(self) -> None:
        idle = None
        if self._idle.value:
            old = self._host.script.get("idle")
            seed = int(self._seed.value)
            Idle(seed)
            idle = {**old, "seed": seed} if isinstance(old, dict) else seed
        script = self._host.script
        fresh = {"duration": timeline.NEW_LENGTH} if idle is not None and not script else {}
        made = timeline.set_top(script, idle=idle, **fresh)
        self._host.edit("life" if idle is not None else "no life", made, self._host.chosen, thing="life")
