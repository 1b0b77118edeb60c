"""Random outgoing directions drawn from a scattering model."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from specularia.bsdf.cells import cell_means, cell_points, is_isotropic, refined_means
from specularia.bsdf.model import Array, ScatteringModel
from specularia.conventions import disk_to_square, square_to_disk
from specularia.errors import CoverageError

__all__ = ["Sample", "sample"]


@dataclass(frozen=True)
class Sample:
    """Directions drawn from a distribution.

    Attributes
    ----------
    ux, uy : [K] outgoing direction cosines.
    weight : [K] BSDF over the density (per projected solid angle) that they were drawn with. Its mean is the
        direct-hemispherical value without bias, and each weight lies near it.
    """

    ux: Array
    uy: Array
    weight: Array


def sample(
    model: ScatteringModel,
    side: str,
    *,
    theta_i_deg: float,
    phi_i_deg: float = 0.0,
    count: int,
    rng: np.random.Generator,
    cells: int | None = None,
) -> Sample:
    """Draw outgoing directions by inverse transform over cells of equal projected solid angle.

    A cell is drawn with its share of the light, a point in it evenly; where the distribution varies within a
    cell the weight makes up for it.

    Parameters
    ----------
    model, side : what to draw from.
    theta_i_deg, phi_i_deg : incident direction.
    count : K, directions to draw.
    rng : the generator; the same state gives the same directions.
    cells : along an edge of the square; None takes the resolution of a tree, and otherwise 128.

    Raises
    ------
    CoverageError : the model has no data for this direction, or sends no light to this side.
    """
    n = cells or max(128, 1 << (getattr(model, "resolution", None) or 0))
    turn = phi_i_deg if is_isotropic(model) else 0.0
    if is_isotropic(model):
        mean = cell_means(model, side, theta_i_deg=theta_i_deg, phi_i_deg=phi_i_deg, n=n).ravel()
    else:
        # In the sample's own frame, where the cells of a tree of rank 4 are whole cells here.
        q = model.quadrature(side, theta_i_deg, phi_i_deg)
        own = cell_points(*disk_to_square(q.ux, q.uy), n)
        mean = refined_means(
            lambda x, y: model.evaluate(side, theta_i_deg, phi_i_deg, x, y), square_to_disk, own
        )
        mean = np.maximum(np.nan_to_num(mean), 0.0).ravel()
    total = mean.sum()
    if not total > 0:
        raise CoverageError(
            f"nothing to draw from: {side.replace('_', ' ')} at theta_i = {theta_i_deg} degrees has no light."
        )
    upper = np.cumsum(mean) / total
    cell = np.minimum(np.searchsorted(upper, rng.random(count), side="right"), n * n - 1)
    x, y = square_to_disk((cell // n + rng.random(count)) / n, (cell % n + rng.random(count)) / n)
    c, d = np.cos(np.radians(turn)), np.sin(np.radians(turn))
    ux, uy = x * c - y * d, x * d + y * c
    density = mean[cell] / (total * np.pi / n**2)
    return Sample(ux=ux, uy=uy, weight=model.evaluate(side, theta_i_deg, phi_i_deg, ux, uy) / density)
