// Signed distances from lattice points to shapes, with their roughness: brush/distance.rs, brush/roughness.rs,
// brush/evaluator.rs.
#pragma once

#include "threads.cuh"

struct Vector {
    float x, y, z;
};

// Like Rust's `if a > b { a } else { b }`; fmaxf treats zeroes otherwise.
__device__ inline float larger(float a, float b) { return a > b ? a : b; }

__device__ inline float smaller(float a, float b) { return a < b ? a : b; }

__device__ inline float length(float x, float y, float z) { return sqrtf(x * x + (y * y + z * z)); }

__device__ inline float dot(Vector p, const float* v) { return p.x * v[0] + (p.y * v[1] + p.z * v[2]); }

// From the point to the place `along` an axis.
__device__ inline float off_axis(Vector p, float along, const float* unit) {
    return length(p.x - along * unit[0], p.y - along * unit[1], p.z - along * unit[2]);
}

__device__ inline float sphere(Vector p, const float* constants) {
    return length(p.x, p.y, p.z) - constants[0];
}

__device__ inline float cuboid(Vector p, const float* constants) {
    const float* half = constants + 9;
    float qx = fabsf(dot(p, constants)) - half[0];
    float qy = fabsf(dot(p, constants + 3)) - half[1];
    float qz = fabsf(dot(p, constants + 6)) - half[2];
    float outside = length(larger(qx, 0.0f), larger(qy, 0.0f), larger(qz, 0.0f));
    return outside + smaller(larger(larger(qx, qy), qz), 0.0f);
}

__device__ inline float cylinder(Vector p, const float* constants) {
    float axis = constants[3], radius = constants[4];
    float along = dot(p, constants);
    float side = off_axis(p, along, constants) - radius;
    float half = axis * 0.5f;
    float end = fabsf(along - half) - half;
    float outside = length(larger(side, 0.0f), larger(end, 0.0f), 0.0f);
    return outside + smaller(larger(side, end), 0.0f);
}

__device__ inline float capsule(Vector p, const float* constants) {
    float axis = constants[3], radius = constants[4];
    float along = smaller(larger(dot(p, constants), 0.0f), axis);
    return off_axis(p, along, constants) - radius;
}

__device__ inline float cone(Vector p, const float* constants) {
    float radius = constants[4], slant = constants[5], rise = constants[6], run = constants[7];
    float along = dot(p, constants);
    float beyond = off_axis(p, along, constants) - radius;
    // Over the side's line, and how far that point is past either end of the side.
    float over = beyond * rise + along * run;
    float up = along * rise - beyond * run;
    float past = up - smaller(larger(up, 0.0f), slant);
    float to_side = over * over + past * past;
    float rim = larger(beyond, 0.0f);
    float to_base = rim * rim + along * along;
    float outside = sqrtf(smaller(to_side, to_base));
    float inside = larger(over, -along);
    return inside < 0.0f ? inside : outside;
}

__device__ inline float smooth_distance(const Tool& tool, Vector p) {
    switch (tool.kind) {
        case SPHERE: return sphere(p, tool.constants);
        case CUBOID: return cuboid(p, tool.constants);
        case CYLINDER: return cylinder(p, tool.constants);
        case CAPSULE: return capsule(p, tool.constants);
        default: return cone(p, tool.constants);
    }
}

// SplitMix64, as lattice/hash.rs has it.
__device__ inline u64 mix(u64 value) {
    u64 z = value + 0x9E3779B97F4A7C15ull;
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ull;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBull;
    return z ^ (z >> 31);
}

__device__ inline float lerp(float a, float b, float t) { return a + (b - a) * t; }

// A place among noise points: the cell, and the faded position between its ends.
struct Place {
    i32 cell;
    float t;
};

__device__ inline Place locate(i32 voxel, i32 scale) {
    const i32 RIM = 1 << 20;
    i32 place = smallest(largest(voxel, -RIM), RIM) * ONE;
    // Rounded down.
    i32 cell = place / scale - (place % scale < 0);
    float t = (float)(place - cell * scale) / (float)scale;
    return {cell, t * t * (3.0f - 2.0f * t)};
}

// The value of a noise point: 24 bits of a hash, in [-1, 1).
__device__ inline float noise_point(i32 x, i32 y, i32 z, u64 seed) {
    u64 place = (u64)(x & 0x1fffff) << 42 | (u64)(y & 0x1fffff) << 21 | (u64)(z & 0x1fffff);
    return (float)((i32)(mix(place ^ seed) >> 40) - (1 << 23)) / (float)(1 << 23);
}

// The noise on the plane of noise points with one x.
__device__ inline float noise_face(i32 x, Place y, Place z, u64 seed) {
    auto row = [&](i32 z) {
        return lerp(noise_point(x, y.cell, z, seed), noise_point(x, y.cell + 1, z, seed), y.t);
    };
    return lerp(row(z.cell), row(z.cell + 1), z.t);
}

// Bumps at a lattice point.
__device__ inline float bumps(const Tool& tool, i32 x, i32 y, i32 z) {
    Place px = locate(x, tool.scale), py = locate(y, tool.scale), pz = locate(z, tool.scale);
    u64 seed = mix(tool.seed);
    float value = lerp(noise_face(px.cell, py, pz, seed), noise_face(px.cell + 1, py, pz, seed), px.t);
    if (value < -1.0f) value = -1.0f;
    if (value > 1.0f) value = 1.0f;
    return value * (float)tool.amplitude;
}

// To the nearest integer, halves to even, with an addition: next to 1.5 * 2^23, floats are the integers.
__device__ inline i32 round_distance(float distance) {
    const float SHIFT = 12582912.0f, HORIZON = 4194304.0f;
    float near = smaller(larger(distance, -HORIZON), HORIZON);
    return __float_as_int(near + SHIFT) - __float_as_int(SHIFT);
}

// Voxels from a shape's origin; they stop where no distance shows the difference.
__device__ inline i32 voxels_from(i32 voxel, i32 home) {
    const i64 FARTHEST = 65000;
    i64 voxels = (i64)voxel - home;
    return (i32)(voxels < -FARTHEST ? -FARTHEST : voxels > FARTHEST ? FARTHEST : voxels);
}

// The signed distance of the lattice point `offset` from a brick's lowest sample `low`. Rows along x begin at `low`, and
// only their first coordinate stops at the end of all distances, as on the CPU.
__device__ inline i32 distance_to(const Tool& tool, const i32* low, const i32* offset) {
    i32 y = low[1] + offset[1], z = low[2] + offset[2];
    Vector p = {
        (float)((voxels_from(low[0], tool.home[0]) + offset[0]) * ONE - tool.rest[0]),
        (float)(voxels_from(y, tool.home[1]) * ONE - tool.rest[1]),
        (float)(voxels_from(z, tool.home[2]) * ONE - tool.rest[2]),
    };
    float distance = smooth_distance(tool, p);
    if (tool.is_rough) distance += bumps(tool, low[0] + offset[0], y, z);
    return round_distance(distance);
}
