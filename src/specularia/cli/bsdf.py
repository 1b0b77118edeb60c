"""Commands of `specularia bsdf`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from enum import StrEnum
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from specularia.cli._common import Json, Quiet, emit, numbers, session, table

if TYPE_CHECKING:
    from specularia.bsdf import TabulatedModel, XmlModel
    from specularia.gonio import Table

app = typer.Typer(
    no_args_is_help=True, help="Scattering models and BSDF files: what they hold, what is wrong."
)

File = Annotated[
    Path,
    typer.Argument(help="A BSDF file: .xml (Klems or tensor tree, from anyone) or .nc.", show_default=False),
]
Band = Annotated[
    str | None,
    typer.Option("--band", help="Band of a file with several: Visible (default), Solar, CIE-X, CIE-Z."),
]
Phi = Annotated[
    float, typer.Option("--phi", min=-360.0, max=360.0, help="Azimuth of the incident direction, degrees.")
]


class SideName(StrEnum):
    """The sides of a pane."""

    transmission_front = "transmission_front"
    transmission_back = "transmission_back"
    reflection_front = "reflection_front"
    reflection_back = "reflection_back"


@app.command()
def info(file: File, as_json: Json = False, quiet: Quiet = False) -> None:
    """What a file holds: basis, rank, resolution, bands, sides."""
    with session(quiet=quiet):
        from specularia import bsdf

        model = bsdf.read(file)
        tree = isinstance(model, bsdf.XmlModel)
        payload = {
            "file": str(file),
            "format": "xml" if tree else "nc",
            "basis": model.basis if isinstance(model, bsdf.XmlModel) else "tables at incident angles",
            "rank": model.rank if isinstance(model, bsdf.XmlModel) else 3 if model.isotropic else 4,
            "resolution": model.resolution if isinstance(model, bsdf.XmlModel) else None,
            "bands": list(model.bands),
            "sides": list(model.parts if isinstance(model, bsdf.XmlModel) else model.tables),
            "answers": {s: model.origin(s) for s in model.sides},
            "extrapolated_beyond_deg": getattr(model, "extrapolated_beyond_deg", {}),
            "attributes": dict(model.attributes),
        }
        lines = [
            f"{file}: {payload['basis']}"
            + (f", rank {payload['rank']}" if payload["rank"] else "")
            + (f", resolution 2^{payload['resolution']}" if payload["resolution"] else ""),
            f"bands: {', '.join(model.bands)}",
            *table(["side", "comes from"], [[s, model.origin(s)] for s in model.sides]),
        ]
        emit(payload, as_json=as_json, lines=lines)


@app.command()
def check(
    file: File,
    band: Band = None,
    render: Annotated[
        bool, typer.Option("--render", help="Prove it with rtrace: a uniform sky and a sun, both sides.")
    ] = False,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """What is wrong with a file, what to do about it, and which programs will take it."""
    with session(quiet=quiet):
        from dataclasses import asdict

        from specularia import bsdf

        model = bsdf.read(file, band=band)
        checks, takers = bsdf.check(model, render=render), bsdf.programs(model)
        payload = {
            "file": str(file),
            "checks": [asdict(c) for c in checks],
            "programs": [asdict(p) for p in takers],
        }
        lines = [
            f"{'ok  ' if c.ok else 'NOT '} {c.name}: {c.value:.3g} (limit {c.limit:g}). {c.advice}"
            for c in checks
        ]
        lines += [f"{'yes ' if p.takes else 'no  '} {p.name}. {p.why}" for p in takers]
        emit(payload, as_json=as_json, lines=lines)


@app.command()
def tau(
    file: File,
    theta: Annotated[
        str, typer.Option("--theta", help="Incident angles, degrees, as 0,20,40.")
    ] = "0,20,40,60,75",
    phi: Phi = 0.0,
    band: Band = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Direct-hemispherical transmission and reflection; null (a dash) outside the data."""
    angles = numbers(theta, option="--theta")
    with session(quiet=quiet):
        from specularia import bsdf

        model = bsdf.read(file, band=band)
        values = {s: model.direct_hemispherical(s, angles, phi).tolist() for s in model.sides}
        payload = {
            "file": str(file),
            "band": model.band,
            "phi_deg": phi,
            "theta_deg": angles,
            **values,
            "origin": {s: model.origin(s) for s in model.sides},
            "extrapolated_beyond_deg": getattr(model, "extrapolated_beyond_deg", {}),
        }
        rows = [[t, *(values[s][k] for s in values)] for k, t in enumerate(angles)]
        emit(payload, as_json=as_json, lines=table(["theta_i_deg", *values], rows))


@app.command("slice")
def slice_(
    file: File,
    theta: Annotated[
        float, typer.Option("--theta", min=0.0, max=180.0, help="Incident angle; above 90 on the back.")
    ],
    output: Annotated[Path, typer.Option("-o", "--output", help="The .npz file to write.")],
    phi: Phi = 0.0,
    size: Annotated[int, typer.Option("--size", min=2, max=4096, help="Cells along either axis.")] = 201,
    band: Band = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """The transmitted distribution for one incident direction, on a grid of direction cosines."""
    with session(quiet=quiet):
        import numpy as np

        from specularia import bsdf
        from specularia.files import atomic, writable

        if output.suffix != ".npz":
            raise typer.BadParameter(f"{output} does not end in .npz", param_hint="-o")
        if theta == 90.0:
            raise typer.BadParameter("90 degrees is light along the pane", param_hint="--theta")
        writable(output)
        with _named(file):
            found = bsdf.transmitted_slice(
                bsdf.read(file, band=band), theta_deg=theta, phi_deg=phi, size=size
            )
        with atomic(output) as temporary:
            np.savez_compressed(temporary, ux=found.ux, uy=found.uy, bsdf=found.bsdf)
        total = float(np.nansum(found.bsdf) * (2.0 / size) ** 2)
        payload = {
            "path": str(output.resolve()),
            "side": found.side,
            "theta_deg": theta,
            "phi_deg": phi,
            "tau": total,
        }
        emit(payload, as_json=as_json, lines=[f"{output}: {found.side}, tau {total:.4g} from the cells"])


@app.command()
def compare(
    a: Annotated[
        Path,
        typer.Argument(
            help="A BSDF file (.xml or .nc), a measured table, or a folder of tables.", show_default=False
        ),
    ],
    b: Annotated[Path, typer.Argument(help="The one held against the first, likewise.", show_default=False)],
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder for the table and the figures.")],
    theta: Annotated[
        str, typer.Option("--theta", help="Incident angles, degrees; those of the tables unless given.")
    ] = "",
    phi: Phi = 0.0,
    side: Annotated[
        SideName, typer.Option("--side", help="The side compared.")
    ] = SideName.transmission_front,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Two models side by side: a table, and figures of their distributions on one scale."""
    angles = numbers(theta, option="--theta") if theta else None
    with session(quiet=quiet):
        from dataclasses import asdict, fields

        from specularia import bsdf
        from specularia.files import make_folder
        from specularia.report import figures

        (model_a, points_a), (model_b, points_b) = _source(a), _source(b)
        for path, model in ((a, model_a), (b, model_b)):
            with _named(path):
                model.quadrature(side.value, 0.0)
        models = {"A": model_a, "B": model_b}
        rows = bsdf.compare(*models.values(), theta_deg=angles, phi_deg=phi, side=side.value)
        folder = make_folder(output)
        files = [bsdf.write_csv(rows, folder / "compare.csv")]
        named = {f"{k} {path.name}": m for (k, m), path in zip(models.items(), (a, b))}
        shown = [r.theta_deg for r in rows if r.l1 == r.l1]
        if shown:
            common: dict[str, Any] = {"side": side.value, "phi_i_deg": phi, "synthetic": _synthetic(models)}
            files.append(figures.dsf(named, shown, folder / "dsf.png", **common))
            points = [*points_a, *points_b]
            files.append(figures.sections(named, shown, folder / "sections.png", measured=points, **common))
            files.append(figures.ratio_map(named, shown, folder / "ratio.png", **common))
        columns = [f.name for f in fields(bsdf.Comparison)]
        payload = {
            "a": str(a),
            "b": str(b),
            "side": side.value,
            "angles": [asdict(r) for r in rows],
            **{c: [getattr(r, c) for r in rows] for c in columns},
            "files": [str(f.resolve()) for f in files],
        }
        lines = table(columns, [[getattr(r, c) for c in columns] for r in rows])
        emit(payload, as_json=as_json, lines=[*lines, f"{folder}: {', '.join(f.name for f in files)}"])


class BasisName(StrEnum):
    """What a model can be converted to."""

    klems_full = "klems-full"
    klems_half = "klems-half"
    klems_quarter = "klems-quarter"
    tensor3 = "tensor3"
    tensor4 = "tensor4"


_RESOLUTIONS = {"tensor3": (3, 9), "tensor4": (2, 7)}


@app.command()
def convert(
    file: File,
    output: Annotated[Path, typer.Option("-o", "--output", help="The .xml file to write.")],
    basis: Annotated[
        BasisName | None,
        typer.Option(
            "--basis", help="The file's own unless given; for .nc tensor3, or tensor4 if anisotropic."
        ),
    ] = None,
    resolution: Annotated[
        int | None, typer.Option("--resolution", min=2, max=9, help="2^g cells along an edge of a tree.")
    ] = None,
    cull: Annotated[
        float | None, typer.Option("--cull", min=0.0, max=99.9, help="Cells of a tensor3 to remove, percent.")
    ] = None,
    flip: Annotated[
        bool, typer.Option("--flip", help="Turn the sample over about its y axis: front becomes back.")
    ] = False,
    rotate: Annotated[
        float,
        typer.Option(
            "--rotate", min=-360.0, max=360.0, help="Turn it about its normal, degrees, seen from the front."
        ),
    ] = 0.0,
    isotropic: Annotated[bool, typer.Option("--isotropic", help="Average it over all azimuths.")] = False,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """A file in another basis, resolution or position, with its transmission and reflection kept."""
    with session(quiet=quiet):
        from specularia import bsdf
        from specularia.files import writable

        if output.suffix != ".xml":
            raise typer.BadParameter(f"{output} does not end in .xml", param_hint="-o")
        klems = basis is not None and basis.value.startswith("klems")
        if klems and (resolution is not None or cull is not None):
            raise typer.BadParameter("a Klems matrix has its own patches", param_hint="--resolution, --cull")
        least, most = _RESOLUTIONS.get("" if basis is None else basis.value, (2, 9))
        if resolution is not None and not least <= resolution <= most:
            raise typer.BadParameter(
                f"{resolution} does not lie between {least} and {most}", param_hint="--resolution"
            )
        writable(output)
        converted = bsdf.convert(
            bsdf.read(file),
            basis=None if basis is None else basis.value,
            resolution=resolution,
            cull=cull,
            flip=flip,
            rotate_deg=rotate,
            isotropic=isotropic,
        )
        path = bsdf.write(converted, output).path
        angles = [0.0, 20.0, 40.0, 60.0, 75.0]
        tau = {s: converted.direct_hemispherical(s, angles).tolist() for s in converted.sides}
        payload = {
            "path": str(path.resolve()),
            "basis": converted.basis,
            "rank": converted.rank,
            "resolution": converted.resolution,
            "bands": list(converted.bands),
            "sides": list(converted.parts),
            "theta_deg": angles,
            "tau": tau,
        }
        rows = [[t, *(tau[s][k] for s in tau)] for k, t in enumerate(angles)]
        head = f"{path}: {converted.basis}" + (f", rank {converted.rank}" if converted.rank else "")
        head += f", resolution 2^{converted.resolution}" if converted.resolution else ""
        emit(payload, as_json=as_json, lines=[head, *table(["theta_i_deg", *tau], rows)])


@app.command()
def mitsuba(
    file: File,
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder for the table, plugin and scene.")],
    resolution: Annotated[
        int, typer.Option("--resolution", min=4, max=8, help="2^g outgoing cells along an edge.")
    ] = 7,
    band: Band = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """A table for Mitsuba 3, with the plugin that renders it and a scene that shows how."""
    with session(quiet=quiet):
        from specularia import bsdf
        from specularia.files import make_folder

        model = bsdf.read(file, band=band)
        made = bsdf.export_mitsuba(model, make_folder(output), resolution=resolution)
        payload = {
            "path": str(made.folder.resolve()),
            "files": [str(f.resolve()) for f in made.files],
            "band": model.band,
            "sides": list(made.tau),
            "theta_deg": made.theta_deg.tolist(),
            "tau": {s: t.tolist() for s, t in made.tau.items()},
        }
        lines = [
            f"{made.folder}: {', '.join(f.name for f in made.files)}",
            "In Python: set a variant of Mitsuba, import specularia_bsdf from that folder, load the scene.",
        ]
        emit(payload, as_json=as_json, lines=lines)


@app.command()
def view(
    file: Annotated[
        list[Path],
        typer.Argument(
            metavar="FILE...",
            help="BSDF files (.xml or .nc), measured tables, or folders of tables; each is a model.",
            show_default=False,
        ),
    ],
    output: Annotated[Path, typer.Option("-o", "--output", help="The .html file to write.")],
    theta: Annotated[
        str,
        typer.Option("--theta", help="Angles of incidence to hold, degrees; every 2 degrees unless given."),
    ] = "",
    band: Annotated[
        str | None, typer.Option("--band", help="Band of an .xml with several; all of them unless given.")
    ] = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """An interactive picture of one model or several in one file that opens offline.

    Measured tables are fitted, and their points drawn into the section. Drag the light on the small
    hemisphere.
    """
    angles = numbers(theta, option="--theta") if theta else None
    if angles is not None and not all(0.0 <= a < 90.0 for a in angles):
        raise typer.BadParameter("angles lie in 0 <= theta < 90", param_hint="--theta")
    with session(quiet=quiet):
        from specularia import bsdf
        from specularia.files import writable
        from specularia.report.viewer import write_view

        if output.suffix not in (".html", ".htm"):
            raise typer.BadParameter(f"{output} does not end in .html", param_hint="-o")
        writable(output)
        models: dict[str, Sequence[TabulatedModel | XmlModel]] = {}
        measured: list[Table] = []
        for path in file:
            model, tables = _source(path)
            bands = model.bands if isinstance(model, bsdf.XmlModel) else ()
            held = [bsdf.read(path, band=b) for b in ([band] if band else bands)] if bands else [model]
            name, k = path.stem or path.name, 1
            while name in models:
                k += 1
                name = f"{path.stem} ({k})"
            models[name] = held
            measured += tables
        title = ", ".join(path.name for path in file)
        synthetic = any(_synthetic(dict(enumerate(held))) for held in models.values()) or any(
            t.synthetic for t in measured
        )
        path = write_view(
            models, output, theta_deg=angles, measured=measured, title=title, synthetic=synthetic
        )
        payload = {
            "path": str(path.resolve()),
            "models": list(models),
            "bands": {name: [m.band for m in held] for name, held in models.items()},
            "measured": len(measured),
            "bytes": path.stat().st_size,
        }
        emit(payload, as_json=as_json, lines=[f"{path}: {path.stat().st_size / 1e6:.1f} MB"])


def _synthetic(models: Mapping[Any, TabulatedModel | XmlModel]) -> bool:
    return any("synthetic" in m.attributes for m in models.values())


@contextmanager
def _named(path: Path) -> Iterator[None]:
    """A side or a direction that a model does not hold is reported with the file's name."""
    from specularia.errors import CoverageError

    try:
        yield
    except CoverageError as error:
        raise CoverageError(str(error) if str(path) in str(error) else f"{path}: {error}") from error


def _source(path: Path) -> tuple[TabulatedModel | XmlModel, list[Table]]:
    """A model from a BSDF file; or measured tables, with the model that is fitted to them."""
    from specularia import bsdf

    with path.open("rb") if path.is_file() else nullcontext(BytesIO(b"")) as f:
        head = f.read(512).lstrip(b"\xef\xbb\xbf \t\r\n")
    known = (b"<", b"\x89HDF", b"CDF", b"\xff\xfe", b"\xfe\xff")
    if not path.exists() or head.startswith(known) or path.suffix in (".xml", ".nc"):
        return bsdf.read(path), []
    from specularia import gonio

    files = sorted(p for p in path.iterdir() if p.is_file()) if path.is_dir() else [path]
    if not files:
        from specularia.errors import FormatError

        raise FormatError(file=path, expected="measured tables", found="an empty folder")
    tables = [t for p in files for t in gonio.read(p)]
    return gonio.fit(tables), tables
