"""An independent reference for the tracer: numpy, Embree's triangles, Jones vectors in space, a ray epsilon.

It shares nothing with the tracer under test but the definition of the pane. Polarisation is the complex
electric field as a vector in space; unpolarised light is an equal mixture of two fields at right angles.
"""

from __future__ import annotations

import numpy as np

from specularia.glass import Bubbles, Slab

EPSILON_UM = 2e-3

MARGIN_PX = 64
"""Of the mesh beyond a period on each side."""


def smooth_map(
    shape: tuple[int, int], *, seed: int, rms_slope: float, pitch_um: float = 1.5, width_px: float = 4.0
) -> np.ndarray:
    """A periodic random relief [ny, nx] in um with a Gaussian correlation and the given rms slope."""
    rng = np.random.default_rng(seed)
    ky, kx = np.meshgrid(*(2 * np.pi * np.fft.fftfreq(n) for n in shape), indexing="ij")
    f = np.fft.fft2(rng.standard_normal(shape)) * np.exp(-((kx**2 + ky**2) * width_px**2) / 4)
    h = np.real(np.fft.ifft2(f))
    slope = np.sqrt(np.mean((np.roll(h, -1, 0) - h) ** 2 + (np.roll(h, -1, 1) - h) ** 2)) / pitch_um
    return h * (rms_slope / slope)


def meet_interface(d, e, normal, ratio, polarised, rng):
    """Fresnel by chance for rays d [N, 3] with fields e [N, 3]; (crossed, d, e)."""
    return meet_interface_at(d, e, normal, ratio, polarised, rng.random(len(d)))[:3]


def meet_interface_at(d, e, normal, ratio, polarised, xi):
    """The same for given random numbers [N]; also the probability of a reflection."""
    normal = np.where((np.sum(d * normal, 1) > 0)[:, None], -normal, normal)
    c = -np.sum(d * normal, 1)
    s = np.cross(d, normal)
    size = np.linalg.norm(s, axis=1)
    other = np.cross(d, np.where(np.abs(d[:, :1]) < 0.9, [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]))
    s = np.where(size[:, None] > 1e-9, s, other)
    s /= np.linalg.norm(s, axis=1)[:, None]
    cos_t = np.sqrt((1 - ratio**2 * (1 - c**2)).astype(complex))
    rs = (ratio * c - cos_t) / (ratio * c + cos_t)
    rp = (c - ratio * cos_t) / (c + ratio * cos_t)
    es, ep = np.sum(e * s, 1), np.sum(e * np.cross(d, s), 1)
    if not polarised:
        es = ep = np.full(len(d), np.sqrt(0.5), complex)
    share = np.abs(rs * es) ** 2 + np.abs(rp * ep) ** 2
    total = cos_t.real == 0
    crossed = (xi >= share) & ~total
    mirrored = d + 2 * c[:, None] * normal
    refracted = ratio[:, None] * d + (ratio * c - cos_t.real)[:, None] * normal
    new = np.where(crossed[:, None], refracted, mirrored)
    # Power transmitted, with the flux in the beam: 1 - |r|^2 for either field.
    a = np.where(crossed, np.sqrt(1 - np.minimum(np.abs(rs), 1) ** 2), rs) * es
    b = np.where(crossed, np.sqrt(1 - np.minimum(np.abs(rp), 1) ** 2), rp) * ep
    field = a[:, None] * s + b[:, None] * np.cross(new, s)
    return crossed, new, field / np.linalg.norm(field, axis=1)[:, None], np.where(total, 1.0, share)


def incident(theta_deg, phi_deg, count, rng):
    """Directions and fields of unpolarised light that arrives on the front."""
    t, p = np.radians(theta_deg), np.radians(phi_deg)
    d = np.tile([-np.sin(t) * np.cos(p), -np.sin(t) * np.sin(p), -np.cos(t)], (count, 1))
    s = np.array([-np.sin(p), np.cos(p), 0.0])
    e = np.where((rng.random(count) < 0.5)[:, None], s, np.cross(d, s)).astype(complex)
    return d, e


class Relief:
    """A period of a face, and some more on all sides, as an Embree mesh; cells split along 00-11."""

    def __init__(self, heights, pitch_um):
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene

        ny, nx = heights.shape
        self.period = np.array([nx, ny]) * pitch_um
        # More than one period of large maps would only fill the cache.
        my, mx = self.beyond = min(ny, MARGIN_PX), min(nx, MARGIN_PX)
        self.margin = np.array([mx, my]) * pitch_um
        h = np.pad(heights, ((my, my + 1), (mx, mx + 1)), mode="wrap")
        rows, self.columns = ny + 2 * my, nx + 2 * mx
        y, x = np.mgrid[: rows + 1, : self.columns + 1]
        v = np.stack([(x - mx) * pitch_um, (y - my) * pitch_um, h], -1)
        i = np.arange(rows)[:, None] * (self.columns + 1) + np.arange(self.columns)
        a, b, c, d = i, i + 1, i + self.columns + 2, i + self.columns + 1
        faces = np.concatenate(
            [np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)]
        )
        self.cells = rows * self.columns
        self.scene = EmbreeScene()
        TriangleMesh(self.scene, v.reshape(-1, 3)[faces].astype(np.float32))
        # Planes in double precision, of one period: they stay in the cache.
        self.heights, self.pitch = heights, pitch_um
        e = np.pad(heights, ((0, 1), (0, 1)), mode="wrap")
        slopes = [
            (e[:-1, 1:] - e[:-1, :-1], e[1:, 1:] - e[:-1, 1:]),
            (e[1:, 1:] - e[1:, :-1], e[1:, :-1] - e[:-1, :-1]),
        ]
        n = np.array([np.stack([-gx / pitch_um, -gy / pitch_um, np.ones_like(gx)], -1) for gx, gy in slopes])
        self.normals = n / np.linalg.norm(n, axis=-1)[..., None]
        self.low, self.high = h.min(), h.max()

    def meet(self, o, d):
        """(way, normal); way is infinite where the mesh is missed."""
        found = self.scene.run(o.astype(np.float32), d.astype(np.float32), output=1)
        hit = found["primID"] >= 0
        ny, nx = self.heights.shape
        half, cell = np.divmod(np.where(hit, found["primID"], 0), self.cells)
        iy, ix = np.divmod(cell, self.columns) - np.array(self.beyond)[:, None]
        normal = self.normals[half, iy % ny, ix % nx]
        corner = np.stack([ix * self.pitch, iy * self.pitch, self.heights[iy % ny, ix % nx]], -1)
        way = np.sum((corner - o) * normal, 1) / np.where(hit, np.sum(d * normal, 1), 1.0)
        return np.where(hit, way, np.inf), normal


def transmission_of_relief(
    slab: Slab, *, theta_deg, phi_deg=0.0, paths, seed, polarised, faces=None, leaving=None
):
    """tau of a clear pane without bubbles for light on the front, its standard error, and lost paths.

    At its first interface light goes both ways, with weights.
    `faces` are the pane's reliefs where they have been made before. `leaving`, a list, gets the directions
    [K, 3] of transmitted paths and their weights [K].
    """
    rng = np.random.default_rng(seed)
    half = 500.0 * slab.thickness_mm
    faces = faces or reliefs(slab)
    index = slab.medium.index_at(520.0)
    d, e = incident(theta_deg, phi_deg, paths, rng)
    place = np.zeros((paths, 3))
    # Both faces' periods must be met evenly: start over many periods of the front.
    place[:, :2] = rng.random((paths, 2)) * faces[0].period * 4096
    place[:, 2] = half + faces[0].high + 1.0
    face = np.zeros(paths, int)
    glass = np.zeros(paths, bool)
    fresh = np.ones(paths, bool)
    weight = np.ones(paths)
    owner = np.arange(paths)
    active = np.arange(paths)
    score = np.zeros(paths)
    for _ in range(4000):
        if active.size == 0:
            break
        split = []
        t = np.empty(active.size)
        normal = np.empty((active.size, 3))
        for f, relief in enumerate(faces):
            which = face[active] == f
            rays = active[which]
            if rays.size == 0:
                continue
            local = place[rays].copy()
            local[:, :2] %= relief.period
            local[:, 2] -= half if f == 0 else -half
            local += EPSILON_UM * d[rays]
            t[which], normal[which] = relief.meet(local, d[rays])
            # Rays that leave the mesh sideways while still between its bounds are moved by whole periods.
            with np.errstate(divide="ignore"):
                side = np.min(
                    (np.where(d[rays, :2] > 0, relief.period - local[:, :2], local[:, :2]) + relief.margin)
                    / np.maximum(np.abs(d[rays, :2]), 1e-12),
                    axis=1,
                )
                bound = np.where(d[rays, 2] > 0, relief.high + 0.5, relief.low - 0.5)
                out = np.maximum((bound - local[:, 2]) / d[rays, 2], 0.0)
            missed = np.isinf(t[which])
            sideways = missed & (side < out)
            move = np.where(missed, np.where(sideways, 0.9 * side, out), t[which])
            place[rays] += (move + EPSILON_UM)[:, None] * d[rays]
            gone = missed & ~sideways
            # Beyond the shell: out of the pane, or across the glass to the other shell.
            outside = gone & ~glass[rays]
            through = rays[outside & (d[rays, 2] < 0)]
            np.add.at(score, owner[through], weight[through])
            if leaving is not None:
                leaving.append((d[through], weight[through]))
            inside = rays[gone & glass[rays]]
            target = np.where(d[inside, 2] > 0, 0, 1)
            level = np.where(target == 0, half + faces[0].low - 0.5, -half + faces[1].high + 0.5)
            place[inside] += ((level - place[inside, 2]) / d[inside, 2])[:, None] * d[inside]
            face[inside] = target
            hits = rays[~missed]
            first = fresh[hits]
            ratio = np.where(glass[hits], index, 1 / index)
            arriving = d[hits], e[hits], normal[which][~missed], ratio, polarised
            xi = np.where(first, 1.0, rng.random(hits.size))
            crossed, d[hits], e[hits], share = meet_interface_at(*arriving, xi)
            glass[hits] ^= crossed
            face[rays[outside]] = -1
            fresh[hits] = False
            weight[hits[first]] *= 1.0 - share[first]
            # The reflected branch goes on with probability 4 R, if that is less than 1.
            keep = first & (rng.random(hits.size) < 4.0 * share)
            if keep.any():
                _, back, field, _ = meet_interface_at(*(v[keep] for v in arriving[:4]), polarised, 0.0)
                branch = np.maximum(share[keep], 0.25)
                split.append((hits[keep], back, field, branch))
        active = active[face[active] >= 0]
        for rays, back, field, branch in split:
            active = np.append(active, np.arange(len(d), len(d) + len(rays)))
            d, e = np.append(d, back, axis=0), np.append(e, field, axis=0)
            place = np.append(place, place[rays], axis=0)
            face, fresh = np.append(face, face[rays]), np.append(fresh, fresh[rays])
            glass = np.append(glass, ~glass[rays])
            weight, owner = np.append(weight, branch), np.append(owner, owner[rays])
    return score.mean(), score.std() / np.sqrt(paths), active.size / paths


def reliefs(slab: Slab):
    """Embree's meshes of both faces."""
    return [Relief(r.astype(float), p[0]) for r, p in zip(slab.reliefs, slab.pitch_um)]


def transmission_of_bubbles(slab: Slab, bubbles: Bubbles, *, theta_deg, paths, seed, polarised):
    """tau of a clear flat pane with bubbles for light on the front."""
    rng = np.random.default_rng(seed)
    half, index = 0.5 * slab.thickness_mm, slab.medium.index_at(520.0)
    cell = np.asarray(bubbles.cell_mm)
    shifts = np.array([(i, j, 0) for i in (-1, 0, 1) for j in (-1, 0, 1)]) * [*cell, 0]
    centre = (bubbles.centre_mm[None] + shifts[:, None]).reshape(-1, 3)
    a = bubbles.axis[:, :, None] * bubbles.axis[:, None, :]
    matrix = np.eye(3) / bubbles.short_mm[:, None, None]
    matrix = matrix + (1 / bubbles.long_mm - 1 / bubbles.short_mm)[:, None, None] * a
    matrix = np.tile(matrix, (9, 1, 1))
    d, e = incident(theta_deg, 0.0, paths, rng)
    place = np.column_stack([rng.random((paths, 2)) * cell, np.full(paths, half)])
    up = np.tile([0.0, 0.0, 1.0], (paths, 1))
    crossed, d, e = meet_interface(d, e, up, np.full(paths, 1 / index), polarised, rng)
    active = np.flatnonzero(crossed)
    in_air = np.zeros(paths, bool)
    through = 0
    for _ in range(20000):
        if active.size == 0:
            break
        o, v = place[active], d[active]
        with np.errstate(divide="ignore"):
            face = np.where(v[:, 2] > 0, half - o[:, 2], half + o[:, 2]) / np.abs(v[:, 2])
            wall = np.min(np.where(v[:, :2] > 0, cell - o[:, :2], o[:, :2]) / np.abs(v[:, :2]), axis=1)
        best = np.minimum(face, wall)
        normal = np.where((face <= wall)[:, None], [0.0, 0.0, 1.0], 0.0)
        kind = np.where(face <= wall, 0, 1)
        for c, m in zip(centre, matrix):
            p, q = (o - c) @ m, v @ m
            aa, bb, cc = np.sum(q * q, 1), np.sum(p * q, 1), np.sum(p * p, 1) - 1
            root = np.sqrt(np.maximum(bb**2 - aa * cc, 0))
            t = np.where(in_air[active], (-bb + root) / aa, (-bb - root) / aa)
            good = (bb**2 > aa * cc) & (t > 1e-7) & (t < best)
            best = np.where(good, t, best)
            kind = np.where(good, 2, kind)
            n = (p + t[:, None] * q) @ m
            normal = np.where(good[:, None], n / np.linalg.norm(n, axis=1)[:, None], normal)
        place[active] += best[:, None] * v
        step = active[kind == 1]
        place[step, :2] = np.mod(place[step, :2] + 1e-9 * d[step, :2], cell)
        hits = active[kind != 1]
        ratio = np.where(in_air[hits], 1 / index, index)
        crossed, d[hits], e[hits] = meet_interface(d[hits], e[hits], normal[kind != 1], ratio, polarised, rng)
        at_face = kind[kind != 1] == 0
        through += np.sum(crossed & at_face & (d[hits, 2] < 0))
        in_air[hits] ^= crossed & ~at_face
        active = np.setdiff1d(active, hits[crossed & at_face])
    return through / paths
