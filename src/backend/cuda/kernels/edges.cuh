// Lattice edges, and where the surface crosses them.
#pragma once

#include "shapes.cuh"
#include "site.cuh"

// A lattice edge with a vertex.
struct Edge {
    i32 axis;
    // Its lower end, relative to the brick's minimum corner.
    i32 x, y, z;
    // Index of the lower end's column in the window of columns, and the offset to the other end's column.
    i32 window, next_window;
};

__device__ inline Edge edge_at(u32 place) {
    i32 level = place / CORNERS, corner = place % CORNERS, axis = level / 9;
    i32 x = corner % 9, z = corner / 9;
    return {axis, x, level % 9, z, (z + 1) * WINDOW + x + 1, axis == 0 ? 1 : axis == 1 ? 0 : WINDOW};
}

// Linear crossing of an edge between two densities of opposite signs, rounded to the nearest 1/4096, halves up.
// Never at either end.
__device__ inline i32 linear_steps(i32 p, i32 q) {
    i32 from = p < 0 ? -p : p, sum = from + (q < 0 ? -q : q), steps;
    if (sum < 1 << 17) {
        // Integer path: the quotient is off by at most one, which the remainder corrects.
        i32 whole = from * (2 * SNAP) + sum, part = 2 * sum;
        steps = (i32)__fdividef((float)whole, (float)part);
        i32 rest = whole - steps * part;
        steps += (rest >= part) - (rest < 0);
    } else {
        // Doubles near 1.5 * 2^52 have a spacing of 1. A quotient that is not a half is at least 2^-26 away from
        // one, so the bias only decides halves.
        const double SHIFT = 6755399441055744.0, BIAS = 1.0 / (1 << 28);
        double share = (double)SNAP * (double)from / (double)sum;
        steps = __double2loint(share + BIAS + SHIFT);
    }
    return smallest(largest(steps, 1), SNAP - 1);
}

// A surface crossing, derived from the samples around an edge.
struct Crossing {
    // Steps of 1/4096 voxel from the lower end.
    i32 step;
    bool is_lower_solid;
    // Whether both ends are unedited, and whether all samples of the gradient stencils at both ends are.
    bool is_pristine, is_stencil_pristine;
    // Density gradient at the crossing; it points towards air.
    Vector gradient;
};

// Central difference.
__device__ inline i32 rise(Marked before, Marked after) { return (after >> 1) - (before >> 1); }

// The gradient at a sample that may lie on the world's border; `last` is the last coordinate. Densities are
// extrapolated linearly beyond it.
__device__ inline i32 rise_at(Marked before, Marked own, Marked after, i32 at, i32 last) {
    i32 inner = rise(at == 0 ? own : before, at == last ? own : after);
    return at == 0 || at == last ? 2 * inner : inner;
}

__device__ inline Crossing crossing_on(const Site& site, const Marked* padding, const Edge& edge) {
    const i32 STRIDES[3] = {1, AREA, WINDOW};
    const i32 AT[3] = {site.low[0] + edge.x, 0, site.low[2] + edge.z}, LAST[3] = {site.params.width, 0, site.params.depth};
    const Marked* p = padding + (edge.y + 1) * AREA + edge.window;
    const Marked* q = p + (edge.axis == 0 ? 1 : edge.axis == 1 ? AREA : WINDOW);
    Crossing crossing;
    crossing.is_lower_solid = *p < 0;
    crossing.is_pristine = !((*p | *q) & 1);
    // A pristine vertical edge is crossed exactly at the column's height, which may be the upper end.
    bool is_exact = edge.axis == 1 && crossing.is_pristine;
    crossing.step = is_exact ? -(*p >> 1) * (SNAP / ONE) : linear_steps(*p >> 1, *q >> 1);

    float t = (float)crossing.step / (float)SNAP, components[3];
    Marked stencil = *p | *q;
#pragma unroll
    for (i32 i = 0; i < 3; i++) {
        Marked p0 = p[-STRIDES[i]], p1 = p[STRIDES[i]], q0 = q[-STRIDES[i]], q1 = q[STRIDES[i]];
        stencil |= p0 | p1 | q0 | q1;
        i32 low = rise(p0, p1), high = rise(q0, q1);
        if (site.is_at_rim && i != 1) {
            low = rise_at(p0, *p, p1, AT[i], LAST[i]);
            high = rise_at(q0, *q, q1, AT[i] + (edge.axis == i), LAST[i]);
        }
        components[i] = lerp((float)low, (float)high, t);
    }
    crossing.is_stencil_pristine = !(stencil & 1);
    crossing.gradient = {components[0], components[1], components[2]};
    return crossing;
}
