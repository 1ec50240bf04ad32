// What the threads of a block that meshes a brick share.
#pragma once

#include "threads.cuh"

constexpr i32 LEVELS = 27;
// Warps that have a corner.
constexpr i32 CORNER_WARPS = 3;
// Most edges that cross a surface: 8 x 9 x 9 along each axis. Most indices: five triangles in each cube.
constexpr i32 MOST_VERTICES = 3 * 8 * 9 * 9;
constexpr i32 MOST_CUBE_INDICES = 15;

// Samples with their editedness in one number: twice the density, and one more if it is edited.
typedef i32 Marked;

// Edges of one level from 32 corners, a bit for each; and how many edges come before them.
struct Run {
    u32 crossed, first;
};

// The surface as bits, until its edges and cubes are listed.
struct Bits {
    // By corner, with some before and after, so that every corner has neighbours: what is above it, solid samples in the
    // lower half, edited ones in the upper half; the cubes to draw, none where there is no cell.
    u32 columns[CORNERS + 20];
    u16 drawn[CORNERS + 20];
    Run runs[LEVELS][CORNER_WARPS];
};

// Indices that a warp writes together: as many as 32 cubes have nearly always, so that more blocks run side by side.
constexpr u32 STAGED_INDICES = 240;

// Where a warp puts its output in order.
union Output {
    float normals[96];
    u16 indices[STAGED_INDICES];
};

struct MeshMemory {
    i32 heights[AREA];
    Marked padding[WINDOW * AREA];
    union {
        Bits bits;
        Output output[THREADS / 32];
    };
    // Places of the edges, in order of their vertices; and numbers of the vertices, by place.
    u16 edges[MOST_VERTICES], numbers[LEVELS * CORNERS];
    // Drawn cubes in order: the place of their lowest corner in its layer | case << PLACE_BITS | indices << CUBE_BITS.
    u32 cubes[LEN];
    // What signs the corners in the brick have, and those beside it: 1 solid, 2 air.
    u32 signs[2];
    // Layers that have a cube to draw.
    u32 layers;
    u32 vertex, vertices, index, indices, cubes_in_all;
};

constexpr u32 PLACE_BITS = 10, CUBE_BITS = 18;

// From where the corner (0, 0) is in `columns` and `drawn`.
constexpr i32 MARGIN = 10;

// A brick and what its stack has.
struct Site {
    const MeshParams& params;
    const MeshJob& job;
    const ColumnJob& column;
    const Stack& stack;
    // Lowest sample.
    i32 low[3];
    // Do any of its corners lie on the world's rim? There is none above, and none below.
    bool is_at_rim;
};

// Where the brick so far away is in `windows`, each -1, 0 or 1; those below and above lie beside it.
__device__ inline const u32* window_at(const Site& site, i32 dx, i32 dz) {
    i32 strides = site.job.strides;
    return site.params.windows + (i32)(site.job.window + dx * (strides & 0xffff) + dz * (strides >> 16));
}
