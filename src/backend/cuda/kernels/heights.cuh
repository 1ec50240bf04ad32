// Heights of new ground: octaves of Perlin noise, bit-identical to the `noise` crate that ground/noise_heights.rs
// uses. Doubles go through the same operations in the same order.
#pragma once

#include "threads.cuh"

// Columns of a block, which loads the tables of its octaves once for all of them.
constexpr i32 COLUMNS = 8 * THREADS;
constexpr i32 MOST_OCTAVES = 16;
constexpr i32 TABLE = 256;
// The largest absolute height in voxels, and the value that stands for a height beyond it.
constexpr double LIMIT = 32768.0;
constexpr i32 REFUSED = -2147483647 - 1;

// Quintic fade curve: first and second derivatives are zero at both ends.
__device__ inline double eased(double t) { return t * t * t * (t * (t * 6.0 - 15.0) + 10.0); }

__device__ inline double blended(double a, double b, double t) { return b * t + a * (1.0 - t); }

// Dot product of one of four diagonal gradients with the offset from its corner.
__device__ inline double sloped(u32 hash, double x, double z) { return (hash & 1 ? -x : x) + (hash & 2 ? -z : z); }

__device__ inline double clamped(double value, double low, double high) {
    return value < low ? low : value > high ? high : value;
}

// Gradient noise at a point with positive coordinates whose integer parts fit 31 bits.
__device__ inline double perlin(const u8* table, double x, double z) {
    i32 column = (i32)x, row = (i32)z;
    double u = x - (double)column, v = z - (double)row;
    u32 west = table[column & 255], east = table[(column + 1) & 255];
    u32 north = row & 255, south = (row + 1) & 255;
    double bend = eased(v);
    double at_west = blended(sloped(table[west ^ north], u, v), sloped(table[west ^ south], u, v - 1.0), bend);
    double at_east = blended(sloped(table[east ^ north], u - 1.0, v), sloped(table[east ^ south], u - 1.0, v - 1.0), bend);
    return clamped(blended(at_west, at_east, eased(u)) * (2.0 / 1.41421356237309504880), -1.0, 1.0);
}

// Fractal noise: the amplitude decreases from octave to octave.
__device__ inline double fractal(const HeightsParams& params, const u8 (*tables)[TABLE], double x, double z) {
    double sum = 0.0, strength = params.persistence;
    for (u32 octave = 0; octave < params.octaves; octave++) {
        sum += perlin(tables[octave], x, z) * strength;
        strength *= params.persistence;
        x *= params.lacunarity;
        z *= params.lacunarity;
    }
    return sum * params.factor;
}

// Ridged noise: ridges where an octave is 0. Each octave is weighted by the previous one.
__device__ inline double ridged(const HeightsParams& params, const u8 (*tables)[TABLE], double x, double z) {
    double sum = 0.0, strength = 1.0, weight = 1.0;
    for (u32 octave = 0; octave < params.octaves; octave++) {
        double ridge = 1.0 - fabs(perlin(tables[octave], x, z));
        ridge = ridge * ridge * weight;
        weight = clamped(ridge * params.weighting, 0.0, 1.0);
        sum += ridge * strength;
        strength *= params.persistence;
        x *= params.lacunarity;
        z *= params.lacunarity;
    }
    double noise = sum * params.factor - 1.0;
    return (noise + 1.0) / params.peak * 2.0 - 1.0;
}

extern "C" __global__ void __launch_bounds__(THREADS) heights(HeightsParams params) {
    __shared__ u8 tables[MOST_OCTAVES][TABLE];
    // Four bytes at a time.
    for (u32 i = threadIdx.x; i < params.octaves * (TABLE / 4); i += THREADS) ((u32*)tables)[i] = params.tables[i];
    __syncthreads();
    u32 start = blockIdx.x * COLUMNS, end = params.count - start < COLUMNS ? params.count : start + COLUMNS;
    for (u32 i = start + threadIdx.x; i < end; i += THREADS) {
        u32 column = params.first + i, row = column / params.row_len;
        double x = (double)(column - row * params.row_len) / params.scale + params.origin[0];
        double z = (double)row / params.scale + params.origin[1];
        x *= params.frequency;
        z *= params.frequency;
        double noise = params.is_ridged ? ridged(params, tables, x, z) : fractal(params, tables, x, z);
        double height = params.base + params.amplitude * noise;
        // Rounds halves away from zero.
        params.heights[i] = fabs(height) <= LIMIT ? (i32)round(height * ONE) : REFUSED;
    }
}
