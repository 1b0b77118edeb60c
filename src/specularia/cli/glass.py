"""Commands of `specularia glass`."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from specularia.cli import _glass_light
from specularia.cli._common import Cull, Json, Quiet, Resolution, Seed, emit, numbers, session, table

if TYPE_CHECKING:
    from specularia.glass import EnergyBalance, Slab
    from specularia.glass.directions import Pool
    from specularia.glass.model import Traced

app = typer.Typer(no_args_is_help=True, help="The pane as a slab between two reliefs: tracing and Model C.")

app.command("colours")(_glass_light.colours)
app.command("film")(_glass_light.film)
app.command("wave")(_glass_light.wave)

Glass = Annotated[
    Path, typer.Argument(metavar="GLASS.toml", help="The pane: faces, medium, bubbles.", show_default=False)
]
PathsOption = Annotated[
    int | None,
    typer.Option(
        "--paths",
        min=1,
        help="For each incident direction and side (200000); with --target-error the most a direction gets.",
        show_default=False,
    ),
]
Target = Annotated[
    float | None,
    typer.Option(
        "--target-error",
        min=1e-5,
        max=0.999,
        help="Trace each direction until the relative standard error of tau and the noise of the transmitted "
        "distribution (mean |deviation| over its light, on 64 x 64 cells), are no larger; such as 0.03.",
    ),
]
Wavelength = Annotated[
    float, typer.Option("--wavelength", min=200.0, max=20000.0, help="In nm, for index and absorption.")
]


class Method(StrEnum):
    """How light is followed through the pane."""

    PATHS = "paths"
    RADIANCE = "radiance"


class Sides(StrEnum):
    """Material of the sides of the array that Radiance sees."""

    CLEAR = "clear"
    ABSORBING = "absorbing"


class Face(StrEnum):
    """A face of the pane."""

    FRONT = "front"
    BACK = "back"


@app.command()
def trace(
    glass: Glass,
    output: Annotated[
        list[Path] | None,
        typer.Option(
            "-o", "--output", help="OUT.nc, the model itself, or OUT.xml, for Radiance; may be given twice."
        ),
    ] = None,
    paths: PathsOption = None,
    target_error: Target = None,
    anisotropic: Annotated[
        bool, typer.Option("--anisotropic", help="Keep the azimuth of the light (XML: trees of rank 4).")
    ] = False,
    azimuths: Annotated[
        int, typer.Option("--azimuths", min=3, max=360, help="With --anisotropic: azimuths of the light.")
    ] = 8,
    tau_only: Annotated[
        bool, typer.Option("--tau-only", help="The energy balance alone, for light on the front; no model.")
    ] = False,
    theta: Annotated[
        str, typer.Option("--theta", help="With --tau-only: incident angles in degrees, A,B,...")
    ] = "0,20,40,60,82.5",
    phi: Annotated[
        float,
        typer.Option(
            "--phi",
            min=-360.0,
            max=360.0,
            help="With --tau-only: incident azimuth in degrees, not averaged over.",
        ),
    ] = 0.0,
    wavelength: Wavelength = 520.0,
    resolution: Resolution = 6,
    cull: Cull = None,
    workers: Annotated[
        int | None,
        typer.Option(
            "--workers", min=1, help="Trace on so many processes of this machine (dask.distributed)."
        ),
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option(
            "--scheduler", help="Trace on the workers of a dask scheduler, such as tcp://10.0.0.1:8786."
        ),
    ] = None,
    method: Annotated[
        Method,
        typer.Option("--method", help="radiance: a finite array of tiles through Radiance, as published."),
    ] = Method.PATHS,
    array_mm: Annotated[
        float, typer.Option("--array", min=0.01, help="With --method radiance: width of the array in mm.")
    ] = 10.0,
    sides: Annotated[
        Sides,
        typer.Option("--sides", help="With --method radiance: what the sides of the array are made of."),
    ] = Sides.CLEAR,
    patches: Annotated[
        int | None,
        typer.Option(
            "--patches",
            min=2,
            help="Trace N x N patches of the maps too: their spread is an error of the model.",
        ),
    ] = None,
    colour: Annotated[
        bool,
        typer.Option(
            "--colour",
            help="Bands CIE-X, Visible and CIE-Z, all from the same paths; wants a spectrum of the medium.",
        ),
    ] = False,
    illuminant: Annotated[
        str, typer.Option("--illuminant", help="With --colour: of the CIE, such as D65, E or A.")
    ] = "D65",
    seed: Seed = 0,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Trace light through a pane: the geometry-based model (Model C), or its energy balance alone.

    Finished directions are kept beside the output until it is written: after an interruption the same command
    goes on from there, and ends with the same numbers.
    """
    outputs = output or []
    if not tau_only and not outputs:
        raise typer.BadParameter("name OUT.nc or OUT.xml, or ask for --tau-only", param_hint="-o")
    wrong = [p for p in outputs if p.suffix.lower() not in (".nc", ".xml")]
    if wrong:
        raise typer.BadParameter(f"{wrong[0]} must end in .nc or .xml", param_hint="-o")
    if workers is not None and scheduler is not None:
        raise typer.BadParameter("give --workers or --scheduler, not both", param_hint="--scheduler")
    if anisotropic and resolution > 7 and any(p.suffix.lower() == ".xml" for p in outputs):
        raise typer.BadParameter("trees of rank 4 go up to 7", param_hint="--resolution")
    angles = _angles(numbers(theta, option="--theta"))
    _check_seed(seed)
    with session(quiet=quiet):
        from specularia import bsdf
        from specularia.errors import SpeculariaWarning
        from specularia.files import writable
        from specularia.glass import read_slab
        from specularia.glass import trace as balance_of
        from specularia.glass.effort import DEFAULT_PATHS, MOST_PATHS
        from specularia.glass.model import traced_model

        if tau_only and outputs:
            warnings.warn(
                f"--tau-only computes no model: {outputs[0]} is not written.", SpeculariaWarning, stacklevel=1
            )
            outputs = []
        for path in outputs:
            writable(path)
        slab = read_slab(glass, seed=seed)
        wanted = illuminant if colour else slab.colour
        tiling = _tiling(slab)
        if method is Method.RADIANCE:
            if wanted is not None:
                raise typer.BadParameter(
                    "--method radiance knows no colour; leave out --colour, and colour in [trace]",
                    param_hint="--colour",
                )
            _radiance(
                slab,
                outputs,
                angles=angles,
                phi=phi,
                resolution=resolution,
                cull=cull,
                rays=paths,
                options={"array_mm": array_mm, "sides": sides.value, "wavelength_nm": wavelength},
                as_json=as_json,
            )
            return
        most = paths or (DEFAULT_PATHS if target_error is None else MOST_PATHS)
        effort = {"paths": most, "target_error": target_error, "seed": seed, "wavelength_nm": wavelength}
        if tau_only:
            found = balance_of(slab, theta_deg=angles, phi_deg=phi, **effort)  # type: ignore[arg-type]
            seen, rows = _glass_light.colour_of_pane(
                slab, angles, phi_deg=phi, paths=most, seed=seed, wavelength_nm=wavelength, illuminant=wanted
            )
            emit(_payload(found) | tiling | seen, as_json=as_json, lines=[*_rows(found), *rows])
            return
        with _pool(workers, scheduler) as pool:
            traced = traced_model(
                slab,
                azimuths=azimuths if anisotropic else None,
                output=outputs[0],
                pool=pool,
                patches=patches,
                colour=wanted,
                **effort,  # type: ignore[arg-type]
            )
        for path in outputs:
            if path.suffix.lower() == ".nc":
                bsdf.write_model(traced.model, path)
            else:
                bsdf.write(traced.model, path, resolution=resolution, cull=cull)
        if traced.store is not None:
            traced.store.remove()
        seen, rows = _glass_light.colour_of_model(traced, illuminant=wanted)
        payload = _model_payload(traced) | tiling | seen | {"written": [str(p.resolve()) for p in outputs]}
        lines = [
            *_rows(traced.balances["front"]),
            *rows,
            *_spread(traced),
            *(f"written: {p}" for p in outputs),
        ]
        emit(payload, as_json=as_json, lines=lines)


@app.command("tau-curve")
def tau_curve(
    glass: Glass,
    theta: Annotated[
        str, typer.Option("--theta", help="Incident angles in degrees: A:B:STEP, B included, or A,B,...")
    ] = "0:85:5",
    side: Annotated[Face, typer.Option("--side", help="The face that the light arrives on.")] = Face.FRONT,
    phi: Annotated[
        float | None,
        typer.Option(
            "--phi", min=-360.0, max=360.0, help="Incident azimuth in degrees; without it the mean over all."
        ),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="OUT.csv, or OUT.png: a figure, with its numbers in OUT.csv."),
    ] = None,
    paths: PathsOption = None,
    target_error: Target = None,
    wavelength: Wavelength = 520.0,
    seed: Seed = 0,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Where the light goes, over the angle of incidence: transmitted, reflected, absorbed."""
    angles = _angles(_grid(theta))
    if output is not None and output.suffix.lower() not in (".csv", ".png"):
        raise typer.BadParameter(f"{output} must end in .csv or .png", param_hint="-o")
    _check_seed(seed)
    with session(quiet=quiet):
        from specularia.files import writable
        from specularia.glass import read_slab
        from specularia.glass import trace as balance_of
        from specularia.glass.effort import DEFAULT_PATHS, MOST_PATHS

        if output is not None:
            writable(output)
        slab = read_slab(glass, seed=seed)
        found = balance_of(
            slab,
            theta_deg=angles,
            side=side.value,
            phi_deg=phi,
            paths=paths or (DEFAULT_PATHS if target_error is None else MOST_PATHS),
            target_error=target_error,
            seed=seed,
            wavelength_nm=wavelength,
        )
        payload = _payload(found) | {"side": side.value, "phi_deg": phi}
        lines = _rows(found)
        if output is not None:
            from specularia.report.figures.balance import energy_balance, write_balance

            if output.suffix.lower() == ".png":
                written = [
                    energy_balance(found, output, synthetic=slab.synthetic),
                    output.with_suffix(".csv"),
                ]
            else:
                written = [write_balance(found, output)]
            payload["written"] = [str(p.resolve()) for p in written]
            lines += [f"written: {p}" for p in written]
        emit(payload, as_json=as_json, lines=lines)


@app.command()
def photometer(
    glass: Glass,
    output: Annotated[
        Path, typer.Option("-o", "--output", help="Folder for the tables.", show_default=False)
    ],
    theta: Annotated[
        str, typer.Option("--theta", help="Incident angles in degrees, A,B,... or A:B:STEP.")
    ] = "0,20,40,60,82.5",
    phi: Annotated[str, typer.Option("--phi", help="Incident azimuths in degrees, A,B,...")] = "0",
    points: Annotated[
        int, typer.Option("--points", min=100, help="Directions in the scan of each table.")
    ] = 60_000,
    aperture: Annotated[
        float, typer.Option("--aperture", min=0.3, max=10.0, help="Full width at half maximum, degrees.")
    ] = 0.6,
    noise: Annotated[
        float, typer.Option("--noise", min=0.0, max=1.0, help="Standard deviation of a reading over it.")
    ] = 0.0,
    floor: Annotated[
        float, typer.Option("--floor", min=0.0, help="Standard deviation of the additive noise, 1/sr (DSF).")
    ] = 0.0,
    shadow: Annotated[bool, typer.Option("--shadow", help="Shade the column of the sample's mount.")] = False,
    paths: Annotated[int, typer.Option("--paths", min=1, help="For each table.")] = 1_000_000,
    wavelength: Wavelength = 520.0,
    seed: Seed = 0,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """What a gonio-photometer would record of a pane: pab-opto tables of its transmission."""
    angles = _angles(_grid(theta))
    azimuths = numbers(phi, option="--phi")
    _check_seed(seed)
    with session(quiet=quiet):
        from specularia.glass import read_slab
        from specularia.glass.photometer import write_tables

        slab = read_slab(glass, seed=seed)
        found = write_tables(
            slab,
            output,
            theta_deg=angles,
            phi_deg=azimuths,
            points=points,
            aperture_deg=aperture,
            relative_noise=noise,
            floor=floor,
            shadow=shadow,
            paths=paths,
            wavelength_nm=wavelength,
            seed=seed,
        )
        rows = [[t.theta_deg, t.phi_deg, t.tau, t.tau_se, t.path.name] for t in found]
        emit(
            {
                "files": [str(t.path.resolve()) for t in found],
                **{
                    key: [getattr(t, key) for t in found] for key in ("theta_deg", "phi_deg", "tau", "tau_se")
                },
            },
            as_json=as_json,
            lines=[*table(["theta_i", "phi_i", "tau", "se", "file"], rows), f"written: {output}"],
        )


def _angles(angles: list[float]) -> list[float]:
    if not all(0.0 <= t < 90.0 for t in angles):
        raise typer.BadParameter("angles in 0 <= theta < 90 degrees are wanted", param_hint="--theta")
    return angles


def _grid(text: str) -> list[float]:
    """A:B:STEP with B included, or A,B,..."""
    if ":" not in text:
        return numbers(text, option="--theta")
    parts = numbers(text.replace(":", ","), option="--theta")
    if len(parts) != 3 or parts[2] <= 0 or parts[1] < parts[0] or (parts[1] - parts[0]) / parts[2] > 10_000:
        raise typer.BadParameter(f"{text!r} is not A:B:STEP with A <= B and STEP > 0", param_hint="--theta")
    first, last, step = parts
    return [first + k * step for k in range(int((last - first) / step + 1e-9) + 1)]


def _check_seed(seed: int) -> None:
    if not 0 <= seed < 1 << 39:
        raise typer.BadParameter("a seed lies in 0 <= seed < 2^39", param_hint="--seed")


@contextmanager
def _pool(workers: int | None, scheduler: str | None) -> Iterator[Pool | None]:
    """Workers to trace on; None for this process."""
    if workers is None and scheduler is None:
        yield None
        return
    from specularia.glass.cluster import Cluster

    with Cluster(workers=workers, scheduler=scheduler) as cluster:
        yield cluster


def _payload(found: EnergyBalance) -> dict[str, Any]:
    """The energy balance for --json; one number of paths where all angles got the same."""
    names = ("theta_deg", "tau", "tau_se", "rho", "rho_se", "absorbed", "absorbed_se", "lost", "seconds")
    payload = {name: getattr(found, name) for name in names}
    if found.sides.any():
        payload["sides_of_patch"] = found.sides
    payload["paths"] = found.paths if len(set(found.paths)) > 1 else int(found.paths[0])
    return payload


def _model_payload(traced: Traced) -> dict[str, Any]:
    """The balance for light on the front, with losses and times of both sides together, and of the back."""
    front, back = traced.balances["front"], traced.balances["back"]
    payload = _payload(front) | {"lost": front.lost + back.lost, "seconds": front.seconds + back.seconds}
    payload["back"] = _payload(back)
    payload["noise"] = dict(traced.noise)
    if traced.variation is not None:
        payload["patches"] = asdict(traced.variation)
    return payload


def _tiling(slab: Slab) -> dict[str, Any]:
    """What tiling does to the slopes of the maps: said on stderr, returned for --json."""
    from specularia.progress import note

    for name, r in slab.tilings.items():
        changed = ""
        if r.tiling != "periodic":
            changed = (
                f"rms slope {r.rms_slope[0]:.4g} of the map, {r.rms_slope[1]:.4g} tiled (Sdq {r.Sdq[0]:.4g}, "
                f"{r.Sdq[1]:.4g}); largest difference between the distributions of slopes {r.distance:.2g}"
            )
        blended = f", {100 * r.blended:.2g} % of it blended" if r.blended else ""
        missing = f"; {r.filled} missing pixels filled" if r.filled else ""
        period = f"period of {r.shape[1]} x {r.shape[0]} pixels{blended}"
        note(f"{name}: {r.tiling}, {period}; {changed or f'rms slope {r.rms_slope[1]:.4g}'}{missing}")
    return {"tiling": {name: asdict(r) for name, r in slab.tilings.items()}}


def _spread(traced: Traced) -> list[str]:
    """The spread between patches for a person to read."""
    found = traced.variation
    if found is None:
        return []
    columns = (found.theta_deg, found.tau_sd, found.tau_error, found.l1, found.noise)
    rows = [[float(v) for v in row] for row in zip(*columns)]
    return [
        "",
        f"Between {found.along_side} x {found.along_side} patches (sd), of their mean (error):",
        *table(["theta_i", "tau sd", "tau error", "L1", "its noise"], rows),
    ]


def _rows(found: EnergyBalance) -> list[str]:
    rows = [
        [float(t), float(a), float(b), float(c), float(d), int(lost), int(n)]
        for t, a, b, c, d, lost, n in zip(
            found.theta_deg, found.tau, found.tau_se, found.rho, found.absorbed, found.lost, found.paths
        )
    ]
    return table(["theta_i", "tau", "se", "rho", "absorbed", "lost", "paths"], rows)


def _radiance(
    slab: Slab,
    outputs: list[Path],
    *,
    angles: list[float],
    phi: float,
    resolution: int,
    cull: float | None,
    rays: int | None,
    options: dict[str, Any],
    as_json: bool,
) -> None:
    """The published route: XML, or the energy balance alone."""
    from specularia.glass import peer

    if any(p.suffix.lower() != ".xml" for p in outputs):
        raise typer.BadParameter("--method radiance writes .xml only", param_hint="-o")
    payload: dict[str, Any]
    if not outputs:
        found = peer.balance(slab, theta_deg=angles, phi_deg=phi, rays=rays or 10_000, **options)
        theta, tau, rho = found.theta_deg, found.tau, found.rho
        payload = {"tau_se": found.tau_se, "rays": found.rays}
    else:
        given: dict[str, Any] = {} if cull is None else {"cull": cull}
        for path in outputs:
            sums = peer.write_xml(slab, path, resolution=resolution, samples=rays or 1000, **given, **options)
        theta, tau, rho = (sums[k] for k in ("theta_deg", "transmission_front", "reflection_front"))
        payload = {"back": {"tau": sums["transmission_back"], "rho": sums["reflection_back"]}}
        payload["written"] = [str(p.resolve()) for p in outputs]
    payload = {"theta_deg": theta, "tau": tau, "rho": rho, "sum": tau + rho, **options} | payload
    rows = [[float(t), float(a), float(b), float(a + b)] for t, a, b in zip(theta, tau, rho)]
    lines = [*table(["theta_i", "T", "R", "R+T"], rows), *(f"written: {p}" for p in outputs)]
    emit(payload, as_json=as_json, lines=lines)
