// Materials at vertices, and their mixes: surface/mesh.rs.
#pragma once

#include "edges.cuh"
#include "strata.cuh"

// Four material ids and their weights, one byte each.
struct Mix {
    u32 ids, weights;
};

__device__ inline Mix pure(u32 material) { return {material, 255}; }

__device__ inline Mix column_mix(u32 column) {
    u32 base = column & 0xff, overlay = column >> 8 & 0xff, blend = column >> 16 & 0xff;
    if (blend == 0 || base == overlay) return pure(base);
    if (blend == 255) return pure(overlay);
    return {base | overlay << 8, (255 - blend) | blend << 8};
}

// Weights of the materials of two mixes with at most two materials each. Loops over them are unrolled, so indices
// are constant and everything stays in registers.
struct Shares {
    u32 ids[4];
    i32 weights[4];
    i32 count;
};

// Adds a material unless its weight is zero.
__device__ inline void add_share(Shares& shares, u32 id, u32 weight, i32 share) {
    if (weight == 0) return;
    bool is_known = false;
#pragma unroll
    for (i32 i = 0; i < 4; i++) {
        bool is_it = i < shares.count && shares.ids[i] == id;
        if (is_it) shares.weights[i] += weight * share;
        is_known |= is_it;
    }
#pragma unroll
    for (i32 i = 0; i < 4; i++) {
        if (is_known || i != shares.count) continue;
        shares.ids[i] = id;
        shares.weights[i] = weight * share;
    }
    shares.count += !is_known;
}

// Sorts by descending weight, then by id.
__device__ inline void sort_shares(Shares& shares) {
#pragma unroll
    for (i32 pass = 0; pass < 3; pass++) {
#pragma unroll
        for (i32 i = 0; i < 3; i++) {
            if (i + 1 >= shares.count) continue;
            i32 a = shares.weights[i], b = shares.weights[i + 1];
            u32 id = shares.ids[i], other = shares.ids[i + 1];
            if (a > b || (a == b && id < other)) continue;
            shares.weights[i] = b;
            shares.weights[i + 1] = a;
            shares.ids[i] = other;
            shares.ids[i + 1] = id;
        }
    }
}

// Interpolates between two mixes of at most two materials each, in integers, at `step` of SNAP.
__device__ inline Mix lerp_mix(Mix a, Mix b, i32 step) {
    if (a.ids == b.ids && a.weights == b.weights) return a;
    Shares shares = {{0, 0, 0, 0}, {0, 0, 0, 0}, 0};
    add_share(shares, a.ids & 0xff, a.weights & 0xff, SNAP - step);
    add_share(shares, a.ids >> 8 & 0xff, a.weights >> 8 & 0xff, SNAP - step);
    add_share(shares, b.ids & 0xff, b.weights & 0xff, step);
    add_share(shares, b.ids >> 8 & 0xff, b.weights >> 8 & 0xff, step);
    sort_shares(shares);
    i32 total = largest(shares.weights[0] + shares.weights[1] + shares.weights[2] + shares.weights[3], 1);
    u32 rest = 255;
    Mix mix = {shares.ids[0], 0};
#pragma unroll
    for (i32 i = 1; i < 4; i++) {
        u32 weight = shares.weights[i] * 255 / total;
        mix.ids |= shares.ids[i] << (i * 8);
        mix.weights |= weight << (i * 8);
        rest -= weight;
    }
    mix.weights |= rest;
    return mix;
}

__device__ inline i32 between(i32 low, i32 high, i32 step) {
    return low + (i32)(((i64)high - low) * step / SNAP);
}

// Material of an unedited edge, interpolated between both columns as the heightmap does: the overlay near the
// pristine surface, the base below OVERLAY_DEPTH.
__device__ inline Mix own_mix(const Site& site, const i32* heights, const Edge& edge, i32 step) {
    i32 y = site.low[1] + edge.y, other = edge.window + edge.next_window;
    i32 upper = edge.axis == 1 ? y + 1 : y;
    i32 depth = between(heights[edge.window], heights[other], step) - between(y * ONE, upper * ONE, step);
    u32 a = site.stack.columns[edge.window], b = site.stack.columns[other];
    if (depth > OVERLAY_DEPTH) return lerp_mix(pure(a & 0xff), pure(b & 0xff), step);
    return lerp_mix(column_mix(a), column_mix(b), step);
}

// The material stored at an edge's solid end.
__device__ inline u32 stored_material(const Site& site, const Edge& edge, bool is_lower) {
    i32 x = edge.x + (edge.axis == 0 && !is_lower);
    i32 y = edge.y + (edge.axis == 1 && !is_lower);
    i32 z = edge.z + (edge.axis == 2 && !is_lower);
    u32 ref = window_at(site, x / SIDE, z / SIDE)[y / SIDE];
    if (ref == NONE || !(ref & 1)) return GROUND;
    return site.params.bricks[ref >> 1].materials[y % SIDE * 64 + z % SIDE * SIDE + x % SIDE];
}

__device__ inline Mix mix_at(
    const Site& site, const MeshMemory& shared, const Edge& edge, const Crossing& crossing
) {
    u32 stored = stored_material(site, edge, crossing.is_lower_solid);
    if (stored != GROUND) return pure(stored);
    if (site.params.strata) {
        // That of the solid end: what a dig there yields.
        i32 end = !crossing.is_lower_solid, window = edge.window + (end ? edge.next_window : 0);
        Voxel voxel = {
            site.low[0] + edge.x + (edge.axis == 0 && end),
            site.low[1] + edge.y + (edge.axis == 1 && end),
            site.low[2] + edge.z + (edge.axis == 2 && end),
            shared.heights[window],
            site.stack.columns[window],
        };
        return pure(strata_material(*site.params.strata, voxel));
    }
    if (site.params.is_single) return {site.params.single_ids, site.params.single_weights};
    return own_mix(site, shared.heights, edge, crossing.step);
}
