"""Make the frames of a smile that grows and fades, all at once, as one array.

python examples/05_animation_frames.py [folder]
"""

import sys
from pathlib import Path

import numpy as np

import facegen

folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
face = facegen.load_face()

# Weights over time: half a second up, half a second held, half a second down, at 20 frames a second.
rise = np.sin(np.linspace(0, np.pi / 2, 10)) ** 2
amount = np.concatenate([rise, np.ones(10), rise[::-1]])

# The smile is linear in its data: scale the peak's controls, and pose the whole batch in one call.
peak = face.controls(face.resolve("happiness").deformation)
batch = facegen.Controls(**{
    name: amount.reshape(-1, *[1] * value.ndim) * value for name, value in vars(peak).items()})
frames = face.pose_controls(batch, detail=1)                             # (30, n, 3) millimetres
print("frames, vertices, axes:", frames.shape)

mesh = face.mesh(1)
pictures = [facegen.render(mesh, vertices, size=128) for vertices in frames[::3]]
sheet = facegen.contact_sheet(pictures, [f"{3 * i / 20:.2f} s" for i in range(len(pictures))], columns=5)
print(facegen.save_image(sheet, folder / "frames.png"))
