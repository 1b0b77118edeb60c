"""Reading measured tables: the registry of formats, and what the numbers of a file mean."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from specularia.errors import FormatError, SpeculariaWarning
from specularia.files import existing
from specularia.gonio import named_columns, pab, viavi
from specularia.gonio.beam import Beam, integrate_beam, normalised
from specularia.gonio.integration import integral_shows
from specularia.gonio.raw import Raw
from specularia.gonio.rows import unify_line_ends
from specularia.gonio.table import Table

__all__ = ["FEWEST_POINTS", "READERS", "Reader", "read", "read_beam"]

FEWEST_POINTS = 16
"""A hemisphere with fewer points is left out; a file without a fuller one is refused."""

_HEAD = 4096
"""Bytes of a file that its format is told from."""

_SPARSE = 5000
"""Points below which the user is told how far apart they lie."""


@dataclass(frozen=True)
class Reader:
    """A format: a cheap look at the first bytes, then the parse."""

    name: str
    looks_right: Callable[[bytes], bool]
    parse: Callable[..., list[Raw]]


READERS = (
    Reader("VIAVI", viavi.looks_right, viavi.parse),
    Reader("named columns", named_columns.looks_right, named_columns.parse),
    Reader("pab-opto", pab.looks_right, pab.parse),
)
"""Readers in the order in which they are asked."""


def read(
    path: str | Path,
    *,
    quantity: str | None = None,
    side: str | None = None,
    wavelength_nm: float | None = None,
    band: str | None = None,
    beam: Beam | None = None,
) -> list[Table]:
    """Read a measured table: one record per incident direction and hemisphere that the file covers.

    Parameters
    ----------
    path : a pab-opto table, its raw ("mountain") export, a VIAVI text file, or a CSV table with named
        columns.
    quantity : "DSF" or "BSDF", against what the file says; needed where it says neither.
    side : "transmission" or "reflection", against the rule that theta_s < 90 is the side the light came from.
        Of a file that covers both hemispheres, the one named is kept.
    wavelength_nm : of the light it was measured in; without it the file's word holds, else "Visible".
    band : of a table with columns X, Y and Z, the one to take: "CIE-X", "CIE-Y" (the default) or "CIE-Z".
    beam : the scan of the bare beam (`read_beam`) that the values are signals relative to. They become
        absolute DSF, whatever the file's word for them, and carry the error of the scan as one that all
        values share.

    Returns
    -------
    tables : transmission first. What the reader noticed stands in their `warnings` and is warned of once.

    Raises
    ------
    FormatError : with file, line, what was expected and what was found.
    """
    path = existing(path, what="a measured table")
    raws = _parsed(path, need_quantity=quantity is None and beam is None)
    if beam is not None:
        raws = [normalised(raw, beam) for raw in raws]
    tables = [
        t for raw in raws for t in _tables(raw, quantity=quantity, side=side, wavelength_nm=wavelength_nm)
    ]
    if beam is not None:
        tables = [replace(t, scale_se=beam.relative_se, scale_bound=beam.relative_bound) for t in tables]
    if band is not None:
        tables = [t.in_band(band) for t in tables]
    for text in dict.fromkeys(w for t in tables for w in t.warnings):
        warnings.warn(f"{path.name}: {text}.", SpeculariaWarning, stacklevel=2)
    return tables


def read_beam(path: str | Path) -> Beam:
    """Read a scan of the bare beam, made without a sample, in any format that tables come in.

    Parameters
    ----------
    path : directions around the beam and the signal there, in the unit of the tables to be normalised.

    Returns
    -------
    beam : its power, the integral of the signal over solid angle, with its errors; see `beam.integrate_beam`.

    Raises
    ------
    FormatError : as `read`; or where the scan does not resolve or not contain the beam.
    """
    path = existing(path, what="a scan of the bare beam")
    raws = _parsed(path, need_quantity=False)
    if len(raws) > 1:
        raise FormatError(file=path, expected="a scan of one beam", found=f"{len(raws)} incident directions")
    beam = integrate_beam(raws[0])
    for text in beam.warnings:
        warnings.warn(f"{path.name}: {text}.", SpeculariaWarning, stacklevel=2)
    return beam


def _parsed(path: Path, *, need_quantity: bool) -> list[Raw]:
    if path.is_dir():
        raise FormatError(file=path, expected="a measured table", found="a folder")
    try:
        data = unify_line_ends(path.read_bytes())
    except OSError as error:
        raise FormatError(file=path, expected="a file that can be read", found=str(error.strerror)) from error
    reader = next((r for r in READERS if r.looks_right(data[:_HEAD])), None)
    if reader is None:
        found = repr(data[:40].decode("latin-1").strip()) if data.strip() else "an empty file"
        raise FormatError(
            file=path,
            expected="a measured table: pab-opto (a header of lines '#key value'), VIAVI ('!!BSDF Data') or "
            "CSV (a line of column names, theta_i, phi_i, theta_s, phi_s and a value)",
            found=found,
        )
    return reader.parse(data, file=str(path), need_quantity=need_quantity)


def _tables(raw: Raw, *, quantity: str | None, side: str | None, wavelength_nm: float | None) -> list[Table]:
    band = f"{wavelength_nm:g} nm" if wavelength_nm is not None else (raw.band or "Visible")
    noticed = [*raw.warnings, *([raw.assumed] if raw.assumed and side is None else [])]
    theta, face = raw.theta_s_deg, "front" if raw.theta_i_deg < 90 else "back"
    halves, split_note = _hemispheres(theta, light_on_front=face == "front")
    noticed += split_note
    most = max(int(mask.sum()) for mask in halves.values())
    if most < FEWEST_POINTS:
        raise FormatError(
            file=raw.file, expected=f"{FEWEST_POINTS} points or more in a hemisphere", found=f"{most}"
        )
    if side is not None:
        theta, halves, note = _override(theta, halves, side)
        noticed += note
    elif raw.kind and raw.kind not in halves:
        raise FormatError(
            file=raw.file,
            line=raw.quantity_line,
            expected=f"scattered directions of {raw.kind}, as the label {raw.unit} says",
            found="theta_s on the side of the light" if raw.kind == "transmission" else "theta_s beyond 90",
            advice=f"theta counts from the front normal; if not in this file, say --side {raw.kind}.",
        )
    noticed += _grazing(theta) + _duplicates(theta, raw.phi_s_deg)
    tables = []
    for kind, chosen in sorted(halves.items(), reverse=True):
        here = list(noticed)
        values = raw.values[chosen]
        if np.any(values < 0):
            here.append(f"{int(np.sum(values < 0))} of {values.size} values are negative; they are kept")
        if not values.any():
            here.append("every value is zero: no light was measured, or the column is not that of the signal")
        if values.size < _SPARSE:
            apart = np.degrees(np.sqrt(2 * np.pi / values.size))
            here.append(
                f"a sparse table: {values.size} points, {apart:.2g} degrees apart if spread evenly; "
                "narrower features are lost"
            )
        tables.append(
            Table(
                file=raw.file,
                quantity=quantity or raw.quantity or "DSF",
                side=f"{kind}_{face}",
                theta_i_deg=raw.theta_i_deg,
                phi_i_deg=raw.phi_i_deg,
                theta_s_deg=theta[chosen],
                phi_s_deg=raw.phi_s_deg[chosen],
                values=values,
                up_phi_deg=raw.up_phi_deg,
                band=band,
                name=raw.name,
                synthetic=raw.synthetic,
                quantity_line=raw.quantity_line,
                # The user's word stands against the file's, its integral included.
                stated_integral=raw.stated_integral if quantity is None else None,
                others={k: column[chosen] for k, column in raw.others.items()},
                warnings=tuple(here),
            )
        )
    if quantity is None and raw.quantity is None:
        tables = _as_dsf_if_proved(tables, raw)
    return tables


Mask = NDArray[np.bool_]


def _hemispheres(theta: NDArray[np.float64], *, light_on_front: bool) -> tuple[dict[str, Mask], list[str]]:
    """Which rows are transmission and which reflection; rows at exactly 90 go with the fuller hemisphere."""
    beyond = theta > 90.0
    before = theta < 90.0
    level = ~beyond & ~before
    if level.any():
        if beyond.sum() >= before.sum():
            beyond |= level
        else:
            before |= level
    halves = {
        "transmission": beyond if light_on_front else before,
        "reflection": before if light_on_front else beyond,
    }
    counts = {k: int(m.sum()) for k, m in halves.items()}
    present = {k: m for k, m in halves.items() if m.any()}
    if len(present) < 2:
        return present, []
    note = (
        f"both hemispheres in one table: {counts['transmission']} points transmitted, "
        f"{counts['reflection']} reflected"
    )
    few = min(counts, key=lambda k: counts[k])
    if counts[few] < FEWEST_POINTS:
        del present[few]
        note += f"; {few} is left out, it takes {FEWEST_POINTS} points or more"
    return present, [note]


def _override(
    theta: NDArray[np.float64], halves: dict[str, Mask], side: str
) -> tuple[NDArray[np.float64], dict[str, Mask], list[str]]:
    """The hemisphere that the user names: the one of two, or the only one, mirrored if need be."""
    if side in halves:
        left = {k: m for k, m in halves.items() if k != side}
        notes = [f"{int(m.sum())} points of {k} left out, --side {side}" for k, m in left.items()]
        return theta, {side: halves[side]}, notes
    (mask,) = halves.values()
    return 180.0 - theta, {side: mask}, []


def _grazing(theta: NDArray[np.float64]) -> list[str]:
    level = int(np.sum(theta == 90.0))
    return [f"{level} points at theta_s = 90 carry no weight"] if level else []


def _duplicates(theta: NDArray[np.float64], phi: NDArray[np.float64]) -> list[str]:
    """A note on directions that occur more than once; at a pole, every azimuth is one direction."""
    at_pole = (theta == 0.0) | (theta == 180.0)
    key = np.round(theta * 1e5) * 1e8 + np.where(at_pole, 0.0, np.round(phi * 1e5))
    extra = key.size - np.unique(key).size
    if not extra:
        return []
    pole = int(at_pole.sum())
    where = f", {pole} of them at the pole" if pole > 1 else ""
    return [f"{extra} rows repeat a direction{where}; each direction counts with the mean of its rows"]


def _as_dsf_if_proved(tables: list[Table], raw: Raw) -> list[Table]:
    """Raw signals become DSF where the file's own integral is the one of a DSF; else the user has to say."""
    for table in tables:
        if integral_shows(table) == "DSF":
            note = (
                f"the unit {raw.unit or '(none)'} is neither DSF nor BSDF; taken as DSF, whose integral "
                f"equals the header's front_integral of {raw.stated_integral:g}"
            )
            return [replace(t, warnings=(*t.warnings, note)) for t in tables]
    stated = ""
    if raw.stated_integral is not None:
        stated = f", and a front_integral of {raw.stated_integral:g} that does not prove which it is"
    raise FormatError(
        file=raw.file,
        line=raw.quantity_line,
        expected="DSF, BSDF, BRDF or BTDF",
        found=f"the unit {raw.unit!r}{stated}",
        advice="Say --quantity DSF or BSDF.",
    )
