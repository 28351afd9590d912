"""Whose table is worked on: a new person's, a file of the work, a copy of a shipped one, or a file from elsewhere."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from facegen.data import tables_dir
from facegen.errors import FacegenError, InputError
from facegen.facs.expression_table import people
from facegen.facs.person_file import Change, person_change, read_person_data
from facegen.facs.yamlfile import read_data
from facegen.fileio.textfile import make_folder
from facegen.studio import table_edit as edit
from facegen.studio.limits import LIMITS
from facegen.studio.page import Page
from facegen.studio.work import TableWork

_NOBODY = "(nobody yet)"
_SHIPPED = "a copy of {}"
_START = "Type a name and press *New person*, open a table, or copy one of the shipped people."


class WhoseTable:
    """A folder of the panel. put: called with what was done and the table that is open then."""

    def __init__(self, page: Page, put: Callable[[str, TableWork], None]) -> None:
        self.page, self._put = page, put
        gui, calls = page.client.gui, page.calls
        with gui.add_folder("Person"):
            self._person = gui.add_dropdown("Table of", (_NOBODY,), initial_value=_NOBODY)
            self._person.on_update(calls(self._open))
            self._name = gui.add_text("Name", "", hint="Such as Ada. The table is saved as ada.yaml.")
            gui.add_button("New person").on_click(calls(self._create))
            self._upload = gui.add_upload_button("Open a table from this computer", mime_type=".yaml,.yml,.json")
            self._upload.on_upload(calls(self._uploaded))
            self._download = gui.add_button("Download the table")
            self._download.on_click(calls(self._fetch))

    def refresh(self, table: TableWork) -> None:
        """Show which table is open."""
        own = [name for name in self.page.desk.people(self.page.name) if name.endswith(".yaml")]
        set_options(self._person, (_NOBODY, *dict.fromkeys([*own, *([table.file] if table.file else [])]),
                                   *(_SHIPPED.format(name) for name in people())))
        self._person.value = table.file or _NOBODY
        self._download.disabled = table.file is None

    @property
    def state(self) -> str:
        """Whether the table is saved, in words."""
        table = self.page.work.table
        if table.file is None:
            return _START
        if table.person is None:
            return f"**{table.data.get('name', table.file)}** is like everybody yet: change something."
        path = self.page.desk.person_file(table.file, self.page.name)
        try:
            saved = path.exists() and read_data(path) == table.data
        except FacegenError as error:           # broken by another hand: said here, and the page goes on
            return f"**{table.file}** cannot be read:\n```\n{str(error).replace('```', '')}\n```"
        if saved:
            return f"**{table.file}** is saved as it is here. Choose it as *Person* on the tab Face."
        return f"**{table.file}** has changes that are not saved."

    def planned(self) -> Change:
        """Return what saving the table changes; InputError if there is nothing in it."""
        table = self.page.work.table
        if table.file is None or table.person is None:
            raise InputError("table: there is no habit in it yet; change an expression or a unit first")
        path = self.page.desk.person_file(table.file, self.page.name)
        make_folder(path.parent)
        return person_change(table.data, path)

    def _open(self) -> None:
        chosen, desk = self._person.value, self.page.desk
        shipped = {_SHIPPED.format(name): name for name in people()}
        if chosen == _NOBODY:
            self._put("close the table", TableWork())
        elif chosen in shipped:
            name = shipped[chosen]
            self._put(f"copy {name}", TableWork(f"{name}.yaml", read_data(tables_dir() / "people" / f"{name}.yaml")))
        else:
            self._put(f"open {chosen}", TableWork(chosen, read_data(desk.person_file(chosen, self.page.name))))

    def _create(self) -> None:
        name = self._name.value
        file = edit.file_name(name)
        if file in self.page.desk.people(self.page.name):
            raise InputError(f"name: there is a {file} already; open it above, or take another name")
        self.page.desk.person_file(file, self.page.name)        # refuses what is no name
        self._put(f"new person {name}", TableWork(file, edit.new_table(name)))

    def _uploaded(self) -> None:
        file = self._upload.value
        data = read_person_data(file.content, file.name, most=LIMITS.habits)
        stem = file.name.rpartition(".")[0] or file.name
        self._put(f"open {file.name}", TableWork(edit.file_name(stem), {"name": stem, **data}))
        self.page.say("It is kept here when you save it.", f"{file.name} is open")

    def _fetch(self) -> None:
        change = self.planned()
        self.page.client.send_file_download(change.path.name, change.after.encode(), save_immediately=True)


def set_options(dropdown: Any, options: tuple[str, ...], usual: str | None = None) -> None:
    """Give a dropdown other options; a value that is none of them gives way to the usual or the first."""
    if tuple(dropdown.options) != options:
        value = dropdown.value
        dropdown.options = options
        dropdown.value = value if value in options else usual or options[0]
