"""The scan of the bare beam, which makes raw signals absolute.

A gonio-photometer's detector gives a signal proportional to the light per solid angle. Without a sample it
scans the beam itself, whose power in the same unit is the integral of that signal over solid angle. With the
sample in place

    DSF(theta_s, phi_s) = signal(theta_s, phi_s) / integral of the bare beam's signal over solid angle ,

and no calibration of the detector is needed (Apian-Bennewitz, P. (2010), New scanning gonio-photometer for
extended BRTF measurements, Proc. SPIE 7792, doi:10.1117/12.860889). All values share the error of the scan.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from specularia.conventions import direction_cosines
from specularia.errors import FormatError
from specularia.gonio.noise import estimate
from specularia.gonio.raw import Raw
from specularia.gonio.table import Array
from specularia.gonio.triangulation import merged, triangulate, weights

__all__ = ["Beam", "integrate_beam", "normalised"]

_FEWEST_ABOVE_HALF = 6
"""Directions above half of the peak that a scan should have."""

_CORE, _FEWEST_IN_CORE = 0.2, 60
"""The core of a beam is brighter than this share of the peak; directions for its noise to be told from it."""

_RIM = 0.1
"""A scan whose rim is brighter than this share of the peak does not contain the beam."""

_SEED = 1


@dataclass(frozen=True)
class Beam:
    """A scan of the bare beam, integrated.

    Attributes
    ----------
    file : where it was read from.
    power : integral of the signal over solid angle, in the signal's unit times sr.
    relative_se : standard error of the power from the noise of the scan, relative.
    relative_bound : half-width of the bound on what the sampling and the rim of the scan hide, relative.
    fwhm_deg : full width at half maximum of a round spot with the area of what is above half of the peak.
    unit : the file's word for the signal, or "".
    points : directions of the scan.
    warnings : what was noticed.
    """

    file: str
    power: float
    relative_se: float
    relative_bound: float
    fwhm_deg: float
    unit: str
    points: int
    warnings: tuple[str, ...] = ()


def integrate_beam(raw: Raw) -> Beam:
    """Integrate a scan of the bare beam over solid angle.

    The directions are laid out in the plane by Lambert's azimuthal projection around the beam, which keeps
    solid angle, and integrated as tables are. The bound holds half of the change when every other direction
    is left out, and the signal at the rim over the whole area: an offset that should have been taken off, or
    light beyond.

    Raises
    ------
    FormatError : fewer than six directions above half of the peak, or a rim that is bright.
    """
    p, q = _plane(raw)
    first, group, count = merged(p, q)
    x, y = p[first], q[first]
    signal = np.bincount(group, raw.values) / count
    if x.size < 16 or np.ptp(x) < 1e-6 or np.ptp(y) < 1e-6:
        raise FormatError(
            file=raw.file, expected="a scan of directions around the beam", found=f"{x.size} directions"
        )
    triangles, neighbours = triangulate(x, y)
    weight = weights(x, y, triangles, neighbours)
    power = float(np.sum(weight * signal))
    rim = np.unique(triangles[np.nonzero(neighbours < 0)[0]])
    peak = float(signal.max())
    bright = signal > 0.5 * peak
    if peak <= 0 or bright.sum() < _FEWEST_ABOVE_HALF or power <= 0:
        raise FormatError(
            file=raw.file,
            expected=f"a scan with {_FEWEST_ABOVE_HALF} directions or more above half of the beam's peak",
            found=f"{int(bright.sum())} with a peak of {peak:.4g}",
            advice="Scan the bare beam in finer steps, without the sample.",
        )
    if np.median(signal[rim]) > _RIM * peak or signal[rim].max() > 0.5 * peak:
        raise FormatError(
            file=raw.file,
            expected="a scan that contains the whole beam",
            found=f"{signal[rim].max() / peak:.2g} of the peak's signal at the rim of the scan",
            advice="Scan a wider field around the bare beam, without the sample.",
        )
    variance = _variance(x, y, signal, count.astype(float), peak) / count
    error = float(np.sqrt(np.sum(weight**2 * variance)))
    coarse = _thinned(x, y, signal, weight)
    beyond = abs(float(np.median(signal[rim]))) * float(weight.sum())
    area = float(np.sum(weight[bright]))
    notes = []
    if (coarse + beyond) > 0.02 * power:
        notes.append(
            f"the power of the beam is uncertain by {100 * (coarse + beyond) / power:.1f} %: "
            f"{100 * coarse / power:.1f} % by the steps of the scan, {100 * beyond / power:.1f} % by the "
            "signal at its rim"
        )
    return Beam(
        file=raw.file,
        power=power,
        relative_se=error / power,
        relative_bound=(coarse + beyond) / power,
        fwhm_deg=float(np.degrees(2.0 * np.sqrt(area / np.pi))),
        unit=raw.unit,
        points=int(raw.values.size),
        warnings=tuple(notes),
    )


def normalised(raw: Raw, beam: Beam) -> Raw:
    """A raw table as absolute DSF by the power of the bare beam.

    Raises
    ------
    FormatError : for a table that says that it holds BSDF; a detector's signal is no BSDF.
    """
    if raw.quantity == "BSDF":
        raise FormatError(
            file=raw.file,
            line=raw.quantity_line,
            expected="a raw signal, to be normalised by the scan of the bare beam",
            found=f"{raw.unit}, which is normalised already",
            advice="Leave --beam out, or give the instrument's raw export.",
        )
    note = (
        f"normalised by the bare beam, whose power is {beam.power:.5g} within {100 * beam.relative_se:.2g} %"
    )
    if raw.quantity == "DSF":
        note = f"the file calls its values DSF; given the bare beam they are taken as raw signals, {note}"
    return replace(
        raw,
        values=raw.values / beam.power,
        # The scan is of one column; what X and Z of the beam are it does not tell.
        others={},
        quantity="DSF",
        stated_integral=None,
        warnings=(*raw.warnings, note),
    )


def _plane(raw: Raw) -> tuple[Array, Array]:
    """Places in Lambert's azimuthal projection around the bright directions."""
    v = np.stack(direction_cosines(raw.theta_s_deg, raw.phi_s_deg), axis=1)
    bright = raw.values > 0.5 * raw.values.max()
    centre = np.average(v[bright], axis=0, weights=raw.values[bright]) if bright.any() else v[0]
    centre /= max(float(np.linalg.norm(centre)), 1e-12)
    aside = np.cross(centre, np.eye(3)[np.argmin(np.abs(centre))])
    aside /= np.linalg.norm(aside)
    # Half the distance between two directions is the sine of half their angle; twice that is Lambert's
    # radius.
    stretch = np.sqrt(2.0 / np.maximum(1.0 + v @ centre, 1e-6))
    return (v @ aside) * stretch, (v @ np.cross(centre, aside)) * stretch


def _variance(x: Array, y: Array, signal: Array, count: Array, peak: float) -> Array:
    """Of single values, told from the bright core where it holds directions enough.

    On the flanks the signal falls by factors from one direction to the next, which no surface follows; seen
    together with the core they would make the noise too large. In the core the logarithm is smoother than the
    signal (that of a Gaussian beam is a quadratic).
    """
    whole = estimate(x, y, signal, np.ones_like(signal), count).variance(signal)
    core = signal > _CORE * peak
    if core.sum() < _FEWEST_IN_CORE:
        return whole
    inner = signal[core]
    bright = estimate(x[core], y[core], np.log(inner), inner, count[core], signal=inner)
    return np.minimum(whole, bright.variance(signal))


def _thinned(x: Array, y: Array, signal: Array, weight: Array) -> float:
    """Half of how far the integral moves when every other direction is left out, noise included."""
    rng = np.random.default_rng(_SEED)
    moved = []
    for _ in range(2):
        kept = np.sort(rng.permutation(x.size)[: (x.size + 1) // 2])
        triangles, _ = triangulate(x[kept], y[kept])
        half = np.zeros_like(weight)
        half[kept] = weights(x[kept], y[kept], triangles)
        moved.append(np.sum((half - weight) * signal) ** 2)
    return 0.5 * float(np.sqrt(np.mean(moved)))
