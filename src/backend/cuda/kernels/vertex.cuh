// The one vertex function: surface/vertex.rs, surface/crossings.rs.
#pragma once

#include "edges.cuh"
#include "mixes.cuh"

// What `a` divided by a positive number is, exactly rounded like any division, with the number's reciprocal at hand
// (Markstein): twice the rest is divided, too. Here nothing comes near the ends of the range of exponents: components are
// multiples of 2^-61, lengths lie between 2^-17 and 2^28.
__device__ inline float quotient(float a, float number, float reciprocal) {
    float result = a * reciprocal;
    result = fmaf(fmaf(-result, number, a), reciprocal, result);
    result = fmaf(fmaf(-result, number, a), reciprocal, result);
    // Zeroes have a sign.
    return copysignf(result, a);
}

// The vector of length 1; up where there is none. Products of its components are added in this order.
__device__ inline Vector unit(Vector v) {
    float length = sqrtf(v.x * v.x + v.y * v.y + v.z * v.z);
    if (!(length > 0.0f)) return {0.0f, 1.0f, 0.0f};
    float reciprocal = 1.0f / length;
    return {quotient(v.x, length, reciprocal), quotient(v.y, length, reciprocal), quotient(v.z, length, reciprocal)};
}

// Does the edge lie between a cell of the mask and one of the heightmap?
__device__ inline bool is_border(const ColumnJob& column, const Edge& edge) {
    i32 bit = (edge.z + 1) * 10 + edge.x + 1;
    return column.borders[edge.axis][bit / 32] >> bit % 32 & 1;
}

// How far the height is looked up on both sides of a column: not beyond the world's rim.
__device__ inline i32 run_around(i32 at, i32 cells) { return smallest(at + 1, cells) - largest(at - 1, 0); }

// The tile's normal over a column, `Ground::normal`. Beyond the rim, heights repeat, so there the differences are right.
__device__ inline Vector ground_normal(const Site& site, const i32* heights, i32 window) {
    i32 along_x = run_around(site.low[0] + window % WINDOW - 1, site.params.width);
    i32 along_z = run_around(site.low[2] + window / WINDOW - 1, site.params.depth);
    float x = (float)(heights[window + 1] - heights[window - 1]) / (float)(along_x * ONE);
    float z = (float)(heights[window + WINDOW] - heights[window - WINDOW]) / (float)(along_z * ONE);
    float length = sqrtf(x * x + z * z + 1.0f), reciprocal = 1.0f / length;
    return {quotient(-x, length, reciprocal), reciprocal, quotient(-z, length, reciprocal)};
}

// The tile's normal on an edge.
__device__ inline Vector sheet_normal(const Site& site, const i32* heights, const Edge& edge, i32 step) {
    Vector a = ground_normal(site, heights, edge.window);
    if (edge.axis == 1) return a;
    Vector b = ground_normal(site, heights, edge.window + edge.next_window);
    float t = (float)step / (float)SNAP;
    return unit({lerp(a.x, b.x, t), lerp(a.y, b.y, t), lerp(a.z, b.z, t)});
}

__device__ inline ushort4 position_of(const Edge& edge, i32 step) {
    i32 x = edge.x * SNAP + (edge.axis == 0 ? step : 0);
    i32 y = edge.y * SNAP + (edge.axis == 1 ? step : 0);
    i32 z = edge.z * SNAP + (edge.axis == 2 ? step : 0);
    return {(u16)x, (u16)y, (u16)z, 0};
}

__device__ inline Vector normal_of(
    const Site& site, const MeshBench& bench, const Edge& edge, const Crossing& crossing
) {
    bool is_sheet = crossing.is_pristine && (crossing.is_stencil_pristine || is_border(site.column, edge));
    return is_sheet ? sheet_normal(site, bench.heights, edge, crossing.step) : unit(crossing.gradient);
}
