"""Recorded streams: files of other people's trackers as performances, and back (docs/streams.md).

::

    from facegen.animation.streams import load_performance, save_performance

    performance = load_performance("openface.csv", smooth=True)
    save_performance(performance, "take.csv", format="livelink")
"""

from facegen.animation.streams.files import load_performance, save_performance
from facegen.animation.streams.formats import FORMATS, Format, Sample, Wish, register

__all__ = ["FORMATS", "Format", "Sample", "Wish", "load_performance", "register", "save_performance"]
