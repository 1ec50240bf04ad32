// Position and normal of a vertex: surface/vertex.rs, surface/crossings.rs.
#pragma once

#include "edges.cuh"
#include "mixes.cuh"

// The correctly rounded quotient of `a` and a positive number, from the number's reciprocal (Markstein), with two
// correction steps. Exponents stay far from their limits: components are multiples of 2^-61, lengths lie between
// 2^-17 and 2^28.
__device__ inline float quotient(float a, float number, float reciprocal) {
    float result = a * reciprocal;
    result = fmaf(fmaf(-result, number, a), reciprocal, result);
    result = fmaf(fmaf(-result, number, a), reciprocal, result);
    // Keeps the sign of zero.
    return copysignf(result, a);
}

// Normalises a vector; a zero vector becomes (0, 1, 0). The order of the sum matters for the last bit.
__device__ inline Vector unit(Vector v) {
    float length = sqrtf(v.x * v.x + v.y * v.y + v.z * v.z);
    if (!(length > 0.0f)) return {0.0f, 1.0f, 0.0f};
    float reciprocal = 1.0f / length;
    return {quotient(v.x, length, reciprocal), quotient(v.y, length, reciprocal), quotient(v.z, length, reciprocal)};
}

// Whether the edge lies between a masked cell and a heightmap cell.
__device__ inline bool is_border(const ColumnJob& column, const Edge& edge) {
    i32 bit = (edge.z + 1) * 10 + edge.x + 1;
    return column.borders[edge.axis][bit / 32] >> bit % 32 & 1;
}

// Factor from a difference of heights around a column to a slope. The distance is two columns, or one on the
// world's border. Both factors are powers of two, so nothing is rounded.
__device__ inline float slope_scale(i32 at, i32 cells) {
    return at == 0 || at == cells ? 1.0f / ONE : 1.0f / (2 * ONE);
}

// The heightmap normal at a column, like `Ground::normal`. Heights repeat beyond the border, which makes these
// one-sided differences there.
__device__ inline Vector ground_normal(const Site& site, const i32* heights, i32 window) {
    float x = (float)(heights[window + 1] - heights[window - 1]);
    float z = (float)(heights[window + WINDOW] - heights[window - WINDOW]);
    x *= slope_scale(site.low[0] + window % WINDOW - 1, site.params.width);
    z *= slope_scale(site.low[2] + window / WINDOW - 1, site.params.depth);
    float length = sqrtf(x * x + z * z + 1.0f), reciprocal = 1.0f / length;
    return {quotient(-x, length, reciprocal), reciprocal, quotient(-z, length, reciprocal)};
}

// The format of `positions`, two coordinates per word.
__device__ inline uint2 position_of(const Edge& edge, i32 step) {
    i32 x = edge.x * SNAP + (edge.axis == 0 ? step : 0);
    i32 y = edge.y * SNAP + (edge.axis == 1 ? step : 0);
    i32 z = edge.z * SNAP + (edge.axis == 2 ? step : 0);
    return {(u16)x | (u32)(u16)y << 16, (u16)z};
}

// The heightmap normal on an unedited edge, else the normalised gradient.
__device__ inline Vector normal_of(
    const Site& site, const MeshMemory& shared, const Edge& edge, const Crossing& crossing
) {
    Vector normal = crossing.gradient;
    if (crossing.is_pristine && (crossing.is_stencil_pristine || is_border(site.column, edge))) {
        normal = ground_normal(site, shared.heights, edge.window);
        if (edge.axis == 1) return normal;
        Vector other = ground_normal(site, shared.heights, edge.window + edge.next_window);
        float t = (float)crossing.step / (float)SNAP;
        normal = {lerp(normal.x, other.x, t), lerp(normal.y, other.y, t), lerp(normal.z, other.z, t)};
    }
    return unit(normal);
}
