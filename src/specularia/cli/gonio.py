"""Commands of `specularia gonio`."""

from __future__ import annotations

import warnings
from dataclasses import asdict
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from specularia.cli._common import Cull, Json, Quiet, Resolution, emit, session, table

if TYPE_CHECKING:
    from specularia.bsdf import TabulatedModel, XmlModel
    from specularia.gonio import Summary, Table
    from specularia.gonio.cross_validation import HeldOut
    from specularia.gonio.peer import Peer

app = typer.Typer(no_args_is_help=True, help="Measured scattering: gonio-photometer tables and Model M.")

Files = Annotated[
    list[Path],
    typer.Argument(
        help="Measured tables: pab-opto (also raw exports), VIAVI text, or CSV with named columns.",
        show_default=False,
    ),
]


class QuantityName(StrEnum):
    """What the values of a table may be."""

    DSF = "DSF"
    BSDF = "BSDF"


class SideName(StrEnum):
    """Where the scattered light of a table may go."""

    transmission = "transmission"
    reflection = "reflection"


class BandName(StrEnum):
    """Columns of a table with three of them."""

    x = "CIE-X"
    y = "CIE-Y"
    z = "CIE-Z"


class Method(StrEnum):
    """Who makes the model."""

    own = "own"
    radiance = "radiance"


class Symmetry(StrEnum):
    """What the sample may be turned or mirrored by."""

    auto = "auto"
    isotropic = "isotropic"
    bilateral = "bilateral"
    none = "none"


class Basis(StrEnum):
    """Trees of an XML file."""

    tensor3 = "tensor3"
    tensor4 = "tensor4"


class Reflection(StrEnum):
    """What stands for the light that the sample sends back."""

    measured = "measured"
    fresnel = "fresnel"
    none = "none"


Quantity = Annotated[
    QuantityName | None,
    typer.Option("--quantity", case_sensitive=False, help="What the values are, against what the files say."),
]
Side = Annotated[
    SideName | None,
    typer.Option(
        "--side",
        case_sensitive=False,
        help="Which side was measured, against the rule that theta_s < 90 is the side of the light.",
    ),
]
Wavelength = Annotated[
    float | None,
    typer.Option("--wavelength", min=200.0, max=20000.0, help="Of the light, nm; else the band is Visible."),
]
Band = Annotated[
    BandName | None,
    typer.Option("--band", case_sensitive=False, help="Of tables with three columns; CIE-Y is the default."),
]
BeamFile = Annotated[
    Path | None,
    typer.Option(
        "--beam", help="A scan of the bare beam: the tables are raw signals, made absolute DSF by it."
    ),
]
Masks = Annotated[
    list[str] | None,
    typer.Option(
        "--mask",
        metavar="PHI,PHI,THETA",
        help="The shadow of the mount: azimuths of scattered light from one to the other, and the angle from "
        "the normal where it starts, degrees; may be given several times.",
    ),
]


@app.command()
def info(
    files: Files,
    quantity: Quantity = None,
    side: Side = None,
    wavelength: Wavelength = None,
    band: Band = None,
    beam: BeamFile = None,
    mask: Masks = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """What each table holds: quantity, side, incident direction, points, integral, oddities."""
    _check_words(quantity, beam)
    masks = _masks(mask)
    with session(quiet=quiet):
        from specularia import gonio
        from specularia.errors import SpeculariaWarning

        summaries = gonio.summarise_all(_tables(files, quantity, side, wavelength, band, beam), masks=masks)
        odd = [
            f"{name.replace('_', ' ')}: {note}."
            for name in dict.fromkeys(s.table.side for s in summaries)
            for note in gonio.check_set([s for s in summaries if s.table.side == name])
        ]
        for note in odd:
            warnings.warn(note, SpeculariaWarning, stacklevel=1)
        rows = [
            [
                s.table.label,
                s.table.quantity,
                s.table.kind,
                s.table.theta_i_deg,
                s.table.phi_i_deg,
                s.points,
                s.negative,
                s.coverage,
                s.tau,
                s.tau_se,
                s.tau_systematic,
            ]
            for s in summaries
        ]
        header = ["file", "quantity", "side", "theta_i", "phi_i"]
        header += ["points", "negative", "coverage", "tau/rho", "se", "sys"]
        payload = {"files": [_entry(s) for s in summaries], "warnings": odd}
        emit(payload, as_json=as_json, lines=table(header, rows))


@app.command()
def fit(
    files: Files,
    output: Annotated[
        list[Path],
        typer.Option(
            "-o", "--output", help="OUT.nc, the model itself, or OUT.xml, for Radiance; may be given twice."
        ),
    ],
    quantity: Quantity = None,
    side: Side = None,
    wavelength: Wavelength = None,
    band: Band = None,
    beam: BeamFile = None,
    mask: Masks = None,
    method: Annotated[
        Method,
        typer.Option(
            "--method",
            help="Who makes OUT.xml: this program, or Radiance's pabopto2bsdf and bsdf2ttree from the same "
            "tables; OUT.nc is always this program's.",
        ),
    ] = Method.own,
    symmetry: Annotated[
        Symmetry,
        typer.Option(
            "--symmetry",
            help="Of the sample; auto is isotropic for one azimuth of incidence at each angle, else what the "
            "azimuths say.",
        ),
    ] = Symmetry.auto,
    reflection: Annotated[
        Reflection,
        typer.Option(
            "--reflection",
            help="As measured; that of a flat clear slab where it was not measured; or left out.",
        ),
    ] = Reflection.measured,
    index: Annotated[
        float,
        typer.Option(
            "--index", min=1.01, max=3.0, help="Index of refraction of the slab of --reflection fresnel."
        ),
    ] = 1.52,
    cross_validate: Annotated[
        bool, typer.Option("--cross-validate", help="Leave out each inner angle in turn and predict it.")
    ] = False,
    level: Annotated[
        float, typer.Option("--level", min=0.5, max=0.999, help="Probability that intervals are made for.")
    ] = 0.95,
    figures: Annotated[
        Path | None,
        typer.Option("--figures", metavar="DIR", help="Folder for figures, each with its numbers beside it."),
    ] = None,
    basis: Annotated[
        Basis | None,
        typer.Option(
            "--basis",
            help="XML: trees of rank 3 (one azimuth of incidence) or 4; without it what the sample needs.",
        ),
    ] = None,
    resolution: Resolution = 6,
    cull: Cull = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Make the measurement-based model (Model M) of tables measured on one sample."""
    _check_words(quantity, beam)
    masks = _masks(mask)
    _check_outputs(output, method, basis, reflection, resolution)
    with session(quiet=quiet):
        from specularia import bsdf, gonio
        from specularia.files import make_folder, writable

        for path in output:
            writable(path)
        if figures is not None:
            make_folder(figures)
        tables = _tables(files, quantity, side, wavelength, band, beam)
        if reflection is not Reflection.measured:
            tables = _without_reflection(tables, reflection)
        alike = symmetry in (Symmetry.auto, Symmetry.isotropic)
        summaries = gonio.summarise_all(tables, masks=masks, isotropic=alike)
        model = gonio.fit(tables, summaries=summaries, symmetry=symmetry.value, masks=masks)
        measured_sides = list(model.tables)
        if reflection is Reflection.fresnel:
            from specularia.gonio.slab_reflection import with_slab_reflection

            model = with_slab_reflection(model, index=index)
        results = {name: _side_result(model, name, summaries, level) for name in measured_sides}
        peer = None
        for path in output:
            if path.suffix.lower() == ".nc":
                bsdf.write_model(model, path)
                continue
            written: XmlModel
            if method is Method.radiance:
                peer = _by_radiance(summaries, path, resolution, cull, isotropic=model.isotropic)
                written = peer.model
            else:
                made = bsdf.write(
                    model, path, resolution=resolution, cull=cull, basis=basis.value if basis else None
                )
                written = made.model  # type: ignore[assignment]
            for name, result in results.items():
                _add_xml(result, written, name, model if peer else None)
        held = gonio.cross_validate(summaries, model, level=level) if cross_validate else []
        drawn = _draw(figures, model, results, held, peer, level) if figures else []
        _emit_fit(model, results, summaries, output, held, peer, drawn, as_json=as_json)


def _check_words(quantity: QuantityName | None, beam: Path | None) -> None:
    if quantity is not None and beam is not None:
        raise typer.BadParameter(
            "a scan of the beam makes the values DSF; leave --quantity out", param_hint="--quantity"
        )


def _masks(texts: list[str] | None) -> list[Any]:
    if not texts:
        return []
    from specularia.errors import PhysicsError
    from specularia.gonio import Mask

    try:
        return [Mask.parse(text) for text in texts]
    except PhysicsError as error:
        raise typer.BadParameter(str(error), param_hint="--mask") from error


def _check_outputs(
    output: list[Path], method: Method, basis: Basis | None, reflection: Reflection, resolution: int
) -> None:
    wrong = [p for p in output if p.suffix.lower() not in (".nc", ".xml")]
    if wrong:
        raise typer.BadParameter(f"{wrong[0]} must end in .nc or .xml", param_hint="-o")
    xml = [p for p in output if p.suffix.lower() == ".xml"]
    if method is Method.radiance:
        if not xml:
            raise typer.BadParameter(
                "Radiance's programs write .xml; name one with -o", param_hint="--method"
            )
        if basis is not None:
            raise typer.BadParameter(
                "Radiance's programs choose the rank by the tables' azimuths", param_hint="--basis"
            )
        if reflection is Reflection.fresnel:
            raise typer.BadParameter(
                "Radiance's programs take measured reflection only", param_hint="--reflection"
            )
    if basis is Basis.tensor4 and resolution > 7:
        raise typer.BadParameter("trees of rank 4 go up to 7", param_hint="--resolution")


def _tables(
    files: list[Path],
    quantity: QuantityName | None,
    side: SideName | None,
    wavelength: float | None,
    band: BandName | None,
    beam: Path | None,
) -> list[Table]:
    from specularia import gonio

    scan = gonio.read_beam(beam) if beam is not None else None
    found: list[Table] = []
    for path in files:
        found += gonio.read(
            path,
            quantity=quantity.value if quantity else None,
            side=side.value if side else None,
            wavelength_nm=wavelength,
            band=band.value if band else None,
            beam=scan,
        )
    return found


def _without_reflection(tables: list[Table], reflection: Reflection) -> list[Table]:
    """The tables of transmission; those of reflection stay where the slab only stands in for missing ones."""
    if reflection is Reflection.fresnel:
        return tables
    from specularia.errors import CoverageError

    kept = [t for t in tables if t.kind == "transmission"]
    if not kept:
        raise CoverageError("--reflection none leaves nothing: these tables hold reflection only.")
    return kept


def _by_radiance(
    summaries: list[Summary], path: Path, resolution: int, cull: float | None, *, isotropic: bool
) -> Peer:
    from specularia.gonio.peer import fit_with_radiance

    return fit_with_radiance(summaries, path, resolution=resolution, cull=cull, isotropic=isotropic)


def _add_xml(result: dict[str, Any], written: XmlModel, side: str, own: TabulatedModel | None) -> None:
    """tau of the written file at the measured angles; of Radiance's also how it differs from ours."""
    from specularia import bsdf

    theta, phi = result["theta_deg"], result["phi_deg"]
    result["xml"] = written.direct_hemispherical(side, theta, phi)
    if own is None:
        return
    result["radiance"] = result["xml"]
    rows = [
        bsdf.compare(own, written, theta_deg=[t], phi_deg=float(p), side=side)[0] for t, p in zip(theta, phi)
    ]
    for name in ("l1", "peak_ratio", "fwhm_ratio"):
        result[f"radiance_{name}"] = [getattr(r, name) for r in rows]


def _draw(
    folder: Path,
    model: TabulatedModel,
    results: dict[str, dict[str, Any]],
    held: list[HeldOut],
    peer: Peer | None,
    level: float,
) -> list[Path]:
    from specularia.report.figures.measured_model import held_out, tau_with_interval

    synthetic = "synthetic" in model.attributes
    drawn = [
        tau_with_interval(
            model,
            name,
            folder / f"{name}.png",
            theta_deg=r["theta_deg"],
            measured=r["measured"],
            error=r["measured_se"],
            level=level,
            peer=peer.model if peer else None,
            synthetic=synthetic,
        )
        for name, r in results.items()
    ]
    if held:
        drawn.append(held_out(held, folder / "cross_validation.png", synthetic=synthetic))
    return drawn


_COLUMNS = {
    "theta_deg": "theta",
    "phi_deg": "phi",
    "measured": "measured",
    "measured_se": "se",
    "tau_systematic": "sys",
    "model": "model",
    "interval_low": "low",
    "interval_high": "high",
    "xml": "xml",
    "radiance_l1": "L1 r/m",
    "radiance_peak_ratio": "peak r/m",
    "radiance_fwhm_ratio": "fwhm r/m",
}
"""Columns of the table of a side, with their headings."""


def _emit_fit(
    model: TabulatedModel,
    results: dict[str, dict[str, Any]],
    summaries: list[Summary],
    output: list[Path],
    held: list[HeldOut],
    peer: Peer | None,
    drawn: list[Path],
    *,
    as_json: bool,
) -> None:
    lines = [f"band {model.band}, written to {', '.join(str(p) for p in output)}"]
    for name, result in results.items():
        columns = [k for k in _COLUMNS if k in result and (k != "phi_deg" or not model.isotropic)]
        heading = {**_COLUMNS, "xml": "radiance" if peer else "xml"}
        rows = [[float(v) for v in row] for row in zip(*(result[k] for k in columns))]
        lines += ["", name.replace("_", " "), *table([heading[k] for k in columns], rows)]
        lines.append(f"extrapolated beyond {result['extrapolated_beyond_deg']:g} degrees")
    if held:
        lines += ["", *_held_lines(held)]
    origins = {s: model.origin(s) for s in model.sides}
    lines += ["", *(f"{s.replace('_', ' ')}: {origin}" for s, origin in origins.items())]
    lines += [f"figure: {p}" for p in drawn]
    first = "transmission_front" if "transmission_front" in results else next(iter(results))
    payload: dict[str, Any] = {
        **results[first],
        "band": model.band,
        "isotropy": {
            s: model.attributes[f"symmetry_{s}"] for s in results if f"symmetry_{s}" in model.attributes
        },
        "sides": results,
        "origins": origins,
        "isotropic": model.isotropic,
        "files": [_entry(s) for s in summaries],
        "written": [str(p.resolve()) for p in output],
        "figures": [str(p.resolve()) for p in drawn],
    }
    if held:
        payload["cross_validation"] = [
            {**asdict(h), "error_percent": 100.0 * h.off, "holds": h.holds} for h in held
        ]
    if peer:
        payload["radiance_messages"] = [*peer.messages]
        payload["radiance_notes"] = [*peer.notes]
    emit(payload, as_json=as_json, lines=lines)


def _held_lines(held: list[HeldOut]) -> list[str]:
    header = ["left out", "theta", "phi", "measured", "predicted", "off %", "low", "high", "holds"]
    header += ["L1 %", "with noise"]
    rows = [
        [
            f"{h.side.replace('_', ' ')}, {h.left_out}",
            h.theta_deg,
            h.phi_deg,
            h.measured,
            h.predicted,
            100.0 * h.off,
            h.low,
            h.high,
            "yes" if h.holds else "no",
            100.0 * h.l1,
            100.0 * h.l1_raw,
        ]
        for h in held
    ]
    inside = sum(h.holds for h in held)
    return [
        "cross-validation",
        *table(header, rows),
        f"{inside} of {len(held)} measured values lie in the {100 * held[0].level:g} % interval; L1 is over "
        "tau, on cells of 0.005, less the noise of the table left out (in quadrature)",
    ]


def _entry(summary: Summary) -> dict[str, Any]:
    one = summary.table
    symbol = "tau" if one.kind == "transmission" else "rho"
    return {
        "file": one.file,
        "quantity": one.quantity,
        "side": one.kind,
        "light_on": one.side.split("_")[1],
        "theta_i_deg": one.theta_i_deg,
        "phi_i_deg": one.phi_i_deg,
        "band": one.band,
        "points": summary.points,
        "negative": summary.negative,
        "coverage": summary.coverage,
        symbol: summary.tau,
        "tau_se": summary.tau_se,
        "tau_systematic": summary.tau_systematic,
        "systematic": summary.systematic,
        "noise": {"relative": summary.noise.relative, "floor": summary.noise.floor},
        "cleaning": [{"step": x.name, "count": x.count, "text": x.text} for x in summary.steps],
        "scale_se": one.scale_se,
        "warnings": list(summary.warnings),
    }


def _side_result(model: TabulatedModel, side: str, summaries: list[Summary], level: float) -> dict[str, Any]:
    """What is said of one measured side: at its tables' directions, and as a curve over the angle."""
    import numpy as np

    measured = model.tables[side]
    theta = np.asarray(measured.theta_i_deg, float)
    phi = np.zeros_like(theta) if measured.phi_i_deg is None else np.asarray(measured.phi_i_deg, float)
    low, high = model.tau_interval(side, theta, phi, level=level)
    own = [s for s in summaries if s.table.side == side]
    bound = np.array([max(s.tau_systematic for s in own if abs(s.table.polar_deg - t) < 0.05) for t in theta])
    curve = np.append(np.arange(0.0, 90.0, 2.5), 89.5)
    curve_low, curve_high = model.tau_interval(side, curve, level=level)
    # The model's interval knows noise and interpolation; what gaps and shadows may hide comes on top.
    widened = np.interp(curve, theta, bound)
    beyond = model.extrapolated_beyond_deg[side]
    return {
        "theta_deg": theta,
        "phi_deg": phi,
        "measured": measured.tau,
        "model": model.direct_hemispherical(side, theta, phi),
        "measured_se": measured.tau_se,
        "tau_systematic": bound,
        "interval_level": level,
        "interval_low": np.maximum(low - bound, 0.0),
        "interval_high": high + bound,
        "extrapolated_beyond_deg": beyond,
        "curve": {
            "theta_deg": curve,
            "model": model.direct_hemispherical(side, curve),
            "low": np.maximum(curve_low - widened, 0.0),
            "high": curve_high + widened,
            "extrapolated": curve > beyond,
        },
    }
