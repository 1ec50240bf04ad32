// Shapes that are given by distances on a grid, in integers: brush/shapes/grid.rs, brush/shapes/shape_grid.rs.
#pragma once

#include "threads.cuh"

struct Vector {
    float x, y, z;
};

// Like Rust's `if a > b { a } else { b }`; fmaxf treats zeroes differently.
__device__ inline float larger(float a, float b) { return a > b ? a : b; }

__device__ inline float smaller(float a, float b) { return a < b ? a : b; }

// The place in a grid nearest to a point.
struct GridPlace {
    // The cell, and where in it, in 1/256 of its side.
    i64 cell[3], part[3];
    // Distance from the point, in 1/256 voxel.
    double beyond;
};

// The place nearest to a point at this distance from the grid's centre.
__device__ inline GridPlace place_in_grid(const GridRecord& grid, const i64* from) {
    GridPlace place;
    double squared = 0.0;
    for (i32 axis = 0; axis < 3; axis++) {
        i64 along = 0;
        for (i32 i = 0; i < 3; i++) along += grid.rows[i][axis] * from[i];
        i64 local = divided(along + grid.squared / 2, grid.squared), last = largest((i32)grid.size[axis] - 1, 0) * (i64)ONE;
        i64 at = divided(local * ONE, grid.scale) + last / 2, inside = at < 0 ? 0 : at > last ? last : at;
        double excess = (double)(at - inside) * (double)grid.scale / 256.0;
        squared += excess * excess;
        i64 cell = inside >> 8, last_cell = (i64)grid.size[axis] - 2;
        place.cell[axis] = cell < last_cell ? cell : last_cell;
        place.part[axis] = inside - place.cell[axis] * ONE;
    }
    place.beyond = sqrt(squared);
    return place;
}

__device__ inline GridPlace place_in_grid(const GridRecord& grid, Vector p) {
    i64 from[3] = {(i64)p.x, (i64)p.y, (i64)p.z};
    return place_in_grid(grid, from);
}

// Index of one of a grid's samples, without the first row of its image.
__device__ inline i64 grid_index(const GridRecord& grid, const i64* cell, i32 x, i32 y, i32 z) {
    return ((cell[2] + z) * grid.size[1] + cell[1] + y) * grid.size[0] + cell[0] + x;
}

__device__ inline i64 grid_sample(const u16* distances, i64 index) { return (i64)distances[index] - GRID_ZERO; }

// How far outside the grid a point is.
__device__ __noinline__ float beyond_grid(const GridRecord& grid, Vector p) { return (float)place_in_grid(grid, p).beyond; }

// Distance from a point to the shape, the point's vector being from the grid's centre.
__device__ __noinline__ float grid_distance(const GridRecord& grid, const u16* images, Vector p) {
    const float FARTHEST = 3.4028235e38f;
    if (grid.size[0] < 2 || grid.size[1] < 2 || grid.size[2] < 2) return FARTHEST;
    GridPlace place = place_in_grid(grid, p);
    const u16* distances = images + grid.image + grid.size[0];
    i64 sum = 0;
    for (i32 z = 0; z < 2; z++) {
        i64 layer = 0;
        for (i32 y = 0; y < 2; y++) {
            i64 first = grid_index(grid, place.cell, 0, y, z);
            i64 row = grid_sample(distances, first) * (ONE - place.part[0]) + grid_sample(distances, first + 1) * place.part[0];
            layer += row * (y == 0 ? ONE - place.part[1] : place.part[1]);
        }
        sum += layer * (z == 0 ? ONE - place.part[2] : place.part[2]);
    }
    float inside = (float)((sum * grid.scale + (1ll << 31)) >> 32);
    return place.beyond > 0.0 ? larger(inside, (float)place.beyond) : inside;
}

// The grid's material at a lattice point, or `NONE`: that of the nearest sample inside the shape among the eight around
// it, else of the nearest one.
__device__ __noinline__ u32 grid_material(const EditRecord& record, const GridRecord& grid, const u16* images, const i32* at) {
    i64 from[3];
    for (i32 i = 0; i < 3; i++) from[i] = (i64)(at[i] - record.origin_voxel[i]) * ONE - record.origin_fraction[i];
    GridPlace place = place_in_grid(grid, from);
    const u16* distances = images + grid.image + grid.size[0];
    i64 nearest = 0, greatest = -1;
    bool has_inside = false;
    for (i32 corner = 0; corner < 8; corner++) {
        i64 weight = 1;
        for (i32 i = 0; i < 3; i++) weight *= corner >> i & 1 ? place.part[i] : ONE - place.part[i];
        i64 index = grid_index(grid, place.cell, corner & 1, corner >> 1 & 1, corner >> 2);
        bool is_inside = weight > 0 && grid_sample(distances, index) < 0;
        // Of equally near ones, the first.
        if (is_inside < has_inside || (is_inside == has_inside && weight <= greatest)) continue;
        nearest = index;
        greatest = weight;
        has_inside = is_inside;
    }
    const u16* materials = distances + (i64)grid.size[0] * grid.size[1] * grid.size[2];
    u32 pair = materials[nearest / 2], material = nearest % 2 == 0 ? pair & 0xff : pair >> 8;
    return material == GROUND ? NONE : material;
}
