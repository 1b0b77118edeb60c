"""What a study puts between light and dark: its own heights, with all else that the glass says of a face."""

from types import SimpleNamespace

import numpy as np

from specularia import surface
from specularia.glass import Face, Slab
from specularia.study.stages.models import with_faces


def test_heights_of_the_study_take_the_place_of_heights_alone(tmp_path):
    noise = 0.01 * np.random.default_rng(1).standard_normal((32, 32))
    folder = tmp_path / "heights_front"
    folder.mkdir()
    map_ = surface.HeightMap(noise, 1.5, 1.5, sigma_um=np.full(noise.shape, 0.01))
    surface.write(map_, folder / "front.nc")
    slab = Slab(3.0, front=Face.flat(micro_slope=0.05), back=Face.flat(micro_slope=0.07, sealant_index=1.4))
    for denoise in (False, True):
        work = SimpleNamespace(
            results={"heights_front": folder}, parameters={"tiling": "mirror", "denoise": denoise}
        )
        found = with_faces(work, slab)
        assert found.front.micro_slope == 0.05
        assert found.back == slab.back
        assert found.front.tiling == "mirror"
        assert (found.front.measured_um is not None) is denoise
        assert bool(found.front.heights_um.std() < 0.5 * noise.std()) is denoise
