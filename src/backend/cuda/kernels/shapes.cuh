// Signed distances from lattice points to shapes, with roughness: brush/shapes/, brush/roughness.rs,
// brush/evaluator.rs.
#pragma once

#include "grid.cuh"

// In the same order as in brush/shapes/mod.rs. Curves, paths and corridors are for the CPU only.
enum Kind { SPHERE, CUBOID, CYLINDER, CAPSULE, CONE, TORUS, CURVE, PATH, CORRIDOR, GRID };

__device__ inline float length(float x, float y, float z) { return sqrtf(x * x + (y * y + z * z)); }

__device__ inline float dot(Vector p, const float* v) { return p.x * v[0] + (p.y * v[1] + p.z * v[2]); }

// Distance from the point to the position `along` an axis.
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
    // Signed distance to the lateral line, and how far the projection lies past either end of the side.
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

__device__ inline float torus(Vector p, const float* constants) {
    float radius = constants[4], tube = constants[5];
    float along = dot(p, constants);
    float beyond = off_axis(p, along, constants) - radius;
    return length(beyond, along, 0.0f) - tube;
}

__device__ inline float smooth_distance(const EditParams& params, const EditRecord& record, Vector p) {
    switch (record.kind) {
        case SPHERE: return sphere(p, record.constants);
        case CUBOID: return cuboid(p, record.constants);
        case CYLINDER: return cylinder(p, record.constants);
        case CAPSULE: return capsule(p, record.constants);
        case CONE: return cone(p, record.constants);
        case TORUS: return torus(p, record.constants);
        default: return grid_distance(params.grids[record.grid], params.images, p);
    }
}

// At most the distance of a point, changing no faster than the point moves.
__device__ inline float least_distance(const EditParams& params, const EditRecord& record, Vector p) {
    return record.kind == GRID ? beyond_grid(params.grids[record.grid], p) : smooth_distance(params, record, p);
}

// SplitMix64, as in lattice/hash.rs.
__device__ inline u64 mix(u64 value) {
    u64 z = value + 0x9E3779B97F4A7C15ull;
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ull;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBull;
    return z ^ (z >> 31);
}

__device__ inline float lerp(float a, float b, float t) { return a + (b - a) * t; }

// A position in the noise lattice: its cell, and the smoothed fraction within it.
struct Place {
    i32 cell;
    float t;
};

__device__ inline Place locate(i32 voxel, i32 origin, i32 scale) {
    const i32 RIM = 1 << 20;
    i32 place = smallest(largest(voxel, -RIM), RIM) * ONE - origin;
    // Round towards minus infinity.
    i32 cell = place / scale;
    if (place < cell * scale) cell--;
    float t = (float)(place - cell * scale) / (float)scale;
    return {cell, t * t * (3.0f - 2.0f * t)};
}

// The value at a noise lattice point: 24 bits of a hash, in [-1, 1).
__device__ inline float noise_point(i32 x, i32 y, i32 z, u64 seed) {
    u64 place = (u64)(x & 0x1fffff) << 42 | (u64)(y & 0x1fffff) << 21 | (u64)(z & 0x1fffff);
    return (float)((i32)(mix(place ^ seed) >> 40) - (1 << 23)) / (float)(1 << 23);
}

// The noise of one edit around one brick. A noise cell is at least one voxel wide, so eight samples span at most
// eight cells with nine points. The block hashes them once for all samples.
constexpr i32 MOST_POINTS = 9 * 9 * 9;

// Positions of the brick's samples in the noise lattice. Each warp holds one coordinate per lane: lanes 0 to 7
// along x, then along y, then along z.
struct Noise {
    Place own;
    // Strides between points along y and z.
    i32 row, area;
};

__device__ inline i32 noise_lane(i32 axis, i32 offset) { return axis * SIDE + offset; }

// Hashes the noise points around the brick with minimum corner `low`. Called by the whole block, which must
// synchronise before it reads them.
__device__ inline Noise hash_noise(const EditRecord& record, const i32* low, float* points) {
    i32 axis = lane() / SIDE, start = axis == 0 ? low[0] : axis == 1 ? low[1] : low[2];
    const i32* origins = record.noise_origin;
    i32 origin = axis == 0 ? origins[0] : axis == 1 ? origins[1] : origins[2];
    Noise noise = {locate(start + (i32)lane() % SIDE, origin, record.scale), 0, 0};
    i32 first[3], count[3];
#pragma unroll
    for (i32 i = 0; i < 3; i++) {
        first[i] = __shfl_sync(WARP, noise.own.cell, noise_lane(i, 0));
        count[i] = __shfl_sync(WARP, noise.own.cell, noise_lane(i, SIDE - 1)) - first[i] + 2;
        // From here on, cells are relative to the first one.
        if (axis == i) noise.own.cell -= first[i];
    }
    noise.row = count[0];
    noise.area = count[0] * count[1];
    // Divides small integers as floats. The error is far below the 0.5 that is added.
    float by_row = 1.0f / (float)noise.row, by_area = 1.0f / (float)noise.area;
    u64 seed = mix(record.seed);
    for (i32 i = threadIdx.x; i < noise.area * count[2]; i += THREADS) {
        i32 z = (i32)(((float)i + 0.5f) * by_area), in_area = i - z * noise.area;
        i32 y = (i32)(((float)in_area + 0.5f) * by_row), x = in_area - y * noise.row;
        points[i] = noise_point(first[0] + x, first[1] + y, first[2] + z, seed);
    }
    return noise;
}

// The position of one coordinate. All lanes of a warp must ask for the same axis.
__device__ inline Place place_of(const Noise& noise, i32 axis, i32 offset) {
    i32 from = noise_lane(axis, offset);
    return {__shfl_sync(WARP, noise.own.cell, from), __shfl_sync(WARP, noise.own.t, from)};
}

// Roughness at a sample: interpolates noise points along y, then z, then x.
__device__ inline float bumps(const EditRecord& record, const Noise& noise, const float* points, Place x, Place y, Place z) {
    const float* near = points + x.cell + y.cell * noise.row + z.cell * noise.area;
    auto row = [&](const float* p) { return lerp(p[0], p[noise.row], y.t); };
    auto face = [&](const float* p) { return lerp(row(p), row(p + noise.area), z.t); };
    float value = lerp(face(near), face(near + 1), x.t);
    if (value < -1.0f) value = -1.0f;
    if (value > 1.0f) value = 1.0f;
    return value * (float)record.amplitude;
}

// Rounds to the nearest integer, halves to even, by an addition: floats near 1.5 * 2^23 have a spacing of 1.
__device__ inline i32 round_distance(float distance) {
    const float SHIFT = 12582912.0f, HORIZON = 4194304.0f;
    float near = smaller(larger(distance, -HORIZON), HORIZON);
    return __float_as_int(near + SHIFT) - __float_as_int(SHIFT);
}

// Voxels from a shape's origin, clamped where the distance no longer matters. Both arguments are below 2^24, as the
// sample is within the shape's reach.
__device__ inline i32 voxels_from(i32 voxel, i32 origin) {
    const i32 FARTHEST = 65000;
    return smallest(largest(voxel - origin, -FARTHEST), FARTHEST);
}

// Vector from the shape's origin to the sample at `offset` from the brick's minimum corner `low`. In a row along x
// only the coordinate of `low` is clamped, as on the CPU.
__device__ inline Vector from_origin(const EditRecord& record, const i32* low, const i32* offset) {
    return {
        (float)((voxels_from(low[0], record.origin_voxel[0]) + offset[0]) * ONE - record.origin_fraction[0]),
        (float)(voxels_from(low[1] + offset[1], record.origin_voxel[1]) * ONE - record.origin_fraction[1]),
        (float)(voxels_from(low[2] + offset[2], record.origin_voxel[2]) * ONE - record.origin_fraction[2]),
    };
}

// Whether every sample of the brick is too far outside the shape to change; false if uncertain. Like
// `Evaluator::is_out_of_reach`: no sample is farther from the brick's centre than half of its diagonal.
__device__ inline bool is_out_of_reach(const EditParams& params, const EditRecord& record, const i32* low) {
    // Half of the diagonal: 3.5 voxels along each axis, times the square root of 3, rounded up.
    const float HALF = 3.5f * (float)ONE;
    const i32 DIAGONAL = 1553, LOWEST[3] = {0, 0, 0};
    Vector p = from_origin(record, low, LOWEST);
    i32 distance = round_distance(least_distance(params, record, {p.x + HALF, p.y + HALF, p.z + HALF}));
    // A generous bound on the rounding error of floats.
    i32 rounding = 16 + (distance >> 14), amplitude = record.is_rough ? record.amplitude : 0;
    return distance - rounding > record.band + amplitude + DIAGONAL;
}
