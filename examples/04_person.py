"""Give a person habits of their own: their happiness is not everybody's.

python examples/04_person.py [folder]
"""

import sys
from pathlib import Path

import facegen

folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
table = folder / "ada.yaml"
table.write_text("""\
about: A person who smiles with one side and frowns while she does.
source: "an example"
overrides:
  happiness: {units: "4B+6B+L12E+R12B+25B", about: A one-sided smile under lowered brows.}
adds:
  ada_maybe: {units: "L2D+14C+55B", about: Her way of saying perhaps., also: [perhaps]}
""", encoding="utf-8")

face = facegen.load_face()
people = {"everybody": None, **{name: name for name in facegen.people()}, "ada": table}
pictures = [facegen.render(face, "happiness", person=person, size=192) for person in people.values()]
pictures.append(facegen.render(face, "perhaps", person=table, size=192))
sheet = facegen.contact_sheet(pictures, [*people, "ada: perhaps"], columns=len(pictures))
print(facegen.save_image(sheet, folder / "people.png"))
