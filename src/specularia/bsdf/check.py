"""What is wrong with a BSDF, what to do about it, and which programs will take it."""

from __future__ import annotations

import numpy as np

from specularia.bsdf.cells import cell_means, grid, is_isotropic
from specularia.bsdf.check_render import rendered
from specularia.bsdf.check_sun import direct_sun, sun_response
from specularia.bsdf.compare import lobe
from specularia.bsdf.finding import Check, Program
from specularia.bsdf.model import Array, ScatteringModel
from specularia.bsdf.tabulated import TabulatedModel
from specularia.bsdf.xml_model import KlemsPart, XmlModel

__all__ = ["Check", "Program", "check", "programs", "sun_response"]

_ANGLES = np.array([0.0, 5.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0, 75.0, 80.0, 85.0])
_TRANSMISSION = ("transmission_front", "transmission_back")


def check(model: ScatteringModel, *, render: bool = False) -> list[Check]:
    """All checks that apply to a model.

    Parameters
    ----------
    model : any scattering model.
    render : True to prove the transmission sides with rtrace as well, see `check_render.rendered`.
    """
    found = [_energy(model), _negative(model), *_sides(model), *_reciprocity(model), *_orientation(model)]
    found += [*_normal_incidence(model), *direct_sun(model), *_grazing(model), *_resolution(model)]
    if render:
        found += rendered(model, _transmission(model))
    return found


def _transmission(model: ScatteringModel) -> list[str]:
    return [s for s in _TRANSMISSION if s in model.sides]


def _energy(model: ScatteringModel) -> Check:
    """The largest share of the light from one direction that leaves again."""
    phi = [0.0] if is_isotropic(model) else [0.0, 90.0, 180.0, 270.0]
    worst, where = 0.0, ""
    for face in ("front", "back"):
        total = np.zeros((len(phi), _ANGLES.size))
        for kind in ("transmission", "reflection"):
            side = f"{kind}_{face}"
            if side in model.sides:
                total += np.nan_to_num([model.direct_hemispherical(side, _ANGLES, p) for p in phi])
        k = np.unravel_index(int(total.argmax()), total.shape)
        if total[k] > worst:
            worst, where = float(total[k]), f"light on the {face} at {_ANGLES[k[1]]:g} degrees"
    ok = worst <= 1.005
    return Check(
        "energy",
        ok,
        worst,
        1.005,
        f"Most light leaves for {where}."
        if ok
        else f"More light leaves than arrives ({where}): DSF taken for BSDF, or wrongly scaled values.",
    )


def _negative(model: ScatteringModel) -> Check:
    if isinstance(model, XmlModel):
        count = sum(p.negative for p in model.parts.values())
    elif isinstance(model, TabulatedModel):
        count = sum(
            int(np.count_nonzero(t.base < 0) + np.count_nonzero(t.patch < 0)) for t in model.tables.values()
        )
    else:
        x, y = grid(64)
        count = sum(
            int(np.count_nonzero(model.evaluate(s, t, 0.0, x, y) < 0)) for s in model.sides for t in _ANGLES
        )
    return Check(
        "negative values",
        count == 0,
        float(count),
        0.0,
        "None." if count == 0 else "They count as zero, which adds light; clean the source of the data.",
    )


def _sides(model: ScatteringModel) -> list[Check]:
    own = set(model.parts if isinstance(model, XmlModel) else getattr(model, "tables", model.sides))
    found = []
    present = [s for s in _TRANSMISSION if s in own]
    if present:
        isotropic_tree = isinstance(model, XmlModel) and model.rank == 3
        missing = 2 - len(present)
        if missing == 0:
            advice = "Both are there."
        elif isotropic_tree:
            advice = (
                f"Only {present[0].replace('_', ' ')} is there. Renderers do not sample rank-3 trees in "
                "reverse: sky light seen through the pane is black. Write the file again with bsdf.write, "
                "which adds the other side."
            )
        else:
            advice = f"Only {present[0].replace('_', ' ')} is there; the other follows by reciprocity."
        found.append(
            Check("transmission sides", not (missing and isotropic_tree), float(missing), 0.0, advice)
        )
    reflections = sum(s in own for s in ("reflection_front", "reflection_back"))
    found.append(
        Check(
            "reflection sides",
            True,
            float(2 - reflections),
            2.0,
            "Both are there."
            if reflections == 2
            else f"{2 - reflections} of 2 missing: renderers take the pane as black in reflection there.",
        )
    )
    return found


def _rings(model: ScatteringModel, side: str) -> Array:
    """Power from ring to ring of the hemisphere, [incident, outgoing], for unit radiance, in sr."""
    n, rings, each = 64, 6, 5
    x, y = grid(n)
    ring = np.minimum((np.hypot(x, y) * rings).astype(int), rings - 1).ravel()
    phi = [0.0] if is_isotropic(model) else [22.5, 112.5, 202.5, 292.5]
    out = np.zeros((rings, rings))
    for k in range(rings * each):
        s = (k + 0.5) / (rings * each)
        for p in phi:
            theta = float(np.degrees(np.arcsin(s)))
            mean = np.nan_to_num(cell_means(model, side, theta_i_deg=theta, phi_i_deg=p, n=n)).ravel()
            power = np.bincount(ring, mean, minlength=rings) * (np.pi / n**2)
            out[k // each] += power * 2 * np.pi * s / (rings * each * len(phi))
    return out


def _reciprocity(model: ScatteringModel) -> list[Check]:
    """Power exchanged between rings of the two hemispheres, both ways; narrow peaks do not disturb it."""
    own = set(model.parts if isinstance(model, XmlModel) else getattr(model, "tables", model.sides))
    if not own.issuperset(_TRANSMISSION):
        return []
    front, back = (_rings(model, s) for s in _TRANSMISSION)
    apart = float(np.abs(front - back.T).sum() / max(front.sum(), 1e-12))
    ok = apart <= 0.1
    return [
        Check(
            "reciprocity",
            ok,
            apart,
            0.1,
            "Light goes both ways alike."
            if ok
            else "Front and back transmission contradict each other: one may be mislabelled, scaled or "
            "flipped. Write the file with one of them and let the other follow by reciprocity.",
        )
    ]


def _orientation(model: ScatteringModel) -> list[Check]:
    """Whether transmitted light keeps its direction: mean exit direction along that of undeflected light."""
    found = []
    for side in _transmission(model):
        s = float(np.sin(np.radians(40.0)))
        shares = []
        for p in [0.0] if is_isotropic(model) else [0.0, 90.0, 180.0, 270.0]:
            mean = cell_means(model, side, theta_i_deg=40.0, phi_i_deg=p, n=64)
            total = float(np.nansum(mean))
            shares.append(float(np.nansum(mean * grid(64)[0])) / (-s * total) if total > 0 else 0.0)
        value = float(np.mean(shares))
        ok = value >= -0.05
        found.append(
            Check(
                f"orientation {side.replace('_', ' ')}",
                ok,
                value,
                -0.05,
                "1 means undeflected on average, 0 diffuse."
                if ok
                else "Light leaves towards where it came from: the outgoing azimuth is half a turn off.",
            )
        )
    return found


def _normal_incidence(model: ScatteringModel) -> list[Check]:
    """tau at theta = 0 against its neighbours."""
    found = []
    for side in _transmission(model):
        tau = model.direct_hemispherical(side, [0.0, 5.0])
        jump = float(abs(tau[0] / tau[1] - 1.0)) if tau[1] > 0 else 0.0
        known = bool(np.isfinite(tau[0]))
        found.append(
            Check(
                f"theta 0 {side.replace('_', ' ')}",
                known and jump <= 0.05,
                jump if known else float("nan"),
                0.05,
                "Smooth towards normal incidence."
                if known and jump <= 0.05
                else "The value at normal incidence is missing or out of line with that at 5 degrees.",
            )
        )
    return found


def _grazing(model: ScatteringModel) -> list[Check]:
    found = []
    for side in _transmission(model):
        theta = np.arange(45.0, 87.0, 1.5)
        tau = model.direct_hemispherical(side, theta)
        known = np.isfinite(tau) & (tau > 0)
        last = float(theta[known][-1]) if known.any() else 0.0
        fall = tau[1:] / np.where(tau[:-1] > 0, tau[:-1], np.nan)
        sudden = np.flatnonzero(fall < 0.25)
        if sudden.size:
            last = min(last, float(theta[sudden[0]]))
        beyond = getattr(model, "extrapolated_beyond_deg", {}).get(side)
        if beyond is not None:
            last = min(last, float(beyond))
        ok = last >= 75.0
        found.append(
            Check(
                f"grazing {side.replace('_', ' ')}",
                ok,
                last,
                75.0,
                f"Data reach {last:g} degrees."
                if ok
                else f"Data end at {last:g} degrees; above, the values are missing, a floor or extrapolated.",
            )
        )
    return found


def _resolution(model: ScatteringModel) -> list[Check]:
    """The narrowest lobe against the width of a cell, both in degrees at 0 to 40 degrees of incidence."""
    sides = _transmission(model)
    if not sides:
        return []
    narrowest = min(
        lobe(model, s, theta_i_deg=t).fwhm_deg
        for s in sides
        for t in (0.0, 20.0, 40.0)
        if np.isfinite(model.direct_hemispherical(s, t))
    )
    cell = _cell_deg(model)
    if cell is None:
        return []
    value = narrowest / cell
    ok = value >= 2.0
    return [
        Check(
            "resolution",
            ok,
            value,
            2.0,
            f"The narrowest lobe, {narrowest:.2g} degrees, spans that many cells."
            if ok
            else f"The narrowest lobe, {narrowest:.2g} degrees, is as wide as the cells, {cell:.2g} degrees: "
            "good for annual sums, too coarse for glare and sun patches. Use finer data or a finer tree.",
        )
    ]


def _cell_deg(model: ScatteringModel) -> float | None:
    if isinstance(model, XmlModel):
        if model.resolution is not None:
            return float(np.degrees(2.0 / (1 << model.resolution)))
        bounds = next(p.outgoing.bounds_deg for p in model.parts.values() if isinstance(p, KlemsPart))
        return float(2 * bounds[1])
    if isinstance(model, TabulatedModel):
        return float(np.degrees(min(2 * t.half_width / t.patch.shape[1] for t in model.tables.values())))
    return None


def programs(model: ScatteringModel) -> list[Program]:
    """Which programs take a file, for what."""
    if not isinstance(model, XmlModel):
        why = "It is a model of this package; write it as .xml first."
        return [Program(n, False, why) for n in ("Radiance", "Radiance matrices (dctimestep)", "WINDOW 7")]
    visible = "Visible" in model.bands
    blind = "It has no Visible band, the only one that Radiance reads."
    matrix = model.rank is None
    return [
        Program(
            "Radiance",
            visible,
            ("Klems patches blur the sun over 10 degrees." if matrix else "As a BSDF material.")
            if visible
            else blind,
        ),
        Program(
            "Radiance matrices (dctimestep)",
            visible,
            ("As it is." if matrix else "After bsdf2klems or rmtxop.") if visible else blind,
        ),
        Program("WINDOW 7", matrix, "It reads Klems matrices." if matrix else "It reads no tensor trees."),
    ]
