// Applies batches with stencil edits (sculpting, or edits under rules), like edits/stencil_edit.rs.
//
// Edits read the state before the launch: the host ensures that no edit of a launch reads what an earlier one may
// write. Bricks are therefore read in place and written to other slots.
#pragma once

#include "rules.cuh"
#include "surface.cuh"

struct StencilEditor : RuleChecker {
    static constexpr bool LOOKS = true;

    // Whether this is a stencil edit. If so, loads the padded brick, and the block must synchronise.
    __device__ bool begin(const EditJob& job, const Stack& stack, u32 edit) {
        const SculptParams& sculpt = params.sculpt_params[edit];
        if (sculpt.operation == PLAIN && sculpt.power < 0) return false;
        if (has_looked) return true;
        has_boxes = __syncthreads_or(is_box_near(job.brick));
        look(job, stack);
        return true;
    }

    // A sample during an edit.
    struct Sample {
        i32 at[3];
        // Layer and index within the brick.
        i32 y, index;
        // Signed distance from the shape.
        i32 outside;
        i32 before;
    };

    // Paints a solid sample unless a rule forbids it, and returns whether it changed. `counted` is the voxel's
    // outcome and material, `outcome * 256 + material`.
    __device__ bool paint(
        const EditRecord& record, bool is_bound, const OwnColumn& column, const Sample& sample, Brick& brick, u32& counted
    ) {
        u32 ref = shared.refs[13], old = stored(ref, sample.index);
        if (sample.outside > 0 || sample.before >= 0) return false;
        bool is_pristine = ref == NONE || params.edit.bricks[ref >> 1].samples[sample.index] == PRISTINE;
        if (!is_pristine && old == record.material) return false;
        u32 own = resolve(old, column, sample.y), painted = resolve(record.material, column, sample.y), outcome = PAINTED;
        if (is_bound) outcome = is_protected(sample.at) ? PROTECTED : is_unbreakable(own) ? UNBREAKABLE : PAINTED;
        if (own != painted) counted = outcome * 256 + (outcome == PAINTED ? painted : own);
        if (outcome != PAINTED) return false;
        brick.materials[sample.index] = (u8)record.material;
        brick.samples[sample.index] = (i16)storable(sample.before);
        return true;
    }

    // Computes the density that an edit proposes for a sample; false if it does not change.
    __device__ bool proposed(
        const EditRecord& record, const SculptParams& sculpt, const OwnColumn& column, const Sample& sample, i32& after
    ) {
        const Marked* own = shared.around + around_at(column.x, sample.y, column.z);
        if (is_rounded(sculpt)) {
            after = rounded(sculpt, sample.before, sample.outside, distance_of(surface[sample.index]));
            return true;
        }
        if (sculpt.operation != PLAIN) return sculpted(sculpt, params.edit.images, sample.at, sample.outside, own, after);
        i32 depth = largest(sample.outside, -DEPTH);
        after = record.operation == DIG ? largest(sample.before, -depth) : smallest(sample.before, depth);
        return sample.outside <= BAND;
    }

    // The material of a sample that a sculpting edit makes solid.
    __device__ u32 sculpted_material(
        const EditRecord& record, const SculptParams& sculpt, const OwnColumn& column, const Sample& sample
    ) {
        u32 material = sculpt.material;
        if (material == NONE && sculpt.operation == UNION && record.kind == GRID) {
            const GridRecord& grid = params.edit.grids[record.grid];
            if (grid.has_materials) material = grid_material(record, grid, params.edit.images, sample.at);
        }
        return material == NONE ? new_material(column, sample.y) : material;
    }

    // Changes a sample's density as far as the rules allow. Results are those of `paint`.
    __device__ bool change(
        const EditRecord& record, const SculptParams& sculpt, const OwnColumn& column, const Sample& sample, Brick& brick, u32& counted
    ) {
        i32 before = sample.before, after = before;
        if (!proposed(record, sculpt, column, sample, after) || storable(after) == storable(before)) return false;
        bool was_solid = before < 0, would_be_solid = after < 0;
        u32 outcome = FATES, material = GROUND;
        if (sculpt.power >= 0) after = judged(column, sample.at, sample.y, sculpt.power, after, outcome);
        bool is_solid = after < 0, is_refused = outcome != FATES && would_be_solid != was_solid && is_solid == was_solid;
        if (!was_solid && (is_solid || is_refused)) {
            if (sculpt.operation == PLAIN) {
                material = record.operation == ADD ? record.material : GROUND;
            } else {
                material = sculpted_material(record, sculpt, column, sample);
            }
        }
        if (is_refused) {
            if (was_solid) material = stored(shared.refs[13], sample.index);
            counted = outcome * 256 + resolve(material, column, sample.y);
        }
        if (storable(after) == storable(before)) return false;
        brick.samples[sample.index] = (i16)storable(after);
        if (was_solid == is_solid) return true;
        if (was_solid) {
            counted = REMOVED * 256 + resolve(brick.materials[sample.index], column, sample.y);
            // Air has no material.
            material = GROUND;
        } else {
            counted = ADDED * 256 + resolve(material, column, sample.y);
        }
        brick.materials[sample.index] = (u8)material;
        return true;
    }

    // Applies one edit to the thread's open samples, like the plain `apply`.
    __device__ u32 apply(
        u32 edit, const OwnColumn& column, u32 open, const Noise& noise, EditMemory& work, bool& has_materials
    ) {
        const EditRecord& record = params.edit.edit_records[edit];
        const SculptParams& sculpt = params.sculpt_params[edit];
        Place along_x = place_of(noise, 0, column.x), along_z = place_of(noise, 2, column.z);
        u32 changed = 0;
#pragma unroll 1
        for (i32 k = 0; k < OWN; k++) {
            i32 index = own_index(k), y = own_y(column, k);
            Place along_y = place_of(noise, 1, y);
            bool is_changed = false;
            u32 counted = NONE;
            if (open >> k & 1) {
                i32 offset[3] = {column.x, y, column.z};
                float distance = smooth_distance(params.edit, record, from_origin(record, column.low, offset));
                if (record.is_rough) distance += bumps(record, noise, work.noise, along_x, along_y, along_z);
                Sample sample = {
                    {column.low[0] + column.x, column.low[1] + y, column.low[2] + column.z},
                    y,
                    index,
                    round_distance(distance),
                    density(shared.around[around_at(column.x, y, column.z)]),
                };
                is_changed = sculpt.operation == PLAIN && record.operation == PAINT
                    ? paint(record, sculpt.power >= 0, column, sample, work.brick, counted)
                    : change(record, sculpt, column, sample, work.brick, counted);
                has_materials |= work.brick.materials[index] != GROUND;
            }
            changed |= (u32)is_changed << k;
            store_bits(work.effect.changed, k, is_changed);
            count_voxels(shared.counts, counted);
        }
        return changed;
    }

    // Writes the changed parts and voxel counts of an edit. The next edit synchronises before it overwrites them.
    __device__ void enter(const EditJob& job, u32 edit) {
        if (warp() == 0) enter_parts(params.edit, job.cuts, edit, shared.work.effect.changed);
        u32 outcomes = params.rules ? FATES : ADDED + 1;
        for (u32 outcome = warp(); outcome < outcomes; outcome += THREADS / 32) {
            enter_counts(params.edit, edit, outcome, shared.counts + outcome * 256);
        }
    }
};

extern "C" __global__ void __launch_bounds__(THREADS) stencil_edit(StencilEditParams params) {
    __shared__ StencilEditMemory shared;
    StencilEditor editor = {{{params, shared, nullptr, 0, 0, nullptr, nullptr, false, false}, false}};
    edit_brick(params.edit, shared.work, editor);
}
