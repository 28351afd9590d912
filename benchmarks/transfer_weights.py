"""What each weight of the energies does, on copies of the template in other triangles, where the true motion is known.

    python benchmarks/transfer_weights.py

Prints the table of docs/transfer.md; needs fast_simplification, as the tests do.
"""

from __future__ import annotations

import sys
from pathlib import Path

from facegen.transfer.skin import lay_skin
from facegen.transfer.template import places_on
from facegen.transfer.weights import read_weights

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "transfer"))
from remeshing import errors, remesh, template_of_units

WEIGHTS = ("ours", "anchor=0", "landmarks=0", "landmarks=0,anchor=0", "gradients=0", "smooth=10", "identity=1", "paper")
SHARES = (0.4, 1.0)


def main() -> None:
    """Print the table."""
    template = template_of_units()
    copies = [remesh(template, share) for share in SHARES]
    skins = [lay_skin(template, surface, places_on(surface, template.landmarks)) for surface, _ in copies]
    print("| weights |", *(f"triangles x {share:g} |" for share in SHARES))
    print("|---|" + "---|" * len(SHARES))
    for name in WEIGHTS:
        found = [errors(skin.motion(weights=read_weights(name)), true)[0]
                 for skin, (_, true) in zip(skins, copies, strict=True)]
        print(f"| `{name}` |", *(f"{100 * error:.1f} % |" for error in found), flush=True)


if __name__ == "__main__":
    main()
