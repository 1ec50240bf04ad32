// Draws the cells of one brick, as surface/block.rs does.
//
// Each of the 9x9 corners of a brick's cells, seen from above, has a thread that holds its column as bits, bit y for
// layer y: a few operations on them tell the cubes to draw, and the lattice edges with a vertex. Most bricks are done
// then. For the others:
//
//   1. Edges are put in the order of their vertices: by axis, then layer, then corner. There are 27 levels of 81 edges; a
//      ballot turns a level of all columns into words, and counting bits in them numbers the edges.
//   2. Samples are copied out of 27 bricks, only the layers that those edges look at.
//   3. Threads take vertices from a list of the edges, each as the vertex function has it (surface/crossings.rs).
//   4. Threads take triangles from a list of them, and look up the numbers of their vertices by lattice edge.
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
    // Eight bricks of sixteen words: a word for each thread.
    i32 brick = t / 16, word = t % 16;
    u32 ref = window[(brick & 1) * (strides & 0xffff) + (brick >> 1 & 1) * (strides >> 16) + (brick >> 2)];
    u64 bits = ref == NONE ? 0 : ((const u64*)site.params.bricks[ref >> 1].solid)[word];
    ((u64*)bench.rows[brick])[word] = bits;

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
    CornerColumn column = {0, 0};
    for (i32 y = 0; y <= SIDE; y++) {
        const u8(&rows)[2][SIDE * SIDE] = bench.rows[brick + y / SIDE * 4];
        i32 at = y % SIDE * SIDE + row;
        column.solid |= (rows[0][at] >> bit & 1u) << y;
        column.edited |= (rows[1][at] >> bit & 1u) << y;
    }
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

// The edges along each axis from the corners of one column that have a vertex: the two ends differ, and a cube beside it
// is drawn.
struct ColumnEdges {
    u32 along[3];
};

__device__ inline ColumnEdges column_edges(const u16* solid, const u16* drawn) {
    u32 own = solid[0];
    ColumnEdges edges;
    edges.along[0] = (own ^ solid[1]) & both_faces(drawn[0] | drawn[-9]);
    edges.along[1] = (own ^ own >> 1) & (u32)(drawn[0] | drawn[-1] | drawn[-9] | drawn[-10]);
    edges.along[2] = (own ^ solid[9]) & both_faces(drawn[0] | drawn[-1]);
    return edges;
}

// Turns the edges of 32 columns to words, one for each level, and stores them. For one warp.
__device__ inline void store_levels(MeshBench& bench, const ColumnEdges& edges) {
    u32 own = 0;
#pragma unroll
    for (i32 level = 0; level < LEVELS; level++) {
        u32 word = __ballot_sync(WARP, edges.along[level / 9] >> level % 9 & 1);
        if (lane() == level) own = word;
    }
    if (lane() < LEVELS) bench.crossed[warp()][lane()] = own;
}

// Two bits, the second one two places from the first.
__device__ inline u32 spread_pair(u32 bits) { return (bits & 1) | (bits & 2) << 1; }

// The case of a cube, which says what corners are solid; 0, without a triangle, for one that is not drawn.
__device__ inline u32 cube_case(const MeshBench& bench, u32 cell) {
    u32 y = cell / 64, corner = MARGIN + cell / SIDE % SIDE * 9 + cell % SIDE;
    if (!(bench.drawn[corner] >> y & 1)) return 0;
    const u16* solid = bench.solid + corner;
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
    Marked* row = bench.apron + layer * AREA + z * WINDOW;
    const u32* refs = bench.refs + around(0, level, (z + 7) / SIDE - 1);
    for (i32 x = 0; x < WINDOW; x++) row[x] = mark(PRISTINE, (i32)((u32)height - (u32)heights[x]));
    if (refs[-1] != NONE) {
        i32 before = site.params.bricks[refs[-1] >> 1].samples[at + 7];
        if (before != PRISTINE) row[0] = mark(before, 0);
    }
    if (refs[0] != NONE) {
        uint4 eight = *(const uint4*)&site.params.bricks[refs[0] >> 1].samples[at];
        u32 pairs[4] = {eight.x, eight.y, eight.z, eight.w};
        for (i32 x = 0; x < SIDE; x++) {
            i32 stored = (i16)(pairs[x / 2] >> (x % 2 * 16));
            if (stored != PRISTINE) row[x + 1] = mark(stored, 0);
        }
    }
    if (refs[1] != NONE) {
        const i16* after = &site.params.bricks[refs[1] >> 1].samples[at];
        for (i32 x = 0; x < 2; x++) {
            if (after[x] != PRISTINE) row[x + 9] = mark(after[x], 0);
        }
    }
}

// Numbers the edges of one warp's corners and lists them; returns how many edges the whole block has. For one warp.
__device__ inline u32 list_edges(MeshBench& bench, const ColumnEdges& edges) {
    u32 own = 0, before = 0;
    for (i32 i = 0; i < CORNER_WARPS && lane() < LEVELS; i++) {
        u32 count = __popc(bench.crossed[i][lane()]);
        if (i < warp()) before += count;
        own += count;
    }
    u32 end = running_sum(own);
    if (lane() < LEVELS) bench.first[warp()][lane()] = (u16)(end - own + before);
    __syncwarp();

    for (i32 axis = 0; axis < 3; axis++) {
        for (u32 rest = edges.along[axis]; rest != 0; rest &= rest - 1) {
            i32 level = axis * 9 + __ffs(rest) - 1;
            u32 number = bench.first[warp()][level] + __popc(bench.crossed[warp()][level] & lanes_before());
            bench.edges[number] = (u16)(level * CORNERS + threadIdx.x);
        }
    }
    return __shfl_sync(WARP, end, 31);
}

// The number of the vertex on the lattice edge at a place.
__device__ inline u32 vertex_number(const MeshBench& bench, u32 place) {
    u32 level = place / CORNERS, corner = place % CORNERS;
    u32 word = corner / 32, before = (1u << corner % 32) - 1;
    return bench.first[word][level] + __popc(bench.crossed[word][level] & before);
}

// Reserves room for the block. For one thread.
__device__ inline void reserve(const MeshParams& params, MeshBench& bench, u32 vertices) {
    u32 triangles = 0;
    for (i32 i = 0; i < THREADS / 32; i++) triangles += bench.warp_triangles[i];
    u32 indices = triangles * 3;
    u32 vertex = atomicAdd(&params.counters[0], vertices);
    u32 index = atomicAdd(&params.counters[1], indices);
    bool is_room = fits(vertex, vertices, params.vertex_capacity);
    is_room &= fits(index, indices, params.index_capacity);
    bench.vertex = is_room ? vertex : NONE;
    bench.vertices = vertices;
    bench.index = index;
    bench.triangles_in_all = triangles;
    params.results[blockIdx.x] = {bench.vertex, vertices, is_room ? index : 0, indices};
}

// Makes the block's vertices, 32 at a time. For each warp; normals go through shared memory, so that what the lanes of a
// warp write lies side by side.
__device__ inline void make_vertices(const Site& site, MeshBench& bench) {
    const MeshParams& params = site.params;
    float* normals = bench.normals[warp()];
    for (u32 base = warp() * 32; base < bench.vertices; base += THREADS) {
        u32 count = smallest(bench.vertices - base, 32);
        u64 to = (u64)bench.vertex + base;
        if (lane() < count) {
            Edge edge = edge_at(bench.edges[base + lane()]);
            Crossing crossing = crossing_on(bench.apron, edge);
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
}

// How many triangles a thread's own cells have.
__device__ inline u32 count_triangles(const MeshParams& params, const MeshBench& bench) {
    u32 triangles = 0;
    for (u32 i = 0; i < CELLS_EACH; i++) {
        triangles += triangles_of(params, cube_case(bench, threadIdx.x * CELLS_EACH + i));
    }
    return triangles;
}

// Lists the triangles of a thread's own cells, from number `first` on.
__device__ inline void list_triangles(const MeshParams& params, MeshBench& bench, u32 first) {
    for (u32 i = 0; i < CELLS_EACH; i++) {
        u32 cell = threadIdx.x * CELLS_EACH + i, count = triangles_of(params, cube_case(bench, cell));
        for (u32 number = 0; number < count; number++) bench.triangles[first++] = (u16)(cell | number << 9);
    }
}

// The three vertex numbers of a listed triangle.
__device__ inline void look_up(const MeshParams& params, const MeshBench& bench, u32 triangle, u16* numbers) {
    u32 cell = triangle & 511, first = (triangle >> 9) * 3;
    u32 y = cell / 64, corner = cell / SIDE % SIDE * 9 + cell % SIDE;
    const u16* slots = params.table[cube_case(bench, cell)] + first;
    for (u32 i = 0; i < 3; i++) numbers[i] = (u16)vertex_number(bench, y * CORNERS + corner + slots[i]);
}

// Writes the block's triangles, 32 at a time. For each warp.
__device__ inline void write_triangles(const MeshParams& params, MeshBench& bench) {
    u16* numbers = bench.indices[warp()];
    for (u32 base = warp() * 32; base < bench.triangles_in_all; base += THREADS) {
        u32 count = smallest(bench.triangles_in_all - base, 32);
        if (lane() < count) look_up(params, bench, bench.triangles[base + lane()], numbers + lane() * 3);
        __syncwarp();
        u64 to = (u64)bench.index + base * 3;
        for (u32 i = lane(); i < count * 3; i += 32) params.indices[to + i] = numbers[i];
        __syncwarp();
    }
}

extern "C" __global__ void __launch_bounds__(THREADS) mesh(MeshParams params) {
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

    // Edges to words, samples to the apron, and triangles are counted.
    ColumnEdges edges = {{0, 0, 0}};
    if (t < CORNERS) edges = column_edges(solid, drawn);
    if (warp() < CORNER_WARPS) store_levels(bench, edges);
    i32 bottom = __ffs(layers) - 1, top = 31 - __clz(layers);
    i32 rows = (top - bottom + 4) * WINDOW;
    for (i32 row = t; row < rows; row += THREADS) copy_row(site, bench, bottom + row / WINDOW, row % WINDOW);
    u32 triangles = count_triangles(params, bench);
    u32 end = running_sum(triangles);
    if (lane() == 31) bench.warp_triangles[warp()] = end;
    __syncthreads();

    if (warp() < CORNER_WARPS) {
        u32 vertices = list_edges(bench, edges);
        if (t == 0) reserve(params, bench, vertices);
    }
    u32 first = end - triangles;
    for (i32 i = 0; i < warp(); i++) first += bench.warp_triangles[i];
    __syncthreads();
    if (bench.vertex == NONE) return;

    make_vertices(site, bench);
    // The list of triangles takes the place of the samples.
    __syncthreads();
    list_triangles(params, bench, first);
    __syncthreads();
    write_triangles(params, bench);
}
