"""What a scattering model is: interface, tables, files, checks, comparison, sampling."""

from specularia.bsdf.build_tree import Built, build
from specularia.bsdf.cells import Slice, cell_means, transmitted_slice
from specularia.bsdf.check import Check, Program, check, programs
from specularia.bsdf.compare import Comparison, Lobe, centroid, compare, haze, js_distance, lobe, write_csv
from specularia.bsdf.convert import convert
from specularia.bsdf.io import Written, direct_hemispherical, evaluate, read, write
from specularia.bsdf.mitsuba import MitsubaExport, export_mitsuba
from specularia.bsdf.model import Quadrature, ScatteringModel
from specularia.bsdf.sample import Sample, sample
from specularia.bsdf.tabulated import SideTable, TabulatedModel
from specularia.bsdf.tabulated_io import read_model, write_model
from specularia.bsdf.tensor_tree import TensorTree
from specularia.bsdf.xml_model import XmlModel
from specularia.bsdf.xml_read import read_xml

__all__ = [
    "Built",
    "Check",
    "Comparison",
    "Lobe",
    "MitsubaExport",
    "Program",
    "Quadrature",
    "Sample",
    "ScatteringModel",
    "SideTable",
    "Slice",
    "TabulatedModel",
    "TensorTree",
    "Written",
    "XmlModel",
    "build",
    "cell_means",
    "centroid",
    "check",
    "compare",
    "convert",
    "direct_hemispherical",
    "evaluate",
    "export_mitsuba",
    "haze",
    "js_distance",
    "lobe",
    "programs",
    "read",
    "read_model",
    "read_xml",
    "sample",
    "transmitted_slice",
    "write",
    "write_csv",
    "write_model",
]
