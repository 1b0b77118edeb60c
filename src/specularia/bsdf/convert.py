"""Models in another basis, another resolution or another position.

Every conversion keeps, for each incident bin of the result, the direct-hemispherical value of the model
averaged over that bin.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from specularia import progress
from specularia.bsdf.build_tree import _assemble, bin_edges, build, reduce_cells
from specularia.bsdf.cells import _count, _means, cell_means, is_isotropic
from specularia.bsdf.klems import BASES, KlemsBasis
from specularia.bsdf.model import Array, ScatteringModel
from specularia.bsdf.tensor_tree import BRANCH, TensorTree
from specularia.bsdf.views import AzimuthMean, Flipped, Rotated, other_face
from specularia.bsdf.xml_model import KlemsPart, Part, TreePart, XmlModel
from specularia.bsdf.xml_write import band_in_file, structure_of
from specularia.conventions import SIDES, disk_to_square, square_to_disk
from specularia.errors import PhysicsError, SpeculariaWarning

__all__ = ["KLEMS", "convert", "flipped_part", "klems_part", "matrix_between", "rank_4_part", "tree_at"]

KLEMS = {f"klems-{b.name.split()[-1].lower()}": b for b in BASES}
"""Klems bases by the names that `convert` takes."""

_RADIAL, _ACROSS = 3, 2
"""Incident directions over which a patch is averaged, along theta and along phi."""
_FINE = 4
"""The same for isotropic models, along either, since turning them costs little."""
_CELLS = 128
"""Cells along an edge of the square from which an isotropic distribution is summed into patches."""
_LEAST, _MOST = 6, 24
"""Fewest and most points along an edge of an outgoing patch."""


def convert(
    model: ScatteringModel,
    *,
    basis: str | None = None,
    resolution: int | None = None,
    cull: float | None = None,
    flip: bool = False,
    rotate_deg: float = 0.0,
    isotropic: bool = False,
) -> XmlModel:
    """A model in another basis or position, ready to be written as XML.

    Parameters
    ----------
    model : any scattering model. All bands of a model from XML are converted.
    basis : klems-full, klems-half, klems-quarter, tensor3 or tensor4; None keeps the one that a model from
        XML has, and takes tensor3 for any other model.
    resolution : g of a tree, 2^g cells along an edge; 3 to 9 for tensor3 (6 unless given), 2 to 5 for tensor4
        (4 unless given). None keeps the tree of a model from XML as it is.
    cull : percentage of the cells to remove, tensor3 only; see `build`.
    flip : turn the sample over about its y axis, so that front and back change places. First of the moves.
    rotate_deg : turn it about its normal, counter-clockwise seen from the front.
    isotropic : average it over all azimuths. A tensor3 is isotropic in any case.

    Notes
    -----
    A flip moves numbers and changes none of them, so that two of them are the identity; so is the rotation of
    an isotropic model. Where a geometry block would no longer fit it is left out, with a warning.

    Raises
    ------
    PhysicsError : an unknown basis, or a resolution out of range.
    """
    if basis is not None and basis not in (*KLEMS, "tensor3", "tensor4"):
        raise PhysicsError(f"no basis {basis!r}; there are {', '.join(KLEMS)}, tensor3 and tensor4.")
    settings = {"basis": basis, "resolution": resolution, "cull": cull}
    moves = {"flip": flip, "rotate_deg": rotate_deg, "isotropic": isotropic}
    if not isinstance(model, XmlModel):
        return _convert(model, **settings, **moves)  # type: ignore[arg-type]
    bands = {
        band: _convert(replace(model, parts=parts, band=band, all_bands={}), **settings, **moves)  # type: ignore[arg-type]
        for band, parts in {**model.all_bands, model.band: model.parts}.items()
    }
    geometry = model.geometry
    if geometry and (flip or rotate_deg):
        geometry = ""
        warnings.warn(
            "the geometry block shows the sample as it lay before; it is left out.",
            SpeculariaWarning,
            stacklevel=2,
        )
    return replace(
        bands[model.band],
        bands=tuple(bands),
        all_bands={b: m.parts for b, m in bands.items()},
        geometry=geometry,
    )


def _convert(
    model: ScatteringModel,
    *,
    basis: str | None,
    resolution: int | None,
    cull: float | None,
    flip: bool,
    rotate_deg: float,
    isotropic: bool,
) -> XmlModel:
    origin = {s: Flipped(model).origin(s) for s in Flipped(model).sides}
    if not flip:
        origin = {s: _origin(model, s) for s in model.sides}
    turn = bool(rotate_deg % 360.0) and not (is_isotropic(model) or isotropic)
    average = isotropic and not is_isotropic(model)
    view: ScatteringModel = Flipped(model) if flip else model
    view = Rotated(view, rotate_deg) if turn else view
    own = model.parts if isinstance(model, XmlModel) else {}
    as_it_is = bool(own) and _same(own, basis, resolution) and cull is None and not turn and not average
    parts: dict[str, Part] = {}
    if as_it_is:
        parts = {other_face(s) if flip else s: flipped_part(p) if flip else p for s, p in own.items()}
        origin = {s: o for s, o in origin.items() if s in parts}
    else:
        into = _klems_target(own, basis, resolution, cull)
        if into is not None:
            angles = (np.arange(24) * 15.0).tolist() if average else [rotate_deg if turn else 0.0]
            for side, p in own.items():
                now = flipped_part(p) if flip else p
                assert isinstance(now, KlemsPart)
                parts[other_face(side) if flip else side] = matrix_between(now, into, angles)
            origin = {s: o for s, o in origin.items() if s in parts}
        else:
            parts = _resampled(view, own, basis=basis, resolution=resolution, cull=cull, average=average)
    band = model.band if isinstance(model, XmlModel) else band_in_file(model.band)
    attributes = {k: v for k, v in dict(getattr(model, "attributes", {})).items() if k not in SIDES}
    if band != model.band:
        attributes["measured_band"] = model.band
    attributes |= {s: o for s, o in origin.items() if o != "file"}
    return XmlModel(
        parts=parts, band=band, structure=structure_of(parts), bands=(band,), attributes=attributes
    )


def _origin(model: ScatteringModel, side: str) -> str:
    known = getattr(model, "origin", None)
    return str(known(side)) if callable(known) else "model"


def _same(own: Mapping[str, Part], basis: str | None, resolution: int | None) -> bool:
    """Whether parts stand in this basis and at this resolution already."""
    for p in own.values():
        if isinstance(p, KlemsPart):
            wanted = (p.incident, p.outgoing) if basis is None else (KLEMS.get(basis),) * 2
            same = resolution is None and wanted == (p.incident, p.outgoing)
        elif isinstance(p, TreePart):
            same = basis in (None, f"tensor{p.tree.rank}") and resolution in (None, p.tree.resolution)
        else:
            same = False
        if not same:
            return False
    return True


def _klems_target(
    own: Mapping[str, Part], basis: str | None, resolution: int | None, cull: float | None
) -> KlemsBasis | None:
    """The basis that a model of matrices only goes into; None for any other conversion."""
    matrices = [p for p in own.values() if isinstance(p, KlemsPart)]
    if not matrices or len(matrices) < len(own) or resolution is not None or cull is not None:
        return None
    return matrices[0].incident if basis is None else KLEMS.get(basis)


def _resampled(
    view: ScatteringModel,
    own: Mapping[str, Part],
    *,
    basis: str | None,
    resolution: int | None,
    cull: float | None,
    average: bool,
) -> dict[str, Part]:
    first = next(iter(own.values()), None)
    if basis is None:
        if isinstance(first, KlemsPart) and resolution is None:
            angles: KlemsBasis | None = first.incident
        else:
            angles = None
            basis = f"tensor{first.tree.rank}" if isinstance(first, TreePart) else "tensor3"
    else:
        angles = KLEMS.get(basis)
    if isinstance(first, TreePart) and resolution is None:
        resolution = first.tree.resolution if basis == f"tensor{first.tree.rank}" else None
    if angles is not None and (resolution is not None or cull is not None):
        raise PhysicsError("resolution and cull are for trees; a Klems matrix has its patches.")
    if basis == "tensor3" and not is_isotropic(view) and not average:
        warnings.warn(
            "a tree of rank 3 is isotropic: the sample is averaged over all azimuths (tensor4 keeps them).",
            SpeculariaWarning,
            stacklevel=4,
        )
    if average and basis != "tensor3":
        view = AzimuthMean(view)
    parts: dict[str, Part] = {}
    with progress.task(f"converting to {angles.name if angles else basis}", len(view.sides)) as task:
        for side in view.sides:
            if angles is not None:
                parts[side] = klems_part(view, side, angles)
            elif basis == "tensor3":
                known = view.parts.get(side) if isinstance(view, XmlModel) else None
                if isinstance(known, TreePart) and known.tree.rank == 3:
                    parts[side] = tree_at(known.tree, resolution=resolution or 6, cull=cull)
                else:
                    parts[side] = TreePart(build(view, side, resolution=resolution or 6, cull=cull).tree)
            else:
                parts[side] = rank_4_part(view, side, resolution=resolution or 4)
            task.advance()
    return parts


def flipped_part(part: Part) -> Part:
    """One side of a sample that is turned over about its y axis, as the same side of its other face.

    Both directions are mirrored in x. Cells of a tree and patches of a Klems basis go over into one another,
    so no value changes; only rings with an odd number of patches do not, and are refused.
    """
    if isinstance(part, TreePart):
        # A tree of rank 3 is seen with the light from phi = 0, where the mirror swaps left and right.
        return TreePart(_mirrored(part.tree, (2,) if part.tree.rank == 3 else (0, 2)))
    if not isinstance(part, KlemsPart):
        raise PhysicsError("a side made by reciprocity is converted with its model, not alone.")
    rows, columns = (_mirror_patches(b) for b in (part.outgoing, part.incident))
    return KlemsPart(
        matrix=part.matrix[np.ix_(rows, columns)], incident=part.incident, outgoing=part.outgoing
    )


def _mirror_patches(basis: KlemsBasis) -> NDArray[np.int64]:
    """The patch that each patch becomes when x changes its sign."""
    out = []
    for first, count in zip(basis.first, basis.phi_count):
        if count > 1 and count % 2:
            raise PhysicsError(f"the basis {basis.name} has rings of an odd number of patches; name another.")
        out.append(first + np.mod(count // 2 - np.arange(count), count))
    return np.concatenate(out)


def _mirrored(tree: TensorTree, axes: tuple[int, ...]) -> TensorTree:
    """A tree with some of its coordinates p replaced by 1 - p."""
    width = 1 << tree.rank
    mask = sum(1 << k for k in axes)
    child = tree.child.reshape(-1, width)[:, np.arange(width) ^ mask].ravel()
    values = tree.values.copy()
    for node in np.flatnonzero(tree.log2 != BRANCH):
        edge = 1 << int(tree.log2[node])
        first, last = int(tree.start[node]), int(tree.start[node]) + edge**tree.rank
        values[first:last] = np.flip(tree.values[first:last].reshape((edge,) * tree.rank), axes).ravel()
    return replace(tree, child=child, values=values)


def _patch_points(basis: KlemsBasis, patches: NDArray[np.int64], k: int) -> tuple[Array, Array]:
    """Direction cosines [P, k * k] of k x k parts of equal projected solid angle of some patches."""
    ring = np.searchsorted(basis.first, patches, side="right") - 1
    s2 = np.sin(np.radians(basis.bounds_deg)) ** 2
    step = (np.arange(k) + 0.5) / k
    r = np.sqrt(s2[ring, None] + step * (s2[ring + 1] - s2[ring])[:, None])
    wide = 2 * np.pi / np.asarray(basis.phi_count)[ring]
    phi = ((patches - basis.first[ring])[:, None] - 0.5 + step) * wide[:, None]
    x, y = r[:, :, None] * np.cos(phi)[:, None, :], r[:, :, None] * np.sin(phi)[:, None, :]
    return x.reshape(len(patches), -1), y.reshape(len(patches), -1)


def _incident(basis: KlemsBasis, patch: int, radial: int, across: int) -> tuple[Array, Array, Array]:
    """theta_i, phi_i [K] in degrees over an incident patch, and weights of Gauss's rule along cos(theta)."""
    ring = int(np.searchsorted(basis.first, patch, side="right")) - 1
    count = basis.phi_count[ring]
    high, low = np.cos(np.radians(basis.bounds_deg[ring : ring + 2]))
    g, w = np.polynomial.legendre.leggauss(radial)
    c = 0.5 * (high + low) + 0.5 * (high - low) * g
    across *= 8 // count if count < 8 else 1
    phi = (patch - basis.first[ring] - 0.5 + (np.arange(across) + 0.5) / across) * 360.0 / count
    theta, azimuth = np.meshgrid(np.degrees(np.arccos(c)), phi, indexing="ij")
    weight = np.repeat(w * c, across)
    # A patch of the incident direction is found from (ix, -iy).
    return theta.ravel(), -azimuth.ravel(), weight / weight.sum()


def _patch_tau(model: ScatteringModel, side: str, basis: KlemsBasis) -> Array:
    """Direct-hemispherical value of the model averaged over each incident patch."""
    out = np.empty(basis.patches)
    for ring, (first, count) in enumerate(zip(basis.first, basis.phi_count)):
        s2 = np.sin(np.radians(basis.bounds_deg[ring : ring + 2])) ** 2
        parts = 64 if is_isotropic(model) else 12
        theta = np.degrees(np.arcsin(np.sqrt(s2[0] + (np.arange(parts) + 0.5) / parts * (s2[1] - s2[0]))))
        if is_isotropic(model):
            tau = np.asarray(model.direct_hemispherical(side, theta, 0.0), float)
            out[first : first + count] = np.nanmean(tau) if np.isfinite(tau).any() else np.nan
            continue
        across = max(4, 24 // count)
        for k in range(count):
            phi = -(k - 0.5 + (np.arange(across) + 0.5) / across) * 360.0 / count
            tau = np.asarray(model.direct_hemispherical(side, theta[:, None], phi[None, :]), float)
            out[first + k] = np.nanmean(tau) if np.isfinite(tau).any() else np.nan
    if np.isnan(out).any():
        raise PhysicsError(f"the model has no data for {side.replace('_', ' ')} in some incident patches.")
    return out


def klems_part(model: ScatteringModel, side: str, basis: KlemsBasis) -> KlemsPart:
    """One side of a model as a matrix: the mean of the BSDF over each pair of patches.

    An outgoing patch is averaged over more points where the model's own quadrature is dense. Each column is
    scaled so that it adds up to the model's direct-hemispherical value averaged over the incident patch.
    """
    tau = _patch_tau(model, side, basis)
    matrix = np.zeros((basis.patches, basis.patches))
    for first, count in zip(basis.first, basis.phi_count):
        if is_isotropic(model):
            matrix[:, first : first + count] = _isotropic_columns(model, side, basis, int(first), count)
            continue
        for j in range(first, first + count):
            for theta, phi, weight in zip(*_incident(basis, j, _RADIAL, _ACROSS)):
                matrix[:, j] += weight * _patch_means(model, side, basis, float(theta), float(phi))
    total = basis.solid_angle @ matrix
    scale = np.where(total > 0, tau / np.where(total > 0, total, 1.0), 1.0)
    return KlemsPart(matrix=matrix * scale, incident=basis, outgoing=basis)


def _isotropic_columns(model: ScatteringModel, side: str, basis: KlemsBasis, first: int, count: int) -> Array:
    """Columns of one incident ring: the distribution at phi_i = 0, turned to every azimuth of the ring."""
    # Cells of the square lie in rings; a point anywhere in each keeps whole rings from falling on one side of
    # the edge of a patch.
    rng = np.random.default_rng(first)
    k = np.arange(_CELLS)
    out = np.zeros((basis.patches, count))
    theta_i, phi_i, weight = _incident(basis, first, _FINE, _FINE)
    for theta in np.unique(theta_i):
        jitter = rng.uniform(size=(2, _CELLS, _CELLS))
        a, b = (k[:, None] + jitter[0]) / _CELLS, (k[None, :] + jitter[1]) / _CELLS
        x, y = (v.ravel() for v in square_to_disk(a, b))
        light = cell_means(model, side, theta_i_deg=float(theta), n=_CELLS).ravel() * (np.pi / _CELLS**2)
        for phi, w in zip(phi_i[theta_i == theta], weight[theta_i == theta]):
            for j in range(count):
                turn = np.radians(phi - 360.0 * j / count)
                c, d = np.cos(turn), np.sin(turn)
                row = basis.index(-(x * c - y * d), x * d + y * c)
                out[:, j] += w * np.bincount(row, light, basis.patches)
    return out / basis.solid_angle[:, None]


def _overlap(new: KlemsBasis, old: KlemsBasis, angle_deg: float) -> Array:
    """[new, old] share of each new patch that lies in each old one, turned by an angle before."""
    x, y = _patch_points(new, np.arange(new.patches), _MOST)
    c, d = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))
    number = old.index(x * c + y * d, y * c - x * d) + old.patches * np.arange(new.patches)[:, None]
    share = np.bincount(number.ravel(), minlength=new.patches * old.patches)
    return share.reshape(new.patches, old.patches) / _MOST**2


def matrix_between(part: KlemsPart, basis: KlemsBasis, angles_deg: Sequence[float] = (0.0,)) -> KlemsPart:
    """A matrix on other patches, turned about the normal and averaged over some angles.

    Every new value is the mean of the old ones over the pair of new patches. Columns are scaled so that the
    light of the old incident patches is kept.
    """
    old = np.maximum(part.matrix, 0.0)
    sums = part.outgoing.solid_angle @ old
    matrix, tau = np.zeros((basis.patches, basis.patches)), np.zeros(basis.patches)
    for angle in angles_deg:
        # Both patches are found with x or y reversed, so that the turn runs the other way in them.
        into = _overlap(basis, part.incident, -angle)
        matrix += _overlap(basis, part.outgoing, -angle) @ old @ into.T / len(angles_deg)
        tau += into @ sums / len(angles_deg)
    total = basis.solid_angle @ matrix
    scale = np.where(total > 0, tau / np.where(total > 0, total, 1.0), 1.0)
    return KlemsPart(matrix=matrix * scale, incident=basis, outgoing=basis)


def _patch_means(model: ScatteringModel, side: str, basis: KlemsBasis, theta: float, phi: float) -> Array:
    q = model.quadrature(side, theta, phi)
    number = np.bincount(basis.index(-q.ux, q.uy), minlength=basis.patches)
    points = np.clip(np.ceil(2 * np.sqrt(number) / _LEAST) * _LEAST, _LEAST, _MOST).astype(int)
    out = np.empty(basis.patches)
    for k in np.unique(points):
        patches = np.flatnonzero(points == k)
        x, y = _patch_points(basis, patches, int(k))
        out[patches] = np.nan_to_num(model.evaluate(side, theta, phi, -x, y)).mean(axis=1)
    return out


def tree_at(tree: TensorTree, *, resolution: int, cull: float | None = None) -> TreePart:
    """A tree of rank 3 at another resolution: means of its cells, or its cells divided."""
    if not 3 <= resolution <= 9:
        raise PhysicsError(f"a tree's resolution must lie between 3 and 9, not {resolution}.")
    n = 1 << tree.resolution
    t, a = (np.arange(n // 2) + 0.5) / n, (np.arange(n) + 0.5) / n
    position = np.stack([v.ravel() for v in np.meshgrid(t, a, a, indexing="ij")], axis=-1)
    cells = np.maximum(tree.lookup(position), 0.0).reshape(n // 2, n, n)
    if resolution < tree.resolution:
        f = 1 << (tree.resolution - resolution)
        weight = -np.diff(bin_edges(tree.resolution) ** 2).reshape(-1, f, 1, 1)
        blocks = cells.reshape(n // 2, n // f, f, n // f, f).mean(axis=(2, 4)).reshape(-1, f, n // f, n // f)
        cells = (blocks * weight).sum(axis=1) / weight.sum(axis=1)
    for axis in range(3):
        cells = cells.repeat(1 << max(resolution - tree.resolution, 0), axis)
    cells = cells.astype(np.float32)
    tau = cells.sum(axis=(1, 2), dtype=float) * np.pi / cells.shape[1] ** 2
    return TreePart(_assemble(*reduce_cells(cells, tau, cull=cull)))


def rank_4_part(model: ScatteringModel, side: str, *, resolution: int) -> TreePart:
    """One side of a model as a tree of rank 4 with cells of one size.

    Each incident cell stands for the mean over 2 x 2 directions in it, and its outgoing cells add up to the
    model's direct-hemispherical value averaged over 4 x 4 directions.

    Parameters
    ----------
    model, side : what is converted.
    resolution : g, 2 to 5: 2^g cells along each of the four edges.
    """
    if not 2 <= resolution <= 5:
        raise PhysicsError(f"a tree of rank 4 is made at resolutions 2 to 5, not {resolution}.")
    n = 1 << resolution
    cells = np.zeros((n, n, n, n), np.float32)
    for i in range(n):
        for j in range(n):
            tau = np.nanmean(model.direct_hemispherical(side, *_cell_directions(i, j, n, 4)))
            total = np.zeros((n, n))
            for theta, phi in zip(*_cell_directions(i, j, n, 2)):
                total += _square_means(model, side, float(theta), float(phi), n)
            sum_ = total.sum() * np.pi / n**2
            cells[i, j] = total * (tau / sum_ if sum_ > 0 else 1.0)
    return TreePart(
        TensorTree(
            rank=4,
            log2=np.array([resolution], np.int8),
            start=np.zeros(1, np.int64),
            child=np.zeros(0, np.int32),
            values=cells.ravel(),
        )
    )


def _cell_directions(i: int, j: int, n: int, k: int) -> tuple[Array, Array]:
    """theta_i, phi_i [k * k] in degrees within one incident cell of a tree of rank 4."""
    step = (np.arange(k) + 0.5) / k
    a, b = np.meshgrid((i + step) / n, (j + step) / n, indexing="ij")
    x, y = square_to_disk(a.ravel(), b.ravel())
    return np.degrees(np.arcsin(np.minimum(np.hypot(x, y), 1.0))), np.degrees(np.arctan2(-y, x))


def _square_means(model: ScatteringModel, side: str, theta: float, phi: float, n: int) -> Array:
    """Means over the outgoing cells of a tree of rank 4, which counts x the other way."""
    q = model.quadrature(side, theta, phi)
    own = _count(*disk_to_square(-q.ux, q.uy), n)
    return np.nan_to_num(_means(lambda x, y: model.evaluate(side, theta, phi, -x, y), square_to_disk, own))
