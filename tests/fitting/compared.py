"""How a fit is compared with what was made."""

import numpy as np


def of(performance, names):
    """Return the weights (n, k) of these names, 0 for what was not fitted."""
    return np.column_stack([performance.column(name) if name in performance.names else np.zeros(len(performance))
                            for name in names])


def swapped(name):
    """Return the name of the same shape on the other side."""
    if name.endswith("Left"):
        return name[:-4] + "Right"
    return name[:-5] + "Left" if name.endswith("Right") else name
