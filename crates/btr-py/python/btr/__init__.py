"""Back-to-Reality: evolve robot controllers and their simulator against each other."""

from btr._btr import __version__

__all__ = ["__version__"]
