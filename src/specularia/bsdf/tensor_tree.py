"""Tensor trees: BSDFs on cells of varying size, as Radiance and WINDOW files hold them.

A tree of rank 3 is isotropic. Its first coordinate is the incident direction, 0.5 - 0.5 sin(theta_i), so that
only the lower half is used; the other two are the outgoing direction on the Shirley-Chiu square, seen with
the undeflected direction at azimuth 0. A tree of rank 4 has the incident direction on a square as well. The
tree itself knows only positions in the unit cube; `specularia.bsdf.xml_model` maps directions to them.

Branches list their children with the first coordinate as the lowest bit; grids of values are in C order with
the first coordinate slowest (both as in Radiance, src/common/bsdf_t.c).
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from specularia.bsdf._query_kernel import tree_positions
from specularia.bsdf.model import Array

__all__ = ["BRANCH", "TensorTree", "TreeSyntaxError"]

BRANCH = -1
_TOKEN = re.compile(r"[{}]|[^{}]+")
_DEEPEST = 12
"""No tree is deeper than this; a file that claims to be is not a tree."""


class TreeSyntaxError(ValueError):
    """Text that is no tree; `line` counts from 1 within the text."""

    def __init__(self, expected: str, found: str, line: int) -> None:
        super().__init__(f"expected {expected}, found {found}")
        self.expected, self.found, self.line = expected, found, line


@dataclass(frozen=True)
class TensorTree:
    """A tree as flat arrays, so that many positions are looked up at once.

    Attributes
    ----------
    rank : 3 or 4.
    log2 : [nodes] BRANCH, or g of a grid of 2^g values along each coordinate. Node 0 is the root.
    start : [nodes] where the node's entries begin in `child` (branches) or `values` (grids).
    child : node numbers, 2^rank for each branch.
    values : BSDF in 1/sr, 2^(rank g) for each grid.
    """

    rank: int
    log2: NDArray[np.int8]
    start: NDArray[np.int64]
    child: NDArray[np.int32]
    values: NDArray[np.float32]

    @cached_property
    def resolution(self) -> int:
        """log2 of the number of smallest leaves along an edge of the unit cube."""
        deepest, nodes, depth = 0, np.array([0]), 0
        while nodes.size:
            branches = self.log2[nodes] == BRANCH
            grids = nodes[~branches]
            if grids.size:
                deepest = max(deepest, depth + int(self.log2[grids].max()))
            nodes = self._children(nodes[branches]).ravel()
            depth += 1
        return deepest

    @property
    def arrays(
        self,
    ) -> tuple[int, NDArray[np.int8], NDArray[np.int64], NDArray[np.int32], NDArray[np.float32]]:
        """Rank, log2, start, child and values, as the compiled look-up takes them."""
        return self.rank, self.log2, self.start, self.child, self.values

    @property
    def negative(self) -> int:
        """How many values are below zero (readers of such files take them as zero)."""
        return int(np.count_nonzero(self.values < 0))

    def _children(self, nodes: NDArray[np.integer]) -> NDArray[np.int32]:
        return self.child[self.start[nodes][:, None] + np.arange(1 << self.rank)]

    def locate(self, position: Array) -> tuple[NDArray[np.float32], Array, Array]:
        """Leaves that hold the positions.

        Parameters
        ----------
        position : [K, rank], each coordinate in [0, 1); values outside are moved to the nearest cell.

        Returns
        -------
        value [K] in 1/sr, lower corner [K, rank] and edge length [K] of the leaf.
        """
        below_one = np.nextafter(1.0, 0.0)
        p = np.clip(np.asarray(position, float), 0.0, below_one)
        node = np.zeros(len(p), np.int64)
        corner, size = np.zeros_like(p), np.ones(len(p))
        weight = 1 << np.arange(self.rank)
        active = np.flatnonzero(self.log2[node] == BRANCH)
        while active.size:
            upper = p[active] >= 0.5
            node[active] = self.child[self.start[node[active]] + upper @ weight]
            size[active] *= 0.5
            corner[active] += upper * size[active, None]
            p[active] = 2.0 * p[active] - upper
            active = active[self.log2[node[active]] == BRANCH]
        edge = 1 << self.log2[node].astype(np.int64)
        index = np.minimum((p * edge[:, None]).astype(np.int64), edge[:, None] - 1)
        flat = index[:, 0]
        for k in range(1, self.rank):
            flat = flat * edge + index[:, k]
        size /= edge
        return self.values[self.start[node] + flat], corner + index * size[:, None], size

    def lookup(self, position: Array) -> NDArray[np.float32]:
        """Values [K] at positions [K, rank]."""
        return np.asarray(tree_positions(*self.arrays, np.atleast_2d(np.asarray(position, float))))

    def outgoing(self, incident: Array) -> tuple[Array, Array, Array, Array]:
        """All leaves of the outgoing square for one incident position.

        Parameters
        ----------
        incident : [rank - 2] position of the incident direction.

        Returns
        -------
        (a, b, size, value) : lower corners, edge and value of the leaves; size^2 adds up to 1.
        """
        return self._leaves(incident, tuple(range(self.rank - 2)))

    def incoming(self, outgoing: Array) -> tuple[Array, Array, Array, Array]:
        """All leaves of the incident square of a tree of rank 4 for one outgoing position [2]."""
        return self._leaves(outgoing, (2, 3))

    def _leaves(self, position: Array, fixed: tuple[int, ...]) -> tuple[Array, Array, Array, Array]:
        """Leaves that the coordinates `fixed` lead to, as squares of the two others."""
        p = np.clip(np.asarray(position, float), 0.0, np.nextafter(1.0, 0.0))
        u_bit, v_bit = (k for k in range(self.rank) if k not in fixed)
        node, a, b, size = np.array([0]), np.zeros(1), np.zeros(1), 1.0
        parts: list[tuple[Array, Array, Array, Array]] = []
        while node.size:
            branch = self.log2[node] == BRANCH
            for g in np.unique(self.log2[node[~branch]]):
                k = np.flatnonzero(self.log2[node] == g)
                parts.append(self._grid_leaves(node[k], int(g), p, fixed, a[k], b[k], size))
            node, a, b = node[branch], a[branch], b[branch]
            if not node.size:
                break
            upper = p >= 0.5
            p = 2.0 * p - upper
            size *= 0.5
            low = int(upper @ (1 << np.array(fixed)))
            quarter = [(low | (u << u_bit) | (v << v_bit), u, v) for u in (0, 1) for v in (0, 1)]
            kids = self._children(node)
            node = np.concatenate([kids[:, c] for c, _, _ in quarter])
            a, b = (
                np.concatenate([a + u * size for _, u, _ in quarter]),
                np.concatenate([b + v * size for _, _, v in quarter]),
            )
        aa, bb, ss, vv = (np.concatenate(x) for x in zip(*parts))
        return aa, bb, ss, vv

    def _grid_leaves(
        self,
        nodes: NDArray[np.integer],
        g: int,
        p: Array,
        fixed: tuple[int, ...],
        a: Array,
        b: Array,
        size: float,
    ) -> tuple[Array, Array, Array, Array]:
        """The leaves of grids of one size, whose lower corners are (a, b)."""
        n = 1 << g
        stride = [n ** (self.rank - 1 - k) for k in range(self.rank)]
        at = sum(int(i) * stride[k] for i, k in zip(np.minimum((p * n).astype(int), n - 1), fixed))
        u, v = (k for k in range(self.rank) if k not in fixed)
        i, j = (x.ravel() for x in np.meshgrid(np.arange(n), np.arange(n), indexing="ij"))
        where = self.start[nodes][:, None] + (at + i * stride[u] + j * stride[v])[None, :]
        edge = size / n
        corners = (a[:, None] + i * edge).ravel(), (b[:, None] + j * edge).ravel()
        return *corners, np.full(where.size, edge), self.values[where.ravel()].astype(float)

    @classmethod
    def from_text(cls, text: str, rank: int) -> TensorTree:
        """Read the braces-and-numbers text of a ScatteringData element.

        Raises
        ------
        TreeSyntaxError : unbalanced braces, a wrong number of children or values, a word that is no number.
        """
        log2: list[int] = []
        start: list[int] = []
        children: list[list[int]] = []
        runs: list[str] = []
        run_node: list[int] = []
        open_nodes: list[int] = []
        position = 0

        def fault(expected: str, found: str) -> TreeSyntaxError:
            return TreeSyntaxError(expected, found, text.count("\n", 0, position) + 1)

        for match in _TOKEN.finditer(text):
            token, position = match.group(), match.start()
            if token == "{":
                if not open_nodes and log2:
                    raise fault("one tree", "a second one")
                if len(open_nodes) >= _DEEPEST:
                    raise fault(f"a tree of at most {_DEEPEST} levels", "a deeper one")
                if open_nodes:
                    children[open_nodes[-1]].append(len(log2))
                open_nodes.append(len(log2))
                log2.append(BRANCH)
                start.append(0)
                children.append([])
            elif token == "}":
                if not open_nodes:
                    raise fault("a '{' before each '}'", "a '}' too many")
                node = open_nodes.pop()
                if children[node]:
                    if run_node and run_node[-1] == node:
                        raise fault("children or values within a pair of braces", "both")
                    if len(children[node]) != 1 << rank:
                        raise fault(f"{1 << rank} children of a branch", str(len(children[node])))
                elif not run_node or run_node[-1] != node:
                    raise fault("values or children within a pair of braces", "nothing")
            elif token.strip(" \t\r\n,"):
                if not open_nodes:
                    raise fault("numbers within braces", repr(token.strip()[:20]))
                if children[open_nodes[-1]] or (run_node and run_node[-1] == open_nodes[-1]):
                    raise fault("children or values within a pair of braces", "both")
                runs.append(token)
                run_node.append(open_nodes[-1])
        position = len(text)
        if open_nodes or not log2:
            raise fault("a complete tree", "one that ends too early" if log2 else "no tree")

        words = [r.replace(",", " ").split() for r in runs]
        counts = [len(w) for w in words]
        try:
            values = np.array([x for w in words for x in w], dtype=np.float64).astype(np.float32)
        except ValueError as error:
            raise fault("numbers", str(error).rsplit(":", 1)[-1].strip()) from error
        if not np.all(np.isfinite(values)):
            raise fault("finite numbers", "nan or infinity")
        offsets = np.concatenate([[0], np.cumsum(counts)])
        sizes = {1 << (rank * g): g for g in range(_DEEPEST + 1)}
        for node, count, offset in zip(run_node, counts, offsets):
            if count not in sizes:
                raise fault(f"1, {1 << rank}, {1 << 2 * rank} ... values in a leaf", str(count))
            log2[node], start[node] = sizes[count], int(offset)
        flat: list[int] = []
        for node, kids in enumerate(children):
            if kids:
                start[node] = len(flat)
                flat.extend(kids)
        return cls(
            rank=rank,
            log2=np.array(log2, np.int8),
            start=np.array(start, np.int64),
            child=np.array(flat, np.int32),
            values=values,
        )

    def to_text(self) -> str:
        """The text that `from_text` reads, with seven significant digits."""
        seven = "{:.7g}".format
        lines: list[str] = []
        width = 1 << self.rank
        stack: list[tuple[int, int]] = [(0, 0)]
        while stack:
            node, depth = stack.pop()
            if node < 0:
                lines.append(" " * depth + "}")
                continue
            first = int(self.start[node])
            if self.log2[node] != BRANCH:
                last = first + (1 << (self.rank * int(self.log2[node])))
                words = list(map(seven, self.values[first:last].tolist()))
                rows = [" ".join(words[k : k + 16]) for k in range(0, len(words), 16)]
                lines.append(" " * depth + "{ " + ("\n" + " " * (depth + 2)).join(rows) + " }")
                continue
            lines.append(" " * depth + "{")
            stack.append((-1, depth))
            stack.extend((int(k), depth + 1) for k in self.child[first : first + width][::-1])
        return "\n".join(lines)
