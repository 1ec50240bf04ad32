// The ground's own materials, like ground/strata. Everything is computed in integers.
#pragma once

#include "threads.cuh"

// A voxel of which only the ground's own material is asked.
struct Voxel {
    i32 x, y, z;
    // Height of its column.
    i32 height;
    // The column's word, see `Stack`.
    u32 column;
};

// A random number for a corner of a noise's lattice, -32768 to 32767.
__device__ inline i32 noise_corner(u32 seed, i32 x, i32 y, i32 z) {
    u32 word = ((u32)x * 0x8da6b343u + (u32)y * 0xd8163841u + (u32)z * 0xcb1ab31fu) ^ seed;
    word = (word ^ word >> 16) * 0x85ebca6bu;
    word = (word ^ word >> 13) * 0xc2b2ae35u;
    return (i32)((word ^ word >> 16) >> 16) - 32768;
}

// How far a coordinate has come from one corner to the next, smoothed: 0 to 1024.
__device__ inline i32 noise_blend(i32 at, u32 scale) {
    u32 part = (u32)((at & ((1 << scale) - 1)) << 10) >> scale;
    return (i32)(part * part * (3072 - 2 * part) >> 20);
}

__device__ inline i32 noise_lerp(i32 from, i32 to, i32 part) { return from + ((to - from) * part >> 10); }

// Noise in the plane, -32768 to 32767. `y` is the corners' coordinate along y.
__device__ inline i32 flat_noise(u32 seed, u32 scale, i32 x, i32 y, i32 z) {
    i32 cell_x = x >> scale, cell_z = z >> scale, along_x = noise_blend(x, scale);
    i32 near = noise_lerp(noise_corner(seed, cell_x, y, cell_z), noise_corner(seed, cell_x + 1, y, cell_z), along_x);
    i32 far = noise_lerp(noise_corner(seed, cell_x, y, cell_z + 1), noise_corner(seed, cell_x + 1, y, cell_z + 1), along_x);
    return noise_lerp(near, far, noise_blend(z, scale));
}

// Noise in space, -32768 to 32767.
__device__ inline i32 space_noise(u32 seed, u32 scale, i32 x, i32 y, i32 z) {
    i32 low = flat_noise(seed, scale, x, y >> scale, z), high = flat_noise(seed, scale, x, (y >> scale) + 1, z);
    return noise_lerp(low, high, noise_blend(y, scale));
}

__device__ inline bool is_between(i32 value, const i32* ends) { return ends[0] <= value && value < ends[1]; }

// Whether a height as the bedding has it, in 1/256 voxel, is in a bed.
__device__ inline bool is_in_bed(const StratumRecord& stratum, i64 height) {
    i64 above = height - stratum.bed[0], every = stratum.bed[2];
    if (every > 0) above = (above % every + every) % every;
    return 0 <= above && above < stratum.bed[1];
}

// By how much a column is lifted in the bedding, in 1/256 voxel.
__device__ inline i64 bedding_lift(const StrataTable& table, i32 x, i32 z) {
    i64 dip = ((i64)table.bedding.dip[0] * x + (i64)table.bedding.dip[1] * z) >> 8;
    return dip + (table.bedding.fold * flat_noise(table.bedding.seed, table.bedding.scale, x, 0, z) >> 15);
}

// Whether a stratum holds a voxel of the world.
__device__ inline bool holds(const StrataTable& table, const StratumRecord& stratum, const Voxel& voxel) {
    const u32 SECOND = 0x9e3779b9u, ROUGH = 0x7f4a7c15u;
    i32 x = voxel.x, y = voxel.y, z = voxel.z, height = y * ONE, depth = largest(voxel.height - height - 1, 0);
    if (stratum.condition != 0 && !(voxel.column >> 16 & stratum.condition)) return false;
    i32 moved = stratum.rough == 0 ? 0
                                   : stratum.rough * flat_noise(stratum.seed ^ ROUGH, stratum.rough_scale, x, 0, z) >> 15;
    if (!is_between(depth + moved, stratum.depth) || !is_between(height + moved, stratum.height)) return false;
    if (!is_between(y, stratum.ys)) return false;
    if (stratum.body == FILL) return true;
    if (stratum.body == BED) return is_in_bed(stratum, (i64)height + moved + bedding_lift(table, x, z));
    i32 noise = space_noise(stratum.seed, stratum.scale, x, y, z);
    if (stratum.body == POCKET) return noise > stratum.limit;
    if (noise <= -stratum.limit || noise >= stratum.limit) return false;
    noise = space_noise(stratum.seed ^ SECOND, stratum.scale, x, y, z);
    return -stratum.limit < noise && noise < stratum.limit;
}

// The material of a voxel by the strata. Not inlined: the code is long, and few voxels need it.
__device__ __noinline__ u32 strata_material(const StrataTable& table, Voxel voxel) {
    // A column beyond the world's border is like the nearest one on it.
    voxel.x = smallest(largest(voxel.x, 0), table.last[0]);
    voxel.z = smallest(largest(voxel.z, 0), table.last[1]);
    for (u32 i = 0; i < table.count; i++) {
        if (holds(table, table.strata[i], voxel)) return table.strata[i].material;
    }
    bool is_skin = voxel.y * ONE - voxel.height >= -OVERLAY_DEPTH;
    return (is_skin ? voxel.column >> 8 : voxel.column) & 0xff;
}

// The ground's own material of a voxel. `strata` may be null.
__device__ inline u32 ground_material(const StrataTable* strata, const Voxel& voxel) {
    if (strata) return strata_material(*strata, voxel);
    bool is_overlay = voxel.y * ONE - voxel.height >= -OVERLAY_DEPTH && voxel.column >> 16 >= 128;
    return (is_overlay ? voxel.column >> 8 : voxel.column) & 0xff;
}
