"""A study of reflection tables alone: there is no transmission to compare, and that is no fault."""

import json

import numpy as np

from specularia.bsdf import SideTable, TabulatedModel, write_model
from specularia.study.engine import Work
from specularia.study.stages.comparison import dsf, table_1


def test_reflection_alone_leaves_the_comparison_of_transmission_out(tmp_path):
    even = np.full((1, 16, 16), 0.1 / np.pi, np.float32)
    side = SideTable(
        theta_i_deg=np.array([10.0]),
        base=even,
        patch=even,
        half_width=0.1,
        tau=np.array([0.1]),
        tau_se=np.array([0.001]),
        origin="measured",
    )
    folder = tmp_path / "model_m"
    folder.mkdir()
    write_model(TabulatedModel(tables={"reflection_front": side}, band="520 nm"), folder / "model.nc")
    (folder / "stage.json").write_text(json.dumps({"summary": {"synthetic": True}}))
    work = Work(tmp_path, {"theta_deg": [20.0]}, {}, {}, {"model_m": folder})
    for stage in (table_1, dsf):
        made = stage(work)
        assert made["synthetic"] is True
        (block,) = made["blocks"]
        assert block["kind"] == "text"
        assert "nothing to compare" in block["text"]
