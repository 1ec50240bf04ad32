// Draws the cells of one brick, as surface/block.rs does.
//
// What is above each of the 9x9 corners of a brick's cells, seen from above, is held as bits, bit y for layer y. Most bricks
// are all solid or all air, and done then. In the others each corner has a thread: a few operations on the bits tell the
// cubes to draw, and the lattice edges with a vertex. Then:
//
//   1. Edges are put in the order of their vertices: by axis, then layer, then corner. There are 27 levels of 81 edges;
//      the bits of 32 columns, turned around, are a word for each level, and counting bits in them numbers the edges.
//   2. Samples are copied out of 27 bricks, a thread for each column.
//      Meanwhile one warp lists the cubes and their triangles, and reserves room for the output.
//   3. Edges are listed.
//   4. Warps take 32 vertices, each as the vertex function has it (surface/crossings.rs), or 32 triangles, which look up
//      the numbers of their vertices by lattice edge.
//
// Edges are called by their place, as in surface/block.rs: 81 level + corner, where level = 9 axis + y and corner = 9 z + x.
#pragma once

#include "vertex.cuh"

// Fills the columns of corners, and the signs. A warp has the corners of one of four bricks side by side, and of the one
// above it. A lane brings a layer's half of a brick's bits; turned around, these are what is above two of its corners.
__device__ inline void gather_columns(const Site& site, MeshBench& bench) {
    const Brick* bricks = site.params.bricks;
    u32 dx = warp() & 1, dz = warp() >> 1;
    const u32* window = window_at(site, dx, dz);
    u32 own = window[0], above = window[1], word = 0;
    // Four bytes of each corner's lane: solid samples, those of the corner four rows on, edited samples, and those.
    if (own != NONE) {
        const u32* words = lane() < 16 ? bricks[own >> 1].solid : bricks[own >> 1].edited;
        word = words[lane() % SIDE * 2 + lane() / SIDE % 2];
    }
    word = transpose(word);
    bool has_solid = false, has_air = false;
#pragma unroll
    for (i32 half = 0; half < 2; half++) {
        u32 x = lane() % SIDE + dx * SIDE, z = lane() / SIDE + half * 4 + dz * SIDE;
        if (x > SIDE || z > SIDE) continue;
        u32 bits = word >> half * SIDE & 0xff00ff;
        if (above != NONE) {
            const Brick& found = bricks[above >> 1];
            bits |= (found.solid[half] >> lane() & 1) << 8 | (found.edited[half] >> lane() & 1) << 24;
        }
        // Where there is no brick, the ground tells: below its height all is solid.
        i32 height = site.stack.heights[(z + 1) * WINDOW + x + 1];
        i32 filled = smallest(largest(((height + ONE - 1) >> 8) - site.low[1], 0), 9);
        u32 pristine = (1u << filled) - 1;
        if (own == NONE) bits |= pristine & 0xff;
        if (above == NONE) bits |= pristine & 0x100;
        bench.columns[MARGIN + z * 9 + x] = bits;
        has_solid |= (bits & 0x1ff) != 0;
        has_air |= (bits & 0x1ff) != 0x1ff;
    }
    has_solid = __any_sync(WARP, has_solid);
    has_air = __any_sync(WARP, has_air);
    if (lane() == 0) bench.signs[warp()] = has_solid | has_air << 1;
}

// The cubes to draw over the cell of a corner, a bit for each layer: those that both signs meet in, and that have an
// edited corner or belong to the mask.
__device__ inline u32 drawn_cubes(const Site& site, const u32* columns, i32 x, i32 z) {
    u32 cells = site.job.cells;
    i32 low_x = cells & 7, low_y = cells >> 3 & 7, low_z = cells >> 6 & 7;
    i32 high_x = cells >> 9 & 7, high_y = cells >> 12 & 7, high_z = cells >> 15 & 7;
    if (x < low_x || x > high_x || z < low_z || z > high_z) return 0;
    u32 some = columns[0] | columns[1] | columns[9] | columns[10];
    u32 all = columns[0] & columns[1] & columns[9] & columns[10];
    u32 mixed = (some | some >> 1) & ~(all & all >> 1);
    u32 near = some >> 16;
    u32 wanted = site.column.mask >> (z * SIDE + x) & 1 ? 0xff : near | near >> 1;
    u32 layers = (2u << high_y) - (1u << low_y);
    return mixed & wanted & layers & 0xff;
}

// Layers of corners below and above cubes.
__device__ inline u32 both_faces(u32 cubes) { return cubes | cubes << 1; }

// The edges from the corners of one column that have a vertex, a bit for each level: their two ends differ, and a cube
// beside them is drawn.
__device__ inline u32 column_edges(const u32* columns, const u16* drawn) {
    u32 own = columns[0];
    u32 along_x = (own ^ columns[1]) & both_faces(drawn[0] | drawn[-9]);
    u32 along_y = (own ^ own >> 1) & (u32)(drawn[0] | drawn[-1] | drawn[-9] | drawn[-10]);
    u32 along_z = (own ^ columns[9]) & both_faces(drawn[0] | drawn[-1]);
    return along_x | along_y << 9 | along_z << 18;
}

// Two bits, the second one two places from the first.
__device__ inline u32 spread_pair(u32 bits) { return (bits & 1) | (bits & 2) << 1; }

// The case of a cube, which says what corners are solid.
__device__ inline u32 cube_case(const u32* columns, u32 y) {
    // Two bits of each column: the lower corner's, and the upper one's two places further.
    u32 near = spread_pair(columns[0] >> y) | spread_pair(columns[1] >> y) << 1;
    u32 far = spread_pair(columns[9] >> y) | spread_pair(columns[10] >> y) << 1;
    return near | far << 4;
}

__device__ inline u32 triangles_of(const MeshParams& params, u32 kind) { return params.table[kind][15] / 3; }

// Reads samples above one another, from a layer of a brick on; without a brick nobody edited them.
template <i32 FIRST, i32 COUNT>
__device__ inline void read_samples(const Site& site, u32 ref, u32 at, i32* samples) {
    const i16* found = site.params.bricks[ref >> 1].samples + FIRST * 64 + at;
#pragma unroll
    for (i32 i = 0; i < COUNT; i++) samples[i] = ref != NONE ? found[i * 64] : PRISTINE;
}

// Copies the samples of a thread's column to the apron, and its height. Layers of cubes tell whether samples of the bricks
// below and above are looked at.
__device__ inline void copy_column(const Site& site, MeshBench& bench, u32 layers) {
    u32 t = threadIdx.x, x = t % WINDOW + SIDE - 1, z = t / WINDOW + SIDE - 1;
    if (t >= AREA) return;
    // Layer, row and column 0 are the last of the brick before.
    const u32* window = window_at(site, x / SIDE - 1, z / SIDE - 1);
    u32 at = z % SIDE * SIDE + x % SIDE;
    i32 samples[WINDOW], height = site.stack.heights[t];
    read_samples<0, 8>(site, window[0], at, samples + 1);
    read_samples<7, 1>(site, layers & 1 ? window[-1] : NONE, at, samples);
    read_samples<0, 2>(site, layers & 0xc0 ? window[1] : NONE, at, samples + 9);
    bench.heights[t] = height;
    // Twice the density where the ground tells.
    u32 pristine = ((u32)(site.low[1] - 1) * ONE - (u32)height) * 2;
#pragma unroll
    for (i32 layer = 0; layer < WINDOW; layer++) {
        i32 sample = samples[layer];
        bench.apron[layer * AREA + t] = sample == PRISTINE ? (i32)(pristine + layer * ONE * 2) : sample * 2 + 1;
    }
}

// Counts the edges of all levels. For one warp.
__device__ inline u32 count_edges(const MeshBench& bench) {
    u32 edges = 0;
    for (u32 corner = lane(); corner < CORNERS; corner += 32) {
        edges += __popc(column_edges(bench.columns + MARGIN + corner, bench.drawn + MARGIN + corner));
    }
    return __shfl_sync(WARP, running_sum(edges), 31);
}

// Numbers the edges of each level from a warp's corners. For one warp.
__device__ inline void number_edges(MeshBench& bench) {
    u32 own = 0, before = 0;
    for (i32 i = 0; i < CORNER_WARPS && lane() < LEVELS; i++) {
        u32 count = __popc(bench.runs[lane()][i].crossed);
        if (i < warp()) before += count;
        own += count;
    }
    u32 end = running_sum(own);
    if (lane() < LEVELS) bench.runs[lane()][warp()].first = end - own + before;
    __syncwarp();
}

// Lists the edges from the corner of a thread, a bit for each level.
__device__ inline void list_edges(MeshBench& bench, u32 edges) {
    for (u32 rest = edges; rest != 0; rest &= rest - 1) {
        i32 level = __ffs(rest) - 1;
        Run run = bench.runs[level][warp()];
        bench.edges[run.first + __popc(run.crossed & lanes_before())] = (u16)(level * CORNERS + threadIdx.x);
    }
}

// Lists the places of the cubes to draw; returns how many there are. For one warp.
__device__ inline u32 list_cubes(MeshBench& bench) {
    // The lower half of a layer's cells, and the upper half.
    u32 corners[2] = {lane() / SIDE * 9 + lane() % SIDE, (lane() / SIDE + 4) * 9 + lane() % SIDE};
    u32 drawn[2] = {bench.drawn[MARGIN + corners[0]], bench.drawn[MARGIN + corners[1]]};
    u32 cubes = 0;
    for (u32 y = 0; y < SIDE; y++) {
#pragma unroll
        for (i32 half = 0; half < 2; half++) {
            bool is_drawn = drawn[half] >> y & 1;
            u32 word = __ballot_sync(WARP, is_drawn);
            if (is_drawn) bench.cubes[cubes + __popc(word & lanes_before())] = y * CORNERS + corners[half];
            cubes += __popc(word);
        }
    }
    __syncwarp();
    return cubes;
}

// Adds the cases of the cubes to their places, and lists their triangles; returns how many there are. For one warp.
__device__ inline u32 list_triangles(const MeshParams& params, MeshBench& bench, u32 cubes) {
    u32 triangles = 0;
    for (u32 base = 0; base < cubes; base += 32) {
        u32 cube = base + lane(), count = 0;
        if (cube < cubes) {
            u32 place = bench.cubes[cube], kind = cube_case(bench.columns + MARGIN + place % CORNERS, place / CORNERS);
            bench.cubes[cube] = place | kind << PLACE_BITS;
            count = triangles_of(params, kind);
        }
        u32 end = running_sum(count), first = triangles + end - count;
        for (u32 number = 0; number < count; number++) {
            bench.triangles[first + number] = (u16)(cube | number << CUBE_BITS);
        }
        triangles += __shfl_sync(WARP, end, 31);
    }
    return triangles;
}

// The number of the vertex on the lattice edge at a place.
__device__ inline u32 vertex_number(const MeshBench& bench, u32 place) {
    u32 level = place / CORNERS, corner = place % CORNERS;
    Run run = bench.runs[level][corner / 32];
    return run.first + __popc(run.crossed & ((1u << corner % 32) - 1));
}

// Reserves room for the block: the first vertex, and the first index in the upper half. For one thread.
__device__ inline u64 reserve(const MeshParams& params, u32 vertices, u32 triangles) {
    return atomicAdd((u64*)params.counters, vertices | (u64)triangles * 3 << 32);
}

// Enters what was reserved. For one thread.
__device__ inline void enter(
    const MeshParams& params, MeshBench& bench, u64 reserved, u32 vertices, u32 triangles
) {
    u32 vertex = (u32)reserved, index = (u32)(reserved >> 32), indices = triangles * 3;
    bool is_room = fits(vertex, vertices, params.vertex_capacity);
    is_room &= fits(index, indices, params.index_capacity);
    bench.vertex = is_room ? vertex : NONE;
    bench.vertices = vertices;
    bench.index = index;
    bench.triangles_in_all = triangles;
    params.results[blockIdx.x] = {bench.vertex, vertices, is_room ? index : 0, indices};
}

// Makes up to 32 vertices, the first of number `base`. For one warp; normals go through shared memory, so that what its
// lanes write lies side by side.
__device__ inline void make_vertices(const Site& site, MeshBench& bench, u32 base) {
    const MeshParams& params = site.params;
    float* normals = bench.staged[warp()].normals;
    u32 count = smallest(bench.vertices - base, 32);
    u64 to = (u64)bench.vertex + base;
    if (lane() < count) {
        Edge edge = edge_at(bench.edges[base + lane()]);
        Crossing crossing = crossing_on(site, bench.apron, edge);
        Vector normal = normal_of(site, bench, edge, crossing);
        normals[lane() * 3] = normal.x;
        normals[lane() * 3 + 1] = normal.y;
        normals[lane() * 3 + 2] = normal.z;
        params.positions[to + lane()] = position_of(edge, crossing.step);
        if (params.mixes) {
            Mix mix = mix_at(site, bench, edge, crossing);
            params.mixes[to + lane()] = {mix.ids, mix.weights};
        }
    }
    __syncwarp();
    for (u32 i = lane(); i < count * 3; i += 32) params.normals[to * 3 + i] = normals[i];
    __syncwarp();
}

// The three vertex numbers of a listed triangle.
__device__ inline void look_up(const MeshParams& params, const MeshBench& bench, u32 triangle, u16* numbers) {
    u32 cube = bench.cubes[triangle & ((1 << CUBE_BITS) - 1)], first = (triangle >> CUBE_BITS) * 3;
    const u16* slots = params.table[cube >> PLACE_BITS] + first;
    u32 place = cube & ((1 << PLACE_BITS) - 1);
    for (u32 i = 0; i < 3; i++) numbers[i] = (u16)vertex_number(bench, place + slots[i]);
}

// Writes up to 32 triangles, the first of number `base`. For one warp.
__device__ inline void write_triangles(const MeshParams& params, MeshBench& bench, u32 base) {
    u16* numbers = bench.staged[warp()].indices;
    u32 count = smallest(bench.triangles_in_all - base, 32);
    if (lane() < count) look_up(params, bench, bench.triangles[base + lane()], numbers + lane() * 3);
    __syncwarp();
    u64 to = (u64)bench.index + base * 3;
    for (u32 i = lane(); i < count * 3; i += 32) params.indices[to + i] = numbers[i];
    __syncwarp();
}

// Says that a block has no surface.
__device__ inline void draw_nothing(const MeshParams& params) {
    if (threadIdx.x == 0) params.results[blockIdx.x] = {0, 0, 0, 0};
}

extern "C" __global__ void __launch_bounds__(THREADS, 11) mesh(MeshParams params) {
    __shared__ MeshBench bench;
    const MeshJob job = params.jobs[blockIdx.x];
    const ColumnJob& column = params.columns[job.column];
    const Stack& stack = params.stacks[column.stack];
    Site site = {params, job, column, stack, {column.x * SIDE, job.y * SIDE, column.z * SIDE}};
    i32 t = threadIdx.x, x = t % 9, z = t / 9;
    if (t < CORNERS + 20) bench.drawn[t] = 0;
    if (t == 0) bench.layers = 0;
    gather_columns(site, bench);
    __syncthreads();
    // Where all corners are solid, or none, there is no surface.
    if ((bench.signs[0] | bench.signs[1] | bench.signs[2] | bench.signs[3]) != 3) {
        draw_nothing(params);
        return;
    }

    const u32* columns = bench.columns + MARGIN + t;
    u16* drawn = bench.drawn + MARGIN + t;
    if (x < SIDE && z < SIDE) {
        u32 cubes = drawn_cubes(site, columns, x, z);
        *drawn = (u16)cubes;
        if (cubes != 0) atomicOr(&bench.layers, cubes);
    }
    __syncthreads();
    u32 layers = bench.layers;
    if (layers == 0) {
        draw_nothing(params);
        return;
    }

    copy_column(site, bench, layers);
    // Three warps turn edges to words. The fourth lists triangles, and reserves room; while it waits for that, edges are
    // listed.
    u32 edges = 0, vertices = 0, triangles = 0;
    u64 reserved = 0;
    if (warp() < CORNER_WARPS) {
        edges = t < CORNERS ? column_edges(columns, drawn) : 0;
        u32 level = transpose(edges);
        if (lane() < LEVELS) bench.runs[lane()][warp()].crossed = level;
    } else {
        vertices = count_edges(bench);
        triangles = list_triangles(params, bench, list_cubes(bench));
        if (lane() == 0) reserved = reserve(params, vertices, triangles);
    }
    __syncthreads();
    if (warp() < CORNER_WARPS) {
        number_edges(bench);
        list_edges(bench, edges);
    } else if (lane() == 0) {
        enter(params, bench, reserved, vertices, triangles);
    }
    __syncthreads();
    if (bench.vertex == NONE) return;

    u32 batches = (bench.vertices + 31) / 32, all_batches = batches + (bench.triangles_in_all + 31) / 32;
    for (u32 batch = warp(); batch < all_batches; batch += THREADS / 32) {
        if (batch < batches) {
            make_vertices(site, bench, batch * 32);
        } else {
            write_triangles(params, bench, (batch - batches) * 32);
        }
    }
}
