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

__all__ = ["colour_of_model", "colour_of_pane", "colours", "film", "wave"]


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


def wave(
    glass: Annotated[
        Path | None,
        typer.Argument(metavar="[GLASS.toml]", help="The pane; may be left out with --sizes alone."),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="OUT.npz: edges, dsf, dsf_se, and rays where they are compared."),
    ] = None,
    theta: Annotated[
        float, typer.Option("--theta", min=0.0, max=89.9, help="Incident angle in degrees.")
    ] = 0.0,
    phi: Annotated[
        float, typer.Option("--phi", min=-360.0, max=360.0, help="Incident azimuth in degrees.")
    ] = 0.0,
    wavelength: Annotated[
        str, typer.Option("--wavelength", help="In nm: one, or A,B,... of equal weight.")
    ] = "520",
    cells: Annotated[int, typer.Option("--cells", min=8, max=1024, help="Along ux and uy, over -1..1.")] = 64,
    members: Annotated[
        int,
        typer.Option("--members", min=1, help="Windows at other places, where the pane has no short period."),
    ] = 4,
    window: Annotated[float, typer.Option("--window", min=1.0, help="Size of the window in um.")] = 1000.0,
    pitch: Annotated[
        float | None, typer.Option("--pitch", min=1e-3, help="Of the wave in um (half a wavelength).")
    ] = None,
    compare: Annotated[bool, typer.Option("--compare", help="Trace the pane too, and compare.")] = False,
    paths: Annotated[int, typer.Option("--paths", min=1, help="Of the rays in a comparison.")] = 400_000,
    sizes: Annotated[
        str | None,
        typer.Option(
            "--sizes", help="Lateral sizes in um, A,B,...: compare both on faces of synthetic caps of each."
        ),
    ] = None,
    edge_slope: Annotated[
        float, typer.Option("--edge-slope", min=0.01, max=2.0, help="With --sizes: at the rim of the caps.")
    ] = 0.6,
    seed: Seed = 0,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """The transmitted distribution by scalar diffraction: an independent model, as referee of the rays.

    It states from which lateral size on rays and waves agree, and how far they are apart on a pane.
    """
    if glass is None and sizes is None:
        raise typer.BadParameter("name a GLASS.toml, or ask for --sizes", param_hint="GLASS.toml")
    if output is not None and (output.suffix.lower() != ".npz" or glass is None):
        raise typer.BadParameter("the distribution of a pane is written as .npz", param_hint="-o")
    wavelengths = numbers(wavelength, option="--wavelength")
    if not all(50.0 <= w <= 1e5 for w in wavelengths):
        raise typer.BadParameter("wavelengths in nm are wanted", param_hint="--wavelength")
    steps = None if sizes is None else sorted(numbers(sizes, option="--sizes"))
    with session(quiet=quiet):
        from specularia.files import writable

        if output is not None:
            writable(output)
        payload: dict[str, Any] = {}
        lines: list[str] = []
        if glass is not None:
            told, rows = _waves_of_pane(
                glass,
                output,
                compare=compare,
                settings={
                    "theta_deg": theta,
                    "phi_deg": phi,
                    "wavelengths_nm": wavelengths,
                    "members": members,
                    "window_um": window,
                    "pitch_um": pitch,
                    "seed": seed,
                },
                cells=cells,
                paths=paths,
            )
            payload |= told
            lines += rows
        if steps is not None:
            from specularia.glass import size_agreement

            found = size_agreement(
                steps, edge_slope=edge_slope, wavelength_nm=wavelengths[0], cell=2.0 / cells, seed=seed
            )
            limit = found.agree_above_um()
            payload["sizes"] = {
                "size_um": found.size_um,
                "l1": found.l1,
                "noise": found.noise,
                "cell": found.cell,
                "edge_slope": edge_slope,
                "wavelength_nm": found.wavelength_nm,
                "faces": "caps of spheres, synthetic",
                "agree_within_5_percent_above_um": limit if limit < float("inf") else None,
            }
            rows_of = [
                [float(a), float(b), float(c)] for a, b, c in zip(found.size_um, found.l1, found.noise)
            ]
            lines += [
                "",
                f"Rays and waves on synthetic caps, rim slope {edge_slope:g}, cells {found.cell:.3g}:",
            ]
            lines += table(["size um", "L1", "its noise"], rows_of)
            verdict = f"from {limit:g} um on" if limit < float("inf") else "at none of these sizes"
            lines.append(f"L1 <= 5 %: {verdict}")
        emit(payload, as_json=as_json, lines=lines)


def _waves_of_pane(
    glass: Path,
    output: Path | None,
    *,
    compare: bool,
    settings: dict[str, Any],
    cells: int,
    paths: int,
) -> tuple[dict[str, Any], list[str]]:
    """The far field of a pane, compared with rays where that is asked for, and written."""
    from specularia.glass import agreement, read_slab
    from specularia.glass import wave as far_field
    from specularia.report.style import write_npz

    slab = read_slab(glass, seed=settings["seed"])
    far = far_field(slab, cells=cells, **settings)
    payload: dict[str, Any] = {
        "theta_deg": settings["theta_deg"],
        "phi_deg": settings["phi_deg"],
        "wavelength_nm": far.wavelength_nm,
        "specular": far.specular,
        "evanescent": far.evanescent,
        "members": far.members,
        "pitch_um": list(far.pitch_um),
        "window_um": list(far.window_um),
        "soft_edges": far.tapered,
        "synthetic": slab.synthetic,
    }
    lines = [
        f"undeflected order {far.specular:.4g}, does not leave {far.evanescent:.3g}",
        f"window {far.window_um[0]:.4g} x {far.window_um[1]:.4g} um at {far.pitch_um[0]:.3g} um, "
        + (f"{far.members} places, soft edges" if far.tapered else "a whole number of periods"),
    ]
    arrays = {"edges": far.edges, "dsf": far.dsf, "dsf_se": far.dsf_se}
    if compare:
        found = agreement(slab, cell=2.0 / cells, paths=paths, **settings)
        payload["rays"] = {
            "l1": found.l1,
            "noise": found.noise,
            "cell": found.cell,
            "half_width": found.half_width,
            "beyond_waves": found.beyond[0],
            "beyond_rays": found.beyond[1],
            "reflected_inside": found.reflected_inside,
        }
        lines.append(f"rays: L1 {found.l1:.3g} (noise {found.noise:.2g}) in cells of {found.cell:.3g}")
        arrays |= {
            "compared_edges": found.far_field.edges,
            "compared_dsf": found.far_field.dsf,
            "rays": found.rays,
            "rays_se": found.rays_se,
        }
    if output is not None:
        write_npz(output, arrays)
        payload["written"] = [str(output.resolve())]
        lines.append(f"written: {output}")
    return payload, lines
