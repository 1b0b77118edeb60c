"""specularia: window glass from the instrument to the light in the room."""

from __future__ import annotations

__version__ = "0.1.0"
