"""What a surface file holds, in the words of the command line."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass
from pathlib import Path

from specularia.errors import PhysicsError, SpeculariaWarning
from specularia.surface.heightmap import HeightMap
from specularia.surface.readers import read
from specularia.surface.roughness import Roughness, roughness

__all__ = ["Description", "describe"]


@dataclass(frozen=True)
class Description:
    """A map, its roughness and what its reader warned of."""

    surface: HeightMap
    roughness: Roughness
    warnings: tuple[str, ...]

    def payload(self) -> dict[str, object]:
        """The keys of `surface info --json`; what does not exist (y of a profile) is None."""
        m = self.surface
        field_x, field_y = m.field_um
        numbers = {
            "pitch_x_um": m.pitch_x_um,
            "pitch_y_um": m.pitch_y_um,
            "field_x_um": field_x,
            "field_y_um": field_y,
            "range_um": m.range_um,
        }
        return {
            "format": m.attributes.get("format", ""),
            "shape": list(m.shape),
            **{k: None if math.isnan(v) else v for k, v in numbers.items()},
            "missing": m.missing,
            "Sa_um": self.roughness.Sa_um,
            "Sq_um": self.roughness.Sq_um,
            "Sdq": None if math.isnan(self.roughness.Sdq) else self.roughness.Sdq,
            "warnings": list(self.warnings),
        }


def describe(
    path: str | Path, *, pitch_um: float | tuple[float, float] | None = None, unit: str | None = None
) -> Description:
    """Read a map and say what it is; its warnings are kept in the record and issued as well."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        surface = read(path, pitch_um=pitch_um, unit=unit)
    texts = [str(w.message) for w in caught if issubclass(w.category, SpeculariaWarning)]
    try:
        rough = roughness(surface)
    except PhysicsError as error:
        rough = Roughness(math.nan, math.nan, math.nan)
        texts.append(str(error))
    if "synthetic" in surface.attributes:
        texts.append(f"{surface.name} is synthetic: made by a computer program, not measured.")
    for text in texts:
        warnings.warn(text, SpeculariaWarning, stacklevel=2)
    return Description(surface, rough, tuple(texts))
