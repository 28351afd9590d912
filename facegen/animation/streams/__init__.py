"""Recorded streams: files of other people's trackers as performances, and back (docs/streams.md).

::

    from facegen.animation.streams import load_performance, save_performance

    performance = load_performance("openface.csv", smooth=True)
    save_performance(performance, "take.csv", format="livelink")
"""

from facegen.animation.streams.calibrate import Calibration, calibrated
from facegen.animation.streams.files import load_performance, save_performance
from facegen.animation.streams.formats import FORMATS, Format, Sample, Wish, register
from facegen.animation.streams.resample import resampled
from facegen.animation.streams.smooth import Filter, OneEuro, smoothed
from facegen.animation.streams.translate import translated

__all__ = ["FORMATS", "Calibration", "Filter", "Format", "OneEuro", "Sample", "Wish", "calibrated",
           "load_performance", "register", "resampled", "save_performance", "smoothed", "translated"]
