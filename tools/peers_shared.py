"""What tools/peers.py and tools/peers_gpu.py share: our mesher, the grids, the checks, the rounds."""

import argparse
import json
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import scipy.sparse

TOPOLOGY = ("vertices", "written", "triangles", "unbalanced", "components", "euler")
"""What is said of a mesh; vertices after welding and as they were written, edges that do not run both ways alike."""


def arguments(description):
    """What the command line says."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--bench", required=True, help="the built bench binary 'meshers'")
    parser.add_argument("--quick", action="store_true", help="few rounds")
    parser.add_argument("--fields", default="sphere,terrain,caves,empty")
    parser.add_argument("--sizes", default="64,100,128")
    parser.add_argument("--json", type=Path, help="where to write all figures")
    return parser.parse_args()


class Ours:
    """Our mesher, in a process that meshes on request."""

    is_plain = True
    refuses_air = False

    def __init__(self, bench, contender, normals):
        self.name = contender
        self.normals = normals
        command = [bench, "--serve"]
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def load(self, grid):
        self.request = f"{grid.field} {grid.size} {'closed' if grid.closed else 'cut'} {self.name}\n"

    def answer(self):
        self.process.stdin.write(self.request)
        self.process.stdin.flush()
        line = self.process.stdout.readline()
        if not line:
            sys.exit(f"peers: {self.name} gave up on {self.request!r}")
        return json.loads(line)

    def time(self):
        answer = self.answer()
        self.triangles = answer["triangles"]
        return answer["nanoseconds"]

    def topology(self):
        topology = self.answer()["topology"]
        return {key: topology[key] for key in TOPOLOGY}


class Peer:
    """A mesher of this process: `mesh` is timed, `faces` reads the triangles of the last mesh."""

    is_plain = False
    """Marching cubes that do not look into cubes, so that triangles, pieces and handles are as ours."""
    refuses_air = False
    """Fails where there is no surface."""

    def time(self):
        self.mesh()
        start = time.perf_counter_ns()
        self.mesh()
        took = time.perf_counter_ns() - start
        self.triangles = len(self.faces())
        return took

    def topology(self):
        self.mesh()
        return topology(self.faces())


class ScikitImage(Peer):
    """skimage.measure.marching_cubes (Lewiner), which always makes normals."""

    normals = True
    refuses_air = True

    def __init__(self):
        import skimage.measure

        self.name = f"scikit-image {skimage.__version__}"
        self.marching_cubes = skimage.measure.marching_cubes

    def load(self, grid):
        self.samples = grid.samples

    def mesh(self):
        _, self.triangle_indices, _, _ = self.marching_cubes(self.samples, 0.0)

    def faces(self):
        return self.triangle_indices


class Grid:
    """Samples that the bench wrote, as [z, y, x]."""

    def __init__(self, folder, entry):
        self.field, self.size, self.closed = entry["field"], entry["size"], entry["closed"]
        samples = np.fromfile(folder / entry["file"], dtype="<f4")
        self.samples = samples.reshape(self.size, self.size, self.size)

    def cells(self):
        return (self.size - 1) ** 3


def exported_grids(bench, fields, sizes):
    """What the bench meshes, cut and closed."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        subprocess.run([bench, "--export", name, "--fields", fields, "--sizes", sizes], check=True)
        return [Grid(folder, entry) for entry in json.loads((folder / "grids.json").read_text())["grids"]]


def topology(faces, written=None):
    """The values that `TOPOLOGY` names, for triangles that share vertices; `written` is the number of vertices, all used by default."""
    faces = np.asarray(faces, dtype=np.int64)
    vertices = np.unique(faces)
    written = len(vertices) if written is None else written
    if len(vertices) == 0:
        return dict.fromkeys(TOPOLOGY, 0) | {"written": written}
    runs = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    low, high = runs.min(axis=1), runs.max(axis=1)
    bound = vertices[-1] + 1
    edges, number = np.unique(low * bound + high, return_inverse=True)
    balance = np.bincount(number.ravel(), weights=np.where(runs[:, 0] == low, 1, -1))
    links = scipy.sparse.coo_array((np.ones(len(edges)), (edges // bound, edges % bound)), shape=[bound] * 2)
    pieces, label = scipy.sparse.csgraph.connected_components(links, directed=False)
    return {
        "vertices": len(vertices),
        "written": written,
        "triangles": len(faces),
        "unbalanced": int(np.count_nonzero(balance)),
        "components": len(np.unique(label[vertices])),
        "euler": len(vertices) - len(edges) + len(faces),
    }


def meshes_nothing(meshers, grid):
    """Meshers that refuse a grid: scikit-image does when there is no surface."""
    return [mesher for mesher in meshers if mesher.refuses_air and not (grid.samples < 0).any()]


def check(meshers, grid):
    """Compares the meshes of a closed grid; returns what was found and whether all is well."""
    findings, fine = [], True
    refused = meshes_nothing(meshers, grid)
    for mesher in meshers:
        if mesher in refused:
            continue
        mesher.load(grid)
        found = mesher.topology()
        first = findings[0] if findings else found
        alike = all(found[key] == first[key] for key in ("triangles", "components", "euler"))
        findings.append({"field": grid.field, "size": grid.size, "name": mesher.name, "alike": alike, **found})
        # Ambiguous faces may be cut either way, and scikit-image looks into cubes as well: in caves, pieces and handles
        # differ and nobody is wrong. Balls and hills leave no choice to plain marching cubes.
        fine &= not mesher.is_plain or (found["unbalanced"] == 0 and (alike or grid.field == "caves"))
    return findings, fine


def check_closed(grids, meshers_of, show):
    """The same for all closed grids, by the meshers of each."""
    findings, fine = [], True
    for grid in (grid for grid in grids if grid.closed):
        found, is_fine = check(meshers_of(grid), grid)
        show(found)
        findings += found
        fine &= is_fine
    return findings, fine


def show_findings(findings):
    first = findings[0]
    print(
        f"  {first['field']:<8} n = {first['size']:<4} {first['triangles']} triangles, {first['components']} pieces,"
        f" Euler {first['euler']}: {sum(found['alike'] for found in findings)} of {len(findings)} alike"
    )
    for found in findings:
        notes = [] if found["alike"] else [f"{found[key]} {key}" for key in ("triangles", "components")]
        notes += [] if found["alike"] else [f"Euler {found['euler']}"]
        notes += [f"{found['unbalanced']} unbalanced edges"] if found["unbalanced"] else []
        if notes:
            print(f"      {found['name']}: {', '.join(notes)}")


def quartiles(numbers):
    low, median, high = statistics.quantiles(numbers, n=4, method="inclusive")
    return {"low": low, "median": median, "high": high}


def rounds(is_quick):
    """How many there are, at least and at most, and the seconds after which there is no further one."""
    return (5, 15, 1.0) if is_quick else (15, 101, 6.0)


def measure(meshers, grid, least, most, budget):
    """Everybody once per round, in an order that turns."""
    refused = meshes_nothing(meshers, grid)
    meshers = [mesher for mesher in meshers if mesher not in refused]
    for mesher in meshers:
        mesher.load(grid)
    times = {mesher.name: [] for mesher in meshers}
    start = time.monotonic()
    for number in range(most):
        if number >= least and time.monotonic() - start > budget:
            break
        first = number // 2 % len(meshers)
        order = meshers[first:] + meshers[:first]
        for mesher in order if number % 2 == 0 else reversed(order):
            times[mesher.name].append(mesher.time())
    rows = []
    for mesher in meshers:
        reference = next(ours for ours in meshers if isinstance(ours, Ours) and ours.normals == mesher.normals)
        pairs = zip(times[reference.name], times[mesher.name], strict=True)
        rows.append(
            {
                "field": grid.field,
                "size": grid.size,
                "name": mesher.name,
                "normals": mesher.normals,
                "triangles": mesher.triangles,
                "rounds": len(times[mesher.name]),
                "nanoseconds_per_cell": quartiles([took / grid.cells() for took in times[mesher.name]]),
                "ratio": None if mesher is reference else quartiles([ours / other for ours, other in pairs]),
            }
        )
    return rows


def measure_cut(grids, meshers_of, is_quick):
    """The rows of all grids that are not closed, each shown as soon as it is measured."""
    rows = []
    for grid in (grid for grid in grids if not grid.closed):
        measured = measure(meshers_of(grid), grid, *rounds(is_quick))
        show_rows(measured, grid)
        rows += measured
    return rows


def show_rows(rows, grid):
    print(f"\n{grid.field}, n = {grid.size}, {grid.cells()} cells, {rows[0]['rounds']} rounds")
    print(f"{'':<46} {'us':>9} {'ns/cell':>9} {'triangles':>10}   ours / it (quartiles)")
    for normals, title in ((True, "with normals"), (False, "without normals")):
        print(f"  {title}")
        for row in (row for row in rows if row["normals"] == normals):
            of_cell = row["nanoseconds_per_cell"]["median"]
            line = f"    {row['name']:<42} {of_cell * grid.cells() / 1e3:>9.1f} {of_cell:>9.3f} {row['triangles']:>10}"
            if row["ratio"]:
                line += "   {median:.3f} ({low:.3f} to {high:.3f})".format(**row["ratio"])
            print(line)
