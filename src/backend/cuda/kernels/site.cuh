// What the threads of a block that meshes a brick share.
#pragma once

#include "threads.cuh"

constexpr i32 LEVELS = 27;
// Warps that have a corner.
constexpr i32 CORNER_WARPS = 3;
// Most edges that cross a surface: 8 x 9 x 9 along each axis. Most triangles: five in each cube.
constexpr i32 MOST_VERTICES = 3 * 8 * 9 * 9;
constexpr i32 MOST_TRIANGLES = 5 * LEN;
// A thread's own cells: four in a row.
constexpr u32 CELLS_EACH = LEN / THREADS;

// Samples with their editedness in one number: twice the density, and one more if it is edited.
typedef i32 Marked;

struct MeshBench {
    // Bricks around, by (y * 3 + z) * 3 + x.
    u32 refs[27];
    i32 heights[AREA];
    // Each step of the plan has its own use for this.
    union alignas(8) {
        // Rows of solid samples, then of edited ones, of the eight bricks that hold corners.
        u8 rows[8][2][SIDE * SIDE];
        Marked apron[WINDOW * AREA];
        // cell | number in its cube << 9
        u16 triangles[MOST_TRIANGLES];
    };
    // Where each warp puts its output in order.
    union {
        float normals[THREADS / 32][96];
        u16 indices[THREADS / 32][96];
    };
    // By corner, with one column of nothing before and after, so that every corner has neighbours.
    u16 solid[CORNERS + 20], drawn[CORNERS + 20];
    // Places of the edges, in order of their vertices.
    u16 edges[MOST_VERTICES];
    // Of each level the edges of 32 corners, and how many come before them.
    u32 crossed[CORNER_WARPS][LEVELS];
    u16 first[CORNER_WARPS][LEVELS];
    u32 warp_triangles[THREADS / 32];
    // Layers that have a cube to draw.
    u32 layers;
    u32 vertex, vertices, index, triangles_in_all;
};

// From where the corner (0, 0) is in `solid` and `drawn`.
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

// The brick so far away, each -1, 0 or 1, as an index of `refs`.
__device__ inline i32 around(i32 dx, i32 dy, i32 dz) { return (dy * 3 + dz) * 3 + dx + 13; }
