// Data shared by the threads of a block that meshes a brick.
#pragma once

#include "threads.cuh"

constexpr i32 LEVELS = 27;
// Number of warps that process corners.
constexpr i32 CORNER_WARPS = 3;
// Upper bounds: 8 x 9 x 9 lattice edges along each axis can cross the surface, and a cube has at most five
// triangles.
constexpr i32 MOST_VERTICES = 3 * 8 * 9 * 9;
constexpr i32 MOST_CUBE_INDICES = 15;

// A sample and its edited flag in one number: twice the density, plus 1 if edited.
typedef i32 Marked;

// Which edges of one level cross the surface, one bit for each of 32 corners, and how many edges precede them.
struct Run {
    u32 crossed, first;
};

// The surface as bits, until its edges and cubes are listed.
struct Bits {
    // Per corner, with padding so that every corner has neighbours. `columns` has the samples above the corner:
    // solid bits in the lower half, edited bits in the upper half. `drawn` has the cubes to draw, none where there
    // is no cell.
    u32 columns[CORNERS + 20];
    u16 drawn[CORNERS + 20];
    Run runs[LEVELS][CORNER_WARPS];
};

// Indices that a warp writes at once. 32 cubes rarely have more, and little shared memory lets more blocks run
// concurrently.
constexpr u32 STAGED_INDICES = 240;

// Staging memory in which a warp orders its output.
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
    // Edge ids in vertex order, and vertex numbers by edge id.
    u16 edges[MOST_VERTICES], numbers[LEVELS * CORNERS];
    // Cubes to draw, in order: id of the lowest corner | case << PLACE_BITS | number of indices << CUBE_BITS.
    u32 cubes[LEN];
    // Signs found among the corners in the brick, and among those just outside: 1 solid, 2 air.
    u32 signs[2];
    // Bit mask of the layers with a cube to draw.
    u32 layers;
    u32 vertex, vertices, index, indices, cubes_in_all;
};

constexpr u32 PLACE_BITS = 10, CUBE_BITS = 18;

// Index of corner (0, 0) in `columns` and `drawn`.
constexpr i32 MARGIN = 10;

// A brick and its stack.
struct Site {
    const MeshParams& params;
    const MeshJob& job;
    const ColumnJob& column;
    const Stack& stack;
    // The brick's minimum corner.
    i32 low[3];
    // Does any corner lie on the world's border? The world has none above or below.
    bool is_at_rim;
};

// Entry in `windows` of the brick at this offset; dx and dz are -1, 0 or 1. The entries of the bricks below and
// above are adjacent.
__device__ inline const u32* window_at(const Site& site, i32 dx, i32 dz) {
    i32 strides = site.job.strides;
    return site.params.windows + (i32)(site.job.window + dx * (strides & 0xffff) + dz * (strides >> 16));
}
