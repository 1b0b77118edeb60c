"""Colour of tensor trees as Radiance reads it: chromaticity u', v' beside Visible.

Of matrices Radiance takes the bands CIE-X, Visible and CIE-Z; of trees it takes Visible, CIE-u and CIE-v
(src/common/bsdf_t.c), where the latter two hold in each cell not a BSDF but

    u' = 4 X / (X + 15 Y + 3 Z),   v' = 9 Y / (X + 15 Y + 3 Z)   (CIE 1976).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from specularia.bsdf.model import Array
from specularia.bsdf.tensor_tree import BRANCH, TensorTree
from specularia.bsdf.xml_model import Part, TreePart

__all__ = ["XYZ", "chroma_bands", "chroma_trees"]

XYZ = ("CIE-X", "Visible", "CIE-Z")

_POINTS = {3: 4, 4: 2}
"""Points along each edge of a leaf of Visible at which the two other trees are looked up, by rank."""
_AT_ONCE = 1 << 16


def chroma_bands(bands: Mapping[str, Mapping[str, Part]]) -> dict[str, dict[str, Part]]:
    """The bands CIE-u and CIE-v of trees in X, Y and Z; none without these, and none of matrices."""
    if not set(XYZ) <= set(bands):
        return {}
    out: dict[str, dict[str, Part]] = {"CIE-u": {}, "CIE-v": {}}
    for side in bands["Visible"]:
        parts = [bands[b].get(side) for b in XYZ]
        trees = [part.tree for part in parts if isinstance(part, TreePart)]
        if len(trees) < len(XYZ):
            return {}
        for name, tree in zip(out, chroma_trees(*trees)):
            out[name][side] = TreePart(tree)
    return out


def chroma_trees(x: TensorTree, y: TensorTree, z: TensorTree) -> tuple[TensorTree, TensorTree]:
    """(u', v') on the leaves of Y, from the means of X and Z over each; that of white where no light is.

    Parameters
    ----------
    x, y, z : trees of one rank; BSDF in the three bands, equal for neutral samples.
    """
    corner, size = _leaves(y)
    k = _POINTS[y.rank]
    steps = (np.arange(k) + 0.5) / k
    inside = np.stack(np.meshgrid(*[steps] * y.rank, indexing="ij"), axis=-1).reshape(-1, y.rank)
    means = np.empty((2, size.size))
    for first in range(0, size.size, _AT_ONCE):
        part = slice(first, first + _AT_ONCE)
        points = (corner[part, None] + inside * size[part, None, None]).reshape(-1, y.rank)
        for band, tree in enumerate((x, z)):
            means[band, part] = np.maximum(tree.lookup(points), 0.0).reshape(-1, len(inside)).mean(axis=1)
    mean_x, mean_z = means
    mean_y = np.maximum(y.values.astype(float), 0.0)
    total = mean_x + 15.0 * mean_y + 3.0 * mean_z
    lit = (mean_y > 0) & (total > 0)
    total = np.where(lit, total, 1.0)
    u = np.where(lit, 4.0 * mean_x / total, 4.0 / 19.0)
    v = np.where(lit, 9.0 * mean_y / total, 9.0 / 19.0)
    return replace(y, values=u.astype(np.float32)), replace(y, values=v.astype(np.float32))


def _leaves(tree: TensorTree) -> tuple[Array, Array]:
    """Lower corner [V, rank] and edge [V] of the leaf of each of the tree's values."""
    corners, sizes = np.zeros((tree.values.size, tree.rank)), np.zeros(tree.values.size)
    node: NDArray[np.integer] = np.array([0])
    corner, size = np.zeros((1, tree.rank)), 1.0
    bits = (np.arange(1 << tree.rank)[:, None] >> np.arange(tree.rank)) & 1
    while node.size:
        branch = tree.log2[node] == BRANCH
        for g in np.unique(tree.log2[node[~branch]]):
            here = np.flatnonzero(tree.log2[node] == g)
            n = 1 << int(g)
            cells = np.stack(np.meshgrid(*[np.arange(n)] * tree.rank, indexing="ij"), axis=-1)
            at = tree.start[node[here]][:, None] + np.arange(n**tree.rank)
            corners[at] = corner[here][:, None] + cells.reshape(-1, tree.rank) * (size / n)
            sizes[at] = size / n
        size *= 0.5
        children = tree.child[tree.start[node[branch]][:, None] + np.arange(1 << tree.rank)]
        corner = (corner[branch][:, None] + bits * size).reshape(-1, tree.rank)
        node = children.ravel()
    return corners, sizes
