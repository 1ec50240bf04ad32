// What the threads of a block that meshes a brick share.
#pragma once

#include "threads.cuh"

constexpr i32 LEVELS = 27;
// Warps that have a corner.
constexpr i32 CORNER_WARPS = 3;
// Most edges that cross a surface: 8 x 9 x 9 along each axis. Most triangles: five in each cube.
constexpr i32 MOST_VERTICES = 3 * 8 * 9 * 9;
constexpr i32 MOST_TRIANGLES = 5 * LEN;

// Samples with their editedness in one number: twice the density, and one more if it is edited.
typedef i32 Marked;

// Edges of one level from 32 corners, a bit for each; and how many edges come before them.
struct Run {
    u32 crossed, first;
};

struct MeshBench {
    i32 heights[AREA];
    Marked apron[WINDOW * AREA];
    // By corner, with some before and after, so that every corner has neighbours: what is above it as bits, solid samples in
    // the lower half, edited ones in the upper half; the cubes to draw, none where there is no cell.
    u32 columns[CORNERS + 20];
    u16 drawn[CORNERS + 20];
    Run runs[LEVELS][CORNER_WARPS];
    // Places of the edges, in order of their vertices.
    u16 edges[MOST_VERTICES];
    // Drawn cubes in order: the place of their lowest corner in its layer | case << PLACE_BITS.
    u32 cubes[LEN];
    // number of the cube | number in it << CUBE_BITS
    u16 triangles[MOST_TRIANGLES];
    // Where each warp puts its output in order.
    union {
        float normals[96];
        u16 indices[96];
    } staged[THREADS / 32];
    // What signs each warp's corners have: 1 solid, 2 air.
    u32 signs[THREADS / 32];
    // Layers that have a cube to draw.
    u32 layers;
    u32 vertex, vertices, index, triangles_in_all;
};

constexpr u32 PLACE_BITS = 10, CUBE_BITS = 9;

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
};

// Where the brick so far away is in `windows`, each -1, 0 or 1; those below and above lie beside it.
__device__ inline const u32* window_at(const Site& site, i32 dx, i32 dz) {
    i32 strides = site.job.strides;
    return site.params.windows + (i32)(site.job.window + dx * (strides & 0xffff) + dz * (strides >> 16));
}
