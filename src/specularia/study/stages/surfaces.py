"""Stages heights_front, heights_back and surfaces: from focus stacks to height maps, and their pictures."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from specularia.study.stages.blocks import figure, table

if TYPE_CHECKING:
    from specularia.study.engine import Work
    from specularia.surface import HeightMap

__all__ = ["heights", "is_stack", "map_files", "surfaces"]


def is_stack(path: Path) -> bool:
    """Whether a file is a focus stack, not a height map: a folder, a TIFF, or an array of three axes."""
    if path.suffix.lower() == ".npy" and path.is_file():
        import numpy as np

        return np.load(path, mmap_mode="r").ndim == 3
    return path.is_dir() or path.suffix.lower() in (".tif", ".tiff", ".btf")


def map_files(work: Work) -> dict[str, Path]:
    """Height maps among the results that a stage needs, by face."""
    faces = {stage.removeprefix("heights_"): folder for stage, folder in work.results.items()}
    return {face: folder / f"{face}.nc" for face, folder in faces.items() if face in ("front", "back")}


def heights(work: Work) -> Mapping[str, Any]:
    """The height map of one face: reconstructed from a stack, or taken as it is from a map."""
    from specularia import surface

    path, given = work.file("face"), work.parameters
    if is_stack(path):
        made = surface.heights(
            path, pitch_um=given["pitch_um"], step_um=given["step_um"], first_row=given["first_row"]
        )
    else:
        made = surface.read(path, pitch_um=given["pitch_um"], unit=given["unit"])
    surface.write(made, work.folder / f"{given['face']}.nc")
    rough = surface.roughness(made)
    return {
        "synthetic": "synthetic" in made.attributes,
        "source": path.name,
        "from_stack": is_stack(path),
        "shape": list(made.shape),
        "pitch_um": [made.pitch_x_um, made.pitch_y_um],
        "range_um": made.range_um,
        "missing": made.missing,
        "rms_sigma_um": None if made.sigma_um is None else surface.rms_sigma(made),
        "Sq_um": rough.Sq_um,
        "Sdq": rough.Sdq,
    }


def surfaces(work: Work) -> Mapping[str, Any]:
    """Draw the height maps and the micrographs of the faces."""
    from specularia import surface
    from specularia.report import figures

    maps = {face: surface.read(file) for face, file in map_files(work).items()}
    said = {face: work.summary(f"heights_{face}") for face in maps}
    synthetic = any(s["synthetic"] for s in said.values())
    header = ["face", "from", "pixels", "pitch (µm)", "range (µm)", "Sq (µm)", "Sdq", "missing", "σ (µm)"]
    rows = [
        [
            face,
            "focus stack" if s["from_stack"] else "height map",
            f"{s['shape'][1]} x {s['shape'][0]}",
            s["pitch_um"][0],
            s["range_um"],
            s["Sq_um"],
            s["Sdq"],
            s["missing"],
            s["rms_sigma_um"],
        ]
        for face, s in said.items()
    ]
    named = ", ".join(f"{face}: {s['source']}" for face, s in said.items())
    caption = (
        f"The faces of the slab ({named}). Range: highest minus lowest point; Sq: rms height; Sdq: rms "
        "slope (ISO 25178-2); σ: rms standard uncertainty of a height, from the stack's own noise."
    )
    columns = [
        "face",
        "from",
        "columns",
        "rows",
        "pitch_um",
        "range_um",
        "Sq_um",
        "Sdq",
        "missing",
        "rms_sigma_um",
    ]
    numbers = [[*row[:2], *said[face]["shape"][::-1], *row[3:]] for face, row in zip(said, rows, strict=True)]
    csv = work.folder / "faces.csv"
    face, height_map = list(maps.items())[-1]
    drawn = figures.relief(height_map, work.folder / "relief.png", synthetic=synthetic)
    words = (
        f"The relief of the {face} in parallel projection, drawn as clay; heights are exaggerated as the "
        "figure says."
    )
    blocks = [
        table(csv, header, rows, caption, numbers=(columns, numbers), synthetic=synthetic),
        figure(drawn, words, synthetic=synthetic, like="Fig. 5c"),
    ]
    picture = figures.height_maps(maps, work.folder / "height_maps.png", synthetic=synthetic)
    caption = (
        "Height maps of the faces, each as its microscope saw it: x to the right, y up, heights positive "
        "out of the glass. Uncertainty of a height: σ in the table above."
    )
    blocks.append(figure(picture, caption, synthetic=synthetic, like="Fig. 7"))
    images = {face: image for face in maps if (image := _image(work, face, maps[face])) is not None}
    if images:
        # A picture may be finer than its map, and one face finer than the other.
        pitch = {face: maps[face].field_um[0] / image.shape[1] for face, image in images.items()}
        picture = figures.micrographs(images, pitch, work.folder / "micrographs.png", synthetic=synthetic)
        caption = "The faces in focus everywhere: relative brightness, from the 0.5 % to the 99.5 % quantile."
        blocks.append(figure(picture, caption, synthetic=synthetic, like="Fig. 8"))
    return {"synthetic": synthetic, "blocks": blocks}


def _image(work: Work, face: str, height_map: HeightMap) -> Any:
    """The picture of a face, row 0 at the lowest y: the file the study names, else what its stack gave."""
    named = work.files(f"{face}_image")
    if not named:
        return height_map.image
    from specularia.surface import read_picture

    return read_picture(named[0])
