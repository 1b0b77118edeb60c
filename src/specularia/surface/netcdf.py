"""Height maps as netCDF-4: our own format, for any program that reads netCDF."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from specularia.errors import FormatError
from specularia.files import read_netcdf, write_netcdf
from specularia.surface.heightmap import FLAGS, HeightMap

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["read", "write"]

_LAYERS = {
    "sigma_um": ("um", "standard uncertainty of each height"),
    "image": ("1", "brightness in focus"),
    "reliability": ("1", "share of the focus peak by which it stands above the next one"),
}


def write(
    surface: HeightMap,
    path: str | Path,
    attributes: Mapping[str, str] | None = None,
    *,
    layers: Mapping[str, tuple[tuple[str, ...], np.ndarray, dict[str, str]]] | None = None,
) -> Path:
    """Write a height map as netCDF-4: height_um(y, x), and sigma_um, image, reliability where known.

    Parameters
    ----------
    surface : any height map; its own attributes are stored with it.
    path : ends in .nc.
    attributes : provenance (see `specularia.provenance.record`) to add.
    layers : more variables by name: dimensions, values, attributes.
    """
    import xarray as xr

    path = Path(path)
    variables: dict[str, tuple[tuple[str, ...], Any, Mapping[str, object]]] = {
        "height_um": (("y", "x"), surface.heights_um, {"units": "um", "long_name": "height out of the glass"})
    }
    for key, (units, words) in _LAYERS.items():
        layer = getattr(surface, key)
        if layer is not None:
            variables[key] = (
                ("y", "x"),
                np.asarray(layer, np.float32),
                {"units": units, "long_name": words},
            )
    if surface.flags is not None:
        meaning: dict[str, object] = {
            "long_name": "what is wrong with a pixel",
            "flag_masks": np.array(list(FLAGS.values()), np.uint8),
            "flag_meanings": " ".join(FLAGS),
        }
        variables["flags"] = (("y", "x"), np.asarray(surface.flags, np.uint8), meaning)
    variables.update(layers or {})
    coordinates = {
        "x": ("x", surface.x_um, {"units": "um", "long_name": "along columns"}),
        "y": ("y", surface.y_um, {"units": "um", "long_name": "along rows, row 0 lowest"}),
    }
    dataset = xr.Dataset(variables, coords=coordinates)
    stored = {
        **surface.attributes,
        **(attributes or {}),
        "Conventions": "CF-1.10",
        "content": "specularia height map",
        "name": surface.name,
        "pitch_x_um": repr(float(surface.pitch_x_um)),
        "pitch_y_um": repr(float(surface.pitch_y_um)),
    }
    return write_netcdf(path, {"/": dataset}, {k: _flat(v) for k, v in stored.items()})


def _flat(value: object) -> str:
    return value if isinstance(value, str) else json.dumps(value)


def read(path: str | Path) -> HeightMap:
    """Read a height map that `write` made; a FormatError for any other netCDF file."""
    path = Path(path)
    dataset = read_netcdf(path).get("/")
    if dataset is None or "height_um" not in dataset or dataset["height_um"].dims != ("y", "x"):
        found = "none" if dataset is None else ", ".join(map(str, dataset.data_vars)) or "no variables"
        raise FormatError(
            file=path,
            expected="a variable height_um(y, x)",
            found=found,
            advice="Name a height map of this program or a microscope's own file.",
        )
    attributes = {str(k): str(v) for k, v in dataset.attrs.items()}
    layers = {k: dataset[k].values.astype(np.float64) for k in _LAYERS if k in dataset}
    name = attributes.pop("name", "") or path.stem
    pitch_x = attributes.pop("pitch_x_um", None)
    pitch_y = attributes.pop("pitch_y_um", None)
    heights = dataset["height_um"].values.astype(np.float64)
    return HeightMap(
        heights_um=heights,
        pitch_x_um=float(pitch_x) if pitch_x else _spacing(dataset, "x", path),
        pitch_y_um=float(pitch_y) if pitch_y else _spacing(dataset, "y", path),
        name=name,
        attributes=attributes,
        flags=dataset["flags"].values.astype(np.uint8) if "flags" in dataset else None,
        **layers,
    )


def _spacing(dataset: xr.Dataset, axis: str, path: Path) -> float:
    """The pitch from a coordinate, which must be evenly spaced."""
    if dataset.sizes[axis] == 1:
        return float("nan")
    if axis not in dataset.coords:
        raise FormatError(file=path, expected=f"a coordinate {axis} in um", found="none")
    values = dataset[axis].values.astype(float)
    steps = np.diff(values)
    pitch = float(steps.mean())
    if not pitch > 0 or np.ptp(steps) > 1e-3 * pitch:
        raise FormatError(
            file=path, expected=f"{axis} rising in even steps", found=f"steps {steps.min()} to {steps.max()}"
        )
    return pitch
