"""Compares our dense mesher with VTK, scikit-image and PyMCubes: the same grids, one thread, in turns.

tools/peers.sh installs what this needs and calls it. The bench binary writes the grids, so that every program meshes
the very same samples, and then answers one request at a time (`--serve`), so that the rounds can be paired: in each
round everybody meshes the grid twice and the second call is timed. What is compared holds the same: with normals or
without, shared vertices always. Before anything is timed, the meshes of closed grids are compared.
"""

import json
import sys

import mcubes
from peers_shared import (
    Ours,
    Peer,
    ScikitImage,
    arguments,
    check_closed,
    exported_grids,
    measure_cut,
    show_findings,
)
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkSMPTools, vtkVersion
from vtkmodules.vtkCommonDataModel import vtkImageData
from vtkmodules.vtkFiltersCore import vtkFlyingEdges3D

TARGET = 0.45
"""Our time over VTK's, with normals, from 64 samples a side on."""


class FlyingEdges(Peer):
    """vtkFlyingEdges3D, without gradients and scalars."""

    is_plain = True

    def __init__(self, normals):
        self.name = f"VTK {vtkVersion.GetVTKVersion()} FlyingEdges3D" + ("" if normals else ", bare")
        self.normals = normals
        self.filter = vtkFlyingEdges3D()
        self.filter.SetValue(0, 0.0)
        self.filter.ComputeGradientsOff()
        self.filter.ComputeScalarsOff()
        self.filter.SetComputeNormals(normals)

    def load(self, grid):
        self.image = vtkImageData()
        self.image.SetDimensions(grid.size, grid.size, grid.size)
        self.image.GetPointData().SetScalars(numpy_to_vtk(grid.samples.ravel()))
        self.filter.SetInputData(self.image)

    def mesh(self):
        self.filter.Modified()
        self.filter.Update()

    def faces(self):
        cells = self.filter.GetOutput().GetPolys()
        return vtk_to_numpy(cells.GetConnectivityArray()).reshape(-1, 3)


class PyMCubes(Peer):
    """mcubes.marching_cubes, which makes no normals."""

    name = "PyMCubes 0.1.6"
    normals = False

    def load(self, grid):
        self.samples = grid.samples

    def mesh(self):
        _, self.triangle_indices = mcubes.marching_cubes(self.samples, 0.0)

    def faces(self):
        return self.triangle_indices


def targets(rows):
    """Our time over VTK's where it counts."""
    counted = [row for row in rows if row["name"].startswith("VTK") and row["normals"] and row["size"] >= 64]
    return [
        {
            "what": f"{row['field']:<8} n = {row['size']}",
            "ratio": row["ratio"],
            "limit": TARGET,
            "met": row["ratio"]["median"] <= TARGET,
        }
        for row in counted
    ]


def main():
    told = arguments(__doc__.splitlines()[0])

    vtkSMPTools.SetBackend("Sequential")
    vtkSMPTools.Initialize(1)
    meshers = [
        Ours(told.bench, "burrow dense f32", True),
        FlyingEdges(True),
        ScikitImage(),
        Ours(told.bench, "burrow dense f32, bare", False),
        FlyingEdges(False),
        PyMCubes(),
    ]
    grids = exported_grids(told.bench, told.fields, told.sizes)
    print("closed grids, before anything is timed")
    findings, fine = check_closed(grids, lambda _: meshers, show_findings)
    if not fine:
        sys.exit("peers: meshes are not closed, or not of the same surface; nothing is timed")
    rows = measure_cut(grids, lambda _: meshers, told.quick)
    reached = targets(rows)
    print("\ntargets: our time over VTK's, both with normals, on one thread")
    for target in reached:
        verdict = "met" if target["met"] else "missed"
        print(f"  {target['what']:<20} {target['ratio']['median']:.3f}  at most {TARGET:.2f}  {verdict}")
    if told.json:
        report = {"findings": findings, "rows": rows, "targets": reached}
        told.json.write_text(json.dumps(report, indent=2) + "\n")


if __name__ == "__main__":
    main()
