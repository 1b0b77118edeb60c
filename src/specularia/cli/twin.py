"""`specularia twin`."""

from __future__ import annotations


def twin() -> None:
    """To be described."""
