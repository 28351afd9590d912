"""A composed clip as a performance: what could be recorded of it."""

from __future__ import annotations

import numpy as np

from facegen.animation.clip import Clip
from facegen.animation.performance import Performance
from facegen.facs.tables import load_units
from facegen.progress import Progress, counted, silent

_ANGLES = ("head", "gaze")
_HEAD = ("yaw", "pitch", "roll")
_GAZE = ("yaw_L", "pitch_L", "yaw_R", "pitch_R")


def clip_performance(clip: Clip, fps: float = 25.0, progress: Progress = silent) -> Performance:
    """Return a clip's action units by side, head and gaze, ``fps`` times a second.

    Turns of the head and of the eyes are angles, not weights. Raw data in its poses are no units and are left out,
    which ``warnings`` says. progress: called before each frame.
    """
    catalogue = load_units().catalogue
    told = counted(progress, "working out the frames", range(clip.frames(fps)))
    frames = [frame for _, frame in zip(told, clip.sample(fps), strict=True)]
    weights = [{atom: weight for atom, weight in catalogue.expand(frame.units).items()
                if catalogue.unit_of(atom).region not in _ANGLES} for frame in frames]
    used = {atom for one in weights for atom in one}
    names = tuple(atom for atom in catalogue.atoms if atom in used)
    head = [[frame.deformation.head.get(axis, 0.0) for axis in _HEAD] for frame in frames]
    gaze = [[frame.deformation.eyes.get(axis, 0.0) for axis in _GAZE] for frame in frames]
    left_out = ("the clip's raw movements are no action units and are left out",) if clip.raw else ()
    return Performance(np.array(clip.times(fps)), names, np.array([[one.get(name, 0.0) for name in names]
                                                                   for one in weights]),
                       "units", head=np.array(head), gaze=np.array(gaze), about={"format": "facegen clip"},
                       warnings=(*clip.warnings, *left_out))
