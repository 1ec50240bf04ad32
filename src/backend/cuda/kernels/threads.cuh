// Helpers for threads, counting and integers that all kernels use.
#pragma once

#include "layout.cuh"

__device__ inline i32 smallest(i32 a, i32 b) { return a < b ? a : b; }

__device__ inline i32 largest(i32 a, i32 b) { return a > b ? a : b; }

// Division rounded towards minus infinity; the divisor is positive.
__device__ inline i64 divided(i64 value, i64 by) {
    i64 quotient = value / by;
    return quotient * by > value ? quotient - 1 : quotient;
}

__device__ inline u32 lane() { return threadIdx.x & 31; }

__device__ inline u32 warp() { return threadIdx.x >> 5; }

// Mask of the lanes before this one.
__device__ inline u32 lanes_before() { return (1u << lane()) - 1; }

// Inclusive prefix sum over the warp.
__device__ inline u32 running_sum(u32 value) {
    for (i32 step = 1; step < 32; step *= 2) {
        u32 other = __shfl_up_sync(WARP, value, step);
        if (lane() >= step) value += other;
    }
    return value;
}

// Sum over the warp.
__device__ inline u32 sum_of_warp(u32 value) {
    for (i32 step = 16; step > 0; step /= 2) value += __shfl_xor_sync(WARP, value, step);
    return value;
}

// Transposes a 32x32 bit matrix: bit i of lane k becomes bit k of lane i. Swaps halves of the words, then quarters,
// down to single bits.
__device__ inline u32 transpose(u32 bits) {
    u32 low = 0xffff;
#pragma unroll
    for (i32 step = 16; step > 0; step /= 2) {
        u32 other = __shfl_xor_sync(WARP, bits, step);
        bool is_upper = lane() & step;
        u32 taken = is_upper ? low : ~low, moved = is_upper ? other >> step : other << step;
        bits ^= (bits ^ moved) & taken;
        low ^= low << (step / 2);
    }
    return bits;
}

// Whether `count` entries starting at `first` fit.
__device__ inline bool fits(u32 first, u32 count, u32 capacity) {
    return first <= capacity && count <= capacity - first;
}
