"""Commands of `specularia surface`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, cast

import typer

from specularia.cli._common import Json, Quiet, Seed, emit, numbers, session, table

app = typer.Typer(no_args_is_help=True, help="Height maps: what they hold, from focus stacks, healed.")

SURFACE_FILE = "A surface file: .plu, .al3d, .sur, .x3p, .opd, .nms, .sdf, .nc, .npy, .csv and others."
Map = Annotated[Path, typer.Argument(metavar="MAP", help=SURFACE_FILE)]


def _netcdf(path: Path) -> Path:
    if path.suffix.lower() != ".nc":
        raise typer.BadParameter(f"{path} must end in .nc")
    return path


Output = Annotated[
    Path,
    typer.Option("-o", "--output", metavar="MAP.nc", callback=_netcdf, help="The height map to write."),
]


def _is_picture(path: Path) -> None:
    if path.suffix.lower() not in (".png", ".tif", ".tiff", ".jpg", ".jpeg"):
        raise typer.BadParameter(f"{path} must end in .png, .tif or .jpg")


Unit = Annotated[str | None, typer.Option("--unit", help="Unit of a file that names none: m, mm, um or nm.")]
Pitch = Annotated[float | None, typer.Option("--pitch", help="Pixel size in um, for a file that holds none.")]


Stack = Annotated[
    Path,
    typer.Argument(metavar="STACK", help="A multi-page TIFF, an OME-TIFF, an .npy or a folder of pictures."),
]
Window = Annotated[
    float,
    typer.Option("--window", help="Photographs: pixels (standard deviation) that sharpness is judged over."),
]


@app.command()
def info(
    path: Map, pitch: Pitch = None, unit: Unit = None, as_json: Json = False, quiet: Quiet = False
) -> None:
    """What a surface file holds: grid, field, span of heights, missing pixels, roughness."""
    from specularia.surface import describe

    with session(quiet=quiet):
        payload = describe(path, pitch_um=pitch, unit=unit).payload()
    shown = {k: v for k, v in payload.items() if k != "warnings"}
    shown["shape"] = "{} rows x {} columns".format(*payload["shape"])  # type: ignore[misc]
    emit(payload, as_json=as_json, lines=table((str(path), ""), list(shown.items())))


Levelling = Annotated[
    str,
    typer.Option(
        "--level",
        metavar="METHOD",
        help="Form to take off first: none, plane, polynomial[:DEGREE] or robust[:DEGREE].",
    ),
]


def _levelling(text: str) -> tuple[str, int | None]:
    method, _, order = text.partition(":")
    if method not in ("none", "plane", "polynomial", "robust") or (order and not order.isdigit()):
        raise typer.BadParameter(
            f"{text!r} is not none, plane, polynomial[:N] or robust[:N]", param_hint="--level"
        )
    return method, int(order) if order else None


@app.command()
def texture(
    path: Map,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="DIR", help="A folder for figures and tables.")
    ] = None,
    levelling: Levelling = "plane",
    exaggeration: Annotated[
        float | None, typer.Option("--exaggeration", min=0.0, help="Of the heights in the shaded relief.")
    ] = None,
    pitch: Pitch = None,
    unit: Unit = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """What a surface is: height, slope, spacing and ratio parameters of ISO 25178-2, spectra, figures."""
    from specularia import surface
    from specularia.report.texture import write_texture

    method, order = _levelling(levelling)
    with session(quiet=quiet):
        flat = surface.levelled(surface.read(path, pitch_um=pitch, unit=unit), method=method, order=order)
        found = surface.texture(flat, method="none")
        files = [] if output is None else write_texture(flat, found, output, exaggeration=exaggeration)
    payload = {"levelling": levelling, **found.payload(), "files": [str(f) for f in files]}
    shown = {k: v for k, v in payload.items() if k != "files"}
    emit(payload, as_json=as_json, lines=table((str(path), ""), list(shown.items())))


@app.command()
def export(
    path: Map,
    output: Annotated[
        Path,
        typer.Option(
            "-o", "--output", metavar="FILE", help=".x3p, .nc, or .obj, .ply or .stl for a closed slab in um."
        ),
    ],
    back: Annotated[
        Path | None,
        typer.Option("--back", metavar="MAP", help="Mesh: the back's map; without it a flat back."),
    ] = None,
    thickness: Annotated[
        float | None,
        typer.Option("--thickness", help="Mesh: mm between the mean planes of front and back."),
    ] = None,
    every: Annotated[int, typer.Option("--every", min=1, help="Mesh: take every N-th pixel.")] = 1,
    levelling: Levelling = "none",
    pitch: Pitch = None,
    unit: Unit = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """A height map for other programs: X3P, netCDF, or a closed mesh of a slab."""
    from specularia import surface
    from specularia.files import writable

    method, order = _levelling(levelling)
    mesh = output.suffix.lower() in surface.MESHES
    if mesh and thickness is None:
        raise typer.BadParameter("a closed mesh needs it, in mm", param_hint="--thickness")
    if not mesh and (back is not None or thickness is not None or every != 1):
        raise typer.BadParameter("--back, --thickness and --every belong to .obj, .ply and .stl")
    with session(quiet=quiet):
        writable(output)
        maps = [
            surface.levelled(surface.read(p, pitch_um=pitch, unit=unit), method=method, order=order)
            for p in (path, back)
            if p is not None
        ]
        surface.export(
            maps[0],
            output,
            back=maps[1] if back is not None else None,
            thickness_um=None if thickness is None else 1000.0 * thickness,
            every=every,
        )
    payload = {"path": str(output.absolute()), "bytes": output.stat().st_size, "shape": list(maps[0].shape)}
    emit(payload, as_json=as_json, lines=[f"{output}: {payload['bytes']} bytes"])


@app.command()
def heights(
    stack: Stack,
    output: Output,
    pitch: Annotated[
        float | None, typer.Option("--pitch", help="Pixel size in um; overrides the file's.")
    ] = None,
    step: Annotated[
        float | None,
        typer.Option("--step", help="Step between slices in um, out of the glass; overrides the file's."),
    ] = None,
    first_row: Annotated[
        str | None,
        typer.Option("--first-row", metavar="bottom|top", help="Whether row 0 of a picture is its lowest y."),
    ] = None,
    kind: Annotated[
        str,
        typer.Option(
            "--kind",
            metavar="auto|confocal|contrast",
            help="Confocal brightness, or contrast of photographs.",
        ),
    ] = "auto",
    remove: Annotated[
        str,
        typer.Option(
            "--remove", metavar="LIST", help="What to take off: tilt,bow,vibration or some of them."
        ),
    ] = "",
    max_slope: Annotated[
        float | None, typer.Option("--max-slope", help="Degrees from which a pixel is flagged as steep.")
    ] = None,
    window: Window = 3.0,
    image: Annotated[
        Path | None,
        typer.Option(
            "--picture", metavar="FILE", help="Also write the picture in focus, its top the highest y."
        ),
    ] = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """A focus stack to a height map with the uncertainty and the flags of each pixel.

    Work that was cut off goes on where it was, when the command is given again.
    """
    import json

    from specularia import surface
    from specularia.files import writable
    from specularia.report.texture import write_picture

    if first_row not in (None, "bottom", "top"):
        raise typer.BadParameter("is 'bottom' or 'top'", param_hint="--first-row")
    if kind not in ("auto", "confocal", "contrast"):
        raise typer.BadParameter("is 'auto', 'confocal' or 'contrast'", param_hint="--kind")
    wanted = [word.strip() for word in remove.split(",") if word.strip()]
    if not set(wanted) <= {"tilt", "bow", "vibration"}:
        raise typer.BadParameter(f"{remove!r} is not a list of tilt, bow, vibration", param_hint="--remove")
    if image is not None:
        _is_picture(image)
    with session(quiet=quiet):
        writable(output)
        if image is not None:
            writable(image)
        taken = surface.read_stack(stack, pitch_um=pitch, step_um=step, first_row=first_row)
        made = surface.heights(
            taken, kind=kind, remove=wanted, max_slope_deg=max_slope, window_px=window, output=output
        )
        if image is not None and made.image is not None:
            write_picture(made.image[::-1], image, str(taken.frames.dtype))
    x, y = taken.pitch_um
    payload = {
        "pitch_um": x if x == y else [x, y],
        "step_um": taken.step_um,
        "shape": list(made.shape),
        "missing": made.missing,
        "missing_because": json.loads(made.attributes["missing_because"]),
        "flagged": json.loads(made.attributes["flagged"]),
        "range_um": made.range_um,
        "rms_sigma_um": surface.rms_sigma(made),
        "removed": made.attributes.get("removed", ""),
    }
    lines = [
        f"{output}: {made.shape[0]} rows x {made.shape[1]} columns of {x:g} x {y:g} um, "
        f"{taken.slices} slices",
        f"heights span {made.range_um:.4g} um, rms sigma {payload['rms_sigma_um']:.3g} um, "
        f"{made.missing} missing",
    ]
    emit(payload, as_json=as_json, lines=lines)


@app.command()
def picture(
    stack: Stack,
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="PICTURE", help="A .png, .tif or .jpg to write.")
    ],
    window: Window = 3.0,
    register: Annotated[
        bool,
        typer.Option("--register/--as-is", help="Lay the frames over each other first, or take them as is."),
    ] = True,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """One picture in focus everywhere from photographs through focus."""
    from specularia import surface
    from specularia.report.texture import write_picture

    _is_picture(output)
    with session(quiet=quiet):
        made, kind = surface.all_in_focus(stack, window_px=window, register=register)
        write_picture(made, output, kind)
    payload = {"path": str(output.absolute()), "shape": list(made.shape), "type": kind}
    emit(payload, as_json=as_json, lines=[f"{output}: {made.shape[0]} rows x {made.shape[1]} columns"])


@app.command()
def heal(
    path: Map,
    output: Output,
    pitch: Pitch = None,
    unit: Unit = None,
    method: Annotated[
        str,
        typer.Option(
            "--method",
            metavar="field|flat|gaussian|closing",
            help="field, or for comparison a plane, ISO 16610-71, a morphological closing.",
        ),
    ] = "field",
    ensemble: Annotated[
        int, typer.Option("--ensemble", min=0, max=1000, help="Possible original surfaces to draw.")
    ] = 12,
    seed: Seed = 0,
    reach: Annotated[
        float | None,
        typer.Option("--reach", min=0.0, help="Cut-off of gaussian, radius of closing, um; from the map."),
    ] = None,
    image: Annotated[
        Path | None,
        typer.Option(
            "--image",
            help="The same field under white light, in focus everywhere: what is dark there is no plateau.",
        ),
    ] = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """The surface without its deterioration, and an ensemble of what it may have been.

    Plateaux between the pits are found and a random field is drawn through them. The file holds the most
    probable surface, the members, and masks of the pits and of places without evidence.
    """
    from specularia import provenance, surface
    from specularia.files import writable
    from specularia.surface.healing import Method

    if method not in surface.METHODS:
        raise typer.BadParameter(f"is one of {', '.join(surface.METHODS)}", param_hint="--method")
    with session(quiet=quiet):
        writable(output)
        given = surface.read(path, pitch_um=pitch, unit=unit)
        healed = surface.heal(
            given,
            method=cast(Method, method),
            ensemble=ensemble,
            seed=seed,
            reach_um=reach or None,
            picture=None if image is None else surface.read_picture(image),
        )
        source = provenance.record(
            what=f"healed height map of {path.name}",
            inputs=[path, *([image] if image else [])],
            parameters=healed.parameters,
            seed=seed,
            synthetic="synthetic" in given.attributes,
        )
        surface.write_healed(healed, output, source)
    payload = {
        "method": healed.method,
        "pit_coverage": healed.pit_coverage,
        "Sdq_before": healed.Sdq_before,
        "Sdq_after": healed.Sdq_after,
        "Sdq_members_90": healed.Sdq_interval,
        "no_evidence": healed.no_evidence_share,
        "members": len(healed.members),
        "parameters": healed.parameters,
    }
    lines = [
        f"{output}: pits cover {healed.pit_coverage:.1%} of the surface",
        f"rms slope Sdq {healed.Sdq_before:.4g} before, {healed.Sdq_after:.4g} after",
    ]
    if healed.Sdq_interval is not None:
        low, high = healed.Sdq_interval
        lines.append(f"{len(healed.members)} possible surfaces: rms slope {low:.4g} to {high:.4g} (90 %)")
    if healed.method == "field":
        lines.append(f"without evidence of the original height: {healed.no_evidence_share:.1%}")
    emit(payload, as_json=as_json, lines=lines)


@app.command()
def denoise(
    path: Map,
    output: Output,
    noise: Annotated[
        float | None,
        typer.Option(
            "--noise-um",
            help="Standard deviation of the noise; without it what the file says of each height.",
        ),
    ] = None,
    pitch: Pitch = None,
    unit: Unit = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """The map without the noise of its microscope, wherever that noise stands out from the relief.

    Noise of some nanometres from pixel to pixel tilts every facet, and rays take it for relief.
    """
    from specularia import surface

    with session(quiet=quiet):
        noisy = surface.read(path, pitch_um=pitch, unit=unit)
        made = surface.denoise(noisy, noise_um=noise)
        before, after = surface.roughness(noisy), surface.roughness(made.surface)
        surface.write(made.surface, output)
    payload = {
        "noise_um": made.noise_um,
        "removed_um": made.removed_um,
        "smoothed_share": made.smoothed_share,
        "rms_sigma_um": surface.rms_sigma(made.surface),
        "Sdq_before": before.Sdq,
        "Sdq_after": after.Sdq,
    }
    lines = [
        f"{output}: {made.removed_um:.3g} um rms taken off, of {made.noise_um:.3g} um of noise; "
        f"{made.smoothed_share:.1%} of the pixels changed",
        f"rms slope Sdq {before.Sdq:.4g} before, {after.Sdq:.4g} after; "
        f"rms sigma {payload['rms_sigma_um']:.3g} um",
    ]
    emit(payload, as_json=as_json, lines=lines)


@app.command()
def cutoff(
    path: Map,
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="DIR", help="Folder for the figure and its numbers.")
    ],
    back: Annotated[
        Path | None, typer.Option("--back", metavar="MAP", help="Map of the other face; flat if left out.")
    ] = None,
    theta: Annotated[str, typer.Option("--theta", help="Angles of incidence, degrees.")] = "0,60",
    cutoffs: Annotated[
        str | None, typer.Option("--cutoffs", help="Cut-off wavelengths in um; a ladder if left out.")
    ] = None,
    index: Annotated[float, typer.Option("--index", min=1.0, max=3.0, help="Refractive index.")] = 1.52,
    thickness: Annotated[float, typer.Option("--thickness", help="Of the pane, mm.")] = 3.0,
    wavelength: Annotated[float, typer.Option("--wavelength", help="Of the light, nm.")] = 520.0,
    paths: Annotated[int, typer.Option("--paths", min=1000, help="Per angle and cut-off.")] = 200_000,
    seed: Seed = 0,
    pitch: Pitch = None,
    unit: Unit = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Transmission and lobe width over the low-pass cut-off of the relief, with the limit of rays marked."""
    from specularia import analysis, surface
    from specularia.files import make_folder
    from specularia.report import figures

    angles = numbers(theta, option="--theta")
    steps = None if cutoffs is None else numbers(cutoffs, option="--cutoffs")
    with session(quiet=quiet):
        front = surface.read(path, pitch_um=pitch, unit=unit)
        other = None if back is None else surface.read(back, pitch_um=pitch, unit=unit)
        make_folder(output)
        found = analysis.cutoff(
            front,
            other,
            cutoffs_um=steps,
            theta_deg=angles,
            index=index,
            thickness_mm=thickness,
            paths=paths,
            seed=seed,
            wavelength_nm=wavelength,
        )
        synthetic = any("synthetic" in m.attributes for m in (front, other) if m is not None)
        picture = figures.cutoff(found, output / "cutoff.png", synthetic=synthetic)
    payload = {
        **found.payload(),
        "figure": str(picture.resolve()),
        "numbers": str(picture.with_suffix(".csv").resolve()),
    }
    header = ["cut-off (um)", *(f"Sdq {f}" for f in found.faces), *(f"beyond {f}" for f in found.faces)]
    header += [f"{what} at {t:g}" for t in found.theta_deg for what in ("tau", "FWHM")]
    rows = []
    for i, step in enumerate(found.cutoff_um):
        row: list[object] = [
            float(step) if step else "none",
            *map(float, found.Sdq[i]),
            *map(float, found.beyond[i]),
        ]
        for j in range(found.theta_deg.size):
            row += [float(found.tau[i, j]), float(found.fwhm_deg[i, j])]
        rows.append(row)
    shares = ", ".join(f"{f} {b:.1%}" for f, b in zip(found.faces, found.beyond_limit))
    lines = [
        *table(header, rows),
        f"rays are wrong for waves below {found.limit_um:.3g} um; slope variance there: {shares}",
        f"figure: {picture}",
    ]
    emit(payload, as_json=as_json, lines=lines)
