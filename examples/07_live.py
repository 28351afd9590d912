"""A face driven live: push a frame of weights, get a picture; everything else is prepared once.

    python examples/07_live.py [folder]
"""

import sys
import time
from pathlib import Path

import numpy as np

import facegen

folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")

live = facegen.Live("akimoto", "arkit", size=256, smooth=True)      # or the path of a rigged avatar
began, count = time.perf_counter(), 20
for k in range(count):                                              # here a tracker's frames would come in
    opening = 0.5 + 0.5 * np.sin(k / 2)
    pixels = live.draw({"jawOpen": opening, "mouthFunnel": 1 - opening}, head=(k, 0, 0), time=k / 30)
print(f"{count / (time.perf_counter() - began):.0f} frames a second")
facegen.save_image(pixels, folder / "07_live.png")

# Without a size there are vertices only, in millimetres, for a renderer of your own.
live = facegen.Live("akimoto", names=["jawOpen", "eyeBlinkLeft"])
print(live.vertices([0.4, 1.0], gaze=(10, 0, 10, 0)).shape)
