"""Move the face without any table: a jaw angle and the movements of a few points.

python examples/03_raw_deformation.py [folder]
"""

import sys
from pathlib import Path

import facegen

folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
face = facegen.load_face()

# Millimetres and degrees; +x is the subject's left, +y up, +z forward.
open_mouth = facegen.Deformation(jaw={"open": 12})
corner = facegen.Deformation(points={"mouth_corner_L": (3, 5, -2)}, units="millimetre")
look = facegen.Deformation(eyes={"yaw_L": 15, "yaw_R": 15})
together = open_mouth + corner + look            # deformations add, and scale: 0.5 * together

moved = face.pose(together) - face.mesh().vertices
print(f"the farthest vertex moves {(moved**2).sum(axis=1).max() ** 0.5:.1f} mm")
print(facegen.save_image(facegen.render(face, together, size=256), folder / "raw.png"))

# A file says the same; this is figure 8 of the 1986 paper.
print(facegen.save_image(facegen.render(face, "akimoto-1986-figure-8", size=256), folder / "figure-8.png"))
