"""Commands of `specularia glass` about colour and waves, and what `glass trace` says of colour."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from specularia.cli._common import Json, Quiet, Seed, emit, numbers, session, table

if TYPE_CHECKING:
    from specularia.glass import Slab
    from specularia.glass.model import Traced

__all__ = ["colour_of_model", "colour_of_pane", "colours", "film"]


def colours(
    glass: Annotated[
        Path | None,
        typer.Argument(
            metavar="[GLASS.toml]",
            help="A pane whose faces are taken; its own glass is shown too where it has a spectrum. Without "
            "one a flat pane of 3 mm.",
            show_default=False,
        ),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="OUT.png, a figure with its numbers in OUT.csv; or OUT.csv."),
    ] = None,
    thickness: Annotated[
        str, typer.Option("--thickness", help="In mm: A,B,...; all from one trace.")
    ] = "1.5,2,2.5,3,3.5,4,4.5,5",
    theta: Annotated[
        float, typer.Option("--theta", min=0.0, max=89.9, help="Incident angle in degrees.")
    ] = 0.0,
    illuminant: Annotated[str, typer.Option("--illuminant", help="Of the CIE, such as D65, E or A.")] = "D65",
    paths: Annotated[int, typer.Option("--paths", min=1, help="Of the one trace.")] = 100_000,
    seed: Seed = 0,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """The colour of a pane in the built-in glasses, over thickness: L*, a*, b* and patches in sRGB."""
    if output is not None and output.suffix.lower() not in (".csv", ".png"):
        raise typer.BadParameter(f"{output} must end in .csv or .png", param_hint="-o")
    depths = numbers(thickness, option="--thickness")
    with session(quiet=quiet):
        from specularia.files import writable
        from specularia.glass import GLASSES, Medium, Slab, Spectrum, read_slab, swatches

        if output is not None:
            writable(output)
        slab = Slab(thickness_mm=3.0) if glass is None else read_slab(glass, seed=seed)
        media = {name: Medium(absorption_per_mm=kind.spectrum()) for name, kind in GLASSES.items()}
        if isinstance(slab.medium.absorption_per_mm, Spectrum):
            media = {"this pane": slab.medium, **media}
        found = swatches(
            slab,
            media,
            thickness_mm=depths,
            theta_deg=theta,
            paths=paths,
            seed=seed,
            illuminant=illuminant,
        )
        payload: dict[str, Any] = {
            "illuminant": found.illuminant,
            "observer": found.observer,
            "theta_deg": theta,
            "traced_mm": found.traced_mm,
            "thickness_mm": found.thickness_mm,
            "glasses": {
                name: {"xyz": found.xyz[k], "xyz_se": found.xyz_se[k], "lab": found.lab[k]}
                for k, name in enumerate(found.glasses)
            },
        }
        rows = [
            [name, float(d), *(float(v) for v in found.lab[m, t])]
            for m, name in enumerate(found.glasses)
            for t, d in enumerate(found.thickness_mm)
        ]
        lines = table(["glass", "mm", "L*", "a*", "b*"], rows)
        if output is not None:
            from specularia.report.figures.swatches import swatch_figure, write_swatches

            written = [output.with_suffix(".csv")]
            if output.suffix.lower() == ".png":
                written = [swatch_figure(found, output, synthetic=slab.synthetic), *written]
            else:
                write_swatches(found, output)
            payload["written"] = [str(p.resolve()) for p in written]
            lines += [f"written: {p}" for p in written]
        emit(payload, as_json=as_json, lines=lines)


def colour_of_model(traced: Traced, *, illuminant: str | None) -> tuple[dict[str, Any], list[str]]:
    """The colour that a model transmits from the front, for --json and for a person; nothing without one."""
    if illuminant is None:
        return {}, []
    import numpy as np

    from specularia.glass.colour import CIE_BANDS

    bands = [traced.model.in_band(b) for b in CIE_BANDS]
    theta = traced.balances["front"].theta_deg
    table_of = bands[1].tables["transmission_front"]
    xyz = np.stack(
        [
            [b.tables["transmission_front"].tau[table_of.theta_i_deg == t].mean() for t in theta]
            for b in bands
        ],
        axis=-1,
    )
    return _told(theta, xyz, illuminant)


def colour_of_pane(
    slab: Slab,
    theta: Sequence[float],
    *,
    phi_deg: float,
    paths: int,
    seed: int,
    wavelength_nm: float,
    illuminant: str | None,
) -> tuple[dict[str, Any], list[str]]:
    """The colour that a pane transmits from the front, as `colour_of_model`."""
    if illuminant is None:
        return {}, []
    import numpy as np

    from specularia.glass import swatches

    found = [
        swatches(
            slab,
            {"pane": slab.medium},
            thickness_mm=[slab.thickness_mm],
            theta_deg=t,
            phi_deg=phi_deg,
            paths=paths,
            seed=seed,
            wavelength_nm=wavelength_nm,
            illuminant=illuminant,
        ).xyz[0, 0]
        for t in theta
    ]
    return _told(theta, np.array(found), illuminant)


def _told(theta: Any, xyz: Any, illuminant: str) -> tuple[dict[str, Any], list[str]]:
    from specularia.glass.colour import OBSERVER, lab

    colour = lab(xyz)
    payload = {"xyz": xyz, "lab": colour, "illuminant": f"CIE {illuminant}", "observer": OBSERVER}
    rows = [[float(t), *(float(v) for v in a), *(float(v) for v in b)] for t, a, b in zip(theta, xyz, colour)]
    header = ["theta_i", "X", "Y", "Z", "L*", "a*", "b*"]
    return payload, ["", f"Transmitted, relative to CIE {illuminant}:", *table(header, rows)]


def film(
    glass: Annotated[
        Path, typer.Argument(metavar="GLASS.toml", help="A pane with [front.film] or [back.film].")
    ],
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="OUT.png with its numbers in OUT.csv; or OUT.csv.")
    ] = None,
    theta: Annotated[
        str, typer.Option("--theta", help="Incident angles in degrees, A,B,...")
    ] = "0,20,40,60,82.5",
    wavelength: Annotated[
        float, typer.Option("--wavelength", min=200.0, max=20000.0, help="Of the laser, in nm.")
    ] = 520.0,
    illuminant: Annotated[str, typer.Option("--illuminant", help="Of the CIE, such as D65, E or A.")] = "D65",
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """What thin films do to a pane without its relief, over the spectrum: exact, and how far off a laser may
    be.

    A laser sees one wavelength, which can sit on a fringe: its transmission and reflection stand beside the
    means over the visible spectrum and the range of both in it.
    """
    if output is not None and output.suffix.lower() not in (".csv", ".png"):
        raise typer.BadParameter(f"{output} must end in .csv or .png", param_hint="-o")
    angles = numbers(theta, option="--theta")
    if not all(0.0 <= t < 90.0 for t in angles):
        raise typer.BadParameter("angles in 0 <= theta < 90 degrees are wanted", param_hint="--theta")
    with session(quiet=quiet):
        import numpy as np

        from specularia.files import writable
        from specularia.glass import film_spread, read_slab
        from specularia.glass.colour import OBSERVER, WAVELENGTHS_NM, lab

        if output is not None:
            writable(output)
        slab = read_slab(glass)
        medium = slab.medium
        found = film_spread(
            theta_deg=angles,
            index=np.array([medium.index_at(float(w)) for w in WAVELENGTHS_NM]),
            absorption_per_mm=np.array([medium.absorption_at(float(w)) for w in WAVELENGTHS_NM]),
            thickness_mm=slab.thickness_mm,
            front=slab.front.film,
            back=slab.back.film,
            laser=(wavelength, medium.index_at(wavelength), medium.absorption_at(wavelength)),
            illuminant=illuminant,
        )
        names = ("tau_laser", "tau_visible", "tau_range", "rho_laser", "rho_visible", "rho_range")
        payload: dict[str, Any] = {"theta_deg": found.theta_deg, "laser_nm": wavelength}
        payload |= {name: getattr(found, name) for name in (*names, "tau_xyz", "rho_xyz")}
        payload |= {"tau_lab": lab(found.tau_xyz), "rho_lab": lab(found.rho_xyz)}
        payload |= {"illuminant": f"CIE {illuminant}", "observer": OBSERVER, "relief": "left out"}
        rows = [
            [float(t), *(float(v) for name in names for v in np.atleast_1d(getattr(found, name)[k]))]
            for k, t in enumerate(found.theta_deg)
        ]
        header = ["theta_i"]
        for what in ("tau", "rho"):
            header += [f"{what} {wavelength:g} nm", "visible", "least", "greatest"]
        lines = table(header, rows)
        if output is not None:
            from specularia.report.figures.film import film_figure, write_film

            written = [output.with_suffix(".csv")]
            if output.suffix.lower() == ".png":
                written = [film_figure(found, output, synthetic=slab.synthetic), *written]
            else:
                write_film(found, output)
            payload["written"] = [str(p.resolve()) for p in written]
            lines += [f"written: {p}" for p in written]
        emit(payload, as_json=as_json, lines=lines)
