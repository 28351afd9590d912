"""A recording of weights over time: on the base face as pictures, and as an animation in a GLB that comes back.

    python examples/06_play_a_recording.py [folder]
"""

import sys
from pathlib import Path

import numpy as np

import facegen

folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")

# Usually a file of a tracker: facegen.load_performance("openface.csv"). Here, two seconds made up: a smile, a blink,
# a turn of the head, and three frames in which the face was lost.
times = np.arange(60) / 30
smile = np.clip(times, 0, 1)
blink = np.exp(-(((times - 1.2) / 0.08) ** 2))
weights = np.stack([smile, smile, blink, blink], axis=1)
weights[20:23] = np.nan
head = np.stack([15 * np.sin(3 * times), 0 * times, 0 * times], axis=1)
take = facegen.Performance(times, ("mouthSmileLeft", "mouthSmileRight", "eyeBlinkLeft", "eyeBlinkRight"), weights,
                           "arkit", head=head)

# A film needs the extra "video" for .mp4; .gif needs nothing, a name without suffix is a folder of pictures.
face = facegen.load_face()
playback = facegen.Playback(take)
renderer = facegen.Renderer(face, size=256)
pose = playback.on(face, detail=renderer.detail)            # vertices of a moment, whatever the rig
moments = (0.0, 0.7, 1.2, 1.9)
sheet = facegen.contact_sheet([renderer.draw(pose(t)) for t in moments], [f"{t} s" for t in moments], columns=4)
facegen.save_image(sheet, folder / "06_take.png")
print(*playback.warnings, sep="\n")

# The same as blendshapes with an animation, for Blender, three.js and games; and back again.
facegen.save_clip(take, folder / "06_take.glb", detail=1)
again = facegen.load_performance(folder / "06_take.glb")
print(again.vocabulary, len(again), "frames;", "largest smile", again.column("mouthSmileLeft").max())
