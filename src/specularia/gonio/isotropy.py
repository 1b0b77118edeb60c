"""Whether a sample may be turned about its normal, or mirrored: tables of several azimuths compared."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations_with_replacement, groupby

import numpy as np

from specularia.conventions import square_to_disk
from specularia.gonio.integration import Summary
from specularia.gonio.table import Array
from specularia.gonio.tabulating import HALF_WIDTH, Image, Tabulated, tabulated

__all__ = ["SAME_ANGLE", "Isotropy", "Ring", "isotropy", "rings"]

SAME_ANGLE = 0.02
"""Angles of incidence closer than this, in degrees, are one."""

_BLOCKS, _SUB = 64, 4
"""Cells along a side on which tables are compared, and samples along a side of each."""

_ALIKE = 0.03
"""L1 distance over tau, noise subtracted, up to which tables count as the same."""

_TAU_ALIKE = 0.01
"""Spread of tau over azimuth up to which it counts as the same; three standard errors if that is more."""

_WIDEST_GAP = 100.0
"""Degrees between neighbouring azimuths up to which a model between them makes sense."""


@dataclass(frozen=True)
class Ring:
    """Tables of one incident angle at several azimuths.

    Attributes
    ----------
    theta_deg : the angle.
    phi_deg : azimuths in the frame of `conventions`.
    tau, tau_se : integrals and their noise.
    l1 : integral of |table - mean of the ring| over projected solid angle, in the frames turned so that the
        light comes from phi_i = 0, over tau: mean over the azimuths, noise subtracted in quadrature.
    l1_raw, l1_noise : the same with noise, and that of noise alone.
    """

    theta_deg: float
    phi_deg: tuple[float, ...]
    tau: tuple[float, ...]
    tau_se: tuple[float, ...]
    l1: float
    l1_raw: float
    l1_noise: float

    @property
    def tau_spread(self) -> float:
        """Standard deviation of tau over azimuth, over its mean."""
        return float(np.std(self.tau) / np.mean(self.tau))

    @property
    def tau_error(self) -> float:
        """What noise alone lets tau scatter by, over its mean."""
        return float(np.sqrt(np.mean(np.square(self.tau_se))) / np.mean(self.tau))

    @property
    def alike(self) -> bool:
        """Whether the tables may be taken for those of an isotropic sample."""
        return self.l1 <= _ALIKE and self.tau_spread <= max(_TAU_ALIKE, 3.0 * self.tau_error)


@dataclass(frozen=True)
class Isotropy:
    """What the azimuths of a set of tables say about the sample's symmetry.

    Attributes
    ----------
    rings : incident angles with two azimuths or more.
    mirror_deg : azimuth of the plane that comes nearest to a mirror; None where no pair of tables tells.
    mirror_l1 : L1 distance over tau between tables and their images in it, noise subtracted; NaN for none.
    evidence : the symmetry that fits: "isotropic", "bilateral" or "none".
    symmetry : the one to model with: that of the evidence, if there are azimuths enough for it.
    sentence : the same in words.
    """

    rings: tuple[Ring, ...]
    mirror_deg: float | None
    mirror_l1: float
    evidence: str
    symmetry: str
    sentence: str


def rings(summaries: Sequence[Summary]) -> list[list[Summary]]:
    """Tables by incident angle, ascending, those of one angle by azimuth."""
    ordered = sorted(summaries, key=lambda s: (round(s.table.polar_deg / SAME_ANGLE), s.table.azimuth_deg))
    return [list(g) for _, g in groupby(ordered, key=lambda s: round(s.table.polar_deg / SAME_ANGLE))]


def isotropy(summaries: Sequence[Summary]) -> Isotropy | None:
    """Compare the tables of one side over azimuth; None where no incident angle has two azimuths.

    Tables are compared on cells of 1/64 of the hemisphere's square and, around the undeflected direction, of
    0.005 in direction cosines. They count as the same within 3 % of the light (L1, noise subtracted) and 1 %
    of tau, or three standard errors. Else the best mirror plane among those half-way between measured
    azimuths is tried in the same way. An anisotropic model needs azimuths no further apart than 100 degrees,
    those in the mirror counted.
    """
    several = [
        r for r in rings(summaries) if r[0].table.polar_deg > SAME_ANGLE and _gap(_azimuths(r)) < 359.0
    ]
    if not several:
        return None
    normal = [s for s in summaries if s.table.polar_deg <= SAME_ANGLE]
    views = _Views()
    found = tuple(_ring(r, views) for r in several)
    if all(r.alike for r in found):
        return Isotropy(found, None, float("nan"), "isotropic", "isotropic", _sentence(found, "isotropic"))
    planes = _planes(several, normal, views)
    mirrors = [p for p in planes if p[1] <= _ALIKE]
    evidence = "bilateral" if mirrors else "none"
    plane: float | None = None
    l1 = float("nan")
    if mirrors:
        # Of several mirror planes the one that the azimuths say most with.
        plane, l1 = min(mirrors, key=lambda p: (_widest(several, p[0]), p[1]))
    elif planes:
        plane, l1 = min(planes, key=lambda p: p[1])
    gap = _widest(several, plane if mirrors else None)
    symmetry = evidence if gap <= _WIDEST_GAP else "isotropic"
    return Isotropy(found, plane, l1, evidence, symmetry, _sentence(found, evidence, plane, l1, gap))


def _azimuths(ring: Sequence[Summary]) -> Array:
    return np.array([s.table.azimuth_deg for s in ring])


def _widest(several: Sequence[Sequence[Summary]], plane: float | None) -> float:
    """Widest gap between azimuths of any ring, images in a mirror plane counted."""
    gaps = []
    for ring in several:
        phi = _azimuths(ring)
        gaps.append(_gap(phi if plane is None else np.concatenate([phi, 2.0 * plane - phi])))
    return max(gaps)


def _gap(phi: Array) -> float:
    """Widest gap between neighbouring azimuths, degrees."""
    turned = np.sort(np.mod(phi, 360.0))
    return float(np.diff(np.append(turned, turned[0] + 360.0)).max())


class _Views:
    """Coarse tables of distributions, made when they are first asked for."""

    def __init__(self) -> None:
        self._made: dict[tuple[int, Image], Tabulated] = {}

    def of(self, summary: Summary, image: Image) -> Tabulated:
        key = id(summary), image
        if key not in self._made:
            self._made[key] = tabulated(
                summary.distribution,
                theta_deg=summary.table.polar_deg,
                images=[image],
                cells=_BLOCKS,
                sub=_SUB,
            )
        return self._made[key]


def _distance(
    one: Tabulated, two: Tabulated, theta_deg: float, dependent: float = 0.0
) -> tuple[float, float]:
    """Integral of |one - two| over projected solid angle, and what their noise alone makes of it.

    `dependent` is the share of the variance that the two have in common.
    """
    n = one.base.shape[0]
    k = (np.arange(n) + 0.5) / n
    edge = 2.0 * HALF_WIDTH / n
    s = np.sin(np.radians(theta_deg))
    x, y = square_to_disk(*np.meshgrid(k, k, indexing="ij"))
    base_weight = np.where(np.maximum(np.abs(x + s), np.abs(y)) > HALF_WIDTH, np.pi / n**2, 0.0)
    x, y = np.meshgrid(edge * n * k - HALF_WIDTH - s, edge * n * k - HALF_WIDTH, indexing="ij")
    patch_weight = np.where(x * x + y * y < 1.0, edge**2, 0.0)
    off, noise = 0.0, 0.0
    for weight, name in ((base_weight, "base"), (patch_weight, "patch")):
        off += float(np.sum(weight * np.abs(getattr(one, name) - getattr(two, name))))
        variance = getattr(one, f"{name}_variance") + getattr(two, f"{name}_variance")
        # The mean of |x| for normal x.
        noise += float(np.sum(weight * np.sqrt((1.0 - dependent) * 2.0 / np.pi * variance)))
    return off, noise


def _without(off: float, noise: float) -> float:
    return float(np.sqrt(max(off**2 - noise**2, 0.0)))


def _ring(ring: Sequence[Summary], views: _Views) -> Ring:
    theta = ring[0].table.polar_deg
    tables = [views.of(s, Image()) for s in ring]
    mean = Tabulated.mean(tables)
    tau = np.array([s.tau for s in ring])
    # A table is 1/K of the mean: var(t - mean) = (1 - 1/K) var t, while var t + var mean = (1 + 1/K) var t.
    share = 2.0 / (len(ring) + 1.0)
    pairs = np.array([_distance(t, mean, theta, share) for t in tables]) / tau.mean()
    off, noise = pairs.mean(axis=0)
    return Ring(
        theta_deg=theta,
        phi_deg=tuple(s.table.azimuth_deg for s in ring),
        tau=tuple(s.tau for s in ring),
        tau_se=tuple(s.tau_se for s in ring),
        l1=_without(off, noise),
        l1_raw=float(off),
        l1_noise=float(noise),
    )


def _planes(
    several: Sequence[Sequence[Summary]], normal: Sequence[Summary], views: _Views
) -> list[tuple[float, float]]:
    """Azimuths of planes that may be mirrors, and the distance of tables from their images in each."""
    halves = {
        round((0.5 * (a.table.azimuth_deg + b.table.azimuth_deg)) % 180.0, 3) % 180.0
        for r in several
        for a, b in combinations_with_replacement(r, 2)
    }
    # Half-way between two azimuths lie two planes, at right angles.
    found = []
    for plane in sorted(halves | {(h + 90.0) % 180.0 for h in halves}):
        distances = [d for r in several for d in _images_apart(r, plane, views)]
        if not distances:
            continue
        for s in normal:
            # At normal incidence the frame turned to phi_i shows the plane at plane - phi_i.
            image = Image(mirrored=True, turn_deg=2.0 * (plane - s.table.azimuth_deg))
            off, noise = _distance(views.of(s, Image()), views.of(s, image), s.table.polar_deg)
            distances.append(_without(off, noise) / s.tau)
        found.append((plane, float(np.mean(distances))))
    return found


def _images_apart(ring: Sequence[Summary], plane: float, views: _Views) -> list[float]:
    """Distances between the ring's tables and those at mirrored azimuths, seen in the mirror."""
    out = []
    for a in ring:
        for b in ring:
            off = (2.0 * plane - a.table.azimuth_deg - b.table.azimuth_deg + 180.0) % 360.0 - 180.0
            if abs(off) <= SAME_ANGLE:
                pair = _distance(views.of(a, Image()), views.of(b, Image(mirrored=True)), a.table.polar_deg)
                out.append(_without(*pair) / (0.5 * (a.tau + b.tau)))
    return out


_VERDICT: Mapping[str, str] = {
    "isotropic": "they agree with an isotropic sample",
    "bilateral": "the sample is not isotropic, but has a mirror plane",
    "none": "the sample is not isotropic",
}


def _sentence(
    found: Sequence[Ring], evidence: str, plane: float | None = None, l1: float = 0.0, gap: float = 0.0
) -> str:
    worst = max(found, key=lambda r: r.l1)
    loose = max(found, key=lambda r: r.tau_spread)
    text = (
        f"tables at {len(worst.phi_deg)} azimuths differ by up to {100 * worst.l1:.1f} % of the light "
        f"(theta_i = {worst.theta_deg:g}; noise, {100 * worst.l1_noise:.1f} %, subtracted), their tau by "
        f"{100 * loose.tau_spread:.2f} % (at {loose.theta_deg:g}; noise {100 * loose.tau_error:.2f} %): "
        + _VERDICT[evidence]
    )
    if evidence != "isotropic" and plane is not None:
        text += f" (images in the plane at {plane:g} degrees differ by {100 * l1:.1f} %)"
    if gap > _WIDEST_GAP:
        text += (
            f". Azimuths {gap:.0f} degrees apart are too few for an anisotropic model, so they are averaged, "
            "which loses that difference"
        )
    return text
