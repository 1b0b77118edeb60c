"""What a renderer makes of direct sun through a tensor tree, and what to do where that is wrong."""

from __future__ import annotations

import numpy as np

from specularia.bsdf.compare import lobe
from specularia.bsdf.finding import Check
from specularia.bsdf.model import Array, ScatteringModel
from specularia.bsdf.xml_model import TreePart, XmlModel, circle_sum, column_sum

__all__ = ["direct_sun", "sun_response"]

_TRANSMISSION = ("transmission_front", "transmission_back")
_EXACT = 0.01
"""Direct sun that is rendered wrong by less than this share counts as right."""
_REMEDY = "use a tree of rank 4 (tensor4), a higher resolution, or sources computed from the model itself."


def sun_response(model: XmlModel, side: str, theta_deg: Array, phi_deg: float = 0.0) -> Array:
    """Transmission that a renderer finds for direct sun.

    Seen against the light, a renderer takes the eye's direction as the incident one: it reads the tree of
    the other side, at the cell that holds the sun. In a tree of rank 3 that cell is seen in the frame turned
    with each eye direction, so that the sun runs round a circle through square cells (see
    `xml_model.circle_sum`), and the sum over all eye directions need not be the tree's own
    direct-hemispherical value. In one of rank 4 the cell stays, and the sum is that of a column of the tree.
    Where the other side is missing, and in matrices, the side itself is read, and the sum is its own value.

    Parameters
    ----------
    model : from XML, with the side or the opposite one.
    side : the transmission side whose face the sun shines on.
    theta_deg : [N] polar angles of the sun.
    phi_deg : its azimuth; without effect in trees of rank 3.

    Returns
    -------
    [N] direct-hemispherical transmission as rendered (ours; src/rt/m_bsdf.c and src/common/bsdf_t.c).
    """
    part = model.parts.get(_TRANSMISSION[1 - _TRANSMISSION.index(side)])
    if not isinstance(part, TreePart):
        return np.asarray(model.direct_hemispherical(side, theta_deg, phi_deg), float)
    s = np.sin(np.radians(theta_deg))
    if part.tree.rank == 3:
        return circle_sum(part.tree, s)
    phi = np.radians(phi_deg)
    return column_sum(part.tree, s * np.cos(phi), s * np.sin(phi))


def _sun(model: ScatteringModel, theta: Array) -> tuple[float, float] | None:
    """Worst share by which direct sun is rendered wrong at these angles, and where; None except for trees."""
    if not isinstance(model, XmlModel) or model.rank is None or not set(_TRANSMISSION) <= set(model.parts):
        return None
    worst, where = 0.0, float(theta[0])
    for side in _TRANSMISSION:
        for phi in (0.0,) if model.rank == 3 else (17.0, 130.0, 250.0):
            tau = model.direct_hemispherical(side, theta, phi)
            lit = np.flatnonzero(tau > 1e-3)
            if lit.size:
                off = np.abs(sun_response(model, side, theta[lit], phi) / tau[lit] - 1.0)
                if off.max() > worst:
                    worst, where = float(off.max()), float(theta[lit[off.argmax()]])
    return worst, where


def direct_sun(model: ScatteringModel) -> list[Check]:
    """How wrong direct sun is rendered on the normal, near it and elsewhere; nothing for other than trees."""
    on_it = _sun(model, np.zeros(1))
    if on_it is None:
        return []
    assert isinstance(model, XmlModel)
    advice = "Direct sun on the normal is rendered right."
    if on_it[0] > _EXACT:
        advice = "Direct sun on the normal is rendered wrong by this share: " + _why_on_the_normal(model)
    found = [Check("theta 0 sun", on_it[0] <= _EXACT, on_it[0], _EXACT, advice)]
    return found + _sun_elsewhere(model)


def _why_on_the_normal(model: XmlModel) -> str:
    """What makes the sum over the four cells around the normal differ from the file's own value."""
    uneven, wide = 0.0, 0.0
    if model.rank == 4:
        return "front and back transmission contradict each other there; write the file again with tensor4."
    for side in _TRANSMISSION:
        part = model.parts[side]
        assert isinstance(part, TreePart)
        middle, ring = 0.5 - 0.25 / (1 << part.tree.resolution), np.array([1, 1, -1, -1]) * 1e-6
        position = np.stack([np.full(4, middle), 0.5 + ring, 0.5 + ring[[0, 2, 1, 3]]], axis=-1)
        cells = part.tree.lookup(position).astype(float)
        uneven = max(uneven, float(np.ptp(cells) / max(cells.max(), 1e-12)))
        wide = max(wide, 4 * 2.0 / (1 << part.tree.resolution))
    if uneven > 0.01:
        return (
            "it falls on a corner of four cells that differ. Write the file with bsdf.write, which makes "
            "them alike, or " + _REMEDY
        )
    narrow = min(lobe(model, s, theta_i_deg=0.0).fwhm_deg for s in _TRANSMISSION)
    if narrow < np.degrees(wide):
        return f"the lobe, {narrow:.2g} degrees, spans fewer than four cells. To mend it, " + _REMEDY
    return (
        "front and back transmission differ near the normal, as those that were measured or traced one by "
        "one do by their noise. Leave one of them to reciprocity, trace more paths, or " + _REMEDY
    )


def _sun_elsewhere(model: XmlModel) -> list[Check]:
    found = []
    ranges = (("direct sun near the normal", 1.0, 9.0, 33), ("direct sun", 10.0, 75.0, 45))
    for name, first, last, count in ranges:
        sun = _sun(model, np.linspace(first, last, count))
        if sun is None:
            continue
        ok = sun[0] <= _EXACT
        where = f"Direct sun from {first:g} to {last:g} degrees is rendered"
        advice = (
            f"{where} within this share."
            if ok
            else f"{where} wrong by up to this share, at {sun[1]:.3g} degrees: cells of a ring keep their "
            f"value while their width changes. Where that matters, {_REMEDY}"
        )
        if not ok and model.rank == 4:
            advice = f"{where} wrong by up to this share, at {sun[1]:.3g} degrees: the tree's two sides "
            advice += "contradict each other; write the file again with tensor4."
        found.append(Check(name, ok, sun[0], _EXACT, advice))
    return found
