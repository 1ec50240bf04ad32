// Applies edits that look around, as volume/careful.rs does, among others: those that sculpt.
//
// What an edit reads is what was there before the launch: the host sees to it that no edit of a launch reads what an
// earlier one may change. So bricks are read where they are, and written elsewhere.
#pragma once

#include "edit.cuh"
#include "sculpt.cuh"

struct CarefulBench {
    Workbench work;
    // The brick with one sample more on all sides, as they were before.
    Marked around[AROUND * AROUND * AROUND];
    // Voxels of each material that an edit added; those that it removed are counted where plain edits count.
    u32 added[256];
    // Bricks around, as `refs` of a mesh.
    u32 refs[27];
};

// How far below and above itself new ground looks for what it is to be made of, in bricks: 64 voxels.
constexpr i32 LOOK = 8;

struct Care {
    static constexpr bool LOOKS = true;

    const CarefulParams& params;
    CarefulBench& bench;
    // The brick's entry in the windows, and the way to its neighbours.
    const u32* window;
    i32 to_x, to_z;
    // Are the surroundings there? Did new ground look farther than windows reach?
    bool has_looked, is_too_far;

    // Does an edit look around? If so, the surroundings are brought, which the block then has to wait for.
    __device__ bool begin(const EditJob& job, const Stack& stack, u32 edit) {
        if (params.chisels[edit].stroke == PLAIN) return false;
        if (has_looked) return true;
        has_looked = true;
        window = params.windows + job.window;
        to_x = job.strides & 0xffff;
        to_z = job.strides >> 16;
        for (i32 i = threadIdx.x; i < 27; i += THREADS) {
            bench.refs[i] = window[brick_at(i % 3 - 1, i / 9 - 1, i / 3 % 3 - 1)];
        }
        for (i32 i = threadIdx.x; i < 256; i += THREADS) bench.added[i] = 0;
        __syncthreads();
        for (i32 i = threadIdx.x; i < AROUND * AROUND * AROUND; i += THREADS) {
            i32 x = i % AROUND, z = i / AROUND % AROUND, y = i / (AROUND * AROUND);
            bench.around[i] = sample_around(x, y, z, job.brick[1] * SIDE, stack.heights[z * WINDOW + x]);
        }
        return true;
    }

    // The entry of a brick so far away.
    __device__ i32 brick_at(i32 dx, i32 dy, i32 dz) const { return dx * to_x + dy + dz * to_z; }

    // A sample of the surroundings, counted from one before the brick's lowest.
    __device__ Marked sample_around(i32 x, i32 y, i32 z, i32 low, i32 height) const {
        u32 ref = bench.refs[(((y + 7) >> 3) * 3 + ((z + 7) >> 3)) * 3 + ((x + 7) >> 3)];
        i32 raw = ref == NONE ? PRISTINE : params.edit.bricks[ref >> 1].samples[index_at(x - 1, y - 1, z - 1)];
        if (raw == PRISTINE) return ((low + y - 1) * ONE - height) * 2;
        return raw * 2 + (raw == DEPTH || raw == -DEPTH);
    }

    // The index of a sample in its brick.
    static __device__ i32 index_at(i32 x, i32 y, i32 z) { return (y & 7) * 64 + (z & 7) * SIDE + (x & 7); }

    // The material stored in a brick.
    __device__ u32 stored(u32 ref, i32 index) const {
        return ref == NONE || !(ref & 1) ? GROUND : params.edit.bricks[ref >> 1].materials[index];
    }

    // Which samples of the column are solid in the brick so many bricks higher up: a bit for each y.
    __device__ u32 solid_levels(u32 ref, const OwnColumn& column, i32 up) const {
        if (ref == NONE) {
            // As many as are below the surface.
            i32 count = ((column.height + ONE - 1) >> 8) - (column.low[1] + up * SIDE);
            return (1u << smallest(largest(count, 0), SIDE)) - 1;
        }
        const u32* solid = params.edit.bricks[ref >> 1].solid + column.z / 4;
        u32 levels = 0;
        for (i32 y = 0; y < SIDE; y++) levels |= (solid[y * 2] >> (column.z % 4 * SIDE + column.x) & 1) << y;
        return levels;
    }

    // What a sample is made of that becomes solid: what lies straight below, else straight above, else beside it.
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
            if (bench.around[around_at(x, y, z)] >= 0) continue;
            return stored(window[brick_at(x >> 3, 0, z >> 3)], index_at(x, y, z));
        }
        return GROUND;
    }

    // Applies one edit to the thread's open samples, as `apply` does.
    __device__ u32 apply(
        u32 edit, const OwnColumn& column, u32 open, const Noise& noise, Workbench& work, bool& has_materials
    ) {
        const Tool& tool = params.edit.tools[edit];
        const Chisel& chisel = params.chisels[edit];
        Place along_x = place_of(noise, 0, column.x), along_z = place_of(noise, 2, column.z);
        u32 changed = 0;
#pragma unroll 1
        for (i32 k = 0; k < OWN; k++) {
            i32 index = own_index(k), y = own_y(column, k);
            Place along_y = place_of(noise, 1, y);
            bool is_changed = false;
            u32 removed = NONE, added = NONE;
            if (open >> k & 1) {
                i32 offset[3] = {column.x, y, column.z};
                float distance = smooth_distance(tool, from_origin(tool, column.low, offset));
                if (tool.is_rough) distance += bumps(tool, noise, work.noise, along_x, along_y, along_z);
                i32 at[3] = {column.low[0] + column.x, column.low[1] + y, column.low[2] + column.z};
                const Marked* own = bench.around + around_at(column.x, y, column.z);
                i32 before = density(*own), after = before;
                is_changed = sculpted(chisel, params.images, at, round_distance(distance), own, after)
                    && storable(after) != storable(before);
                if (is_changed) {
                    i32 pristine = pristine_distance(column, k);
                    u8& material = work.brick.materials[index];
                    work.brick.samples[index] = (i16)storable(after);
                    if (before < 0 && after >= 0) {
                        removed = resolve(material, column, pristine);
                        // Air is of no material.
                        material = GROUND;
                    }
                    if (before >= 0 && after < 0) {
                        material = (u8)(chisel.material == NONE ? new_material(column, y) : chisel.material);
                        added = resolve(material, column, pristine);
                    }
                    has_materials |= material != GROUND;
                }
            }
            changed |= (u32)is_changed << k;
            store_bits(work.effect.changed, k, is_changed);
            count_voxels(work.effect.counts, removed);
            count_voxels(bench.added, added);
        }
        return changed;
    }

    // Says whether any thread looked too far.
    __device__ void end(Workbench& work) const {
        if (__any_sync(WARP, is_too_far) && lane() == 0) atomicOr(&work.flags, TOO_FAR);
    }
};

extern "C" __global__ void __launch_bounds__(THREADS) careful(CarefulParams params) {
    __shared__ CarefulBench bench;
    Care care = {params, bench, nullptr, 0, 0, false, false};
    edit_brick(params.edit, bench.work, care);
}
