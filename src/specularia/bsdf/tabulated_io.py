"""Tabulated models as netCDF-4 files: one group per side, provenance on the root."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from specularia.bsdf.side_table import SideTable
from specularia.bsdf.tabulated import TabulatedModel
from specularia.conventions import SIDES
from specularia.errors import FormatError, PhysicsError
from specularia.files import read_netcdf, write_netcdf

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["read_model", "write_model"]

_NAME = "specularia scattering model"
_VERSION = 3
"""1: isotropic tables only, no errors of the patch. 2: azimuths of incidence, symmetry, errors of both. 3:
several bands, those beside the model's own in groups "side (band)". Models of one band are written as 2."""


def write_model(model: TabulatedModel, path: str | Path) -> Path:
    """Write a model as netCDF-4: one group per side and band, provenance on the root."""
    import xarray as xr

    groups: dict[str, xr.Dataset] = {}
    named = dict(model.tables)
    for band, tables in model.more.items():
        named |= {f"{side} ({band})": t for side, t in tables.items()}
    for side, t in named.items():
        node = "theta_i" if t.phi_i_deg is None else "node"
        where = {"base": (node, "a", "b"), "patch": (node, "x", "y")}
        variables: dict[str, Any] = {
            "tau": ((node,), np.asarray(t.tau, float), {"units": "1"}),
            "tau_se": ((node,), np.asarray(t.tau_se, float), {"units": "1"}),
        }
        for name in ("base", "patch", "base_se", "patch_se"):
            values = getattr(t, name)
            if values is not None:
                variables[f"bsdf_{name}"] = (where[name.removesuffix("_se")], values, {"units": "1/sr"})
        coordinates: dict[str, Any] = {
            "theta_i": (node, np.asarray(t.theta_i_deg, float), {"units": "degree"})
        }
        attributes: dict[str, Any] = {
            "origin": t.origin,
            "half_width": float(t.half_width),
            "blend": t.blend,
            "symmetry": t.symmetry,
        }
        if t.phi_i_deg is not None:
            coordinates["phi_i"] = (node, np.asarray(t.phi_i_deg, float), {"units": "degree"})
            attributes["mirror_deg"] = float(t.mirror_deg)
        groups[side] = xr.Dataset(variables, coords=coordinates, attrs=attributes)
    version = _VERSION if model.more else 2
    root = {"format": f"{_NAME} {version}", "band": model.band, **model.attributes}
    return write_netcdf(path, groups, root)


def read_model(path: str | Path) -> TabulatedModel:
    """Read a model written by `write_model`, of this version or an earlier one.

    Raises
    ------
    FormatError : another file, a broken one, or one of a later version.
    """
    groups = read_netcdf(path)
    attributes = {str(k): str(v) for k, v in groups["/"].attrs.items()}
    _check_version(path, attributes.pop("format", ""))
    band = attributes.pop("band", "Visible")
    try:
        tables = {side: _table(g) for side, g in groups.items() if side in SIDES}
        more: dict[str, dict[str, SideTable]] = {}
        for name, group in groups.items():
            side, _, of_band = name.partition(" (")
            if side in SIDES and of_band:
                more.setdefault(of_band.removesuffix(")"), {})[side] = _table(group)
        return TabulatedModel(tables=tables, band=band, attributes=attributes, more=more)
    except (KeyError, PhysicsError) as error:
        raise FormatError(
            file=path, expected="the tables of a scattering model", found=f"none or broken ones ({error})"
        ) from error


def _check_version(path: str | Path, stated: str) -> None:
    name, _, number = stated.rpartition(" ")
    if name != _NAME or not number.isdigit():
        raise FormatError(
            file=path,
            expected=f"a scattering model (attribute format = '{_NAME} {_VERSION}')",
            found="another netCDF file",
            advice="Models are written by `gonio fit` and `glass trace`.",
        )
    if not 1 <= int(number) <= _VERSION:
        raise FormatError(
            file=path,
            expected=f"a scattering model of version 1 to {_VERSION}",
            found=f"version {number}",
            advice="It was written by a later specularia: update, or make the model again.",
        )


def _table(group: xr.Dataset) -> SideTable:
    values = {name: group[name].values for name in map(str, group.variables)}
    return SideTable(
        theta_i_deg=values["theta_i"].astype(float),
        base=values["bsdf_base"],
        patch=values["bsdf_patch"],
        half_width=float(group.attrs["half_width"]),
        tau=values["tau"].astype(float),
        tau_se=values["tau_se"].astype(float),
        origin=str(group.attrs["origin"]),
        base_se=values.get("bsdf_base_se"),
        blend=str(group.attrs["blend"]),
        phi_i_deg=values["phi_i"].astype(float) if "phi_i" in values else None,
        symmetry=str(group.attrs.get("symmetry", "isotropic")),
        mirror_deg=float(group.attrs.get("mirror_deg", 0.0)),
        patch_se=values.get("bsdf_patch_se"),
    )
