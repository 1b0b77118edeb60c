"""One side of a BSDF file as the same sample shows it when it is turned over."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from specularia.bsdf.klems import KlemsBasis
from specularia.bsdf.tensor_tree import BRANCH, TensorTree
from specularia.bsdf.xml_model import KlemsPart, Part, TreePart
from specularia.errors import PhysicsError

__all__ = ["flipped_part"]


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
