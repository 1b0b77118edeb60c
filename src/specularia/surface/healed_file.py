"""Healed maps as netCDF-4: the map of `surface.write` with masks and the ensemble beside it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from specularia.errors import FormatError
from specularia.files import read_netcdf
from specularia.surface import netcdf
from specularia.surface.healing import Healed

__all__ = ["read_members", "write_healed"]


def write_healed(healed: Healed, path: str | Path, attributes: Mapping[str, str] | None = None) -> Path:
    """Write a healed map as netCDF-4.

    Beside `height_um(y, x)` and `sigma_um(y, x)` there are `pitted(y, x)` (1 where nothing of the original
    surface is left), `no_evidence(y, x)` (1 where the plateaux say too little of the height) and, with an
    ensemble, `member_um(member, y, x)`, each a possible original surface.
    """
    grid = ("y", "x")
    layers: dict[str, tuple[tuple[str, ...], NDArray[np.generic], dict[str, str]]] = {
        "pitted": (grid, healed.pits.astype(np.int8), {"long_name": "1 where the original surface is gone"})
    }
    if healed.no_evidence.size:
        meaning = "1 where what is left says less than half of the variance of the height"
        layers["no_evidence"] = (grid, healed.no_evidence.astype(np.int8), {"long_name": meaning})
    if len(healed.members):
        meaning = "possible original surfaces"
        layers["member_um"] = (("member", *grid), healed.members, {"units": "um", "long_name": meaning})
    return netcdf.write(healed.surface, path, attributes, layers=layers)


def read_members(path: str | Path) -> NDArray[np.float32]:
    """[N, rows, columns] members in a file of `write_healed`; a FormatError where there are none."""
    dataset = read_netcdf(path).get("/")
    if dataset is None or "member_um" not in dataset:
        raise FormatError(
            file=Path(path),
            expected="a healed map with an ensemble, member_um(member, y, x)",
            found="a file without one",
            advice="Make it by `specularia surface heal MAP -o MAP.nc --ensemble N`.",
        )
    return np.asarray(dataset["member_um"].values, np.float32)
