"""Read when sounds are said: Rhubarb's mouth cues, Praat's TextGrid, labels as plain text, facegen's own JSON."""

from __future__ import annotations

import itertools
import os
import re
from collections.abc import Iterable
from pathlib import Path

from facegen.animation.clip import LONGEST
from facegen.animation.phonemes import Sound, check_alphabet, guess_alphabet, is_silence, read_sounds
from facegen.animation.speech import SHORTEST, Speech, TimedSound, spread
from facegen.animation.speech_table import load_speech_table
from facegen.errors import FileError, InputError, NotationError, nearest
from facegen.facs.validate import Entry
from facegen.facs.yamlfile import parse_json
from facegen.fileio.textgrid import Tier, parse_textgrid, read_text

SUFFIXES = (".textgrid", ".json", ".tsv", ".xml", ".txt", ".lab", ".csv")

_PHONES = re.compile(r"phone|phoneme|\bphn\b|segment|\bmau\b|laut|sound", re.IGNORECASE)
_CUE = re.compile(r'<mouthCue\s+start="([^"]*)"\s+end="([^"]*)"\s*>([^<]*)</mouthCue>')
_RHUBARB_TSV = re.compile(r"[0-9.]+\t[A-HX]")
_TOUCH = 0.0005     # seconds that two stretches may lap by rounding of what wrote them

Labels = list[tuple[float, float, str, str]]        # start, end, label, where it stands


def read_speech(path: str | os.PathLike[str], *, tier: str | None = None, alphabet: str = "auto") -> Speech:
    """Return the speech of a file of timings.

    path: a TextGrid (long or short, any encoding Praat writes); Rhubarb's JSON, TSV or XML; what ``facegen speak
    --json`` prints; or lines of ``start end sound``, seconds, parted by tabs, commas or spaces (Audacity's labels,
    the CSV of the Montreal aligner). tier: which tier of a TextGrid; by default the one whose name speaks of phones.
    alphabet: as `read_sounds` takes it.

    Raises FileError or TableError, which name the line or key.
    """
    path = Path(path)
    check_alphabet(alphabet)
    text = read_text(path)
    head = text.lstrip()[:200]
    if tier is not None and not head.startswith(("File type", '"ooText')):
        raise InputError(f"tier: {path} is no TextGrid and has no tiers; leave tier out")
    if head.startswith(("File type", '"ooText', "ooBinary")) or path.suffix.lower() == ".textgrid":
        chosen = _tier(parse_textgrid(text, str(path)), tier, path)
        labels = [(start, end, label, f"tier '{chosen.name}', {start:g} s") for start, end, label in chosen.intervals]
        duration = chosen.intervals[-1][1] if chosen.intervals else 0.0
    elif head.startswith("{"):
        return _json(Entry(parse_json(text, str(path)), str(path)), alphabet)
    elif head.startswith("<"):
        found = [(m[1], m[2], m[3], text.count("\n", 0, m.start()) + 1) for m in _CUE.finditer(text)]
        if not found:
            raise FileError(f"{path}: no <mouthCue start=... end=...> in it: expected Rhubarb's XML")
        return _rhubarb([(_time(path, line, a), _time(path, line, b), value.strip(), f"line {line}")
                         for a, b, value, line in found], path)
    else:
        lines = text.splitlines()
        full = [line for line in lines if line.strip()]
        if len(full) > 1 and all(map(_RHUBARB_TSV.fullmatch, map(str.strip, full))):
            return _rhubarb(_changes(lines, path), path)
        labels = _lines(lines, path)
        duration = labels[-1][1] if labels else 0.0
    return _speech(labels, duration, alphabet, str(path))


def _speech(labels: Labels, duration: float, alphabet: str, source: str) -> Speech:
    """Return labels that hold sounds of an alphabet as speech."""
    if alphabet == "auto":
        alphabet = guess_alphabet(part for _, _, label, _ in labels for part in label.split())
    made: list[TimedSound] = []
    noises = 0
    for start, end, label, where in labels:
        noises += label.strip().casefold() == "spn"
        try:
            sounds = [Sound(load_speech_table().pause, label.strip() or "sil")] if is_silence(label) \
                else read_sounds(label, alphabet)
        except NotationError as error:
            raise FileError(f"{source}: {where}: {str(error).removeprefix('phonemes: ')}") from error
        made += spread(sounds, start, end) if sounds and end - start >= SHORTEST else []
    said = f"{noises} stretches 'spn', noise that the aligner could not read, are shown as silence"
    return _checked(made, duration, source, (said,) if noises else ())


def _checked(made: Iterable[TimedSound], duration: float, source: str, warnings: tuple[str, ...] = ()) -> Speech:
    try:
        return Speech(tuple(made), duration, {"path": source}, warnings)
    except InputError as error:
        raise FileError(f"{source}: {error}") from error


def _tier(tiers: list[Tier], name: str | None, path: Path) -> Tier:
    names = [one.name for one in tiers]
    if name is not None:
        found = next((one for one in tiers if one.name == name), None)
        if found is None:
            raise InputError(f"tier: {path} has no tier of intervals '{name}'{nearest(name, names)} "
                             f"(it has {', '.join(names) or 'none'})")
        return found
    likely = [one for one in tiers if _PHONES.search(one.name)] or tiers
    if len(likely) != 1:
        raise InputError(f"tier: {path} has {len(likely) or 'no'} tiers of intervals that could hold the sounds"
                         f"{'; say which: ' + ', '.join(one.name for one in likely) if likely else ''}")
    return likely[0]


def _json(root: Entry, alphabet: str) -> Speech:
    """Return Rhubarb's JSON, or facegen's own."""
    if not isinstance(root.value, dict) or not ("mouthCues" in root.value or "sounds" in root.value):
        raise root.fail("expected Rhubarb's JSON (mouthCues) or that of facegen speak (sounds)")
    if "mouthCues" in root.value:
        labels: Labels = []
        for entry in dict(root.items())["mouthCues"].each():
            fields = entry.fields(required=("start", "end", "value"))
            labels.append((fields["start"].number(0.0, LONGEST), fields["end"].number(0.0, LONGEST),
                           fields["value"].text(), entry.path))
        return _rhubarb(labels, root.source)
    table, fields, made = load_speech_table(), dict(root.items()), []
    for entry in fields["sounds"].each():
        one = entry.fields(required=("start", "end", "sound"), optional=("label", "stress", "visemes"))
        symbol = one["sound"].text()
        phoneme = table.pause if is_silence(symbol) else table.phonemes.get(table.spellings.get(symbol, symbol)) \
            or table.rhubarb.get(symbol)
        if phoneme is None:
            raise one["sound"].fail(f"unknown sound '{symbol}'{nearest(symbol, table.phonemes)}")
        stress = one["stress"].choice(("primary", "secondary", "none"), "stress") \
            if "stress" in one and one["stress"].value is not None else None
        made.append(TimedSound(one["start"].number(0.0, LONGEST), one["end"].number(0.0, LONGEST),
                               one["label"].text() if "label" in one else symbol, phoneme, stress))
    end = made[-1].end if made else 0.0
    return _checked(made, fields["duration"].number(0.0, LONGEST) if "duration" in fields else end, root.source)


def _rhubarb(labels: Labels, path: str | Path) -> Speech:
    """Return Rhubarb's shapes as speech."""
    shapes, made = load_speech_table().rhubarb, []
    for start, end, label, where in labels:
        if label not in shapes:
            raise FileError(f"{path}: {where}: '{label}' is no mouth shape of Rhubarb (A to H, X)")
        if end < start:
            raise FileError(f"{path}: {where}: ends at {end:g} s, before it starts at {start:g} s")
        if end - start >= SHORTEST:
            made.append(TimedSound(start, end, label, shapes[label]))
    return _checked(made, made[-1].end if made else 0.0, str(path))


def _changes(lines: list[str], path: Path) -> Labels:
    """Return Rhubarb's TSV, a shape at the time when it begins; the last line says when all ends."""
    marks = [(_time(path, k, line.split("\t")[0]), line.split("\t")[1].strip(), f"line {k}")
             for k, line in enumerate(lines, 1) if line.strip()]
    return [(start, end, label, where) for (start, label, where), (end, _, _) in itertools.pairwise(marks)]


def _lines(lines: list[str], path: Path) -> Labels:
    """Return lines of start, end and sound. A first line without numbers is a heading; '#' begins a remark."""
    labels: Labels = []
    heading = None
    for k, line in enumerate(lines, 1):
        text = line.strip()
        if not text or text.startswith("#"):
            continue
        parts = text.split("\t") if "\t" in text else text.split(",") if "," in text else text.split(None, 2)
        parts = [part.strip() for part in parts]
        if not labels and heading is None and not parts[0][:1].isdigit() and not parts[0].startswith((".", "-")):
            heading = [part.casefold() for part in parts]
            continue
        if heading and "type" in heading and len(parts) > heading.index("type") \
                and not _PHONES.search(parts[heading.index("type")]):
            continue                        # the Montreal aligner's CSV holds words too
        if len(parts) < 2:
            raise FileError(f"{path}: line {k}: expected start, end and sound, such as '0.10 0.18 HH', "
                            f"got '{text[:40]}'")
        start, end = _time(path, k, parts[0]), _time(path, k, parts[1])
        if labels and -_TOUCH <= start - labels[-1][1] < 0.0:
            start = labels[-1][1]
        if end < start or (labels and start < labels[-1][1]):
            raise FileError(f"{path}: line {k}: expected times in order, got {start:g} to {end:g}"
                            + (f" after {labels[-1][1]:g}" if labels else ""))
        labels.append((start, end, parts[2] if len(parts) > 2 else "", f"line {k}"))
    if not labels:
        raise FileError(f"{path}: no line of start, end and sound in it; facegen reads TextGrid, Rhubarb's JSON, TSV "
                        "and XML, and lines such as '0.10 0.18 HH'")
    return labels


def _time(path: str | Path, line: int, text: str) -> float:
    try:
        return Entry(float(text), str(path)).number(0.0, LONGEST)
    except (ValueError, InputError):
        raise FileError(f"{path}: line {line}: expected a time in seconds, 0 to {LONGEST:g}, "
                        f"got '{text[:40]}'") from None
