"""What a reader hands over before it is settled what the numbers mean: columns and header as in the file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from specularia.errors import FormatError
from specularia.gonio.table import Array

__all__ = ["Raw", "check_angles"]


@dataclass(frozen=True)
class Raw:
    """One file, parsed.

    Attributes
    ----------
    file : path.
    theta_i_deg, phi_i_deg, up_phi_deg : as in the file.
    theta_s_deg, phi_s_deg : [N] in the frame of `conventions`.
    values : [N].
    others : further columns of the same quantity by their band, [N] each: CIE-X and CIE-Z beside a Y.
    lines : [N] line of each row in the file.
    quantity : "BSDF", "DSF", or None for a unit that is neither.
    unit : the word that the file has for its quantity; quantity_line : where it stands.
    kind : "transmission" or "reflection" where the file's label tells (BTDF, BRDF), else "".
    assumed : what was assumed of the side where nothing in the format tells it; for users who do not say it.
    band : what the file says of the light, or "".
    name : of the sample; synthetic : True if the file says so.
    stated_integral : the file's own integral, or None.
    warnings : what the parser noticed.
    """

    file: str
    theta_i_deg: float
    phi_i_deg: float
    up_phi_deg: float
    theta_s_deg: Array
    phi_s_deg: Array
    values: Array
    lines: NDArray[np.int64]
    quantity: str | None
    unit: str
    quantity_line: int | None
    kind: str = ""
    assumed: str = ""
    band: str = ""
    name: str = ""
    synthetic: bool = False
    stated_integral: float | None = None
    others: Mapping[str, Array] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()


def check_angles(
    theta_deg: Array,
    phi_deg: Array,
    lines: NDArray[np.int64],
    *,
    file: str,
    theta_max_deg: float,
    names: tuple[str, str] = ("theta_s", "phi_s"),
    stated: bool = False,
) -> None:
    """Refuse directions that cannot be degrees, with the line of the first one.

    A table whose every theta fits into pi and every phi into 2 pi is taken for radians unless its unit is
    stated: in degrees its points would crowd in a sector of six degrees around the normal.
    """
    for name, angle, low, high in (
        (names[0], theta_deg, 0.0, theta_max_deg),
        (names[1], phi_deg, -360.0, 360.0),
    ):
        wrong = np.flatnonzero((angle < low) | (angle > high))
        if wrong.size:
            raise FormatError(
                file=file,
                line=int(lines[wrong[0]]),
                expected=f"{name} within {low:g} to {high:g} degrees",
                found=f"{angle[wrong[0]]:g} ({wrong.size} such rows)",
            )
    if stated:
        return
    if theta_deg.max() <= np.pi + 1e-3 and np.abs(phi_deg).max() <= 2 * np.pi + 1e-3:
        raise FormatError(
            file=file,
            line=int(lines[0]),
            expected="angles in degrees",
            found=f"no {names[0]} above {theta_deg.max():.4g} and no {names[1]} above "
            f"{np.abs(phi_deg).max():.4g}, as in radians",
            advice="Convert the angles to degrees.",
        )
