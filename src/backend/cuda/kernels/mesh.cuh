// Draws the cells of one brick, as surface/block.rs does.
//
// Each of the 9x9 corners of a brick's cells, seen from above, has a thread that holds its column as bits, bit y for
// layer y: a few operations on them tell the cubes to draw, and the lattice edges with a vertex. Most bricks are done
// then. For the others:
//
//   1. Edges are put in the order of their vertices: by axis, then layer, then corner. There are 27 levels of 81 edges;
//      the bits of 32 columns, turned around, are a word for each level, and counting bits in them numbers the edges.
//   2. Samples are copied out of 27 bricks, only the layers that those edges look at.
//      Meanwhile one warp lists the cubes and their triangles, and reserves room for the output.
//   3. Edges are listed.
//   4. Warps take 32 vertices, each as the vertex function has it (surface/crossings.rs), or 32 triangles, which look up
//      the numbers of their vertices by lattice edge.
//
// Edges are called by their place, as in surface/block.rs: 81 level + corner, where level = 9 axis + y and corner = 9 z + x.
#pragma once

#include "vertex.cuh"

// Looks up the bricks around, copies heights, and the bits of the bricks that hold corners.
__device__ inline void gather_bits(const Site& site, MeshBench& bench) {
    i32 t = threadIdx.x;
    u32 strides = site.job.strides;
    const u32* window = site.params.windows + site.job.window;
    if (t < 27) {
        i32 along_x = (t % 3 - 1) * (i32)(strides & 0xffff), along_z = (t / 3 % 3 - 1) * (i32)(strides >> 16);
        bench.refs[t] = window[along_x + along_z + t / 9 - 1];
    }
    // Eight bricks of eight layers of two halves: four rows for each thread.
    i32 brick = t / 16, half = t % 16;
    u32 ref = window[(brick & 1) * (strides & 0xffff) + (brick >> 1 & 1) * (strides >> 16) + (brick >> 2)];
    u32 solid = 0, edited = 0;
    if (ref != NONE) {
        const Brick& found = site.params.bricks[ref >> 1];
        solid = found.solid[half];
        edited = found.edited[half];
    }
    // A byte of the one, a byte of the other.
    ((uint2*)bench.rows[brick])[half] = {__byte_perm(solid, edited, 0x5140), __byte_perm(solid, edited, 0x7362)};

    if (t < AREA) bench.heights[t] = site.stack.heights[t];
    if (t < CORNERS + 20) bench.solid[t] = bench.drawn[t] = 0;
    if (t == 0) bench.layers = 0;
}

// A column of corners as bits.
struct CornerColumn {
    u32 solid, edited;
};

__device__ inline CornerColumn corner_column(const Site& site, const MeshBench& bench, i32 x, i32 z) {
    i32 brick = x / SIDE + z / SIDE * 2, row = z % SIDE, bit = x % SIDE;
    u32 layers = 0;
    for (i32 y = 0; y < SIDE; y++) layers |= (bench.rows[brick][y * SIDE + row] >> bit & 0x101u) << y;
    u32 above = bench.rows[brick + 4][row] >> bit & 0x101u;
    CornerColumn column = {(layers & 0xff) | (above & 1) << 8, layers >> 8 | (above & 0x100)};
    // Where there is no brick, the ground tells: below its height all is solid.
    i32 height = bench.heights[(z + 1) * WINDOW + x + 1];
    i32 filled = smallest(largest(((height + ONE - 1) >> 8) - site.low[1], 0), 9);
    u32 pristine = (1u << filled) - 1;
    if (bench.refs[around(x / SIDE, 0, z / SIDE)] == NONE) column.solid |= pristine & 0xff;
    if (bench.refs[around(x / SIDE, 1, z / SIDE)] == NONE) column.solid |= pristine & 0x100;
    return column;
}

// The cubes to draw over the cell of a corner, a bit for each layer: those that both signs meet in, and that have an
// edited corner or belong to the mask.
__device__ inline u32 drawn_cubes(const Site& site, const u16* solid, const u16* edited, i32 x, i32 z) {
    u32 cells = site.job.cells;
    i32 low_x = cells & 7, low_y = cells >> 3 & 7, low_z = cells >> 6 & 7;
    i32 high_x = cells >> 9 & 7, high_y = cells >> 12 & 7, high_z = cells >> 15 & 7;
    if (x < low_x || x > high_x || z < low_z || z > high_z) return 0;
    u32 some = solid[0] | solid[1] | solid[9] | solid[10], all = solid[0] & solid[1] & solid[9] & solid[10];
    u32 mixed = (some | some >> 1) & ~(all & all >> 1);
    u32 near = edited[0] | edited[1] | edited[9] | edited[10];
    u32 wanted = site.column.mask >> (z * SIDE + x) & 1 ? 0xff : near | near >> 1;
    u32 layers = (2u << high_y) - (1u << low_y);
    return mixed & wanted & layers & 0xff;
}

// Layers of corners below and above cubes.
__device__ inline u32 both_faces(u32 cubes) { return cubes | cubes << 1; }

// The edges from the corners of one column that have a vertex, a bit for each level: their two ends differ, and a cube
// beside them is drawn.
__device__ inline u32 column_edges(const u16* solid, const u16* drawn) {
    u32 own = solid[0];
    u32 along_x = (own ^ solid[1]) & both_faces(drawn[0] | drawn[-9]);
    u32 along_y = (own ^ own >> 1) & (u32)(drawn[0] | drawn[-1] | drawn[-9] | drawn[-10]);
    u32 along_z = (own ^ solid[9]) & both_faces(drawn[0] | drawn[-1]);
    return along_x | along_y << 9 | along_z << 18;
}

// Two bits, the second one two places from the first.
__device__ inline u32 spread_pair(u32 bits) { return (bits & 1) | (bits & 2) << 1; }

// The case of a cube, which says what corners are solid.
__device__ inline u32 cube_case(const u16* solid, u32 y) {
    // Two bits of each column: the lower corner's, and the upper one's two places further.
    u32 near = spread_pair(solid[0] >> y) | spread_pair(solid[1] >> y) << 1;
    u32 far = spread_pair(solid[9] >> y) | spread_pair(solid[10] >> y) << 1;
    return near | far << 4;
}

__device__ inline u32 triangles_of(const MeshParams& params, u32 kind) { return params.table[kind][15] / 3; }

__device__ inline Marked mark(i32 stored, i32 pristine) {
    return stored == PRISTINE ? (i32)(2u * (u32)pristine) : stored * 2 + 1;
}

// Copies one row of samples into the apron: one of the brick before, eight, and two of the brick after.
__device__ inline void copy_row(const Site& site, MeshBench& bench, i32 layer, i32 z) {
    // Layer and row 0 are the last of the brick before.
    i32 level = (layer + 7) / SIDE - 1, at = (layer + 7) % SIDE * 64 + (z + 7) % SIDE * SIDE;
    i32 height = (site.low[1] + layer - 1) * ONE;
    const i32* heights = bench.heights + z * WINDOW;
    const u32* refs = bench.refs + around(0, level, (z + 7) / SIDE - 1);
    // Two samples to a word.
    const u32 NOTHING = (u16)PRISTINE * 0x10001u;
    u32 before = NOTHING, after = NOTHING;
    uint4 own = {NOTHING, NOTHING, NOTHING, NOTHING};
    if (refs[-1] != NONE) before = *(const u32*)&site.params.bricks[refs[-1] >> 1].samples[at + 6];
    if (refs[0] != NONE) own = *(const uint4*)&site.params.bricks[refs[0] >> 1].samples[at];
    if (refs[1] != NONE) after = *(const u32*)&site.params.bricks[refs[1] >> 1].samples[at];
    u32 pairs[6] = {before, own.x, own.y, own.z, own.w, after};
    Marked* row = bench.apron + layer * AREA + z * WINDOW;
#pragma unroll
    for (i32 x = 0; x < WINDOW; x++) {
        i32 stored = (i16)(pairs[(x + 1) / 2] >> ((x + 1) % 2 * 16));
        row[x] = mark(stored, (i32)((u32)height - (u32)heights[x]));
    }
}

// Counts the edges of all levels. For one warp.
__device__ inline u32 count_edges(const MeshBench& bench) {
    u32 edges = 0;
    for (u32 corner = lane(); corner < CORNERS; corner += 32) {
        edges += __popc(column_edges(bench.solid + MARGIN + corner, bench.drawn + MARGIN + corner));
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
            u32 place = bench.cubes[cube], kind = cube_case(bench.solid + MARGIN + place % CORNERS, place / CORNERS);
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

extern "C" __global__ void __launch_bounds__(THREADS, 11) mesh(MeshParams params) {
    __shared__ MeshBench bench;
    const MeshJob& job = params.jobs[blockIdx.x];
    const ColumnJob& column = params.columns[job.column];
    const Stack& stack = params.stacks[column.stack];
    Site site = {params, job, column, stack, {column.x * SIDE, job.y * SIDE, column.z * SIDE}};
    gather_bits(site, bench);
    __syncthreads();

    // Each thread with a corner holds its column.
    i32 t = threadIdx.x, x = t % 9, z = t / 9;
    u16* solid = bench.solid + MARGIN + t;
    u16* drawn = bench.drawn + MARGIN + t;
    // Only until the list of edges is made.
    u16* edited = bench.edges + t;
    if (t < CORNERS) {
        CornerColumn own = corner_column(site, bench, x, z);
        *solid = (u16)own.solid;
        *edited = (u16)own.edited;
    }
    __syncthreads();
    if (x < SIDE && z < SIDE) {
        u32 cubes = drawn_cubes(site, solid, edited, x, z);
        *drawn = (u16)cubes;
        if (cubes != 0) atomicOr(&bench.layers, cubes);
    }
    __syncthreads();
    u32 layers = bench.layers;
    if (layers == 0) {
        if (t == 0) params.results[blockIdx.x] = {0, 0, 0, 0};
        return;
    }

    // Three warps turn edges to words, and copy samples to the apron. The fourth lists triangles, and reserves room; while
    // it waits for that, edges are listed.
    u32 edges = 0, vertices = 0, triangles = 0;
    u64 reserved = 0;
    if (warp() < CORNER_WARPS) {
        edges = t < CORNERS ? column_edges(solid, drawn) : 0;
        u32 level = transpose(edges);
        if (lane() < LEVELS) bench.runs[lane()][warp()].crossed = level;
        i32 bottom = __ffs(layers) - 1, top = 31 - __clz(layers), rows = (top - bottom + 4) * WINDOW;
        for (i32 row = t; row < rows; row += CORNER_WARPS * 32) {
            copy_row(site, bench, bottom + row / WINDOW, row % WINDOW);
        }
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
