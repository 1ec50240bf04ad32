// Sculpting operations on one sample, in integers: brush/sculpt_kernel.rs, brush/blend.rs, brush/rounding.rs,
// brush/quantized_operation.rs, brush/stamp.rs.
#pragma once

#include "threads.cuh"

// A sample with two flags: four times the density, plus 1 if it was clamped, plus 2 if it was moved away from the
// surface.
typedef i32 Marked;

// Samples along a side of a padded brick: its own and one on each side. x varies fastest, then z, then y.
constexpr i32 AROUND = SIDE + 2;

// The largest density that can be stored.
constexpr i32 FARTHEST = 32767;

// Bounds on a neighbour's density difference, and on how much sharpening changes a sample.
constexpr i32 CONTRAST = 2 * ONE;
constexpr i32 SHARPER = ONE / 4;

// Distances to planes and stamps are clamped here.
constexpr i64 FARTHEST_PLANE = 1 << 25;

// Index in the padded brick of one of the brick's samples, or of a neighbouring sample.
__device__ inline i32 around_at(i32 x, i32 y, i32 z) { return ((y + 1) * AROUND + z + 1) * AROUND + x + 1; }

__device__ inline i32 density(Marked sample) { return sample >> 2; }

__device__ inline bool is_cut(Marked sample) { return sample & 1; }

__device__ inline bool is_moved(Marked sample) { return sample & 2; }

__device__ inline i32 clamped(i32 value, i32 low, i32 high) { return smallest(largest(value, low), high); }

// The density clamped to the range that can be stored.
__device__ inline i32 storable(i32 density) { return clamped(density, -FARTHEST, FARTHEST); }

__device__ inline i32 sign_of(i32 value) { return (value > 0) - (value < 0); }

__device__ inline i32 magnitude(i32 value) { return value < 0 ? -value : value; }

// An edited sample with its flags.
__device__ inline Marked marked(i32 density, i32 pristine) {
    i32 far = magnitude(density), by = density < 0 ? pristine - density : density - pristine;
    return density * 4 + (far == DEPTH || far == FARTHEST) + (by >= ONE) * 2;
}

__device__ inline i32 within_reach(i64 value) {
    return (i32)(value < -FARTHEST_PLANE ? -FARTHEST_PLANE : value > FARTHEST_PLANE ? FARTHEST_PLANE : value);
}

// Offset to one of the six face neighbours.
__device__ inline i32 face(i32 number) {
    i32 step = number < 2 ? 1 : number < 4 ? AROUND : AROUND * AROUND;
    return number & 1 ? step : -step;
}

// Whether any face neighbour lies on the other side of the surface. With `moved_only`, only moved neighbours that
// are not clamped count.
__device__ inline bool is_beside(const Marked* own, bool moved_only) {
    bool is_any = false;
#pragma unroll
    for (i32 i = 0; i < 6; i++) {
        Marked other = own[face(i)];
        is_any |= (other < 0) != (*own < 0) && (!moved_only || (is_moved(other) && !is_cut(other)));
    }
    return is_any;
}

// Smallest distance of the unclamped face neighbours from the surface, positive on the side of `sign`; UNKNOWN if
// there is none.
constexpr i32 UNKNOWN = 1 << 30;
__device__ inline i32 nearest_of(const Marked* own, i32 sign) {
    i32 nearest = UNKNOWN;
#pragma unroll
    for (i32 i = 0; i < 6; i++) {
        Marked other = own[face(i)];
        if (!is_cut(other)) nearest = smallest(nearest, density(other) * sign);
    }
    return nearest;
}

// Computes the sample's density, extrapolated from its neighbours if it was clamped; false if it is unknown.
__device__ inline bool middle_of(const Marked* own, i32& middle) {
    middle = density(*own);
    if (!is_cut(*own)) return true;
    i32 sign = sign_of(middle), nearest = nearest_of(own, sign);
    if (magnitude(middle) == FARTHEST) {
        middle = sign * ONE;
        return is_beside(own, false);
    }
    bool is_known = nearest != UNKNOWN;
#pragma unroll
    for (i32 i = 0; i < 6; i++) {
        if (is_cut(own[face(i)])) nearest = smallest(nearest, DEPTH);
    }
    middle = sign * (largest(nearest, 0) + ONE);
    return is_known;
}

// Computes the density with `by` added, in a way that the opposite shift undoes; false if the sample does not
// change.
__device__ inline bool shifted(const Marked* own, i32 by, i32& after) {
    i32 middle = density(*own), sign = sign_of(middle);
    if (by == 0) return false;
    // Unedited densities continue beyond this limit, but a shift of them could not be stored.
    if (magnitude(middle) >= FARTHEST) {
        if (sign_of(by) == sign || !is_beside(own, true)) return false;
        middle = sign * ONE;
    } else if (is_cut(*own)) {
        i32 nearest = nearest_of(own, sign);
        if (nearest > DEPTH) return false;
        middle = sign * largest(nearest + ONE, DEPTH);
    }
    after = middle + by;
    // Avoid DEPTH, which would mark the sample as clamped.
    if (magnitude(after) == DEPTH) after += sign_of(by);
    return true;
}

// 64 times the difference between the average of the neighbourhood and `middle`.
__device__ inline i32 way_to_average(const Marked* own, i32 middle) {
    i32 sum = 0;
#pragma unroll
    for (i32 number = 14; number < 27; number++) {
        // Iterates over one half of the neighbours; the other half lies opposite.
        i32 dx = number % 3 - 1, dz = number / 3 % 3 - 1, dy = number / 9 - 1;
        i32 along = (dx != 0) + (dy != 0) + (dz != 0);
        // Binomial weights, 1 2 1 along each axis, and the distance to the neighbour in 1/256 voxel.
        i32 weight = 8 >> along, length = along == 1 ? 256 : along == 2 ? 362 : 443;
        i32 step = (dy * AROUND + dz) * AROUND + dx;
        Marked there = own[step], opposite = own[-step];
        // If one side of a pair is unknown, skip both to stay balanced.
        i32 far = magnitude(middle) + length;
        if (is_cut(there) && far > magnitude(density(there))) continue;
        if (is_cut(opposite) && far > magnitude(density(opposite))) continue;
        i32 way = clamped(density(there) - middle, -CONTRAST, CONTRAST);
        sum += weight * (way + clamped(density(opposite) - middle, -CONTRAST, CONTRAST));
    }
    return sum;
}

// Lets a sample turn solid only next to a solid one, and turn to air only next to air.
__device__ inline i32 attached(const Marked* own, i32 after) {
    bool was_solid = *own < 0, is_solid = after < 0, has_like = was_solid == is_solid;
#pragma unroll
    for (i32 i = 0; i < 6; i++) has_like |= (own[face(i)] < 0) == is_solid;
    return has_like ? after : was_solid ? -1 : 0;
}

// Weight of the change at this distance from the shape, in 1/256.
__device__ inline i32 weight_at(const SculptParams& sculpt, i32 outside) {
    i32 inside = -outside, falloff = sculpt.falloff;
    if (inside < 0 || (inside == 0 && falloff > 0)) return 0;
    if (inside >= falloff) return sculpt.strength;
    // Smoothstep 3 t^2 - 2 t^3: the slope is zero at both ends.
    i32 t = inside * ONE / falloff, faded = (t * t * (3 * ONE - 2 * t)) >> 16;
    return (faded * sculpt.strength + ONE / 2) >> 8;
}

// A fraction of `whole` in 1/256, rounded away from zero.
__device__ inline i32 part_of(i32 whole, i32 weight) {
    i64 part = ((i64)magnitude(whole) * weight + ONE - 1) >> 8;
    return (i32)(whole < 0 ? -part : part);
}

// Signed distance from a plane, positive on the side of its normal.
__device__ inline i32 above_plane(const SculptParams& sculpt, const i32* at) {
    i64 along = 0;
    for (i32 i = 0; i < 3; i++) along += ((i64)at[i] * ONE - sculpt.point[i]) * sculpt.matrix[0][i];
    // Both are integers that a double holds exactly.
    return within_reach((i64)rint((double)along / sculpt.length));
}

// Bilinear sample of a stamp's image. Coordinates are in 1/256 of the spacing between samples.
__device__ inline i64 grey_at(const SculptParams& sculpt, const u16* images, i64 x, i64 y) {
    const u16* image = images + sculpt.image;
    i64 column = x >> 8, row = y >> 8, last_column = (i64)sculpt.columns - 2, last_row = (i64)sculpt.rows - 2;
    column = column < 0 ? 0 : column > last_column ? last_column : column;
    row = row < 0 ? 0 : row > last_row ? last_row : row;
    i64 right = x - column * ONE, down = y - row * ONE;
    right = right < 0 ? 0 : right > ONE ? ONE : right;
    down = down < 0 ? 0 : down > ONE ? ONE : down;
    const u16* upper = image + row * sculpt.columns + column;
    const u16* lower = upper + sculpt.columns;
    i64 above = upper[0] * (ONE - right) + upper[1] * right, below = lower[0] * (ONE - right) + lower[1] * right;
    return above * (ONE - down) + below * down;
}

// Height of a point above a stamp's relief. The last argument receives the distance outside its image,
// negative inside.
__device__ inline i32 above_stamp(const SculptParams& sculpt, const u16* images, const i32* at, i32& beside) {
    const i64 WHITE = 65535ll << 16;
    i64 turned[3];
#pragma unroll
    for (i32 i = 0; i < 3; i++) {
        i64 along = 0;
#pragma unroll
        for (i32 j = 0; j < 3; j++) along += sculpt.matrix[j][i] * ((i64)at[j] * ONE - sculpt.point[j]);
        turned[i] = divided(along + sculpt.squared / 2, sculpt.squared);
    }
    i64 right = turned[0], up = turned[1], down = turned[2], half_x = sculpt.half[0], half_z = sculpt.half[1];
    i64 beside_x = (right < 0 ? -right : right) - half_x, beside_z = (down < 0 ? -down : down) - half_z;
    beside = within_reach(beside_x > beside_z ? beside_x : beside_z);
    i64 x = (right + half_x) * ((i64)sculpt.columns - 1) * ONE / (2 * half_x);
    i64 y = (down + half_z) * ((i64)sculpt.rows - 1) * ONE / (2 * half_z);
    return within_reach(up - divided(grey_at(sculpt, images, x, y) * sculpt.height + WHITE / 2, WHITE));
}

// Quantises a height to steps, with a ramp over the middle quarter of each.
__device__ inline i32 terraced(i32 height, i32 step) {
    i32 tread = (i32)divided(height, step) * step;
    return tread + clamped((height - tread - step * 3 / 8) * 4, 0, step);
}

// The length of the longest side of a right triangle, rounded down. The squares of both sides add up to less than 2^31,
// of which the root of a double is exact enough.
__device__ inline i32 hypotenuse(i32 a, i32 b) { return (i32)sqrt((double)(a * a + b * b)); }

// The density after a union with a rounded edge. `is_inside` says whether the sample was inside already, `surface` is its
// distance to the surface of the ground.
__device__ inline i32 united(i32 before, bool is_inside, i32 outside, i32 surface, i32 radius) {
    i32 shape = largest(outside, -DEPTH), plain = outside <= BAND ? smallest(before, shape) : before;
    if (shape >= radius || (!is_inside && surface >= radius) || (is_inside && before <= -DEPTH)) return plain;
    i32 own = is_inside ? -surface : surface, beside = is_inside ? largest(shape, 0) : shape;
    i32 arc = radius - hypotenuse(radius - own, radius - beside), rounded = arc;
    if (is_inside) {
        rounded = smallest(before, shape) - (own - arc);
    } else if (arc > 0 && own < shape) {
        rounded = (i32)((i64)before * arc / own);
    }
    return smallest(plain, largest(rounded, -DEPTH));
}

__device__ inline bool is_rounded(const SculptParams& sculpt) {
    return sculpt.operation == UNION || sculpt.operation == SUBTRACTION;
}

// The density after a fill or a carve, whose edges are rounded.
__device__ inline i32 rounded(const SculptParams& sculpt, i32 before, i32 outside, i32 surface) {
    i32 radius = sculpt.amounts[0], near = smallest(surface, largest(radius, DEPTH));
    bool is_solid = before < 0;
    i32 after = sculpt.operation == UNION ? united(before, is_solid, outside, near, radius)
                                          : -united(-before, !is_solid, outside, near, radius);
    return before + part_of(after - before, sculpt.strength);
}

// Computes a sample's density after the operation from its distance to the shape and its neighbourhood; false if it
// does not change.
__device__ inline bool sculpted(
    const SculptParams& sculpt, const u16* images, const i32* at, i32 outside, const Marked* own, i32& after
) {
    if (outside > 0) return false;
    i32 target = 0;
    bool has_target = false;
    if (sculpt.operation == FLATTEN) {
        target = above_plane(sculpt, at);
        has_target = true;
    } else if (sculpt.operation == LEVEL) {
        target = at[1] * ONE - sculpt.amounts[0];
        has_target = true;
    } else if (sculpt.operation == STAMP) {
        i32 beside;
        target = above_stamp(sculpt, images, at, beside);
        outside = largest(outside, beside);
        has_target = true;
    }
    i32 weight = weight_at(sculpt, outside);
    if (weight == 0) return false;
    i32 before = density(*own), middle;
    if (has_target) {
        after = before + part_of(target - before, weight);
        return true;
    }
    i32 by = 0;
    if (sculpt.operation == SHIFT) {
        by = sculpt.amounts[0];
        return shifted(own, sign_of(by) * ((magnitude(by) * weight + ONE / 2) >> 8), after);
    }
    if (!middle_of(own, middle)) return false;
    if (sculpt.operation == SMOOTH) {
        by = way_to_average(own, middle) * weight / (64 * ONE);
        after = attached(own, middle + by);
    } else if (sculpt.operation == SHARPEN) {
        by = clamped(way_to_average(own, middle) * weight / (64 * ONE), -SHARPER, SHARPER);
        i32 low = before, high = before;
#pragma unroll
        for (i32 i = 0; i < 27; i++) {
            i32 other = density(own[((i / 9 - 1) * AROUND + i / 3 % 3 - 1) * AROUND + i % 3 - 1]);
            low = smallest(low, other);
            high = largest(high, other);
        }
        after = attached(own, clamped(middle - by, low, high));
    } else {
        i32 step = sculpt.amounts[0], base = sculpt.amounts[1], surface = at[1] * ONE - middle;
        by = part_of(surface - (terraced(surface - base, step) + base), weight);
        after = middle + by;
    }
    return by != 0;
}
