"""Our dense mesher beside VTK, scikit-image and PyMCubes: the same grids, one thread, in turns.

tools/peers.sh installs what this needs and calls it. The bench binary writes the grids, so that every program meshes
the very same samples, and then answers one request at a time (`--serve`), so that the rounds can be paired: in each
round everybody meshes the grid twice and the second call is timed. What is compared holds the same: with normals or
without, shared vertices always. Before anything is timed, the meshes of closed grids are compared.
"""

import argparse
import json
import sys
from pathlib import Path

import mcubes
from peers_shared import Ours, Peer, ScikitImage, check, exported_grids, measure, rounds, show_findings, show_rows
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
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--bench", required=True, help="the built bench binary 'meshers'")
    parser.add_argument("--quick", action="store_true", help="few rounds")
    parser.add_argument("--fields", default="sphere,terrain,caves,empty")
    parser.add_argument("--sizes", default="64,100,128")
    parser.add_argument("--json", type=Path, help="where to write all figures")
    arguments = parser.parse_args()

    vtkSMPTools.SetBackend("Sequential")
    vtkSMPTools.Initialize(1)
    bench = arguments.bench
    meshers = [
        Ours(bench, "burrow dense f32", True),
        FlyingEdges(True),
        ScikitImage(),
        Ours(bench, "burrow dense f32, bare", False),
        FlyingEdges(False),
        PyMCubes(),
    ]
    findings, rows, fine = [], [], True
    grids = exported_grids(bench, arguments.fields, arguments.sizes)
    print("closed grids, before anything is timed")
    for grid in (grid for grid in grids if grid.closed):
        found, is_fine = check(meshers, grid)
        show_findings(found)
        findings += found
        fine &= is_fine
    if not fine:
        sys.exit("peers: meshes are not closed, or not of the same surface; nothing is timed")
    for grid in (grid for grid in grids if not grid.closed):
        measured = measure(meshers, grid, *rounds(arguments.quick))
        show_rows(measured, grid)
        rows += measured
    reached = targets(rows)
    print("\ntargets: our time over VTK's, both with normals, on one thread")
    for target in reached:
        verdict = "met" if target["met"] else "missed"
        print(f"  {target['what']:<20} {target['ratio']['median']:.3f}  at most {TARGET:.2f}  {verdict}")
    if arguments.json:
        report = {"findings": findings, "rows": rows, "targets": reached}
        arguments.json.write_text(json.dumps(report, indent=2) + "\n")


if __name__ == "__main__":
    main()
