"""What a picture is made of beside the mesh: materials, lights and the background."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

from facegen.face.colours import CLAY as CLAY_COLOUR
from facegen.face.colours import COLOURS, Colour


@dataclass(frozen=True)
class Material:
    """How a surface answers light.

    ``albedo``: sRGB 0..255. ``specular``: brightness of the highlight, ``shininess``: its sharpness (the
    lobe is exp(-shininess (1 - n.h))). ``wrap``: how far red, green and blue light creep past the
    terminator: skin lets red through, which makes its shadow edge warm. ``catch``: brightness of the
    catch-light, for wet eyes. ``lift``: its openness counts as openness ** (1 - lift), so that teeth are
    bright enough to be read as teeth, yet dark behind lips that hardly part.
    """

    albedo: Colour
    specular: float = 0.05
    shininess: float = 20.0
    wrap: Colour = (0.0, 0.0, 0.0)
    catch: float = 0.0
    lift: float = 0.0


@dataclass(frozen=True)
class Light:
    """A distant soft light. ``towards``: direction to the light in camera axes (right, up, to the viewer).

    ``colour``: linear. ``spread``: sharpness of its soft shadow. ``highlight``: its share in highlights.
    """

    towards: Colour
    colour: Colour
    spread: float = 6.0
    highlight: float = 1.0


_SKIN_WRAP = (0.32, 0.21, 0.16)
_WET_WRAP = (0.25, 0.12, 0.10)

MATERIALS: Mapping[str, Material] = MappingProxyType({
    "skin": Material(COLOURS["skin"], 0.085, 18.0, _SKIN_WRAP),
    "nostril": Material(COLOURS["nostril"], 0.02, 10.0, _SKIN_WRAP),
    "lips": Material(COLOURS["lips"], 0.12, 34.0, _WET_WRAP),
    "brows": Material(COLOURS["brows"], 0.02, 10.0, (0.1, 0.1, 0.1)),
    "lashes": Material(COLOURS["lashes"], 0.02, 10.0),
    "hair": Material(COLOURS["hair"], 0.05, 10.0, (0.15, 0.15, 0.15)),
    "sclera": Material(COLOURS["sclera"], 0.25, 300.0, (0.35, 0.30, 0.28), 0.5, 0.25),
    "iris": Material(COLOURS["iris"], 0.25, 300.0, (0.3, 0.3, 0.3), 0.9, 0.25),
    "limbus": Material(COLOURS["limbus"], 0.25, 300.0, (0.3, 0.3, 0.3), 0.9, 0.25),
    "pupil": Material(COLOURS["pupil"], 0.25, 300.0, (0.0, 0.0, 0.0), 0.9),
    "teeth": Material(COLOURS["teeth"], 0.15, 60.0, (0.25, 0.2, 0.15), lift=0.72),
    "gums": Material(COLOURS["gums"], 0.12, 40.0, _WET_WRAP, lift=0.3),
    "tongue": Material(COLOURS["tongue"], 0.10, 30.0, _WET_WRAP, lift=0.12),
    "mouth": Material(COLOURS["mouth"], 0.05, 30.0, lift=0.5),
    "flesh": Material((222, 158, 140), 0.0, 10.0, (0.3, 0.3, 0.3)),      # the cut of facegen.geometry.section
})

# A material name that the scene does not know is drawn in plain clay.
CLAY = Material(CLAY_COLOUR, 0.04, 16.0)
# Back faces - the inner side of the skin, seen through open lips - are drawn in this, without direct light.
INSIDE = Material((84, 36, 32), 0.0, 1.0)


@dataclass(frozen=True)
class Scene:
    """Lights and materials. The lights go with the camera, so every view is lit like a portrait."""

    materials: Mapping[str, Material] = field(default_factory=lambda: MATERIALS)
    lights: tuple[Light, ...] = (
        Light((-0.46, 0.56, 0.88), (0.70, 0.68, 0.655), 5.0, 1.0),       # key
        Light((0.75, 0.10, 0.80), (0.17, 0.18, 0.195), 3.0, 0.35),       # fill
        Light((0.72, 0.45, -0.60), (0.22, 0.225, 0.235), 5.0, 0.5),      # rim
        Light((-0.80, 0.30, -0.55), (0.12, 0.12, 0.13), 5.0, 0.5),       # a second, weaker rim
    )
    # The window that wet eyes mirror, without regard to shadow: a picture without catch-lights looks
    # lifeless.
    window: Colour = (-0.26, 0.30, 0.92)
    sky: Colour = (0.40, 0.41, 0.43)
    ground: Colour = (0.235, 0.225, 0.22)
    background: tuple[Colour, Colour] = ((238, 239, 241), (214, 216, 219))    # sRGB at the top and the bottom
