"""Draw an expression by its name, from two sides.

python examples/01_render_a_name.py [folder]
"""

import sys
from pathlib import Path

import facegen

folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
face = facegen.load_face()
for name, view in (("front", (0, 0)), ("left", (40, 0))):
    pixels = facegen.render(face, "happiness", size=256, view=view)     # (256, 256, 4) uint8
    print(facegen.save_image(pixels, folder / f"happiness-{name}.png"))
