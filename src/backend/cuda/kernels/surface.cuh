// How far samples are from the surface of the ground, for fills and carves: edits/surface_distance.rs.
//
// Distances go from sample to sample, through ground or through air, until none gets smaller. The result does not depend
// on the order. One launch computes those of samples next to the surface. In each further one they spread within every
// brick as far as they can, and into it from the bricks around. A way of n steps needs n launches at most.
#pragma once

#include "padded_brick.cuh"

// A distance that no other one depends on.
constexpr i16 NO_DISTANCE = 1 << 14;

// Distances of solid samples are inverted, so that their sign says which ones those are.
__device__ inline i32 distance_of(i16 stored) { return stored < 0 ? ~stored : stored; }

__device__ inline i16 stored_distance(bool is_solid, i32 distance) { return (i16)(is_solid ? ~distance : distance); }

// Part of the way from a sample to a neighbour after which the surface crosses it, in 1/256 voxel.
__device__ inline double crossing(i32 own, i32 other) {
    double near = magnitude(own), far = magnitude(other), whole = near + far;
    return near * (double)ONE / (whole > 1.0 ? whole : 1.0);
}

// Distance of a sample to the plane through the points where the surface crosses the edges to its neighbours; `horizon`
// if it crosses none of them.
__device__ inline i32 to_crossings(const i32* own, i32 horizon) {
    double sum = 0.0;
    bool is_on_surface = false;
    for (i32 axis = 0; axis < 3; axis++) {
        // Sums are in the order x, y, z, and faces in the order x, z, y.
        i32 first = axis == 0 ? 0 : axis == 1 ? 4 : 2;
        double nearest = -1.0;
        for (i32 side = 0; side < 2; side++) {
            i32 other = own[face(first + side)];
            if ((other < 0) == (*own < 0)) continue;
            double length = crossing(*own, other);
            if (nearest < 0.0 || length < nearest) nearest = length;
        }
        if (nearest < 0.0) continue;
        is_on_surface |= nearest == 0.0;
        sum += 1.0 / (nearest * nearest);
    }
    if (is_on_surface) return 0;
    return sum > 0.0 ? smallest((i32)rint(1.0 / sqrt(sum)), horizon) : horizon;
}

extern "C" __global__ void __launch_bounds__(THREADS) surface_start(SurfaceStartParams params) {
    // Densities of the brick and of one sample more on all sides.
    __shared__ i32 around[AROUND * AROUND * AROUND];
    const SurfaceJob& job = params.jobs[blockIdx.x];
    const Stack& stack = params.stacks[job.stack];
    const u32* window = params.windows + job.window;
    i32 to_x = job.strides & 0xffff, to_z = job.strides >> 16;
    for (i32 i = threadIdx.x; i < AROUND * AROUND * AROUND; i += THREADS) {
        // Samples beyond the world's border repeat those at the border.
        i32 x = PaddedBrick::inside(i % AROUND, job.brick[0], params.last[0]) - 1;
        i32 z = PaddedBrick::inside(i / AROUND % AROUND, job.brick[2], params.last[1]) - 1, y = i / (AROUND * AROUND) - 1;
        u32 ref = window[(x >> 3) * to_x + (y >> 3) + (z >> 3) * to_z];
        i32 raw = ref == NONE ? PRISTINE : params.bricks[ref >> 1].samples[PaddedBrick::index_at(x, y, z)];
        i32 pristine = (job.brick[1] * SIDE + y) * ONE - stack.heights[(z + 1) * WINDOW + x + 1];
        around[i] = raw == PRISTINE ? pristine : raw;
    }
    __syncthreads();
    for (i32 index = threadIdx.x; index < LEN; index += THREADS) {
        const i32* own = around + around_at(index % SIDE, index / (SIDE * SIDE), index / SIDE % SIDE);
        params.distances[(u64)blockIdx.x * LEN + index] = stored_distance(*own < 0, to_crossings(own, params.horizon));
    }
}

// The distance of a sample by the shortest way through one of its neighbours, if that is shorter than its own.
__device__ inline i16 shortest(const i16* own) {
    const i32 STEPS[4] = {0, 256, 362, 443};
    bool is_solid = *own < 0;
    i32 distance = distance_of(*own);
#pragma unroll
    for (i32 i = 0; i < 27; i++) {
        i32 x = i % 3 - 1, z = i / 3 % 3 - 1, y = i / 9 - 1;
        i16 other = own[(y * AROUND + z) * AROUND + x];
        i32 way = distance_of(other) + STEPS[magnitude(x) + magnitude(y) + magnitude(z)];
        if ((other < 0) == is_solid) distance = smallest(distance, way);
    }
    return stored_distance(is_solid, distance);
}

extern "C" __global__ void __launch_bounds__(THREADS) surface_spread(SurfaceSpreadParams params) {
    __shared__ i16 around[AROUND * AROUND * AROUND];
    const SurfaceJob& job = params.jobs[blockIdx.x];
    for (i32 i = threadIdx.x; i < AROUND * AROUND * AROUND; i += THREADS) {
        i32 x = i % AROUND, z = i / AROUND % AROUND, y = i / (AROUND * AROUND);
        u32 number = job.around[(((y + 7) >> 3) * 3 + ((z + 7) >> 3)) * 3 + ((x + 7) >> 3)];
        const i16* brick = params.from + (u64)number * LEN;
        around[i] = number == NONE ? NO_DISTANCE : brick[PaddedBrick::index_at(x - 1, y - 1, z - 1)];
    }
    __syncthreads();
    const i32 EACH = LEN / THREADS;
    i16* own[EACH];
#pragma unroll
    for (i32 k = 0; k < EACH; k++) {
        i32 index = k * THREADS + threadIdx.x;
        own[k] = around + around_at(index % SIDE, index / (SIDE * SIDE), index / SIDE % SIDE);
    }
    for (;;) {
        i16 after[EACH];
        bool is_shorter = false;
#pragma unroll
        for (i32 k = 0; k < EACH; k++) {
            after[k] = shortest(own[k]);
            is_shorter |= after[k] != *own[k];
        }
        // No thread writes before all have read.
        if (!__syncthreads_or(is_shorter)) break;
#pragma unroll
        for (i32 k = 0; k < EACH; k++) *own[k] = after[k];
        __syncthreads();
    }
#pragma unroll
    for (i32 k = 0; k < EACH; k++) params.to[(u64)blockIdx.x * LEN + k * THREADS + threadIdx.x] = *own[k];
}
