"""FACS notation: ``parse("AU6C + R12D")`` -> weights by unit code, and ``canonical`` back, without loss.

What people type, all accepted, in upper or lower case::

    6+12   AU6C + AU12D   1,2,5B,26   6 12            units joined by + , ; or spaces
    R12A+R14A   L12C   12L   12_left   T23   B28       sides (the subject's own), upper (T) and lower (B) lip
    12C   12=0.4   12:0.4   AU12_r=3.2   AU12_c=1      letters A-E, weights 0..1, OpenFace 0..5 and presence
    26/27   0                                         alternatives (the first is taken), the neutral face

A unit without an intensity counts as D (0.8): plain to see, short of the extreme. ``_r`` and ``_c`` in small
letters are OpenFace's columns; ``12R`` and ``12_R`` are the right side. Anything else is refused where it
stands.
"""

from __future__ import annotations

import numbers
import re
from collections.abc import Mapping
from dataclasses import dataclass

from facegen.errors import InputError, NotationError
from facegen.facs.units import LETTERS, Catalogue, load_catalogue, split_code

MAX_LENGTH = 10_000  # characters; every unit with every side takes about 1,000

_HEAD = re.compile(r"(?:([LRTBUM])_?)?(?:AU[_ \t]*)?(?:([LRTBU])_?)?([0-9]+)", re.IGNORECASE | re.ASCII)
_COLUMN = re.compile(r"_([rc])(?![A-Za-z0-9])", re.ASCII)
_SIDE = re.compile(r"_?(left|right|l|r)(?![f-z])", re.IGNORECASE | re.ASCII)
_LETTER = re.compile(r"_?([A-E])(?![f-km-qs-z])", re.IGNORECASE | re.ASCII)
_VALUE = re.compile(r"\s*[=:]\s*([-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:e-?[0-9]+)?)?", re.IGNORECASE | re.ASCII)
_COMMA_DECIMAL = re.compile(r",[0-9]+(?![0-9A-Za-z_/]|\s*[=:])", re.ASCII)  # a comma, then a bare number
_WORD = re.compile(r"[^\W\d_]+")
_TRAILING = re.compile(r"\s+\Z")
_SEPARATOR = re.compile(r"\s*[+,;]\s*|\s+")
_SPACE = re.compile(r"\s*")
_LOOKS_LIKE_UNITS = re.compile(r"[\s(\[+,;]*[LRTBUAM]?[_ ]?(?:AU)?[_ \t]*[LRTBU]?_?[0-9]",
                               re.IGNORECASE | re.ASCII)
_HINTS = {
    "(": "brackets mark an optional unit: write the unit or leave it out",
    "[": "brackets mark an optional unit: write the unit or leave it out",
    "*": "'*' means any intensity: write A-E, or leave it out",
    "@": "'@' joins alternatives: choose one, or write 26/27 to take the first",
    "-": "join units with '+'",
    "&": "join units with '+'",
}


def parse(text: str, *, catalogue: Catalogue | None = None) -> dict[str, float]:
    """Return unit code -> weight (0..1, zeros left out) of a FACS script, in FACS order.

    ``L12`` and ``R12`` of equal weight become ``12``; ``T23`` and ``B23`` likewise. A unit given twice must
    agree. Raises NotationError, whose message shows the place.

    >>> parse("AU6C + R12B")
    {'6': 0.5, 'R12': 0.25}
    """
    if not isinstance(text, str):
        raise InputError(f"script: expected a text such as '6C+12D', got {type(text).__name__}")
    return _Parser(text, catalogue or load_catalogue()).script()


def parse_weights(weights: Mapping[str | int, float], *,
                  catalogue: Catalogue | None = None) -> dict[str, float]:
    """Return unit code -> weight for a mapping keyed as people key it: 12, "AU12", "L12", "12L", "AU12_r"
    (0..5).

    Raises NotationError for a key that is no unit, InputError for a weight outside its range.
    """
    catalogue = catalogue or load_catalogue()
    result: dict[str, float] = {}
    for key, weight in weights.items():
        parser = _Parser(str(key).strip(), catalogue)
        term = parser.term()
        if parser.at < len(parser.text) or term.weight is not None or isinstance(key, bool):
            raise parser.error(f"as a key, expected one unit without intensity, got {key!r}", 0)
        if isinstance(weight, bool) or not isinstance(weight, numbers.Real):
            raise InputError(f"unit {key}: expected a number, got {weight!r}")
        if term.code == "0":
            continue
        weight = catalogue.from_openface(weight) if term.column == "r" else weight
        catalogue.expand({term.code: weight})  # refuses a weight outside 0..1
        for atom in catalogue.expand({term.code: 1.0}):
            if result.setdefault(atom, weight) != weight:
                raise InputError(f"unit {atom}: given twice, as {result[atom]:g} and as {weight:g}")
    return catalogue.fold(catalogue.expand(result))


def canonical(weights: Mapping[str, float], *, catalogue: Catalogue | None = None) -> str:
    """Return the one script of these weights: FACS order, a letter where the weight is exactly a letter's.

    ``parse(canonical(w))`` gives ``w`` back, to the last bit; no weights give ``0``, the neutral face.

    >>> canonical({"R12": 0.25, "6": 0.37})
    '6=0.37+R12B'
    """
    catalogue = catalogue or load_catalogue()
    letters = {weight: letter for letter, weight in catalogue.letters.items()}
    folded = catalogue.fold(catalogue.expand(weights))
    terms = [f"{code}{letters[w]}" if w in letters else f"{code}={w!r}" for code, w in folded.items()]
    return "+".join(terms) or "0"


def looks_like_units(text: str) -> bool:
    """Return whether a text begins as a FACS script does, so that errors speak of units and not of names."""
    return _LOOKS_LIKE_UNITS.match(text) is not None


@dataclass(frozen=True)
class _Term:
    code: str
    weight: float | None
    start: int
    column: str = ""


class _Parser:
    """One pass over a script; ``at`` is the position of the next character."""

    def __init__(self, text: str, catalogue: Catalogue) -> None:
        self.text, self.catalogue, self.at = text, catalogue, 0

    def error(self, message: str, position: int) -> NotationError:
        start = max(0, min(position, len(self.text)) - 40)
        snippet = "".join(c if c.isprintable() else " " for c in self.text[start:start + 72])
        caret = " " * (position - start) + "^"
        return NotationError(f"{message}\n  {snippet}\n  {caret}", text=self.text, position=position)

    def take(self, pattern: re.Pattern[str]) -> re.Match[str] | None:
        match = pattern.match(self.text, self.at)
        if match:
            self.at = match.end()
        return match

    def script(self) -> dict[str, float]:
        if len(self.text) > MAX_LENGTH:
            raise self.error(f"the script is longer than {MAX_LENGTH} characters", 0)
        self.take(_SPACE)
        if self.at == len(self.text):
            raise self.error("the script is empty; the neutral face is written 0", 0)
        atoms: dict[str, tuple[float, int]] = {}
        neutral = None
        count = 0
        while True:
            term = self.alternatives()
            count += 1
            if term.code == "0":
                neutral = term.start if neutral is None else neutral
            else:
                self.add(atoms, term)
            if neutral is not None and count > 1:
                raise self.error("0 is the neutral face and stands alone", neutral)
            self.take(_TRAILING)
            if self.at == len(self.text):
                break
            self.separator()
        return self.catalogue.fold({atom: weight for atom, (weight, _) in atoms.items() if weight})

    def add(self, atoms: dict[str, tuple[float, int]], term: _Term) -> None:
        """Note the weight of each atom of a term; two different weights are a contradiction."""
        weight = self.catalogue.default_weight if term.weight is None else term.weight
        unit = self.catalogue.units[split_code(term.code)[1]]
        for atom in (term.code,) if term.code in unit.atoms else unit.atoms:
            before = atoms.setdefault(atom, (weight, term.start))[0]
            if before != weight:
                raise self.error(f"{atom} is given twice, as {before:g} and as {weight:g}", term.start)

    def separator(self) -> None:
        here = self.at
        if self.take(_SEPARATOR):
            if self.at == len(self.text):
                raise self.error("a unit is missing after the last separator", here)
            return
        found = self.text[here]
        raise self.error(_HINTS.get(found, f"expected '+' before the next unit, got '{found}'"), here)

    def alternatives(self) -> _Term:
        """Return the first of ``26/27C``; an intensity behind the last counts for it."""
        first = last = self.term()
        while self.text.startswith("/", self.at):
            self.at += 1
            last = self.term()
        if first.weight is None and last.weight is not None:
            return _Term(first.code, last.weight, first.start)
        return first

    def term(self) -> _Term:
        start = self.at
        head = self.take(_HEAD)
        if head is None:
            raise self.no_unit(start)
        before, after, digits = head.groups()
        number = digits.lstrip("0") or "0"
        mark = (before or after or "").upper()
        if before and after:
            raise self.error(f"one side or lip a unit, got '{before}' and '{after}'", start)
        if mark == "M":
            raise self.movement(number, start)
        if mark == "U":
            raise self.error(f"U{number} does not say which side: write L{number} or R{number}", start)
        if number == "0":
            if mark:
                raise self.error("0 is the neutral face and has no side", start)
            return _Term("0", None, start)
        letter, value, column, side = self.tail(number)
        if side:
            if mark:
                raise self.error(f"one side or lip a unit, got '{mark}' and '{side}'", start)
            mark = side
        unit = self.catalogue.units.get(number)
        if mark == "B" and unit and unit.sides == "both":
            mark = ""  # older sheets write B for bilateral
        problem = self.catalogue.problem(mark, number)
        if problem:
            raise self.error(problem, head.start(3) if number not in self.catalogue.units else start)
        weight = self.catalogue.letters[letter] if letter else value
        return _Term(mark + number, weight, start, column)

    def tail(self, number: str) -> tuple[str, float | None, str, str]:
        """Return the intensity letter, the weight, the OpenFace column and the side behind a number."""
        letter = column = side = ""
        value = None
        while self.at < len(self.text):
            here = self.at
            if not column and (match := self.take(_COLUMN)):
                column = match[1]
            elif not side and (match := self.take(_SIDE)):
                side = match[1][0].upper()
            elif not letter and not column and (match := self.take(_LETTER)):
                letter = match[1].upper()
            elif match := self.take(_VALUE):
                if letter:
                    raise self.error("give a letter or a number, not both", here)
                value = self.value(match, column)
                break  # the number ends the unit
            elif self.text[here].isalpha() or self.text[here] == "_":
                raise self.intensity(number, here)
            else:
                break
        return letter, value, column, side

    def intensity(self, number: str, here: int) -> NotationError:
        word = _WORD.match(self.text, here)
        found = word[0] if word else self.text[here]
        if found.upper() in ("T", "B"):
            return self.error(f"the lip stands before the number: write {found.upper()}{number}", here)
        if re.fullmatch("[A-Ea-e]+", found):
            return self.error("one intensity letter a unit", here)
        return self.error(f"AU{number}{found[:12]}: intensity is A-E, from {number}A (trace) to {number}E "
                          "(maximum)", here)

    def value(self, match: re.Match[str], column: str) -> float:
        if match[1] is None:
            raise self.error("expected a number after '=' or ':'", match.end())
        at, number = match.start(1), float(match[1])
        if match[1].isdigit() and _COMMA_DECIMAL.match(self.text, self.at):
            raise self.error("is this comma a decimal point? write 0.4, or '+' between units", self.at)
        if column == "r":
            if not 0.0 <= number <= 5.0:
                raise self.error(f"an OpenFace intensity (_r) lies in 0..5, got {match[1]}", at)
            return self.catalogue.from_openface(number)
        if column == "c":
            if number not in (0.0, 1.0):
                raise self.error(f"an OpenFace presence (_c) is 0 or 1, got {match[1]}", at)
            return number * self.catalogue.default_weight
        if not 0.0 <= number <= 1.0:
            hint = "; for OpenFace's 0..5 write AU12_r=3.2" if 1.0 < number <= 5.0 else ""
            raise self.error(f"a weight lies in 0..1, got {match[1]}{hint}", at)
        return number

    def movement(self, number: str, start: int) -> NotationError:
        name = self.catalogue.movements.get(number, "a movement code")
        return self.error(f"M{number[:6]} is {name}: a movement, which one still face cannot hold; "
                          "write a position, such as 51-58 for the head or 61-64 for the eyes", start)

    def no_unit(self, start: int) -> NotationError:
        if start == len(self.text):
            return self.error("expected a unit number, the script ends here", start)
        found = self.text[start]
        if found in "+,;/":
            return self.error(f"a unit is missing before '{found}'", start)
        if found in _HINTS:
            return self.error(_HINTS[found], start)
        word = _WORD.match(self.text, start)
        if word and word[0].upper() in LETTERS:
            return self.error(f"an intensity stands right behind its unit: 12{word[0].upper()}", start)
        if word and word[0].upper() in ("L", "R", "T", "B", "AU"):
            return self.error(f"expected a unit number right behind '{word[0]}'", start + len(word[0]))
        return self.error(f"expected a unit such as 12 or L12, got '{word[0] if word else found}'", start)
