"""What a person who places landmarks is told, as Markdown."""

from __future__ import annotations

from collections.abc import Container

from facegen.face.landmarks import REQUIRED
from facegen.studio.landmark_words import ORDER, VIEWS, WORDS
from facegen.studio.picking import CONFIRMED, OPEN, PROPOSED, SKIPPED, state, words_for
from facegen.studio.proposing import FOUND, Advice
from facegen.studio.work import AvatarWork

_SIGNS = {CONFIRMED: "●", PROPOSED: "◐", OPEN: "○", SKIPPED: "–"}


def done(work: AvatarWork) -> int:
    """Return how many of the required points are placed."""
    return sum(name in work.landmarks for name in REQUIRED)


def is_found(work: AvatarWork, advice: Advice) -> bool:
    """Return whether a face was found before any point was placed."""
    return not work.landmarks and advice.sure >= FOUND


def question(work: AvatarWork, name: str | None, advice: Advice, *, on: bool, looks: bool) -> str:
    """Return what is asked for. name: the point, or None; on: whether points are placed; looks: whether a face is still
    looked for."""
    if not on:
        return f"{done(work)} of {len(REQUIRED)} points are placed." if work.landmarks else ""
    if name is None:
        return "All points are placed: go on to **3 Blendshapes**, or click on a ball to move it."
    label, where = WORDS[name].label, WORDS[name].where
    if looks and not work.landmarks:
        return f"**{label}**\n\n{where}\n\nfacegen is looking for a face meanwhile ..."
    if is_found(work, advice):
        return ("**A face was found.** Look at the blue balls: drag those that are not right, then take them all. Or "
                f"click one by one: {label}. {where}")
    what = "needed" if name in REQUIRED else "optional"
    again = " It is placed; click to move it." if name in work.landmarks else ""
    return f"**{label}** ({what}; {done(work)} of {len(REQUIRED)} needed points are placed)\n\n{where}{again}"


def faults(advice: Advice) -> str:
    """Return what is wrong or odd about the points, a line each."""
    return "\n".join([*(f"- ⛔ {words_for(each)}" for each in advice.errors),
                      *(f"- ⚠ {words_for(each)}" for each in advice.warnings)])


def listed(work: AvatarWork, proposed: Container[str]) -> str:
    """Return all points with their states, part by part."""
    lines = []
    for part, label in VIEWS.items():
        lines.append(f"**{label}**\n")
        for name in (name for name in ORDER if WORDS[name].part == part):
            how = state(work, name, proposed)
            lines.append(f"- {_SIGNS[how]} {WORDS[name].label}{'' if name in REQUIRED else ' (optional)'}: {how}")
        lines.append("")
    return "\n".join(lines)
