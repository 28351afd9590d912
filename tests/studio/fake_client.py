"""viser's handles without a browser: what is set is kept, and a person is played by `press` and `enter`."""

from __future__ import annotations

import contextlib
from types import SimpleNamespace
from typing import Any

import numpy as np


class Handle:
    """Any handle: all keywords become attributes; a container where one is asked for."""

    def __init__(self, kind: str, **values: Any) -> None:
        self.kind, self.removed, self._calls = kind, False, []
        self.__dict__.update(values)

    def __setattr__(self, name: str, value: Any) -> None:
        """As viser does, refuse to change what was removed."""
        if self.__dict__.get("removed"):
            raise RuntimeError(f"cannot assign to '{name}' on a removed handle")
        self.__dict__[name] = value

    def on_update(self, call):
        self._calls.append(call)
        return call

    on_trigger = on_click = on_upload = on_drag = on_drag_start = on_drag_end = on_drag_update = on_update

    def enter(self, value: Any) -> None:
        """Do as a person who enters a value."""
        self.__dict__["value"] = value
        self.press()

    def press(self, **event: Any) -> None:
        """Do as a person who presses it."""
        for call in self._calls:
            call(SimpleNamespace(client=self, target=self, **event))

    def __enter__(self):
        return self

    def __exit__(self, *_):
        return None

    def add_tab(self, title, *_):
        return Handle("tab", label=title)

    def remove(self):
        self.removed = True

    close = remove


class Maker:
    """A scene or GUI: every ``add_x(label, ...)`` makes a handle and keeps it in ``made``."""

    def __init__(self) -> None:
        self.made: list[Handle] = []
        self.clicks: list[Any] = []
        self.main_panel = SimpleNamespace(dock_right=lambda: None)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("add_"):
            return lambda *values, **named: self._add(name[4:], values, named)
        return lambda *_, **__: None

    def on_click(self, **_):
        return self.clicks.append

    def remove_click_callback(self, call):
        self.clicks.remove(call)

    def click(self, origin, direction):
        """Do as a person who clicks into the picture, where a ray of the scene begins."""
        for call in tuple(self.clicks):
            call(SimpleNamespace(client=self, ray_origin=tuple(origin), ray_direction=tuple(direction)))

    def _add(self, kind: str, values: tuple, named: dict) -> Handle:
        named = dict(named)
        if values:
            named["label"] = values[0]
        if kind == "mesh_simple":
            named.update(vertices=np.asarray(values[1]), faces=np.asarray(values[2]), visible=True)
        elif kind == "slider":
            named.update(zip(("min", "max", "step", "initial_value"), values[1:], strict=False))
        elif kind in ("dropdown", "button_group") and len(values) > 1:
            named.setdefault("initial_value", values[1][0])
            named["options"] = values[1]
        elif kind in ("html", "markdown"):
            named["content"] = values[0]
        elif len(values) > 1:
            named.setdefault("initial_value", values[1])
        named.setdefault("visible", True)
        if "initial_value" in named:
            named["value"] = named.pop("initial_value")
        made = Handle(kind, **named)
        self.made.append(made)
        return made

    def find(self, label: str) -> Handle:
        """Return the one handle of a label that is not removed; where there are several, the one that is seen."""
        found = [one for one in self.made if str(getattr(one, "label", None)) == label and not one.removed]
        if len(found) > 1:
            found = [one for one in found if one.visible]
        found, = found
        return found


class FakeClient:
    """What `Page` asks of a ClientHandle; ``notices``: what the person was told."""

    def __init__(self) -> None:
        self.scene, self.gui = Maker(), Maker()
        self.camera = SimpleNamespace()
        self.notices: list[tuple[str, str]] = []
        self.downloads: dict[str, bytes] = {}

    def send_file_download(self, name, content, **_):
        self.downloads[name] = content

    def add_notification(self, title, body, **named):
        self.notices.append((title, body))
        return Handle("notice", title=title, body=body, **named)

    def atomic(self):
        return contextlib.nullcontext()

    def flush(self):
        pass
