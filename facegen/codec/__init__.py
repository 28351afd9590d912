"""Parameter streams: frames of a performance as packets of a few bytes, and back."""
