"""The commands of the README, word for word.

    python .ci/readme.py PATTERN

prints those that a regular expression finds, one a line, and ends with an error where it finds none.
"""

from __future__ import annotations

import re
import sys
import textwrap
from pathlib import Path

README = Path(__file__).resolve().parents[1] / "README.md"


def commands(text: str) -> list[str]:
    """Every line of every shell block, in their order; blocks may be indented."""
    blocks = re.findall(r"^( *)```sh\n(.*?)^\1```", text, re.M | re.S)
    lines = [line for _, block in blocks for line in textwrap.dedent(block).splitlines()]
    return [line for line in lines if line.strip()]


if __name__ == "__main__":
    found = [line for line in commands(README.read_text(encoding="utf-8")) if re.search(sys.argv[1], line)]
    if not found:
        sys.exit(f"README.md has no command like {sys.argv[1]!r}.")
    print("\n".join(found))
