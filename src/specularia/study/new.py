"""A commented STUDY.toml for files that are there."""

from __future__ import annotations

import os
import tomllib
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from specularia.errors import OutputError, SpeculariaError
from specularia.files import existing, make_folder, write_text
from specularia.study.bundled import copy_bundled
from specularia.study.stages.surfaces import is_stack

__all__ = ["NewStudy", "kind_of", "new"]

KINDS = ("table", "stack", "map", "image", "finds", "plan", "glass", "room")
"""What a file of a study can be."""


@dataclass(frozen=True)
class NewStudy:
    """What `new` wrote.

    Attributes
    ----------
    study : STUDY.toml.
    written : all files written, the study first; settings other than the study are the demo's, to be edited.
    sorted_as : kind of each file given, by its path.
    unknown : files that were given and recognised as nothing that a study reads.
    """

    study: Path
    written: tuple[Path, ...]
    sorted_as: Mapping[Path, str]
    unknown: tuple[Path, ...]


@dataclass(frozen=True)
class _Found:
    """Paths of a study's files as its STUDY.toml will have them, by kind."""

    kinds: dict[str, list[str]] = field(default_factory=lambda: {kind: [] for kind in KINDS})

    def face(self, face: str, kinds: Sequence[str]) -> str | None:
        """The file for a face: one with the face's name in its own, else the first or second of all."""
        other = {"front": "back", "back": "front"}[face]
        all_ = [path for kind in kinds for path in self.kinds[kind]]
        named = [p for p in all_ if face in Path(p).name.lower()]
        left = [p for p in all_ if face not in Path(p).name.lower() and other not in Path(p).name.lower()]
        place = 0 if face == "front" or any(other in Path(p).name.lower() for p in all_) else 1
        return named[0] if named else (left[place] if len(left) > place else None)


def new(folder: str | Path, given: Sequence[str | Path] = ()) -> NewStudy:
    """Write a commented STUDY.toml that names the files given, sorted by what they are.

    Parameters
    ----------
    folder : where the study goes; made if missing.
    given : measured tables, focus stacks, height maps, pictures of the faces, a catalogue of finds and its
        plan, settings of the glass and the room, in any order. The files stay where they are.

    Notes
    -----
    Which face a stack or map is of is read from its name (front, back), else taken from the order, with a
    comment that says so. Where a slab or a room is possible and no settings were given, the demo's are
    written beside the study with a comment to edit them.

    Raises
    ------
    OutputError : there is a study already.
    FormatError : a file is missing.
    """
    folder = make_folder(folder)
    study = folder / "STUDY.toml"
    if study.exists():
        raise OutputError(f"{study}: there is a study already. Name another folder or move it away.")
    found, sorted_as, unknown = _Found(), {}, []
    for path in map(Path, given):
        kind = kind_of(existing(path, what="a file of the study"))
        if kind is None:
            unknown.append(path)
        else:
            sorted_as[path] = kind
            found.kinds[kind].append(Path(os.path.relpath(path.resolve(), folder.resolve())).as_posix())
    written = [study]
    faces = found.kinds["stack"] or found.kinds["map"]
    for kind, wanted in (("glass", faces), ("room", faces or found.kinds["table"])):
        if wanted and not found.kinds[kind]:
            written.append(copy_bundled(f"{kind}.toml", folder))
            found.kinds[kind].append(f"{kind}.toml")
    write_text(study, _text(found, unknown, {p.name for p in written}))
    return NewStudy(study, tuple(written), sorted_as, tuple(unknown))


def kind_of(path: Path) -> str | None:
    """What a file is, by its content: one of `KINDS`, or None."""
    from specularia import gonio

    suffix = path.suffix.lower()
    if suffix == ".toml":
        return _kind_of_settings(path)
    if path.is_dir():
        return "stack"
    with path.open("rb") as f:
        head = f.read(4096)
    if suffix in (".geojson", ".json"):
        return "plan"
    if b"find_number" in head:
        return "finds"
    if head.lstrip()[:1] in (b"#", b"!") and any(r.looks_right(head[:256]) for r in gonio.READERS):
        return "table"  # a table without a header does not say what it holds; columns may as well be x, y, z
    if suffix in (".png", ".jpg", ".jpeg", ".bmp"):
        return "image"
    if is_stack(path):
        return "stack" if suffix == ".npy" or _pages(path) > 1 else "image"
    return "map" if _is_map(path) else None


def _kind_of_settings(path: Path) -> str | None:
    try:
        keys = set(tomllib.loads(path.read_text(encoding="utf-8")))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError):
        return None
    if {"thickness_mm", "medium"} & keys:
        return "glass"
    return "room" if {"room", "window"} <= keys else None


def _pages(path: Path) -> int:
    import tifffile

    try:
        with tifffile.TiffFile(path) as tiff:
            return len(tiff.pages)
    except tifffile.TiffFileError:
        return 0


def _is_map(path: Path) -> bool:
    from specularia import surface

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # they are given when the file is read in earnest
        try:
            surface.read(path)
        except SpeculariaError:
            return False
    return True


def _quoted(path: str) -> str:
    """A TOML string; single quotes take everything as it is."""
    return f"'{path}'" if "'" not in path else '"' + path.replace("\\", "\\\\").replace('"', '\\"') + '"'


def _text(found: _Found, unknown: Sequence[Path], written: set[str]) -> str:
    """The STUDY.toml: tables for which there are files, and the others as comments."""
    kinds = found.kinds

    def line(key: str, path: str | None, note: str) -> str:
        return f"{key} = {_quoted(path)}  # {note}" if path else f'# {key} = "..."  # {note}'

    def section(name: str, lines: Sequence[str], on: bool) -> str:
        rows = [f"[{name}]", *lines]
        return "\n".join(rows if on else [r if r.startswith("#") else f"# {r}" for r in rows])

    def of_face(face: str, kinds_: Sequence[str]) -> tuple[str | None, str]:
        path = found.face(face, kinds_)
        sure = path is None or face in Path(path).name.lower()
        return path, "" if sure else " (taken from the order of the files: check it)"

    edit = {
        kind: "; the demo's: EDIT it, your specimen differs" if f"{kind}.toml" in written else ""
        for kind in ("glass", "room")
    }
    tables = kinds["table"] or ["gonio/*.dat"]
    gonio = ["tables = [", *(f"    {_quoted(t)}," for t in tables), "]"]
    gonio += [
        '# quantity = "DSF"          # or "BSDF": for files that do not say, or against what they say',
        '# side = "transmission"      # or "reflection": against the rule that theta_s < 90 is the side of '
        "the light",
        "# wavelength_nm = 520.0      # of the light used, for files that do not say",
    ]
    surface = []
    for face, what in (("front", "side that the light came from in the measurement"), ("back", "other side")):
        path, note = of_face(face, ("stack", "map"))
        surface.append(line(face, path, f"focus stack or height map of the {what}{note}"))
    for face in ("front", "back"):
        path, note = of_face(face, ("image",))
        surface.append(line(f"{face}_image", path, f"picture of the {face} for the report{note}"))
    surface += [
        "# pitch_um = 1.5             # pixel size, for files that hold none",
        "# step_um = 1.0              # step between slices, for stacks that hold none",
        '# first_row = "bottom"       # or "top": whether row 0 of a slice is its lowest y',
        '# unit = "um"                # of the heights of maps that name none',
        'tiling = "mirror"            # how the faces go on beyond their fields: mirror, blend or periodic',
        "# denoise = true             # without the noise of the microscope, which light takes for relief",
    ]
    parts = [
        "# A study of window glass. Run it with:  specularia study run STUDY.toml -o results\n"
        "# Check it before with:               specularia study check STUDY.toml\n"
        "# Paths count from this file's folder; *, ? and [...] stand for several files. A table that is "
        "left out\n"
        "# (or commented out, as some are here) is not done.",
        "# Tables of a gonio-photometer, all of one specimen -> Model M.\n"
        + section("gonio", gonio, bool(kinds["table"])),
        "# What the microscope saw of the two faces -> height maps.\n"
        + section("surface", surface, bool(kinds["stack"] or kinds["map"])),
        "# The glass between the faces -> Model C, traced. Faces of [surface] take the place of its own.\n"
        + section(
            "glass",
            [line("settings", (kinds["glass"] or ["glass.toml"])[0], f"GLASS.toml{edit['glass']}")],
            bool(kinds["glass"]),
        ),
        "[trace]\n"
        "wavelength_nm = 520.0        # of the traced light\n"
        "paths = 200000               # per incident direction\n"
        "seed = 1",
        "# The pane as it may have been before decay -> Model H; needs [surface] and [glass].\n"
        + section(
            "healing",
            [
                "ensemble = 8                 # possible original surfaces of each face",
                "# theta_deg = [0, 60]        # angles at which the interval is traced through all of them",
                "# paths = 50_000             # there, for each of them",
                "# model_paths = 200_000      # of Model H, per direction; left out: those of [trace]",
            ],
            bool(kinds["stack"] or kinds["map"]) and bool(kinds["glass"]),
        ),
        "[xml]                        # the Radiance files of the models\n"
        "resolution = 6               # 5 to 8\n"
        "# cull = 90.0                # percentage of cells to merge; left out: as many as move 1 % of the "
        "light",
        "# The specimen over a printed sheet, seen through each model.\n"
        + section(
            "fragment",
            ['# settings = "fragment.toml" # FRAGMENT.toml; left out: defaults, with an invented outline'],
            False,
        ),
        "# The room that each model is put into.\n"
        + section(
            "room",
            [line("settings", (kinds["room"] or ["room.toml"])[0], f"ROOM.toml{edit['room']}")],
            bool(kinds["room"]),
        ),
        "# Why Model C and the measurement differ: an error budget; needs [gonio] and [glass]. Minutes.\n"
        + section(
            "explain",
            [
                '# settings = "pane.toml"     # GLASS.toml with all that is known; left out: that of [glass]',
                '# order = ["endless", "absorption", "bubbles"]  # left out: all steps',
                "# patch_mm = 8.4             # width of the finite patch that the budget begins with",
                "# resolution = 6             # of the tensor tree that it begins with",
                "# aperture_deg = 0.3         # full width of the instrument's response",
                "# unsure = { absorption = 0.1, bubbles = 0.3 }  # relative standard errors",
                "# paths = 1_000_000          # for each state and angle",
            ],
            False,
        ),
        "# What the glass is like, from maps and tables; needs [gonio] and [glass]. Many minutes.\n"
        + section(
            "infer",
            [
                '# settings = "pane.toml"     # GLASS.toml to begin with; left out: that of [glass]',
                '# seek = ["absorption_per_mm", "micro_slope_front", "micro_slope_back"]  # left out: all',
                "# priors = { absorption_per_mm = [0.05, 0.7] }  # median, sigma of the natural logarithm",
                "# scale_error = 0.005        # of the scale that all tables share, relative",
                "# aperture_deg = 0.3         # full width of the instrument's response",
                "# hold_out = true            # predict each inner angle from the others",
                "# paths = 160_000            # for each trace and angle",
            ],
            False,
        ),
        "# The catalogue of finds.\n"
        + section(
            "finds",
            [
                line("table", (kinds["finds"] or ["finds.csv"])[0], "CSV, XLSX or ODS, a row per find"),
                line("plan", kinds["plan"][0] if kinds["plan"] else None, "GeoJSON with rooms and squares"),
                line("mapping", None, "names, words and units of a table in other terms"),
            ],
            bool(kinds["finds"]),
        ),
        "[report]\n"
        'title = "A study of window glass"\n'
        '# note = "Text under the title."\n'
        "dsf_theta_deg = [20, 30, 40] # angles of incidence at which the models are drawn side by side\n"
        "view = true                  # an interactive view of the models within the page",
    ]
    if unknown:
        names = "\n".join(f"#   {path}" for path in unknown)
        parts.insert(1, f"# Given, but nothing that a study reads:\n{names}")
    return "\n\n".join(parts) + "\n"
