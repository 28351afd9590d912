"""Raw deformation data: what a face is handed, whatever its shape. The lowest level at which a user may
enter.

Based on Akimoto, Mase, Suenaga 1986, section 3.1: a jaw angle and the movements of feature points; eye, lid
and head angles join them. Deformations form a vector space (``+``, ``-``, ``*``): the movement of a face is
linear in them up to the rotations that jaw, eyes, lids and head make.
"""

from __future__ import annotations

import math
import numbers
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from types import MappingProxyType

from facegen.errors import InputError, TableError, nearest
from facegen.facs.validate import Entry
from facegen.facs.yamlfile import read_data

Vector = tuple[float, float, float]

UNITS = ("face", "millimetre", "paper")
JAW = ("open", "side", "forward")
LIDS = ("upper_L", "upper_R", "lower_L", "lower_R")
EYES = ("yaw_L", "yaw_R", "pitch_L", "pitch_R")
HEAD = ("yaw", "pitch", "roll", "forward")
_SCALARS = {"jaw": JAW, "lids": LIDS, "eyes": EYES, "head": HEAD, "folds": None}  # None: any name
LIMIT = 1e6  # millimetres, degrees or a factor: nothing on a face comes near, and sums stay finite
KEYS = ("units", "points", *_SCALARS, "turns_with_jaw")
_LENGTHS = (("jaw", "side"), ("jaw", "forward"), ("head", "forward"))  # in `units`; the rest are not lengths
_NEGATED = {("jaw", "side"), ("head", "yaw"), ("head", "roll"), ("eyes", "yaw_L"), ("eyes", "yaw_R")}
_PAPER_PAIRS = (("F8", "F9"), ("F12", "F13"), ("F14", "F15"))  # the first of a pair lies at +x
_PAPER_MIRROR = {a: b for pair in _PAPER_PAIRS for a, b in (pair, pair[::-1])}


def mirror_name(name: str) -> str:
    """Return the name of the same thing on the other side; a thing on the midline keeps its name.

    >>> mirror_name("mouth_corner_L"), mirror_name("F9"), mirror_name("chin")
    ('mouth_corner_R', 'F8', 'chin')
    """
    if name.endswith("_L"):
        return name[:-1] + "R"
    if name.endswith("_R"):
        return name[:-1] + "L"
    return _PAPER_MIRROR.get(name, name)


@dataclass(frozen=True)
class Deformation:
    """Movements of a face; what is missing is zero, and zeros are not kept, so equal movements compare equal.

    points: feature point -> (x, y, z) in ``units``. jaw: ``open`` (degrees), ``side`` (+ to the subject's
    left) and ``forward`` in ``units``. lids: ``upper_L`` ...: share of the open eye that this lid travels, 1
    = closes it alone, negative = opens it wider. eyes: ``yaw_L`` ... (+ to the subject's left) and
    ``pitch_L`` ... (+ up), degrees. head: ``yaw`` (+ left), ``pitch`` (+ up), ``roll`` (+ tilts to the left),
    degrees; ``forward`` in ``units``. folds: corrective fold -> amount, 1 = full. with_jaw: points that turn
    rigidly with the jaw (key ``turns_with_jaw``); sorted, and empty while the jaw rests.

    units: "face" = fractions of the face's own distances; "millimetre"; "paper" = Akimoto 1986: half head
    heights, z BACKWARD. Otherwise +x is the subject's left, +y up, +z forward.
    """

    points: Mapping[str, Vector] = field(default_factory=dict)
    jaw: Mapping[str, float] = field(default_factory=dict)
    lids: Mapping[str, float] = field(default_factory=dict)
    eyes: Mapping[str, float] = field(default_factory=dict)
    head: Mapping[str, float] = field(default_factory=dict)
    folds: Mapping[str, float] = field(default_factory=dict)
    units: str = "face"
    with_jaw: tuple[str, ...] = ()

    __array_ufunc__ = None  # so that a NumPy number times a deformation is a deformation

    def __post_init__(self) -> None:
        raw = {name: getattr(self, name) for name in ("points", *_SCALARS, "units")}
        checked = _checked(Entry({**raw, "turns_with_jaw": list(self.with_jaw)}, "Deformation"))
        _fill(self, **checked)

    def __reduce__(self) -> tuple:  # mapping proxies cannot be pickled
        state = {name: dict(getattr(self, name)) for name in ("points", *_SCALARS)}
        return partial(Deformation, **state, units=self.units, with_jaw=self.with_jaw), ()

    def __hash__(self) -> int:
        return hash((self.units, self.with_jaw, frozenset(self.points.items()),
                     *(frozenset(getattr(self, name).items()) for name in _SCALARS)))

    def __bool__(self) -> bool:
        """Return whether anything moves."""
        return any(getattr(self, name) for name in ("points", *_SCALARS))

    def __add__(self, other: Deformation) -> Deformation:
        if not isinstance(other, Deformation):
            return NotImplemented
        return weighted_sum([(1.0, self), (1.0, other)])

    def __sub__(self, other: Deformation) -> Deformation:
        if not isinstance(other, Deformation):
            return NotImplemented
        return weighted_sum([(1.0, self), (-1.0, other)])

    def __mul__(self, factor: float) -> Deformation:
        if isinstance(factor, bool) or not isinstance(factor, numbers.Real):
            return NotImplemented
        if not abs(factor) <= LIMIT:
            raise InputError(f"factor: a deformation is scaled by a number within {LIMIT:g}, got {factor}")
        return weighted_sum([(float(factor), self)])

    __rmul__ = __mul__

    def __neg__(self) -> Deformation:
        return self * -1.0

    @property
    def has_lengths(self) -> bool:
        """Whether anything here is measured in ``units`` (angles and shares are not)."""
        return bool(self.points) or any(key in getattr(self, name) for name, key in _LENGTHS)

    def mirrored(self) -> Deformation:
        """Return the mirror image: left and right change places."""
        scalars = {name: {mirror_name(key): -value if (name, key) in _NEGATED else value
                          for key, value in getattr(self, name).items()} for name in _SCALARS}
        points = {mirror_name(name): (-x, y, z) for name, (x, y, z) in self.points.items()}
        return _trusted(points=points, **scalars, units=self.units, with_jaw=map(mirror_name, self.with_jaw))

    def both_sides(self) -> Deformation:
        """Return the deformation with every ``_L`` entry mirrored to ``_R``; the midline stays as it is."""
        left = {name: {key: value for key, value in getattr(self, name).items() if key.endswith("_L")}
                for name in ("points", *_SCALARS)}
        return self + _trusted(**left, units=self.units).mirrored()

    def check_names(self, *, points: Collection[str], folds: Collection[str] | None = None,
                    source: str = "deformation", path: str = "") -> None:
        """Raise TableError for a feature point, or fold, that the face does not have."""
        for kind, key, names, valid in (("feature point", "points", self.points, points),
                                        ("feature point", "turns_with_jaw", self.with_jaw, points),
                                        ("fold", "folds", self.folds, folds)):
            for name in names if valid is not None else ():
                if name not in valid:
                    where = f"{path}.{key}" if path else key
                    raise TableError(f"{source}: {where}.{name}: unknown {kind} '{name}'"
                                     f"{nearest(name, valid)}")

    def as_dict(self) -> dict[str, object]:
        """Return plain data, lists and numbers for YAML or JSON, that ``deformation_from_dict`` reads."""
        data: dict[str, object] = {"units": self.units}
        if self.points:
            data["points"] = {name: list(vector) for name, vector in self.points.items()}
        data |= {name: dict(getattr(self, name)) for name in _SCALARS if getattr(self, name)}
        return data | ({"turns_with_jaw": list(self.with_jaw)} if self.with_jaw else {})


def weighted_sum(terms: Iterable[tuple[float, Deformation]]) -> Deformation:
    """Return the sum of ``weight * deformation``; the weights are finite.

    The sums are exact to the last bit, so neither the order of the terms nor their side changes a result. A
    point that turns with the jaw in one term turns with it in the sum. Raises InputError when movements in
    different units meet, for only a face knows how they convert.
    """
    points: dict[str, list[Vector]] = {}
    scalars: dict[str, dict[str, list[float]]] = {name: {} for name in _SCALARS}
    units, with_lengths, with_jaw = None, False, []
    for weight, one in terms:
        if one.has_lengths:
            if with_lengths and one.units != units:
                raise InputError(f"deformations in '{units}' and in '{one.units}' units cannot be added; "
                                 "let the face convert them first")
            units, with_lengths = one.units, True
        units = units or one.units
        if weight == 0.0:
            continue
        with_jaw.extend(one.with_jaw)
        for name, (x, y, z) in one.points.items():
            points.setdefault(name, []).append((weight * x, weight * y, weight * z))
        for name, total in scalars.items():
            for key, value in getattr(one, name).items():
                total.setdefault(key, []).append(weight * value)
    vectors = {name: tuple(map(math.fsum, zip(*several, strict=True))) for name, several in points.items()}
    sums = {name: {key: math.fsum(several) for key, several in total.items()}
            for name, total in scalars.items()}
    return _trusted(points=vectors, **sums, units=units or "face", with_jaw=with_jaw)


def deformation_from_dict(data: Mapping[str, object], *, source: str = "deformation") -> Deformation:
    """Return the deformation that plain data describe (the keys of ``Deformation``; ``turns_with_jaw:
    [F3]``).

    Raises TableError: unknown key, wrong type, number that is not finite; ``source`` names the data in it.
    """
    return _trusted(**_checked(Entry(data, source)))


def deformation_from_entry(entry: Entry) -> Deformation:
    """Return the deformation that one entry of a table describes."""
    return _trusted(**_checked(entry))


def load_deformation(path: str | Path) -> Deformation:
    """Return the deformation in a YAML or JSON file: the same keys, and ``about`` and ``source`` as texts."""
    return load_deformation_file(path)[0]


def load_deformation_file(path: str | Path) -> tuple[Deformation, str | None]:
    """Return the deformation in a file and the source that the file names, if any."""
    return read_deformation(read_data(path), str(path))


def read_deformation(data: object, source: str) -> tuple[Deformation, str | None]:
    """Return the deformation in a file's plain data, and the source that they name; ``source`` is the file."""
    entry = Entry(data, source)
    fields = entry.fields(optional=(*KEYS, "about", "source"))
    texts = {key: fields.pop(key).text() for key in ("about", "source") if key in fields}
    if not fields:
        raise entry.fail(f"holds no deformation: give at least one of {', '.join(KEYS[1:])}")
    found = {key: field.value for key, field in fields.items()}
    return deformation_from_dict(found, source=source), texts.get("source")


def _checked(entry: Entry) -> dict[str, object]:
    """Return the fields of a Deformation from data of unknown quality."""
    fields = entry.fields(optional=KEYS)
    result: dict[str, object] = {"units": fields["units"].choice(UNITS, "unit of length") if "units" in fields
                                 else "face"}
    points = fields["points"].items() if "points" in fields else ()
    result["points"] = {name: e.vector(LIMIT) for name, e in points}
    for name, known in _SCALARS.items():
        inner = fields.get(name)
        if inner is None:
            result[name] = {}
        else:
            pairs = inner.items() if known is None else inner.fields(optional=known).items()
            result[name] = {key: e.number(-LIMIT, LIMIT) for key, e in pairs}
    result["with_jaw"] = fields["turns_with_jaw"].texts() if "turns_with_jaw" in fields else ()
    return result


def _fill(target: Deformation, *, units: str, points: Mapping[str, Vector], with_jaw: Iterable[str] = (),
          **scalars: Mapping[str, float]) -> Deformation:
    """Set the fields of a frozen Deformation, without zeros."""
    kept = {name: vector for name, vector in points.items() if any(vector)}
    object.__setattr__(target, "points", MappingProxyType(kept))
    for name in _SCALARS:
        kept_values = {key: value for key, value in scalars.get(name, {}).items() if value}
        object.__setattr__(target, name, MappingProxyType(kept_values))
    object.__setattr__(target, "units", units)
    object.__setattr__(target, "with_jaw", tuple(sorted(set(with_jaw))) if target.jaw else ())
    return target


def _trusted(**fields) -> Deformation:
    """Return a Deformation of fields that are known to be valid."""
    return _fill(object.__new__(Deformation), **fields)
