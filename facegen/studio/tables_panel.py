"""The table workshop: what one person's expressions and action units are, tried on several faces, saved as a table."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from facegen.errors import InputError
from facegen.face.face import Face
from facegen.facs.expressions import Resolution, resolve
from facegen.studio import raw as raws
from facegen.studio import table_edit as edit
from facegen.studio.page import FACE, Page
from facegen.studio.several import Several
from facegen.studio.task import Task
from facegen.studio.whose_table import WhoseTable, set_options
from facegen.studio.work import TableWork, Work

_NONE = "(none)"
_FACES = ("akimoto", "akimoto-1986")
_FIRST = "happiness"
_FIRST_UNIT = "12"

_HOW = ("**Everybody smiles in their own way.** Here you change what an expression is made of, or what an action unit "
        "moves, for one person. The common tables stay as they are.")


class TablesPanel:
    """The table workshop."""

    def __init__(self, page: Page) -> None:
        self.page = page
        self._several = Several(page)
        self._recipe_shown: edit.Recipe | None = None
        self._seen: Any = None                  # what was shown last
        self._saved = 0                         # times that a table was saved
        self._drawn: Any = None                 # what the several faces show
        self._task: Task | None = None
        gui, calls = page.client.gui, page.calls
        gui.add_markdown(_HOW)
        self._whose = WhoseTable(page, self._put)
        with gui.add_folder("An expression's recipe"):
            self._expression = gui.add_dropdown("Expression", (_FIRST,), initial_value=_FIRST)
            self._expression.on_update(calls(lambda: self._tell(self._expression.value)))
            self._script = gui.add_text("Action units", "", hint="Such as 6C+L12E+R12B: A is a trace, E the most.")
            self._about = gui.add_text("What one sees", "")
            self._change = gui.add_button("Use this recipe")
            self._change.on_click(calls(self._recipe))
            self._word = gui.add_text("Or a new expression", "", hint="A name of this person's own, such as ada_maybe. "
                                      "It begins with the recipe above.")
            self._add = gui.add_button("Add the new expression")
            self._add.on_click(calls(self._added))
            self._common = gui.add_button("As everybody does it")
            self._common.on_click(calls(self._uncommon))
        with gui.add_folder("What an action unit moves"):
            self._codes = edit.unit_choices()
            first = next(text for text, code in self._codes.items() if code == _FIRST_UNIT)
            self._unit = gui.add_dropdown("Action unit", tuple(self._codes), initial_value=first)
            self._unit.on_update(calls(lambda: self._tell(None)))
            self._says = gui.add_markdown("")
            self._scale = gui.add_slider("How much (1 = as everybody)", 0.0, 2.0, 0.05, 1.0)
            self._scale.on_update(calls(self._scaled))
            self._edit = gui.add_button("Lay it on the tab Points", hint="There its points can be dragged; then come "
                                        "back and take it.")
            self._edit.on_click(calls(self._lay))
            self._take = gui.add_button("Take what the tab Points has", hint="The points, jaw, lids, eyes and head "
                                        "moved there become what this unit moves at its most.")
            self._take.on_click(calls(self._taken))
            self._back = gui.add_button("Move it as everybody")
            self._back.on_click(calls(self._unmoved))
        with gui.add_folder("Look at it"):
            self._many = gui.add_checkbox("Show several faces", False, hint="The base face, the face of 1986 and one "
                                          "of your choice. Untick it to have your own face back.")
            self._many.on_update(calls(self._stand))
            self._third = gui.add_dropdown("And", (_NONE,), initial_value=_NONE)
            self._third.on_update(calls(self._stand))
            self._strength = gui.add_slider("Strength", 0.0, 1.0, 0.01, 1.0)
            self._strength.on_update(calls(self._try))
        self._state = gui.add_markdown("")
        self._save = gui.add_button("Save ...", hint="First you see what changes in the file.")
        self._save.on_click(calls(self._ask))
        self._shows: str | None = _FIRST        # the expression looked at; None: the unit

    # -- showing ------------------------------------------------------------------------------------------------
    def refresh(self, work: Work) -> None:
        """Show a work."""
        table, names = work.table, self.page.desk.face_names(self.page.name)
        self._several.keep()
        now = (table, names, self.page.desk.people(self.page.name), self._expression.value, self._unit.value,
               self._scale.value, self._saved)
        if now == self._seen:               # something else was changed, which may be a slider that is dragged
            return
        self._whose.refresh(table)
        set_options(self._third, (_NONE, *(name for name in names if name not in _FACES)))
        found = edit.recipes(table.data)
        set_options(self._expression, tuple(sorted(found, key=lambda name: (not found[name].own, name))), _FIRST)
        self._recipe_of(found)
        code, whose = self._code, table.data.get("name", "everybody")
        self._says.content = f"On {whose}, {edit.unit_says(table.data, code)}." if table.file else \
            "Everybody's movement."
        self._scale.value = min(edit.scale_of(table.data, code), 2.0)
        for handle in (self._change, self._add, self._common, self._scale, self._take, self._back,
                       self._save):
            handle.disabled = table.file is None
        self._state.content = self._whose.state
        self._seen = (*now[:3], self._expression.value, self._unit.value, self._scale.value, self._saved)
        self._draw()

    def close(self) -> None:
        """Stop the loading of a face."""
        if self._task is not None:
            self._task.stop()

    def _recipe_of(self, found: dict[str, edit.Recipe]) -> None:
        one = found.get(self._expression.value)
        if one is not None and one != self._recipe_shown:       # what is being typed stays
            self._recipe_shown = one
            self._script.value, self._about.value = one.units, one.about

    @property
    def _code(self) -> str:
        return self._codes[self._unit.value]

    def _tell(self, expression: str | None) -> None:
        """Look at an expression, or at the unit."""
        self._shows = expression
        self.refresh(self.page.work)
        self._try()

    def _meaning(self, table: TableWork) -> Resolution:
        what = {self._code: 1.0} if self._shows is None else self._shows
        return resolve(what, person=table.person, intensity=self._strength.value)

    def _try(self) -> None:
        """Show what is looked at: on the several faces, or else on the page's own, until that changes."""
        if self._several.shown:
            self._draw()
            return
        rig, meaning = self.page.rig, self._meaning(self.page.work.table)
        self.page.stage.request(FACE, lambda: rig.pose(meaning))

    def _draw(self) -> None:
        if not self._several.shown:
            return
        shown = (self.page.work.table, self._shows, self._code, self._strength.value, self._several.names)
        if shown != self._drawn:
            self._drawn = shown
            meaning = self._meaning(self.page.work.table)
            self._several.pose(lambda rig: meaning)

    def _stand(self) -> None:
        """Stand the faces side by side, or take them away."""
        if not self._many.value:
            self._several.hide()
            self._drawn = None
            self.page.show_face()
            return
        third = self._third.value
        names = (*_FACES, *([third] if third != _NONE else []))

        def stand(rigs: dict[str, Any]) -> None:
            if self._many.value and self._third.value == third:
                self._drawn = None
                self._several.show(rigs)
                self._draw()

        def load(report: Any) -> dict[str, Any]:
            return {name: self.page.desk.face(name, self.page.name, wait=report) for name in names}

        self._task = Task(self.page, "The faces get ready", load, stand)

    def _put(self, label: str, table: TableWork, *, thing: str | None = None) -> None:
        self.page.change(label, thing=thing, table=table)
        self._try()

    def _data(self, label: str, data: dict[str, Any], *, thing: str | None = None) -> None:
        if self.page.work.table.file is None:
            raise InputError("person: nobody's table is open; make a new person first, or open one")
        self._put(label, replace(self.page.work.table, data=data), thing=thing)

    # -- what ---------------------------------------------------------------------------------------------------
    def _recipe(self) -> None:
        name = self._expression.value
        self._shows = name
        self._data(f"recipe of {name}",
                   edit.with_recipe(self.page.work.table.data, name, self._script.value, self._about.value))

    def _added(self) -> None:
        name = edit.fold_name(self._word.value)
        if not name:
            raise InputError("name: type the new expression's name first, such as ada_maybe")
        if name in edit.recipes(self.page.work.table.data):
            raise InputError(f"name: there is an expression '{name}' already; choose it above and change its recipe")
        data = edit.with_recipe(self.page.work.table.data, name, self._script.value, self._about.value)
        self._data(f"new expression {name}", data)
        self._word.value, self._expression.value = "", name
        self._tell(name)

    def _uncommon(self) -> None:
        name = self._expression.value
        self._shows = name
        self._data(f"{name} as everybody", edit.without_recipe(self.page.work.table.data, name))
        self._tell(self._expression.value)

    def _scaled(self) -> None:
        self._shows = None
        self._data(f"how much {self._code}", edit.with_scale(self.page.work.table.data, self._code, self._scale.value),
                   thing=f"table {self._code}")

    def _lay(self) -> None:
        """Have the unit's movement as raw data, to be dragged; the face shows nothing else."""
        movement = edit.movement_of(self.page.work.table.data, self._code)
        face = replace(self.page.work.face, units={}, blend={}, raw=movement.as_dict(), intensity=1.0)
        if isinstance(self.page.rig, Face):
            face = replace(face, raw=raws.in_units(face.raw, self.page.rig, raws.FIRST_UNITS))
        else:
            face = replace(face, rig=_FACES[0])
        self.page.change(f"lay {self._code} on Points", face=face)
        self.page.say(f"On the tab Points drag what {self._code} moves; then come back and take it.",
                      f"{self._unit.value} is on the face")

    def _taken(self) -> None:
        raw = raws.deformation_of(self.page.work.face.raw)
        if raw.has_lengths and raw.units != "face":
            if not isinstance(self.page.rig, Face):
                raise InputError("face: an avatar has no measures of its own; choose the base face, then take it")
            raw = self.page.rig.total(raw, units="face")
        self._shows = None
        self._data(f"what {self._code} moves", edit.with_movement(self.page.work.table.data, self._code, raw))

    def _unmoved(self) -> None:
        self._shows = None
        self._data(f"{self._code} as everybody", edit.without_unit(self.page.work.table.data, self._code))

    # -- saving -------------------------------------------------------------------------------------------------
    def _ask(self) -> None:
        """Show what saving changes, and save when told so."""
        change = self._whose.planned()
        if not change.diff:
            self.page.say("Nothing is changed.", f"{change.path.name} is saved already")
            return
        lost = "" if change.kept else "\n\n**Comments in the file are lost**: its lines cannot be changed one by one."
        gui = self.page.client.gui
        modal = gui.add_modal(f"Save {change.path.name}?")
        with modal:
            gui.add_markdown(f"Lines with + are new, lines with - go.{lost}\n\n{_fenced(change.diff)}")
            save, cancel = gui.add_button("Save this"), gui.add_button("Cancel")
        cancel.on_click(self.page.calls(modal.close))

        def saved() -> None:
            modal.close()
            change.save()
            self._saved += 1
            self.page.show_face()
            self.page.refresh()
            self._drawn = None
            self._try()
            self.page.say("Choose it as Person on the tab Face.", f"{change.path.name} is saved")

        save.on_click(self.page.calls(saved))


def _fenced(diff: str) -> str:
    """Return a diff as a block of Markdown: no line of it can end the block."""
    ticks = "```"
    while ticks in diff:
        ticks += "`"
    return f"{ticks}diff\n{diff}{ticks}"

