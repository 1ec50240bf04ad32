"""Compares our dense mesher with public GPU meshers: cupmb and isoext, on the grids of tools/peers.py.

tools/peers.sh --gpu installs what this needs and calls it. The rounds and checks are those of tools/peers.py, but this
compares unlike things: ours is one thread of the CPU, with samples and mesh in the host's memory, and a peer has
a whole GPU. So each peer is timed three ways, always until the GPU has finished:

    on the card     the samples are on the GPU, and the mesh stays there
    to the host     as above, and vertices and triangles are copied to the host
    host to host    the samples are first copied to the GPU, and the mesh back: as for ours

Peers are called from Python, which takes them some microseconds; ours times itself. Meshes have no normals, but for
scikit-image's and the one of ours next to it. What our own CUDA backend does with a terrain's transactions is another
comparison: `cargo bench --no-default-features --features cuda --bench backends`.
"""

import json
import sys

import numpy as np
from peers_shared import (
    TOPOLOGY,
    Ours,
    Peer,
    ScikitImage,
    arguments,
    check_closed,
    exported_grids,
    measure_cut,
    topology,
)

WAYS = ("on the card", "to the host", "host to host")

SCALAR = """
namespace cupmb {
    template <typename T, typename I, I dim>
    __device__ __forceinline__ T scalar(
            const trove::array<T, dim>&, const trove::array<I, dim>& at, const float* samples, const I side) {
        return samples[(trove::get<2>(at) * side + trove::get<1>(at)) * side + trove::get<0>(at)];
    }
}
"""
"""The field as cupmb reads it: the sample at the lattice point, x fastest."""


class Card:
    """A mesher on the card: `from_host` copies the samples, `on_card` meshes and waits, `to_host` copies the mesh."""

    grid = None

    def load(self, grid):
        """Once for each grid, however many ask."""
        if grid is not self.grid:
            self.begin(grid)
            self.grid = grid


class Cupmb(Card):
    """cupmb.ParallelMarchingBlocks: marching cubes; blocks share no vertices. As it comes, or with its own tuning."""

    def __init__(self, is_tuned):
        import cupmb
        import cupy

        if cupy.cuda.runtime.getDeviceCount() == 0:
            raise RuntimeError("no CUDA device")
        self.cupy, self.cupmb = cupy, cupmb
        self.name = f"cupmb {cupmb.__version__}" + (" tuned" if is_tuned else "")
        rigor = cupmb.AutotuningRigor
        self.rigor = rigor.PATIENT if is_tuned else rigor.ESTIMATE

    def begin(self, grid):
        self.samples, self.side = grid.samples, grid.size
        self.samples_there = self.cupy.asarray(grid.samples)
        # A step of one: the vertices are where the others have them.
        cells = grid.size - 1
        self.blocks = self.cupmb.ParallelMarchingBlocks(
            3,
            SCALAR,
            N=cells,
            L=float(cells),
            extra_params=[("samples", "const float*"), ("side", "I")],
            autotuning_rigor=self.rigor,
        )

    def from_host(self):
        self.samples_there.set(self.samples)

    def on_card(self):
        self.made = self.blocks(self.samples_there, self.side)
        self.cupy.cuda.get_current_stream().synchronize()
        # Nothing, where there is no surface.
        self.triangles = 0 if self.made[1] is None else len(self.made[1])

    def to_host(self):
        empty = np.zeros((0, 3))
        self.mesh = [empty if made is None else self.cupy.asnumpy(made) for made in self.made]


class Isoext(Card):
    """isoext.marching_cubes with one of its tables."""

    def __init__(self, method):
        import torch

        if not torch.cuda.is_available():
            raise RuntimeError("no CUDA device")
        import isoext

        self.torch, self.isoext, self.method = torch, isoext, method
        self.name = f"isoext {isoext.__version__} {method}"

    def begin(self, grid):
        self.samples = self.torch.from_numpy(grid.samples)
        last = [float(grid.size - 1)] * 3
        self.lattice = self.isoext.UniformGrid([grid.size] * 3, aabb_min=[0.0] * 3, aabb_max=last)
        self.from_host()

    def from_host(self):
        self.lattice.set_values(self.samples.cuda())

    def on_card(self):
        self.made = self.isoext.marching_cubes(self.lattice, 0.0, self.method)
        self.torch.cuda.synchronize()
        self.triangles = len(self.made[1])

    def to_host(self):
        self.mesh = [made.cpu().numpy() for made in self.made]


class Way(Peer):
    """A mesher on the card, called in one of the ways."""

    normals = False

    def __init__(self, card, way):
        self.card, self.way = card, way
        self.name = f"{card.name}, {way}"

    def load(self, grid):
        self.card.load(grid)

    def mesh(self):
        if self.way == "host to host":
            self.card.from_host()
        self.card.on_card()
        if self.way != "on the card":
            self.card.to_host()

    def faces(self):
        return range(self.card.triangles)

    def topology(self):
        self.mesh()
        self.card.to_host()
        positions, faces = self.card.mesh
        return topology(welded(positions, faces), len(positions))


def welded(positions, faces):
    """Triangles of one vertex for each position. No two edges of these grids are crossed in one place."""
    faces = np.asarray(faces, dtype=np.int64).reshape(-1, 3)
    if len(faces) == 0:
        return faces
    _, number = np.unique(positions, axis=0, return_inverse=True)
    faces = number.ravel()[faces]
    collapsed = (faces == np.roll(faces, 1, axis=1)).any(axis=1)
    return faces[~collapsed]


def available(kinds):
    """The meshers that can be made; for the others, the reason."""
    meshers = []
    for name, make in kinds.items():
        try:
            meshers.append(make())
        except Exception as error:
            print(f"peers: without {name}: {type(error).__name__}: {error}", file=sys.stderr)
    return meshers


def working(meshers, grid):
    """The meshers that mesh a grid; for the others, the reason."""
    fit = []
    for mesher in meshers:
        if isinstance(mesher, Way):
            try:
                mesher.load(grid)
                mesher.mesh()
            except Exception as error:
                what = f"{mesher.name} on {grid.field}, n = {grid.size}"
                print(f"peers: without {what}: {type(error).__name__}: {error}", file=sys.stderr)
                continue
        fit.append(mesher)
    return fit


def show_meshes(findings):
    """Every mesh of a closed grid, whether it is like ours or not."""
    heading = f"{findings[0]['field']}, n = {findings[0]['size']}"
    print(f"\n  {heading:<44}" + "".join(f"{name:>11}" for name in TOPOLOGY))
    for found in findings:
        name = found["name"].removesuffix(f", {WAYS[0]}")
        print(f"    {name:<42}" + "".join(f"{found[column]:>11}" for column in TOPOLOGY))


def main():
    told = arguments(__doc__.splitlines()[0])
    kinds = {
        "cupmb": lambda: Cupmb(is_tuned=False),
        "cupmb tuned": lambda: Cupmb(is_tuned=True),
        "isoext vega": lambda: Isoext("vega"),
        "isoext nagae": lambda: Isoext("nagae"),
    }
    cards = available(kinds)
    if not cards:
        sys.exit("peers: no GPU mesher runs here, so nothing is compared; they need an NVIDIA card with its driver")
    ways = [Way(card, way) for way in WAYS for card in cards]
    ours = [Ours(told.bench, "burrow dense f32, bare", False)]
    # For scale; and what it is compared with has normals.
    scikit_image = available({"scikit-image": ScikitImage})
    ours += [Ours(told.bench, "burrow dense f32", True)] if scikit_image else []

    grids = exported_grids(told.bench, told.fields, told.sizes)
    print("closed grids, before anything is timed: vertices after welding, and as they were written")
    cards_alone = ways[: len(cards)]
    findings, fine = check_closed(
        grids, lambda grid: ours + scikit_image + working(cards_alone, grid), show_meshes
    )
    if not fine:
        sys.exit("peers: our mesh is not closed; nothing is timed")
    rows = measure_cut(grids, lambda grid: ours + scikit_image + working(ways, grid), told.quick)
    if told.json:
        told.json.write_text(json.dumps({"findings": findings, "rows": rows}, indent=2) + "\n")


if __name__ == "__main__":
    main()
