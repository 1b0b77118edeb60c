"""The tracer's innermost loop: one path of light through a pane between two periodic reliefs.

Symbols as in docs/theory/slab.md. Lengths are micrometres, directions unit vectors in the sample's frame
(z out of the front). A path is always in one of three places: in the *shell* of a face (the layer between the
highest and the lowest point of its relief), in the *bulk* glass between the two shells, or in a *bubble*.
Shells are walked through a hierarchy of bounds (`hierarchy.py`); the bulk is crossed in closed form. No
distance is ever nudged by a small constant: a ray that starts on a triangle or on a bubble's wall leaves that
one out by name or by sign, so no path slips through a surface. What is said of bubbles holds for inclusions
too: they differ in what is inside.

All functions take and return plain numbers and arrays, keep no state and use nothing that a GPU lacks. They
share one file because the compiler's cache looks for changes in the file of the outermost one alone.
"""
# Compiled functions carry no annotations: their types follow from the call.
# mypy: disallow-untyped-defs=False, disallow-untyped-calls=False

from __future__ import annotations

import math

import numba as nb
import numpy as np

from specularia.glass.hierarchy import LEVELS, STEP

__all__ = [
    "ABSORBED", "BACK", "FRONT", "LOST", "SIDES", "meet_interface", "meet_relief", "micro_facet",
    "trace_kernel", "uniform",
]  # fmt: skip

NO_SIDES, ABSORBING, CLEAR, REFLECTING = 0, 1, 2, 3
"""Sides of a finite patch; a pane that goes on for ever has none."""

FRONT, BACK, ABSORBED, LOST, SIDES = 0, 1, 2, 3, 4
"""Where a path ended: out of the front, out of the back, in the glass, given up and counted, or out of
the sides of a finite patch."""

MAX_EVENTS = 1_000_000
"""Interfaces met before a path counts as lost. Light that total reflection traps meets a few hundred."""

MAX_PERIODS = 100_000
"""Periods crossed within one shell before a path counts as lost: a ray level with a perfectly smooth face."""

MIN_WEIGHT = 1e-13
"""A path in glass whose weight falls below this has nothing left: what remains is counted as absorbed."""

# Results may differ in the last bit from strict IEEE order. No step makes an infinity or a NaN: 1e300 stands
# for "never".
FAST = {"contract", "nsz", "arcp", "reassoc", "nnan", "ninf"}

_GOLDEN = np.uint64(0x9E3779B97F4A7C15)
_MIX_1 = np.uint64(0xBF58476D1CE4E5B9)
_MIX_2 = np.uint64(0x94D049BB133111EB)
# Fractions of the square roots of 2, 3, 5 and 7, times 2^64: multiples of them modulo 1 fill a cube of four
# dimensions evenly (Richtmyer 1951, LA-1342).
_ROOT_2 = np.uint64(0x6A09E667F3BCC908)
_ROOT_3 = np.uint64(0xBB67AE8584CAA73B)
_ROOT_5 = np.uint64(0x3C6EF372FE94F82B)
_ROOT_7 = np.uint64(0xA54FF53A5F1D36F1)
_TO_UNIT = 1.0 / 9007199254740992.0


@nb.njit(inline="always")
def _mix(z):
    """Scatter the bits of a 64-bit counter (the finaliser of SplitMix64, doi:10.1145/2660193.2660195)."""
    z = (z ^ (z >> np.uint64(30))) * _MIX_1
    z = (z ^ (z >> np.uint64(27))) * _MIX_2
    return z ^ (z >> np.uint64(31))


@nb.njit(inline="always")
def _unit(bits):
    """53 of 64 bits as a number in [0, 1)."""
    return float(bits >> np.uint64(11)) * _TO_UNIT


@nb.njit(inline="always")
def uniform(key, draw):
    """Number `draw` (0, 1, ...) of the stream `key`: uniform in [0, 1), and a function of its arguments."""
    return _unit(_mix(key + np.uint64(draw + 1) * _GOLDEN))


@nb.njit(inline="always")
def _even(number, step, shift):
    """Coordinate of point `number` of the lattice that `step` spans, shifted as a whole by chance."""
    return _unit(number * step + _mix(shift + step))


@nb.njit(inline="always")
def _chance(number, shift, key, met):
    """Random number that decides at interface `met` of a path: even over all paths at the first three."""
    if met > 2:
        return uniform(key, met)
    return _even(number, _ROOT_3 if met == 0 else (_ROOT_5 if met == 1 else _ROOT_7), shift)


# Both this and meet_interface are called from one place of the loop, which gains 2 % by taking them in.
@nb.njit(fastmath=FAST, error_model="numpy", forceinline=True)
def meet_relief(relief, bounds, layout, quanta, face, below, top, clear, x, y, z, dx, dy, dz, ix, iy, tri):
    """Nearest crossing of a ray with one face's relief.

    Each cell between four samples is cut into two planes along its diagonal 00-11; plane 0 has the larger x.
    The walk goes from cell to cell of some level of the hierarchy, down where the ray dips below the bound of
    a cell, and up again where it leaves the parent of a cell. Bounds are compared in their quanta.

    Parameters
    ----------
    relief, bounds, layout, quanta : the heights and bounds of both faces, see `hierarchy.pack`.
    face : FRONT or BACK.
    below : 0 if the ray runs above the surface, 1 if below; then everything is mirrored in z.
    top : highest point of the (mirrored) relief: beyond it the shell ends.
    clear : sine of the elevation of the steepest slope of this face; light that leaves the surface more
        steeply cannot meet it again.
    x, y, z : start; x and y in pixels within the period, z in um from the mean plane.
    dx, dy, dz : direction, in pixels and um per um of way.
    ix, iy, tri : the plane on which the ray starts, which it cannot meet again; tri = -1 where there is none.

    Returns
    -------
    t : way in um; -1 where the ray leaves the shell away from the surface, -2 where it is given up.
    ix, iy, tri : the plane that was met.
    gx, gy : its slopes in um per pixel.
    x, y : the start again, moved by whole periods so that start + t * direction lies in cell (ix, iy).
    """
    nx = layout[face, 1]
    ny = layout[face, 2]
    levels = layout[face, 3]
    row = nx + 1
    mirror = 1.0 - 2.0 * below
    z *= mirror
    dz *= mirror
    # Way after which a rising ray is above all relief.
    t_end = 1e300
    if dz > 0.0:
        t_end = (top - z) / dz
        if t_end <= 0.0 or dz > clear:
            return -1.0, ix, iy, tri, 0.0, 0.0, x, y
    if dx == 0.0:
        dx = 1e-30
    if dy == 0.0:
        dy = 1e-30
    per_dx = 1.0 / dx
    per_dy = 1.0 / dy
    east = 1 if dx > 0.0 else 0
    north = 1 if dy > 0.0 else 0
    t = 0.0
    level = 0
    if tri < 0:
        ix = min(int(x), nx - 1)
        iy = min(int(y), ny - 1)
        level = min(2 * STEP, levels)
    periods = 0
    bound_of = 4 + below * LEVELS
    per_um = quanta[face, below, 0]
    lowest = quanta[face, below, 1]
    while True:
        edge_x = min(((ix >> level) + east) << level, nx)
        edge_y = min(((iy >> level) + north) << level, ny)
        t_x = (edge_x - x) * per_dx
        t_y = (edge_y - y) * per_dy
        # Rounding may put the exit before the entry by an ulp; the way never runs backwards.
        t_out = t_x if t_x < t_y else t_y
        if t_out < t:
            t_out = t
        z_low = z + dz * (t_out if dz < 0.0 else t)
        if level > 0:
            width = (nx + (1 << level) - 1) >> level
            at = layout[face, bound_of + level] + (iy >> level) * width + (ix >> level)
            if per_um * z_low - lowest <= bounds[np.uint64(at)]:
                level -= STEP
                continue
        else:
            # Unsigned, since a signed index would be tested for counting from the end.
            at = layout[face, 0] + iy * row + ix
            h00 = mirror * relief[np.uint64(at)]
            h10 = mirror * relief[np.uint64(at + 1)]
            h01 = mirror * relief[np.uint64(at + row)]
            h11 = mirror * relief[np.uint64(at + row + 1)]
            if z_low <= max(max(h00, h10), max(h01, h11)):
                # The ray in the cell: u along x, v along y; it changes from one plane to the other at t_d.
                u = x - ix
                v = y - iy
                w = dx - dy
                t_d = (v - u) / w if w != 0.0 else 1e300
                split = t < t_d < t_out
                t_in = t
                t_far = t_d if split else t_out
                plane = 0 if (u - v) + w * 0.5 * (t_in + t_far) >= 0.0 else 1
                last = False
                while True:
                    if plane == 0:
                        gx = h10 - h00
                        gy = h11 - h10
                    else:
                        gx = h11 - h01
                        gy = h01 - h00
                    if plane != tri:
                        # Height of the ray over the plane, c0 + c1 t, negative at the end: it crossed.
                        c0 = z - h00 - gx * u - gy * v
                        c1 = dz - gx * dx - gy * dy
                        if c0 + c1 * t_far < 0.0:
                            t_hit = -c0 / c1 if c1 != 0.0 else t_in
                            # Below the plane already on entry: it crossed at the seam of two planes.
                            t_hit = min(max(t_hit, t_in), t_far)
                            return t_hit, ix, iy, plane, mirror * gx, mirror * gy, x, y
                    if last or not split:
                        break
                    last = True
                    t_in = t_far
                    t_far = t_out
                    plane = 1 - plane
        # On to the next cell of this level.
        tri = -1
        t = t_out
        if t > t_end:
            return -1.0, ix, iy, -1, 0.0, 0.0, x, y
        parent = level + STEP
        if t_x < t_y:
            # The other coordinate may have been rounded over the side of the block that the ray is still in.
            # It is not negative in earnest, so that cutting off its fraction rounds it down.
            jx = edge_x - 1 + east
            low = (iy >> level) << level
            iy = max(low, min(min(low + (1 << level), ny) - 1, int(y + dy * t)))
            up = (jx >> parent) != (ix >> parent)
            if jx == nx or jx < 0:
                # Out of the period on one side is into it on the other; the start moves along.
                jump = nx - 2 * nx * east
                jx += jump
                x += jump
                up = True
                periods += 1
            ix = jx
        else:
            jy = edge_y - 1 + north
            low = (ix >> level) << level
            ix = max(low, min(min(low + (1 << level), nx) - 1, int(x + dx * t)))
            up = (jy >> parent) != (iy >> parent)
            if jy == ny or jy < 0:
                jump = ny - 2 * ny * north
                jy += jump
                y += jump
                up = True
                periods += 1
            iy = jy
        if up and parent <= levels:
            level = parent
        if periods > MAX_PERIODS:
            return -2.0, ix, iy, -1, 0.0, 0.0, x, y


@nb.njit(inline="always")
def _to_sphere(m, x, y, z):
    """M (x, y, z); M = xx, yy, zz, xy, xz, yz is symmetric, so it also takes normals of the sphere back."""
    return m[0] * x + m[3] * y + m[4] * z, m[3] * x + m[1] * y + m[5] * z, m[4] * x + m[5] * y + m[2] * z


@nb.njit(inline="always")
def _matrix(bubbles, k):
    """M of bubble k of a list, as `_to_sphere` takes it."""
    return bubbles[k, 3], bubbles[k, 4], bubbles[k, 5], bubbles[k, 6], bubbles[k, 7], bubbles[k, 8]


@nb.njit(fastmath=FAST, error_model="numpy")
def _meet_listed(bubbles, first, member, grid, x, y, z, dx, dy, dz, t_max):
    """Nearest bubble of a list that a ray in the glass enters within the way t_max.

    `bubbles` [N, 11]: centre, then xx, yy, zz, xy, xz, yz of the symmetric matrix M that takes the bubble to
    the unit sphere, and what is inside (see `_path`). The cells of a plane grid list the bubbles over them:
    cell c holds member[first[c]:first[c+1]]; grid = cells along x and y, and their sizes.

    Returns the way (t_max: none), the bubble (-1: none) and its centre's x and y.
    """
    nx = int(grid[0])
    ny = int(grid[1])
    size_x = grid[2]
    size_y = grid[3]
    jx = int(math.floor(x / size_x))
    jy = int(math.floor(y / size_y))
    east = dx > 0.0
    north = dy > 0.0
    step_x = size_x / abs(dx) if dx != 0.0 else 1e300
    step_y = size_y / abs(dy) if dy != 0.0 else 1e300
    t_x = ((jx + 1 if east else jx) * size_x - x) / dx if dx != 0.0 else 1e300
    t_y = ((jy + 1 if north else jy) * size_y - y) / dy if dy != 0.0 else 1e300
    best = t_max
    found = -1
    found_x = 0.0
    found_y = 0.0
    t = 0.0
    cells = 0
    while t <= best and cells < MAX_EVENTS:
        cx = jx % nx
        cy = jy % ny
        c = cy * nx + cx
        for j in range(first[c], first[c + 1]):
            k = member[j]
            # Of all periodic images of the bubble, the one nearest to this cell.
            bx = bubbles[k, 0]
            by = bubbles[k, 1]
            bx += math.floor(((jx + 0.5) * size_x - bx) / (nx * size_x) + 0.5) * (nx * size_x)
            by += math.floor(((jy + 0.5) * size_y - by) / (ny * size_y) + 0.5) * (ny * size_y)
            m = _matrix(bubbles, k)
            px, py, pz = _to_sphere(m, x - bx, y - by, z - bubbles[k, 2])
            qx, qy, qz = _to_sphere(m, dx, dy, dz)
            # |p + t q| = 1; only entering (p.q < 0), from outside (|p| > 1).
            b = px * qx + py * qy + pz * qz
            if b < 0.0:
                a = qx * qx + qy * qy + qz * qz
                out = px * px + py * py + pz * pz - 1.0
                d = b * b - a * out
                if d > 0.0 and out > 0.0:
                    t_hit = out / (math.sqrt(d) - b)
                    if t_hit < best:
                        best = t_hit
                        found = k
                        found_x = bx
                        found_y = by
        if t_x < t_y:
            t = t_x
            t_x += step_x
            jx += 1 if east else -1
        else:
            t = t_y
            t_y += step_y
            jy += 1 if north else -1
        cells += 1
    return best, found, found_x, found_y


@nb.njit(fastmath=FAST, error_model="numpy")
def _meet_drawn(kinds, sizes, x, y, z, dx, dy, dz, t_max, key, draw):
    """First bubble that a ray in the glass enters within t_max, drawn afresh on every way (free flight).

    The bubbles of a kind lie anywhere, independently, each wholly between the shells. Bubbles of diameter D
    offer a ray the area g D^2 (g from its direction), and the ray meets them at the rate g * sum of D^2 over
    bubbles per volume, as long as they lie in the glass: a bubble that would reach out of it is drawn and
    left again (Woodcock et al. 1965, ANL-7050). `kinds` [K, 9]: sum of D^2 per volume in 1/um, elongation,
    axis, bounds of the glass, what is inside (see `_path`); `sizes` [K, Q]: quantiles of D among the bubbles
    that rays meet.

    Returns the way (t_max: none), the kind (-1: none), the bubble's centre, its M, the next draw, and of
    the bubbles drawn, left again or not, the number and the number expected on this way: with these,
    another density needs no second trace (`reweight.py`).
    """
    t = 0.0
    drawn = 0
    none = (1.0, 1.0, 1.0, 0.0, 0.0, 0.0)
    while True:
        rate = 0.0
        for k in range(kinds.shape[0]):
            rate += kinds[k, 0] * _shadow(kinds, k, dx, dy, dz)
        t -= math.log(1.0 - uniform(key, draw)) / rate
        if t >= t_max:
            return t_max, -1, 0.0, 0.0, 0.0, none, draw + 1, drawn, rate * t_max
        drawn += 1
        share = uniform(key, draw + 1) * rate
        k = 0
        while k < kinds.shape[0] - 1:
            share -= kinds[k, 0] * _shadow(kinds, k, dx, dy, dz)
            if share < 0.0:
                break
            k += 1
        place = uniform(key, draw + 2) * (sizes.shape[1] - 1)
        j = int(place)
        size = sizes[k, j] + (place - j) * (sizes[k, j + 1] - sizes[k, j])
        elongation = kinds[k, 1]
        ax, ay, az = kinds[k, 2], kinds[k, 3], kinds[k, 4]
        long = 0.5 * size * elongation ** (2.0 / 3.0)
        short = long / elongation
        # M = 1 / short + (1 / long - 1 / short) a a^T, and its inverse with long and short in place.
        m0 = 1.0 / short
        m1 = 1.0 / long - m0
        m = (
            m0 + m1 * ax * ax,
            m0 + m1 * ay * ay,
            m0 + m1 * az * az,
            m1 * ax * ay,
            m1 * ax * az,
            m1 * ay * az,
        )
        # Where bubbles are spheres, the ray meets them anywhere on their cross section alike.
        qx, qy, qz = _to_sphere(m, dx, dy, dz)
        per = 1.0 / math.sqrt(qx * qx + qy * qy + qz * qz)
        qx *= per
        qy *= per
        qz *= per
        r2 = uniform(key, draw + 3)
        phi = 2.0 * math.pi * uniform(key, draw + 4)
        draw += 5
        # Two directions across q (Duff et al. 2017, JCGT 6(1)).
        sign = 1.0 if qz >= 0.0 else -1.0
        a = -1.0 / (sign + qz)
        b = qx * qy * a
        co = math.sqrt(r2) * math.cos(phi)
        si = math.sqrt(r2) * math.sin(phi)
        c = -math.sqrt(1.0 - r2)
        px = c * qx + co * (1.0 + sign * qx * qx * a) + si * b
        py = c * qy + co * sign * b + si * (sign + qy * qy * a)
        pz = c * qz - co * sign * qx - si * qy
        along = (long - short) * (px * ax + py * ay + pz * az)
        cz = z + t * dz - (short * pz + along * az)
        reach = math.sqrt(short * short + (long * long - short * short) * az * az)
        if cz - reach > kinds[k, 5] and cz + reach < kinds[k, 6]:
            cx = x + t * dx - (short * px + along * ax)
            cy = y + t * dy - (short * py + along * ay)
            return t, k, cx, cy, cz, m, draw, drawn, rate * t


@nb.njit(inline="always")
def _shadow(kinds, k, dx, dy, dz):
    """Area that a bubble of kind k and diameter 1 offers a ray: pi b sqrt(a^2 sin^2 + b^2 cos^2)."""
    elongation = kinds[k, 1]
    long = 0.5 * elongation ** (2.0 / 3.0)
    short = long / elongation
    c = dx * kinds[k, 2] + dy * kinds[k, 3] + dz * kinds[k, 4]
    return math.pi * short * math.sqrt(long * long * (1.0 - c * c) + short * short * c * c)


@nb.njit(fastmath=FAST, error_model="numpy", forceinline=True)
def meet_interface(nx, ny, nz, dx, dy, dz, ratio, polarised, sx, sy, sz, q, u, v, xi):
    """Reflect or refract one path, by chance, with Fresnel's share of the power as the probability.

    Parameters
    ----------
    nx, ny, nz : unit normal, on the side the light comes from.
    dx, dy, dz : direction of the light.
    ratio : n1 / n2, index on this side over index beyond.
    polarised : False to forget the polarisation after each interface (s and p averaged).
    sx, sy, sz, q, u, v : reference axis of the Stokes vector (1, q, u, v), which looks along the light with
        axes s and d x s; q > 0 is light swinging along the axis.
    xi : random number in [0, 1).

    Returns
    -------
    crossed, and the new dx, dy, dz, sx, sy, sz, q, u, v.
    """
    c = -(dx * nx + dy * ny + dz * nz)
    sin2 = 1.0 - c * c
    k = 1.0 - ratio * ratio * sin2
    turn = polarised and sin2 > 1e-24
    if turn:
        # The new axis s = d x n stands on the plane of incidence. At normal incidence there is no such plane,
        # and the old axis does.
        ax = dy * nz - dz * ny
        ay = dz * nx - dx * nz
        az = dx * ny - dy * nx
        per = 1.0 / math.sqrt(ax * ax + ay * ay + az * az)
        ax *= per
        ay *= per
        az *= per
        # Angle from the old axis to the new one, about d, and Q, U in the new frame.
        co = sx * ax + sy * ay + sz * az
        si = dx * (sy * az - sz * ay) + dy * (sz * ax - sx * az) + dz * (sx * ay - sy * ax)
        norm = co * co + si * si
        c2 = (co * co - si * si) / norm
        s2 = 2.0 * co * si / norm
        q, u = q * c2 + u * s2, u * c2 - q * s2
        sx = ax
        sy = ay
        sz = az
    crossed = False
    if k > 0.0:
        cos_t = math.sqrt(k)
        # Fresnel's amplitudes (Born and Wolf 1999, 1.5.2), with p = d x s for every ray.
        rs = (ratio * c - cos_t) / (ratio * c + cos_t)
        rp = (c - ratio * cos_t) / (c + ratio * cos_t)
        from_s = 0.5 * (1.0 + q)
        from_p = 0.5 * (1.0 - q)
        reflected = rs * rs * from_s + rp * rp * from_p
        if xi >= reflected:
            crossed = True
            if polarised:
                ts = 1.0 - rs * rs
                tp = 1.0 - rp * rp
                per = 1.0 / (1.0 - reflected)
                q = (ts * from_s - tp * from_p) * per
                both = math.sqrt(ts * tp) * per
                u *= both
                v *= both
            f = ratio * c - cos_t
            dx = ratio * dx + f * nx
            dy = ratio * dy + f * ny
            dz = ratio * dz + f * nz
        elif polarised:
            per = 1.0 / reflected
            q = (rs * rs * from_s - rp * rp * from_p) * per
            both = rs * rp * per
            u *= both
            v *= both
    elif polarised:
        # Total reflection: rs / rp has modulus 1 and the argument 2 atan(b / a); U + iV turns by it.
        a = ratio * sin2
        b = c * math.sqrt(-k)
        per = 1.0 / (a * a + b * b)
        re = (a * a - b * b) * per
        im = 2.0 * a * b * per
        u, v = re * u - im * v, im * u + re * v
    if not crossed:
        dx += 2.0 * c * nx
        dy += 2.0 * c * ny
        dz += 2.0 * c * nz
    if not polarised:
        q = 0.0
    return crossed, dx, dy, dz, sx, sy, sz, q, u, v


@nb.njit(fastmath=FAST, error_model="numpy")
def micro_facet(nx, ny, slope, dx, dy, dz, ratio, key, draw):
    """Tilt a plane (-nx and -ny its slopes, nz = 1) as relief too fine for the map does where light meets it.

    The slopes of the fine relief are Gaussian, `slope` rms along x and along y, and add to those of the
    plane. Light meets a facet in proportion to the area that it turns towards the light (Heitz and d'Eon
    2014, doi:10.1111/cgf.12417). Facets from which reflected light would run into the plane again, or
    refracted light out of it, are left out: light meets the fine relief once each time.

    Parameters
    ----------
    dx, dy, dz : direction of the light, which may come from either side.
    ratio : n1 / n2, index on the light's side over index beyond.
    key, draw : random stream, and the number of its next draw.

    Returns
    -------
    nx, ny of the facet's normal (nx, ny, 1), and the next draw. After 64 draws in vain, those of the plane.
    """
    side = -1.0 if nx * dx + ny * dy + dz > 0.0 else 1.0
    most = -side * (nx * dx + ny * dy + dz) + 3.5 * slope * math.sqrt(dx * dx + dy * dy)
    for _ in range(64):
        # Within 3.5 standard deviations, which leaves out 0.2 % of the facets.
        r = slope * math.sqrt(-2.0 * math.log(1.0 - uniform(key, draw) * (1.0 - 0.0021874911181828851)))
        turn = 2.0 * math.pi * uniform(key, draw + 1)
        chance = uniform(key, draw + 2)
        draw += 3
        mx = nx + r * math.cos(turn)
        my = ny + r * math.sin(turn)
        towards = -side * (mx * dx + my * dy + dz)
        if towards <= chance * most:
            continue
        per2 = 1.0 / (mx * mx + my * my + 1.0)
        # Reflected: d + 2 c m; its part along the plane's normal.
        plane = -side * (nx * dx + ny * dy + dz)
        along = (mx * nx + my * ny + 1.0) * towards * per2
        if 2.0 * along - plane <= 0.0:
            continue
        k = 1.0 - ratio * ratio * (1.0 - towards * towards * per2)
        if k > 0.0:
            # Refracted: ratio d + (ratio c - cos t) m, with c = towards / |m|.
            f = ratio * towards * per2 - math.sqrt(k * per2)
            if -ratio * plane + f * (mx * nx + my * ny + 1.0) >= 0.0:
                continue
        return mx, my, draw
    return nx, ny, draw


@nb.njit(fastmath=FAST, error_model="numpy")
def _meet_film(nx, ny, nz, dx, dy, dz, ratio, polarised, sx, sy, sz, q, u, v, xi, table):
    """As `meet_interface`, where a thin film lies on the interface.

    `table` [3, N, 8]: see `thin_film.tables`. Also returns the share of the light that the film did not take.
    """
    c = -(dx * nx + dy * ny + dz * nz)
    sin2 = 1.0 - c * c
    k = 1.0 - ratio * ratio * sin2
    if polarised and sin2 > 1e-24:
        ax = dy * nz - dz * ny
        ay = dz * nx - dx * nz
        az = dx * ny - dy * nx
        per = 1.0 / math.sqrt(ax * ax + ay * ay + az * az)
        ax *= per
        ay *= per
        az *= per
        co = sx * ax + sy * ay + sz * az
        si = dx * (sy * az - sz * ay) + dy * (sz * ax - sx * az) + dz * (sx * ay - sy * ax)
        norm = co * co + si * si
        c2 = (co * co - si * si) / norm
        s2 = 2.0 * co * si / norm
        q, u = q * c2 + u * s2, u * c2 - q * s2
        sx = ax
        sy = ay
        sz = az
    # Which of the three tables, and where in it.
    if k <= 0.0:
        kind = 2
        at = math.sqrt(-k / (ratio * ratio - 1.0))
    elif ratio < 1.0:
        kind = 0
        at = c
    else:
        kind = 1
        at = math.sqrt(k)
    at = min(max(at, 0.0), 1.0) * (table.shape[1] - 1)
    j = min(int(at), table.shape[1] - 2)
    f = at - j
    e = 1.0 - f
    r_s = e * table[kind, j, 0] + f * table[kind, j + 1, 0]
    r_p = e * table[kind, j, 1] + f * table[kind, j + 1, 1]
    t_s = e * table[kind, j, 4] + f * table[kind, j + 1, 4]
    t_p = e * table[kind, j, 5] + f * table[kind, j + 1, 5]
    from_s = 0.5 * (1.0 + q)
    from_p = 0.5 * (1.0 - q)
    reflected = r_s * from_s + r_p * from_p
    through = t_s * from_s + t_p * from_p
    kept = reflected + through
    crossed = xi * kept >= reflected and through > 0.0
    if polarised:
        first = 4 if crossed else 0
        share = through if crossed else reflected
        per = 1.0 / share if share > 0.0 else 0.0
        if crossed:
            q = (t_s * from_s - t_p * from_p) * per
        else:
            q = (r_s * from_s - r_p * from_p) * per
        re = (e * table[kind, j, first + 2] + f * table[kind, j + 1, first + 2]) * per
        im = (e * table[kind, j, first + 3] + f * table[kind, j + 1, first + 3]) * per
        u, v = re * u - im * v, im * u + re * v
    else:
        q = 0.0
    if crossed:
        f = ratio * c - math.sqrt(k)
        dx = ratio * dx + f * nx
        dy = ratio * dy + f * ny
        dz = ratio * dz + f * nz
    else:
        dx += 2.0 * c * nx
        dy += 2.0 * c * ny
        dz += 2.0 * c * nz
    return crossed, dx, dy, dz, sx, sy, sz, q, u, v, kept


@nb.njit(fastmath=FAST, error_model="numpy")
def _path(
    relief, bounds, layout, quanta, scale, outside, bubbles, first, member, grid, kinds, sizes, patch,
    light,
    eta, absorption, polarised, face, x, y, dx, dy, dz, sx, sy, number, shift, key, films,
):  # fmt: skip
    """Follow one path from above (or below) the pane until it leaves it.

    `films` is None, or [2, 3, N, 8] with a table for each face (`thin_film.tables`), all 0 where it has no
    film. The compiler leaves all that is said of films out of the loop for panes without.

    Returns where it ended (FRONT, BACK, ABSORBED, LOST or SIDES), its direction, its weight, what was
    absorbed of it, its way in glass in um, and the bubbles drawn and expected (`_meet_drawn`).
    """
    # scale[face]: pixels per um along x and y; mean plane; highest point of the relief above it and lowest
    # below it; sine of the steepest slope; rms slope of what is too fine for the map.
    z = scale[face, 2] + scale[face, 3] if face == FRONT else scale[face, 2] - scale[face, 4]
    tri = -1
    ix = 0
    iy = 0
    px = x * scale[face, 0]
    py = y * scale[face, 1]
    px -= math.floor(px / layout[face, 1]) * layout[face, 1]
    py -= math.floor(py / layout[face, 2]) * layout[face, 2]
    # outside[face]: index of what fills the relief, and one over it. Where that is no air, it ends in a plane
    # film at the relief's highest point, which the light meets first.
    arriving = outside[face, 0] != 1.0
    film = arriving
    in_glass = False
    in_bulk = False
    in_bubble = False
    m = (1.0, 1.0, 1.0, 0.0, 0.0, 0.0)
    bx = 0.0
    by = 0.0
    bz = 0.0
    # Inside a bubble: its index, 0 for that of the glass, and absorption in 1/um, below 0 for opaque.
    eta_in = 1.0
    absorption_in = 0.0
    sz = 0.0
    q = light[0]
    u = light[1]
    v = light[2]
    weight = 1.0
    absorbed = 0.0
    way = 0.0
    met = 0
    draw = 0
    fine = 0
    drawn = 0
    expected = 0.0
    per_eta = 1.0 / eta
    sides = patch[0]
    for _ in range(MAX_EVENTS):
        entered = False
        ratio = 1.0
        t_side = 1e300
        if sides > 0.0 and not in_bubble:
            t_side, nx_side, ny_side = _meet_side(patch, x, y, dx, dy)
        if film:
            # At the flat surface of the liquid on a face, from outside or from inside.
            bound = scale[face, 2] + scale[face, 3] if face == FRONT else scale[face, 2] - scale[face, 4]
            t = 0.0 if arriving else max((bound - z) / dz, 0.0)
            px += t * dx * scale[face, 0]
            py += t * dy * scale[face, 1]
            px -= math.floor(px / layout[face, 1]) * layout[face, 1]
            py -= math.floor(py / layout[face, 2]) * layout[face, 2]
            nx, ny, nz = 0.0, 0.0, 1.0
            ratio = outside[face, 1] if arriving else outside[face, 0]
        elif in_bubble:
            # A chord of the bubble: from its wall, p.q < 0, straight to the other end.
            ax, ay, az = _to_sphere(m, x - bx, y - by, z - bz)
            cx, cy, cz = _to_sphere(m, dx, dy, dz)
            t = max(-2.0 * (ax * cx + ay * cy + az * cz) / (cx * cx + cy * cy + cz * cz), 0.0)
            nx, ny, nz = _to_sphere(m, ax + t * cx, ay + t * cy, az + t * cz)
            ratio = eta_in * per_eta if eta_in > 0.0 else 1.0
        elif in_bulk:
            # Straight to the near bound of the shell ahead, unless a bubble stands in the way.
            face = FRONT if dz > 0.0 else BACK
            bound = scale[face, 2] - scale[face, 4] if face == FRONT else scale[face, 2] + scale[face, 3]
            t = max((bound - z) / dz, 0.0)
            if bubbles.shape[0] > 0:
                t, k, bx, by = _meet_listed(bubbles, first, member, grid, x, y, z, dx, dy, dz, t)
                if k >= 0:
                    entered = True
                    bz = bubbles[k, 2]
                    m = _matrix(bubbles, k)
                    eta_in = bubbles[k, 9]
                    absorption_in = bubbles[k, 10]
            if kinds.shape[0] > 0:
                t, k, cx, cy, cz, mk, draw, more, dose = _meet_drawn(
                    kinds, sizes, x, y, z, dx, dy, dz, t, _mix(key), draw
                )
                drawn += more
                expected += dose
                if k >= 0:
                    entered = True
                    bx, by, bz, m = cx, cy, cz, mk
                    eta_in = kinds[k, 7]
                    absorption_in = kinds[k, 8]
            nx, ny, nz = 0.0, 0.0, 0.0
            if entered:
                nx, ny, nz = _to_sphere(m, x + t * dx - bx, y + t * dy - by, z + t * dz - bz)
                nx, ny, nz = _to_sphere(m, nx, ny, nz)
                ratio = eta / eta_in if eta_in > 0.0 else 1.0
        else:
            # In a shell; the relief runs through it.
            below = 1 if (face == FRONT) == in_glass else 0
            t, ix, iy, tri, gx, gy, px, py = meet_relief(
                relief, bounds, layout, quanta, face, below, scale[face, 3 + below], scale[face, 5],
                px, py, z - scale[face, 2],
                dx * scale[face, 0], dy * scale[face, 1], dz,
                ix, iy, tri,
            )  # fmt: skip
            if t < 0.0:
                if t < -1.5 or (in_glass == ((face == FRONT) == (dz > 0.0))):
                    return LOST, dx, dy, dz, weight, absorbed, way, drawn, expected
                if in_glass:
                    in_bulk = True
                    continue
                if outside[face, 0] == 1.0:
                    return face, dx, dy, dz, weight, absorbed, way, drawn, expected
                film = True
                continue
            px += min(t, t_side) * dx * scale[face, 0]
            py += min(t, t_side) * dy * scale[face, 1]
            nx, ny, nz = -gx * scale[face, 0], -gy * scale[face, 1], 1.0
            ratio = eta * outside[face, 1] if in_glass else outside[face, 0] * per_eta
            if scale[face, 6] > 0.0:
                nx, ny, fine = micro_facet(nx, ny, scale[face, 6], dx, dy, dz, ratio, _mix(~key), fine)
        at_side = t_side < t
        if at_side:
            t = t_side
            entered = False
        x += t * dx
        y += t * dy
        z += t * dz
        if in_glass:
            way += t
            if absorption > 0.0:
                left = weight * math.exp(-absorption * t)
                absorbed += weight - left
                weight = left
                if weight < MIN_WEIGHT:
                    return ABSORBED, dx, dy, dz, 0.0, absorbed + weight, way, drawn, expected
        elif in_bubble and absorption_in > 0.0:
            left = weight * math.exp(-absorption_in * t)
            absorbed += weight - left
            weight = left
        if at_side:
            if not in_glass and outside[face, 0] == 1.0:
                # In air beyond the edge of the pane.
                return FRONT if dz > 0.0 else BACK, dx, dy, dz, weight, absorbed, way, drawn, expected
            if sides == ABSORBING:
                return ABSORBED, dx, dy, dz, 0.0, absorbed + weight, way, drawn, expected
            tri = -1
            film = False
            px -= math.floor(px / layout[face, 1]) * layout[face, 1]
            py -= math.floor(py / layout[face, 2]) * layout[face, 2]
            if sides == REFLECTING:
                # A mirror image: left becomes right in the Stokes vector too.
                dx -= 2.0 * abs(nx_side) * dx
                dy -= 2.0 * abs(ny_side) * dy
                sx -= 2.0 * abs(nx_side) * sx
                sy -= 2.0 * abs(ny_side) * sy
                u = -u
                v = -v
                continue
            nx, ny, nz = nx_side, ny_side, 0.0
            ratio = eta if in_glass else outside[face, 0]
        elif in_bulk and not in_bubble and not entered:
            # Arrived at a shell: to its own pixels, within the period.
            in_bulk = False
            tri = -1
            z = bound
            px = x * scale[face, 0]
            py = y * scale[face, 1]
            px -= math.floor(px / layout[face, 1]) * layout[face, 1]
            py -= math.floor(py / layout[face, 2]) * layout[face, 2]
            continue
        if entered and absorption_in < 0.0:
            return ABSORBED, dx, dy, dz, 0.0, absorbed + weight, way, drawn, expected
        per = 1.0 / math.sqrt(nx * nx + ny * ny + nz * nz)
        if nx * dx + ny * dy + nz * dz > 0.0:
            per = -per
        if films is None or film or in_bulk or at_side or films[face, 0, 0, 0] == 0.0:
            crossed, dx, dy, dz, sx, sy, sz, q, u, v = meet_interface(
                nx * per, ny * per, nz * per, dx, dy, dz, ratio, polarised, sx, sy, sz, q, u, v,
                _chance(number, shift, key, met),
            )  # fmt: skip
        else:
            crossed, dx, dy, dz, sx, sy, sz, q, u, v, kept = _meet_film(
                nx * per, ny * per, nz * per, dx, dy, dz, ratio, polarised, sx, sy, sz, q, u, v,
                _chance(number, shift, key, met), films[face],
            )  # fmt: skip
            absorbed += weight * (1.0 - kept)
            weight *= kept
        met += 1
        if at_side:
            if crossed:
                return SIDES, dx, dy, dz, weight, absorbed, way, drawn, expected
        elif film:
            if crossed != arriving:
                return face, dx, dy, dz, weight, absorbed, way, drawn, expected
            arriving = False
            film = False
            tri = -1
            z = bound
        elif in_bulk:
            # At a bubble's wall. In the glass means: outside the bubble.
            if crossed:
                in_glass = not in_glass
            in_bubble = not in_glass
        elif crossed:
            in_glass = not in_glass
    return LOST, dx, dy, dz, weight, absorbed, way, drawn, expected


@nb.njit(inline="always")
def _meet_side(patch, x, y, dx, dy):
    """Way to the side of a finite patch, and that side's normal; patch = sides, then lowest and highest x,
    lowest and highest y."""
    t_x = ((patch[2] if dx > 0.0 else patch[1]) - x) / dx if dx != 0.0 else 1e300
    t_y = ((patch[4] if dy > 0.0 else patch[3]) - y) / dy if dy != 0.0 else 1e300
    if t_x < t_y:
        return max(t_x, 0.0), 1.0, 0.0
    return max(t_y, 0.0), 0.0, 1.0


@nb.njit(parallel=True, cache=True)
def trace_kernel(
    relief, bounds, layout, quanta, scale, outside, bubbles, first, member, grid, kinds, sizes, patch,
    light,
    eta, absorption, polarised, face, theta, phi, turned, repeat_x, repeat_y, seed, start, per_replicate,
    ux, uy, side, weight, absorbed, way, drawn, expected, films,
):  # fmt: skip
    """Trace paths start, start + 1, ... and store what became of each.

    Parameters
    ----------
    relief, bounds, layout, quanta, scale, outside, bubbles, first, member, grid, kinds, sizes, patch, light :
        the pane and the light's polarisation, see `slab.Geometry`.
    eta, absorption : index of the glass, absorption in 1/um.
    polarised : see `meet_interface`.
    face, theta, phi : the face the light arrives on; polar angle from its normal and azimuth, radians.
    turned : True to turn the sample under the beam: each path has its own azimuth, and leaves in the frame
        in which the light came from azimuth 0.
    repeat_x, repeat_y : the light spreads over so many periods of that face.
    seed : of the random streams. Path p draws from a stream of its own, known by (seed, p).
    start, per_replicate : first path; paths p of one p // per_replicate form a randomised replicate.
    ux, uy, side, weight, absorbed, way, drawn, expected : [K] results, written here; see `trace.Paths`.
    films : None, or tables of thin films on the faces; see `_path`.
    """
    root = _mix(np.uint64(seed) * _GOLDEN + _MIX_2)
    # Directions point away from the sample, the light runs towards it.
    sin_t = math.sin(theta)
    cos_t = -math.cos(theta) if face == FRONT else math.cos(theta)
    co_0 = math.cos(phi)
    si_0 = math.sin(phi)
    columns = int(math.sqrt(per_replicate)) + 1
    width_x = layout[face, 1] / scale[face, 0]
    width_y = layout[face, 2] / scale[face, 1]
    for i in nb.prange(ux.size):
        p = start + i
        replicate = p // per_replicate
        number = p - replicate * per_replicate
        # Starts, azimuths and the first three decisions are points of one lattice, shifted as a whole by
        # chance in each replicate. In place it runs in rows, each sheared by a step that never repeats:
        # neighbours in number are neighbours in place, whose relief is still in the cache.
        shift = _mix(root + np.uint64(replicate + 1) * _MIX_1)
        key = _mix(root ^ (np.uint64(p + 1) * _MIX_2))
        count = np.uint64(number)
        y = number / per_replicate + uniform(shift, 0)
        y -= math.floor(y)
        row = number // columns
        x = (number - row * columns + _unit(np.uint64(row) * _GOLDEN)) / columns + uniform(shift, 1)
        x -= math.floor(x)
        # Which of the periods: the other face and the bubbles lie differently under each.
        x += int(uniform(key, 0) * repeat_x)
        y += int(uniform(key, 1) * repeat_y)
        x *= width_x
        y *= width_y
        if patch[0] > 0.0:
            # Light falls on a square of the patch only.
            x = patch[5] + (x / width_x - math.floor(x / width_x)) * patch[7]
            y = patch[6] + (y / width_y - math.floor(y / width_y)) * patch[7]
        co = co_0
        si = si_0
        if turned:
            azimuth = 2.0 * math.pi * _even(count, _ROOT_2, shift)
            co = math.cos(azimuth)
            si = math.sin(azimuth)
        ended, dx, dy, _, w, a, way_in_glass, bodies, dose = _path(
            relief, bounds, layout, quanta, scale, outside, bubbles, first, member, grid, kinds, sizes, patch,
    light,
            eta, absorption, polarised, face, x, y, -sin_t * co, -sin_t * si, cos_t, -si, co,
            count, shift, key, films,
        )  # fmt: skip
        if turned:
            dx, dy = dx * co + dy * si, dy * co - dx * si
        ux[i] = dx
        uy[i] = dy
        side[i] = ended
        weight[i] = w
        absorbed[i] = a
        way[i] = way_in_glass
        drawn[i] = bodies
        expected[i] = dose
