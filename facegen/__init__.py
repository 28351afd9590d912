"""facegen: facial expressions from a name or a FACS script."""

__version__ = "0.1.0"
