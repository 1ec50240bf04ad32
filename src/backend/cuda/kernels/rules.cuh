// Applies the digging rules to a change, like volume/rules.rs.
#pragma once

#include "padded_brick.cuh"

// Limits edits by the rules.
struct RuleChecker : PaddedBrick {
    // Whether a protected box is near.
    bool has_boxes;

    __device__ const Protected* boxes() const { return (const Protected*)(params.rules + 1); }

    // Whether a protected box touches the brick or its padding. Each thread checks its share of the boxes.
    __device__ bool is_box_near(const i32* brick) const {
        bool is_near = false;
        for (u32 i = threadIdx.x; params.rules && i < params.rules->boxes; i += THREADS) {
            bool is_touching = true;
            for (i32 axis = 0; axis < 3; axis++) {
                i32 low = brick[axis] * SIDE - 1;
                is_touching &= boxes()[i].min[axis] <= low + AROUND - 1 && low <= boxes()[i].max[axis];
            }
            is_near |= is_touching;
        }
        return is_near;
    }

    __device__ bool is_protected(const i32* at) const {
        bool is_inside = false;
        for (u32 i = 0; has_boxes && i < params.rules->boxes; i++) {
            const Protected& box = boxes()[i];
            is_inside |= box.min[0] <= at[0] && at[0] <= box.max[0] && box.min[1] <= at[1] && at[1] <= box.max[1]
                && box.min[2] <= at[2] && at[2] <= box.max[2];
        }
        return is_inside;
    }

    __device__ bool is_unbreakable(u32 material) const {
        return params.rules->unbreakable[material / 32] >> material % 32 & 1;
    }

    // How fast the rules let solid ground at a sample of the padded brick be removed, in 1/256. `outcome` is the
    // reason if that is below 256, else `FATES`.
    __device__ i32 pace(const OwnColumn& column, i32 x, i32 y, i32 z, i32 power, u32& outcome) const {
        i32 at_y = column.low[1] + y, place = (z + 1) * WINDOW + x + 1;
        u32 material = stored_at(x, y, z);
        if (material == GROUND) {
            Voxel voxel = {column.low[0] + x, at_y, column.low[2] + z, stack->heights[place], stack->columns[place]};
            material = ground_material(params.edit.strata, voxel);
        }
        i32 hardness = params.rules->hardness[material];
        outcome = UNBREAKABLE;
        if (at_y < params.rules->bedrock || is_unbreakable(material)) return 0;
        outcome = FATES;
        if (power >= hardness) return ONE;
        i32 part = largest((2 * power - hardness) * ONE / hardness, 0);
        outcome = part == 0 ? TOO_HARD : SLOWED;
        return part;
    }

    // Whether a face neighbour lies inside the world. The border's samples repeat beyond it, and no rules apply
    // there.
    __device__ bool is_inside(i32 face, const i32* at) const {
        i32 way[3];
        way_to(face, way);
        i32 x = at[0] + way[0], z = at[2] + way[2];
        return 0 <= x && x <= params.last[0] && 0 <= z && z <= params.last[1];
    }

    // The density of a face neighbour.
    __device__ i32 density_beside(i32 face, const OwnColumn& column, i32 y) const {
        i32 way[3];
        way_to(face, way);
        return density(shared.around[around_at(column.x + way[0], y + way[1], column.z + way[2])]);
    }

    // The pace at a face neighbour; 0 if it is protected.
    __device__ i32 pace_beside(i32 face, const OwnColumn& column, const i32* at, i32 y, i32 power) const {
        i32 way[3];
        way_to(face, way);
        i32 beside[3] = {at[0] + way[0], at[1] + way[1], at[2] + way[2]};
        u32 why;
        if (is_protected(beside)) return 0;
        return pace(column, column.x + way[0], y + way[1], column.z + way[2], power, why);
    }

    static __device__ void way_to(i32 face, i32* way) {
        for (i32 axis = 0; axis < 3; axis++) way[axis] = axis != face / 2 ? 0 : face & 1 ? -1 : 1;
    }

    // The density that the rules allow instead of the proposed one. `outcome` is the reason if a rule held it back,
    // else `FATES`.
    __device__ i32 judged(const OwnColumn& column, const i32* at, i32 y, i32 power, i32 proposed, u32& outcome) const {
        const Marked* own = shared.around + around_at(column.x, y, column.z);
        i32 before = density(*own);
        outcome = PROTECTED;
        if (is_protected(at)) return before;
        outcome = FATES;
        if (proposed <= before) return proposed;
        i32 least = ONE;
        if (before < 0) {
            least = pace(column, column.x, y, column.z, power, outcome);
        } else {
            // Air samples next to solid ground also define its surface, so the neighbour's pace limits them.
            // The voxel stays air, so no outcome is reported.
            for (i32 i = 0; i < 6; i++) {
                if (is_inside(i, at) && density_beside(i, column, y) < 0) least = smallest(least, pace_beside(i, column, at, y, power));
            }
        }
        i32 allowed = before + (i32)((((i64)proposed - before) * least + ONE - 1) >> 8);
        if (before >= 0 || allowed < 0) return allowed;
        // A sample that turns to air next to unbreakable ground exposes it but must not move its surface.
        for (i32 i = 0; i < 6; i++) {
            i32 beside = density_beside(i, column, y);
            if (beside >= 0 || !is_inside(i, at) || pace_beside(i, column, at, y, power) != 0) continue;
            allowed = smallest(allowed, largest(ONE + beside, 0));
        }
        return allowed;
    }
};
