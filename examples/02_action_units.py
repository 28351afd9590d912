"""Say an expression in FACS action units, and see what facegen makes of it.

python examples/02_action_units.py [folder]
"""

import sys
from pathlib import Path

import facegen

folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")

# A script, or the same as numbers. L and R are the subject's own left and right.
assert facegen.parse("AU6C + L12D") == {"6": 0.5, "L12": 0.8}
assert facegen.canonical({"6": 0.5, "L12": 0.8}) == "6C+L12D"

meaning = facegen.resolve("5E+43B")
for warning in meaning.warnings:        # opposite units are drawn together, with a warning
    print("warning:", warning)

face = facegen.load_face()
pictures = [facegen.render(face, script, size=192) for script in ("6C+L12D", {"AU4": 0.8, "AU7": 0.5}, "R46")]
sheet = facegen.contact_sheet(pictures, ["6C+L12D", "4 and 7", "R46"], columns=3)
print(facegen.save_image(sheet, folder / "units.png"))
