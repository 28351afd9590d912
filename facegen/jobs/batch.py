"""A labelled data set in one call."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from concurrent.futures import Executor
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from facegen import __version__
from facegen.errors import FileError, InputError
from facegen.face.face import load_face
from facegen.facs.yamlfile import parse_json, read_data
from facegen.fileio.textfile import make_folder, remove_drafts, save_text
from facegen.jobs.crew import Crew
from facegen.jobs.digests import digest_of
from facegen.jobs.manifest import MANIFEST, write_manifest
from facegen.jobs.naming import file_names
from facegen.jobs.picture import IMAGES, LABELS, MASKS, PictureTask, picture_tasks
from facegen.jobs.runner import run
from facegen.jobs.spec import FORMATS, Batch, read_batch
from facegen.render.backends import RENDERERS, choose, warm

MARK = "batch.json"
"""Tells whose folder it is, from the first moment on."""


@dataclass(frozen=True)
class BatchReport:
    """What was done. ``made``, ``kept``, ``removed``: pictures; ``lost``: deaths of workers; ``manifest``: its path."""

    made: int
    kept: int
    removed: int
    lost: int
    manifest: Path


def run_batch(jobs: str | Path | Mapping[str, Any] | Batch, folder: str | Path, *,
              executor: Executor | Crew | None = None, workers: int | None = None, scheduler: str | None = None,
              update: bool = False, step: Callable[[], None] | None = None) -> BatchReport:
    """Draw and label all pictures of a batch into a folder; docs/batch.md tells what lies there then.

    jobs: a jobs file, plain data of the same form, or what `read_batch` returned.
    folder: made if need be. Pictures that are there already, made from the same data, are kept.
    executor: any `concurrent.futures.Executor`. scheduler: the address of a dask cluster instead. Else processes of
        its own, as many as ``workers``, by default one for each core.
    update: make the folder's data set into this one: pictures that are no longer asked for are removed. Without it, a
        folder that holds anything else is an error.
    step: called once for each picture that is there.

    Raises InputError (FileError, TableError) before anything is drawn, FileError if a file cannot be written,
    JobError if workers die again and again. In a script that uses processes, call it under
    ``if __name__ == "__main__":``. ::

        facegen.run_batch({"poses": ["happiness", "6C+12D"], "views": ["0,0", "30,0"], "masks": True}, "set")
    """
    if scheduler is not None and (executor is not None or workers is not None):
        raise InputError("scheduler: give either a scheduler or an executor or workers")
    batch = jobs if isinstance(jobs, Batch) else read_batch(jobs)
    root = Path(folder).absolute()
    chosen = _renderer(batch, root)
    batch = replace(batch, settings=replace(batch.settings, renderer=chosen))
    names = file_names(batch.pictures)
    alone = executor is None and scheduler is None and workers == 1
    tasks = picture_tasks(root, names, list(batch.pictures), batch.settings, threads=None if alone else 1)
    mark = {"facegen": __version__, "pictures": len(tasks), "renderer": chosen,
            "batch": digest_of([names, [asdict(p) for p in batch.pictures], asdict(batch.settings)])}
    known = _check_folder(root, mark, update=update)
    if scheduler is not None:
        from facegen.jobs.cluster import connect

        executor = connect(scheduler)
    try:
        for inner in (IMAGES, LABELS, *([MASKS] if batch.settings.masks else [])):
            make_folder(root / inner)
        if not known:
            (root / MANIFEST).unlink(missing_ok=True)
            save_text(json.dumps(mark, indent=2) + "\n", root / MARK)
        removed = _remove_others(root, tasks) if update else 0
    except BaseException:
        if scheduler is not None:
            executor.close()
        raise
    try:
        if not alone:
            for coloured in {load_face(face).mesh(0).colours is not None for face in {p.face for p in batch.pictures}}:
                warm(chosen, coloured=coloured)
        report = run(tasks, executor=executor, workers=workers, step=step)
    finally:
        remove_drafts(root / file for task in tasks for file in (task.file, task.mask) if file)
    return BatchReport(report.made, report.kept, removed, report.lost,
                       write_manifest(root, tasks, batch.settings))


def _renderer(batch: Batch, root: Path) -> str:
    """Return the renderer for all pictures: settled here, not by each worker, and as it was settled for the folder."""
    wanted = batch.settings.renderer
    if wanted == "auto" and (root / MARK).is_file():
        there = read_data(root / MARK)
        before = there.get("renderer") if isinstance(there, dict) else None
        wanted = before if before in RENDERERS else "auto"
    pixels = max((math.prod(one.size) for one in batch.pictures), default=0)
    return choose(wanted, pictures=len(batch.pictures), pixels=pixels)


def _check_folder(root: Path, mark: Mapping[str, Any], *, update: bool) -> bool:
    """Return whether the folder holds this data set, or raise FileError if it holds anything else."""
    if not root.exists():
        return False
    if not root.is_dir():
        raise FileError(f"{root}: is a file, expected a folder")
    try:
        text = (root / MARK).read_text(encoding="utf-8") if (root / MARK).exists() else None
        inside = [path.name for path in root.iterdir() if path.name != MARK]
    except OSError as error:
        raise FileError(f"{root}: cannot be read: {error.strerror or error}") from error
    if text is None:
        if inside:
            raise FileError(f"{root}: holds other files ('{min(inside)}') and is no data set; take a folder that is "
                            "new or empty")
        return False
    there = parse_json(text, str(root / MARK))
    same = isinstance(there, dict) and there.get("batch") == mark["batch"]
    if not same and not update:
        raise FileError(f"{root}: holds another data set; take another folder, or make it into this one with --update "
                        "(update=True): pictures that fit stay, the others are removed")
    return same


def _remove_others(root: Path, tasks: list[PictureTask]) -> int:
    """Remove the files of pictures that are not asked for; return how many pictures that were."""
    wanted = {task.name for task in tasks}
    files = {root / file for task in tasks for file in (task.file, task.mask) if file}
    removed = 0
    for label in (root / LABELS).glob("*.json"):
        if label.stem not in wanted:
            label.unlink()
            removed += 1
    endings = {f".{kind}" for kind in FORMATS}
    for folder in (root / IMAGES, root / MASKS):
        for path in folder.iterdir() if folder.is_dir() else ():
            if path not in files and path.suffix in endings:
                path.unlink()
    return removed
