"""What a scattering model is: interface, tables, files, comparison."""

from specularia.bsdf.model import Quadrature, ScatteringModel
from specularia.bsdf.tabulated import SideTable, TabulatedModel, read_model, write_model

__all__ = ["Quadrature", "ScatteringModel", "SideTable", "TabulatedModel", "read_model", "write_model"]
