// The input of stencil edits, as in edits/padded_brick.rs and edits/stencil_edit.rs.
#pragma once

#include "edit.cuh"
#include "sculpt.cuh"

// What happened to a voxel, or the rule that prevented it. `FATES` is the number of outcomes.
enum VoxelOutcome { REMOVED, ADDED, PAINTED, PROTECTED, UNBREAKABLE, TOO_HARD, SLOWED, FATES };

struct StencilEditMemory {
    EditMemory work;
    // The brick with one sample of padding on all sides, as before the launch.
    Marked around[AROUND * AROUND * AROUND];
    // Voxels of each material, for each outcome of the current edit.
    u32 counts[FATES * 256];
    // References of the 27 bricks around, x fastest, then z, then y.
    u32 refs[27];
};

// How many bricks new ground searches up and down for its material (64 voxels).
constexpr i32 LOOK = 8;

// What an edit reads: the brick and its padding, as before the launch.
struct PaddedBrick {
    const StencilEditParams& params;
    StencilEditMemory& shared;
    // The brick's entry in the windows, and the strides to its neighbours.
    const u32* window;
    i32 to_x, to_z;
    const Stack* stack;
    // Distances of the brick's samples to the surface; null without.
    const i16* surface;
    // Whether the padding is loaded. Whether the search for a material went beyond the window.
    bool has_looked, is_too_far;

    // Loads the padding. The block must synchronise before reading it.
    __device__ void look(const EditJob& job, const Stack& own_stack) {
        has_looked = true;
        window = params.windows + job.window;
        stack = &own_stack;
        surface = job.surface == NONE ? nullptr : params.surface + (u64)job.surface * LEN;
        to_x = job.strides & 0xffff;
        to_z = job.strides >> 16;
        for (i32 i = threadIdx.x; i < 27; i += THREADS) {
            shared.refs[i] = window[brick_at(i % 3 - 1, i / 9 - 1, i / 3 % 3 - 1)];
        }
        for (i32 i = threadIdx.x; i < FATES * 256; i += THREADS) shared.counts[i] = 0;
        __syncthreads();
        for (i32 i = threadIdx.x; i < AROUND * AROUND * AROUND; i += THREADS) {
            // Samples beyond the world's border repeat those at the border.
            i32 x = inside(i % AROUND, job.brick[0], params.last[0]);
            i32 z = inside(i / AROUND % AROUND, job.brick[2], params.last[1]), y = i / (AROUND * AROUND);
            shared.around[i] = sample_around(x, y, z, job.brick[1] * SIDE, stack->heights[z * WINDOW + x]);
        }
    }

    // Clamps a padded coordinate to the world.
    static __device__ i32 inside(i32 local, i32 brick, i32 last) {
        i32 low = brick * SIDE - 1;
        return smallest(largest(largest(local, -low), 0), largest(last - low, 0));
    }

    // Offset in the window to the brick at this distance.
    __device__ i32 brick_at(i32 dx, i32 dy, i32 dz) const { return dx * to_x + dy + dz * to_z; }

    // A sample of the padded brick; coordinates start one before the brick's minimum corner.
    __device__ Marked sample_around(i32 x, i32 y, i32 z, i32 low, i32 height) const {
        u32 ref = shared.refs[(((y + 7) >> 3) * 3 + ((z + 7) >> 3)) * 3 + ((x + 7) >> 3)];
        i32 raw = ref == NONE ? PRISTINE : params.edit.bricks[ref >> 1].samples[index_at(x - 1, y - 1, z - 1)];
        i32 pristine = (low + y - 1) * ONE - height;
        return raw == PRISTINE ? pristine * 4 : marked(raw, pristine);
    }

    static __device__ i32 index_at(i32 x, i32 y, i32 z) { return (y & 7) * 64 + (z & 7) * SIDE + (x & 7); }

    __device__ u32 stored(u32 ref, i32 index) const {
        return ref == NONE || !(ref & 1) ? GROUND : params.edit.bricks[ref >> 1].materials[index];
    }

    // The material stored at a sample of the padded brick.
    __device__ u32 stored_at(i32 x, i32 y, i32 z) const {
        return stored(window[brick_at(x >> 3, y >> 3, z >> 3)], index_at(x, y, z));
    }

    // Which samples of the column are solid in the brick `up` bricks higher, one bit per layer.
    __device__ u32 solid_levels(u32 ref, const OwnColumn& column, i32 up) const {
        if (ref == NONE) {
            // Without a brick, the samples below the ground's surface.
            i32 count = ((column.height + ONE - 1) >> 8) - (column.low[1] + up * SIDE);
            return (1u << smallest(largest(count, 0), SIDE)) - 1;
        }
        const u32* solid = params.edit.bricks[ref >> 1].solid + column.z / 4;
        u32 levels = 0;
        for (i32 y = 0; y < SIDE; y++) levels |= (solid[y * 2] >> (column.z % 4 * SIDE + column.x) & 1) << y;
        return levels;
    }

    // The material of a sample that becomes solid: that of the nearest solid sample below, else above, else
    // next to it.
    __device__ u32 new_material(const OwnColumn& column, i32 y) {
        for (i32 down = 0; down <= LOOK; down++) {
            if (down > params.look) {
                is_too_far = true;
                return GROUND;
            }
            u32 ref = window[-down], levels = solid_levels(ref, column, -down);
            if (down == 0) levels &= (1u << y) - 1;
            if (down == LOOK) levels &= 0xffu << y;
            if (levels != 0) return stored(ref, index_at(column.x, 31 - __clz(levels), column.z));
        }
        for (i32 up = 0; up <= LOOK; up++) {
            if (up > params.look) {
                is_too_far = true;
                return GROUND;
            }
            u32 ref = window[up], levels = solid_levels(ref, column, up);
            if (up == 0) levels &= 0xfeu << y;
            if (up == LOOK) levels &= (2u << y) - 1;
            if (levels != 0) return stored(ref, index_at(column.x, __ffs(levels) - 1, column.z));
        }
        for (i32 side = 0; side < 4; side++) {
            i32 dx = side == 0 ? -1 : side == 1 ? 1 : 0, dz = side == 2 ? -1 : side == 3 ? 1 : 0;
            i32 x = column.x + dx, z = column.z + dz;
            if (shared.around[around_at(x, y, z)] >= 0) continue;
            return stored_at(x, y, z);
        }
        return GROUND;
    }
};
