"""VTI: VTK image data, for ParaView, through PyVista's VTK. Voxels are cells; axes run x, y, z."""

from __future__ import annotations

import importlib
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from poresynth.io import header
from poresynth.io.format import FLOATS, WIDE, Content, Format, FormatError
from poresynth.io.quiet import quiet

__all__ = ["VTI"]

_NAME, _KEY = "voxels", "poresynth"


def _vtk() -> SimpleNamespace:
    """Import the few parts of VTK that are needed; the whole of it takes a second."""
    names = {
        "vtkmodules.util.numpy_support": ("numpy_to_vtk", "vtk_to_numpy"),
        "vtkmodules.vtkCommonCore": ("vtkStringArray",),
        "vtkmodules.vtkCommonDataModel": ("vtkImageData",),
        "vtkmodules.vtkIOXML": ("vtkXMLImageDataReader", "vtkXMLImageDataWriter"),
    }
    modules = {module: importlib.import_module(module) for module in names}
    return SimpleNamespace(**{n: getattr(modules[m], n) for m in names for n in names[m]})


def _read(path: Path) -> Content:
    vtk = _vtk()
    reader = vtk.vtkXMLImageDataReader()
    errors = _listen(reader)
    reader.SetFileName(str(path))
    with quiet():
        reader.Update()
    # VTK writes the range of an array with NaN as "nan", which it cannot read, and does not need.
    errors = [error for error in errors if "InformationKey" not in error]
    image = reader.GetOutput()
    x, y, z = image.GetDimensions()
    # Programs store voxels as cells or as points; a file of ours and of PoreSpy has cells.
    if image.GetCellData().GetNumberOfArrays():
        data, shape = image.GetCellData(), (z - 1, y - 1, x - 1)
    else:
        data, shape = image.GetPointData(), (z, y, x)
    array = data.GetScalars() or data.GetArray(0)
    if errors or array is None or array.GetNumberOfTuples() != np.prod(shape):
        raise FormatError("truncated, damaged, or without voxels")
    voxels = vtk.vtk_to_numpy(array)
    content = Content(voxels.reshape(*shape, *voxels.shape[1:]), image.GetSpacing()[::-1])
    text = image.GetFieldData().GetAbstractArray(_KEY)
    if text is not None and text.GetNumberOfValues():
        content.header = header.decode(str(text.GetValue(0)))
    return content


def _write(path: Path, content: Content) -> None:
    vtk = _vtk()
    z, y, x = content.array.shape[:3]
    image = vtk.vtkImageData()
    image.SetDimensions(x + 1, y + 1, z + 1)
    image.SetSpacing(content.voxel_size[::-1])
    voxels = np.ascontiguousarray(content.array).reshape(z * y * x, -1)
    array = vtk.numpy_to_vtk(voxels)
    array.SetName(_NAME)
    image.GetCellData().SetScalars(array)
    if content.header:
        text = vtk.vtkStringArray()
        text.SetName(_KEY)
        text.InsertNextValue(header.encode(content.header))
        image.GetFieldData().AddArray(text)
    writer = vtk.vtkXMLImageDataWriter()
    errors = _listen(writer)
    writer.SetFileName(str(path))
    writer.SetInputData(image)
    with quiet():
        written = writer.Write()
    if not written or errors:
        raise FormatError(errors[0] if errors else "VTK could not write it")


def _listen(algorithm: Any) -> list[str]:
    """Return a list that takes what VTK would print."""
    errors: list[str] = []

    def note(caller: Any, event: str, text: str) -> None:
        errors.append(" ".join(text.split()))

    note.CallDataType = "string0"  # type: ignore[attr-defined]  # So VTK hands the text over.
    for event in ("ErrorEvent", "WarningEvent"):
        algorithm.AddObserver(event, note)
    return errors


def _matches(path: Path) -> bool:
    with path.open("rb") as file:
        return b'type="ImageData"' in file.read(400)


VTI = Format(
    name="VTI",
    suffixes=(".vti",),
    dtypes=("bool", *WIDE, *FLOATS),
    read=_read,
    write=_write,
    matches=_matches,
    holds_header=True,
    package="vtk",
    extra="view",
)
