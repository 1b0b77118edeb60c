"""`python -m specularia`."""

from specularia.cli import entry

entry()
