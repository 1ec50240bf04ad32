// Meshes the cells of one brick, like surface/block.rs.
//
// Each of the 9x9 corner columns of a brick's cells is held as bits, bit y for layer y. Most bricks are all solid
// or all air and finish early. In the others each corner column has a thread, which finds the cubes to draw and the
// lattice edges with a vertex by a few bit operations. Then:
//
//   1. Edges are numbered in vertex order: by axis, then layer, then corner. There are 27 levels of 81 edges.
//      Transposing the bits of 32 columns gives one word per level; population counts number the edges. Meanwhile
//      one warp lists cubes.
//   2. Samples are copied out of 27 bricks, one thread per column.
//   3. Edges are listed, while one thread reserves output space. The first vertices are computed while the
//      reservation is pending.
//   4. Each warp takes 32 vertices (surface/crossings.rs), or the triangles of 32 cubes, which look up their vertex
//      numbers by lattice edge.
//
// An edge id is 81 level + corner, where level = 9 axis + y and corner = 9 z + x, as in surface/block.rs.
#pragma once

#include "vertex.cuh"

// A row of eight samples of a brick, one bit each.
__device__ inline u32 row_of(const u32* bits, u32 row) { return ((const u8*)bits)[row]; }

// The samples above position x of a row in the brick's lowest layer, in the format of `columns`.
__device__ inline u32 column_above(const Brick& brick, u32 row, u32 x) {
    u32 column = 0;
#pragma unroll
    for (u32 y = 0; y < SIDE; y++) {
        u32 rows = row_of(brick.solid, y * SIDE + row) | row_of(brick.edited, y * SIDE + row) << 16;
        column |= (rows >> x & 0x10001) << y;
    }
    return column;
}

// Fills the corner columns and the signs. Called by the first two warps. The first has the 64 corners in the brick,
// two per lane: each lane loads half a layer of the bits, and a transpose gives the columns above its corners. The
// second has the 17 corners in the neighbouring bricks.
__device__ inline void gather_columns(const Site& site, MeshMemory& shared) {
    const Brick* bricks = site.params.bricks;
    bool is_inner = warp() == 0, is_side = lane() < SIDE || lane() == 2 * SIDE, has_solid = false, has_air = false;
    u32 x = is_inner ? lane() % SIDE : is_side ? SIDE : lane() - SIDE;
    u32 z = is_inner ? lane() / SIDE : lane() < SIDE ? lane() : SIDE;
    u32 bits = 0;
    if (is_inner || lane() <= 2 * SIDE) {
        const u32* window = window_at(site, x / SIDE, z / SIDE);
        u32 own = window[0], above = window[1], tops[2] = {0, 0};
        i32 heights[2];
        // The second corner is four rows further. The other warp has one corner per lane and repeats it.
        const u32 rows[2] = {z, is_inner ? z + 4 : z};
#pragma unroll
        for (i32 i = 0; i < 2; i++) {
            heights[i] = site.stack.heights[(rows[i] + 1) * WINDOW + x + 1];
            if (above == NONE) continue;
            const Brick& found = bricks[above >> 1];
            tops[i] = row_of(found.solid, rows[i] % SIDE) | row_of(found.edited, rows[i] % SIDE) << 16;
        }
        if (is_inner) {
            // After the transpose, four bytes: solid samples of the first and of the second corner, then edited
            // samples of both.
            if (own != NONE) {
                const u32* words = lane() < 16 ? bricks[own >> 1].solid : bricks[own >> 1].edited;
                bits = words[lane() % SIDE * 2 + lane() / SIDE % 2];
            }
            bits = transpose(bits);
        } else if (own != NONE) {
            bits = column_above(bricks[own >> 1], z % SIDE, x % SIDE);
        }
#pragma unroll
        for (i32 i = 0; i < 2; i++) {
            if (i == 1 && !is_inner) break;
            u32 column = (bits >> i * SIDE & 0xff00ff) | (tops[i] >> x % SIDE & 0x10001) << SIDE;
            // Without a brick, everything below the ground's height is solid.
            i32 filled = smallest(largest(((heights[i] + ONE - 1) >> 8) - site.low[1], 0), 9);
            u32 pristine = (1u << filled) - 1;
            if (own == NONE) column |= pristine & 0xff;
            if (above == NONE) column |= pristine & 0x100;
            shared.bits.columns[MARGIN + rows[i] * 9 + x] = column;
            has_solid |= (column & 0x1ff) != 0;
            has_air |= (column & 0x1ff) != 0x1ff;
        }
    }
    has_solid = __any_sync(WARP, has_solid);
    has_air = __any_sync(WARP, has_air);
    if (lane() == 0) shared.signs[warp()] = has_solid | has_air << 1;
}

// The cubes to draw above a corner's cell, one bit per layer: those with both signs that have an edited corner or
// belong to the mask.
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

// Layers of the corners below and above cubes.
__device__ inline u32 both_faces(u32 cubes) { return cubes | cubes << 1; }

// The edges from one corner column that have a vertex, one bit per level: their ends differ in sign, and an
// adjacent cube is drawn.
__device__ inline u32 column_edges(const u32* columns, const u16* drawn) {
    u32 own = columns[0];
    u32 along_x = (own ^ columns[1]) & both_faces(drawn[0] | drawn[-9]);
    u32 along_y = (own ^ own >> 1) & (u32)(drawn[0] | drawn[-1] | drawn[-9] | drawn[-10]);
    u32 along_z = (own ^ columns[9]) & both_faces(drawn[0] | drawn[-1]);
    return along_x | along_y << 9 | along_z << 18;
}

// Spreads two bits to positions 0 and 2, in both halves of a word.
__device__ inline u32 spread_pairs(u32 bits) { return (bits & 0x10001) | (bits & 0x20002) << 1; }

// The marching cubes case of a cube: one bit per solid corner.
__device__ inline u32 cube_case(const u32* columns, u32 y) {
    // Two bits from each column: the lower corner's, and the upper one's two places higher. The columns at z + 1 go
    // to the upper half.
    u32 low = spread_pairs((columns[0] & 0x1ff | columns[9] << 16) >> y);
    u32 high = spread_pairs((columns[1] & 0x1ff | columns[10] << 16) >> y);
    u32 corners = low | high << 1;
    return (corners | corners >> 12) & 0xff;
}

// Reads a vertical run of samples, starting at layer FIRST of a brick. Without a brick they are pristine.
template <i32 FIRST, i32 COUNT>
__device__ inline void read_samples(const Site& site, u32 ref, u32 at, i32* samples) {
    const i16* found = site.params.bricks[ref >> 1].samples + FIRST * 64 + at;
#pragma unroll
    for (i32 i = 0; i < COUNT; i++) samples[i] = ref != NONE ? found[i * 64] : PRISTINE;
}

// Source of a thread's padded column: references of the bricks below, at and above it, and the index within their
// layers.
struct ApronPlace {
    u32 refs[3], at;
};

__device__ inline ApronPlace apron_place(const Site& site) {
    // Row and column 0 are the last of the preceding brick.
    u32 t = smallest(threadIdx.x, AREA - 1), x = t % WINDOW + SIDE - 1, z = t / WINDOW + SIDE - 1;
    const u32* window = window_at(site, x / SIDE - 1, z / SIDE - 1);
    return {{window[-1], window[0], window[1]}, z % SIDE * SIDE + x % SIDE};
}

// A column of padded samples, and its height.
struct PaddedColumn {
    i32 samples[WINDOW], height;
};

// Reads the thread's column, starting with the last layer of the brick below. Reads from the bricks below and above
// only if cubes in the adjacent layers need them.
__device__ inline PaddedColumn read_column(const Site& site, const ApronPlace& place, u32 layers) {
    PaddedColumn column;
    column.height = site.stack.heights[smallest(threadIdx.x, AREA - 1)];
    read_samples<0, 8>(site, place.refs[1], place.at, column.samples + 1);
    read_samples<7, 1>(site, layers & 1 ? place.refs[0] : NONE, place.at, column.samples);
    read_samples<0, 2>(site, layers & 0xc0 ? place.refs[2] : NONE, place.at, column.samples + 9);
    return column;
}

// Stores a column in shared memory.
__device__ inline void put_column(const Site& site, MeshMemory& shared, const PaddedColumn& column) {
    u32 t = threadIdx.x;
    if (t >= AREA) return;
    shared.heights[t] = column.height;
    // Pristine samples have twice their distance above the ground, without the edited flag.
    u32 pristine = ((u32)(site.low[1] - 1) * ONE - (u32)column.height) * 2;
#pragma unroll
    for (i32 layer = 0; layer < WINDOW; layer++) {
        i32 sample = column.samples[layer];
        shared.padding[layer * AREA + t] = sample == PRISTINE ? (i32)(pristine + layer * ONE * 2) : sample * 2 + 1;
    }
}

// Computes the number of the first edge of each level for a warp's corners. Called by whole warps.
__device__ inline void number_edges(MeshMemory& shared) {
    u32 own = 0, before = 0;
    if (lane() < LEVELS) {
#pragma unroll
        for (u32 i = 0; i < CORNER_WARPS; i++) {
            u32 count = __popc(shared.bits.runs[lane()][i].crossed);
            if (i < warp()) before += count;
            own += count;
        }
    }
    u32 end = running_sum(own);
    if (lane() < LEVELS) shared.bits.runs[lane()][warp()].first = end - own + before;
    __syncwarp();
}

// Lists the edges of the thread's corner; one bit per level.
__device__ inline void list_edges(MeshMemory& shared, u32 edges) {
    for (u32 rest = edges; rest != 0; rest &= rest - 1) {
        i32 level = __ffs(rest) - 1;
        Run run = shared.bits.runs[level][warp()];
        u32 number = run.first + __popc(run.crossed & lanes_before()), place = level * CORNERS + threadIdx.x;
        shared.edges[number] = (u16)place;
        shared.numbers[place] = (u16)number;
    }
}

// Counts the edges of all levels. Called by one warp.
__device__ inline u32 count_edges(const MeshMemory& shared) {
    u32 edges = 0;
    if (lane() < LEVELS) {
#pragma unroll
        for (u32 i = 0; i < CORNER_WARPS; i++) edges += __popc(shared.bits.runs[lane()][i].crossed);
    }
    return sum_of_warp(edges);
}

// Lists the cubes to draw, layer by layer. Called by one warp.
__device__ inline void list_cubes(const MeshParams& params, MeshMemory& shared) {
    // Two half layers of cells.
    u32 corner = lane() / SIDE * 9 + lane() % SIDE, cubes = 0, indices = 0;
    u32 drawn = shared.bits.drawn[MARGIN + corner] | shared.bits.drawn[MARGIN + corner + 4 * 9] << SIDE;
    for (u32 rest = shared.layers; rest != 0; rest &= rest - 1) {
        u32 y = __ffs(rest) - 1;
#pragma unroll
        for (u32 half = 0; half < 2; half++) {
            bool is_drawn = drawn >> (y + half * SIDE) & 1;
            u32 word = __ballot_sync(WARP, is_drawn);
            if (is_drawn) shared.cubes[cubes + __popc(word & lanes_before())] = y * CORNERS + corner + half * 4 * 9;
            cubes += __popc(word);
        }
    }
    __syncwarp();
    // Adds each cube's case and number of indices.
#pragma unroll 1
    for (u32 cube = lane(); cube < cubes; cube += 32) {
        u32 place = shared.cubes[cube], kind = cube_case(shared.bits.columns + MARGIN + place % CORNERS, place / CORNERS);
        u32 count = params.table[kind][MOST_CUBE_INDICES];
        shared.cubes[cube] = place | kind << PLACE_BITS | count << CUBE_BITS;
        indices += count;
    }
    __syncwarp();
    indices = sum_of_warp(indices);
    if (lane() == 0) {
        shared.cubes_in_all = cubes;
        shared.indices = indices;
    }
}

// Reserves output space for the block: returns the first vertex, and the first index in the upper half. Called by
// one thread.
__device__ inline u64 reserve(const MeshParams& params, const MeshMemory& shared) {
    return atomicAdd((u64*)params.counters, shared.vertices | (u64)shared.indices << 32);
}

// Publishes the reservation. Called by one thread.
__device__ inline void enter(const MeshParams& params, MeshMemory& shared, u64 reserved) {
    u32 vertex = (u32)reserved, index = (u32)(reserved >> 32);
    bool is_room = fits(vertex, shared.vertices, params.vertex_capacity);
    is_room &= fits(index, shared.indices, params.index_capacity);
    shared.vertex = is_room ? vertex : NONE;
    shared.index = index;
    params.results[blockIdx.x] = {shared.vertex, shared.vertices, is_room ? index : 0, shared.indices};
}

// A lane's vertex without its normal.
struct Made {
    uint2 position;
    Mix mix;
};

// Computes up to 32 vertices, starting with number `base`; normals go to shared memory. Called by one warp.
__device__ inline Made make_vertices(const Site& site, MeshMemory& shared, u32 base) {
    Made made = {{0, 0}, {0, 0}};
    if (base + lane() < shared.vertices) {
        Edge edge = edge_at(shared.edges[base + lane()]);
        Crossing crossing = crossing_on(site, shared.padding, edge);
        Vector normal = normal_of(site, shared, edge, crossing);
        float* normals = shared.output[warp()].normals + lane() * 3;
        normals[0] = normal.x;
        normals[1] = normal.y;
        normals[2] = normal.z;
        made.position = position_of(edge, crossing.step);
        if (site.params.mixes) made.mix = mix_at(site, shared, edge, crossing);
    }
    __syncwarp();
    return made;
}

// Writes these vertices. Normals come from shared memory, so that writes are coalesced. Called by one warp.
__device__ inline void write_vertices(const MeshParams& params, const MeshMemory& shared, u32 base, const Made& made) {
    const float* normals = shared.output[warp()].normals;
    u32 count = smallest(shared.vertices - base, 32);
    u64 to = (u64)shared.vertex + base;
    if (lane() < count) {
        ((uint2*)params.positions)[to + lane()] = made.position;
        if (params.mixes) params.mixes[to + lane()] = {made.mix.ids, made.mix.weights};
    }
    float* place = params.normals + to * 3 + lane();
#pragma unroll
    for (u32 i = 0; i < 96; i += 32) {
        if (i + lane() < count * 3) place[i] = normals[i + lane()];
    }
    __syncwarp();
}

// Writes the triangles of up to 32 cubes, starting with number `base`. They are staged in shared memory, so that
// writes are coalesced. Called by one warp.
__device__ inline void write_cubes(const MeshParams& params, MeshMemory& shared, u32 base) {
    u16* indices = shared.output[warp()].indices;
    // Indices of the lane's cube; the upper half sums those of all cubes before this batch.
    u32 cube = base + lane() < shared.cubes_in_all ? shared.cubes[base + lane()] : 0, count = cube >> CUBE_BITS, counts = count;
#pragma unroll 1
    for (u32 i = lane(); i < base; i += 32) counts += shared.cubes[i] >> CUBE_BITS << 16;
    u32 ends = running_sum(counts), all = __shfl_sync(WARP, ends, 31), first = (ends & 0xffff) - count;
    const u16* numbers = shared.numbers + (cube & ((1 << PLACE_BITS) - 1));
    const uint4* slots = (const uint4*)params.table[cube >> PLACE_BITS & 0xff];
    u64 to = (u64)shared.index + (all >> 16);
#pragma unroll 1
    for (u32 from = 0; from < (all & 0xffff); from += STAGED_INDICES) {
        if (count != 0) {
            uint4 low = slots[0], high = slots[1];
            const u32 pairs[8] = {low.x, low.y, low.z, low.w, high.x, high.y, high.z, high.w};
#pragma unroll
            for (u32 i = 0; i < MOST_CUBE_INDICES; i += 3) {
                if (i >= count) break;
                u16 triangle[3];
#pragma unroll
                for (u32 j = 0; j < 3; j++) triangle[j] = numbers[pairs[(i + j) / 2] >> (i + j) % 2 * 16 & 0xffff];
                u32 at = first + i - from;
                if (at >= STAGED_INDICES) continue;
#pragma unroll
                for (u32 j = 0; j < 3; j++) indices[at + j] = triangle[j];
            }
        }
        __syncwarp();
        u32 staged = smallest((all & 0xffff) - from, STAGED_INDICES);
        for (u32 i = lane(); i < staged; i += 32) params.indices[to + from + i] = indices[i];
        __syncwarp();
    }
}

// Writes an empty result.
__device__ inline void draw_nothing(const MeshParams& params) {
    if (threadIdx.x == 0) params.results[blockIdx.x] = {0, 0, 0, 0};
}

extern "C" __global__ void __launch_bounds__(THREADS, 12) mesh(MeshParams params) {
    __shared__ MeshMemory shared;
    const MeshJob job = params.jobs[blockIdx.x];
    const ColumnJob& column = params.columns[job.column];
    const Stack& stack = params.stacks[column.stack];
    const i32 low[3] = {column.x * SIDE, job.y * SIDE, column.z * SIDE};
    bool is_at_rim = low[0] <= 0 || low[2] <= 0 || low[0] + SIDE >= params.width || low[2] + SIDE >= params.depth;
    Site site = {params, job, column, stack, {low[0], low[1], low[2]}, is_at_rim};
    i32 t = threadIdx.x;
    if (t < CORNERS + 20) shared.bits.drawn[t] = 0;
    if (t == 0) shared.layers = 0;
    if (warp() < 2) gather_columns(site, shared);
    __syncthreads();
    // Without both signs there is no surface.
    if ((shared.signs[0] | shared.signs[1]) != 3) {
        draw_nothing(params);
        return;
    }

    ApronPlace place = apron_place(site);
    // One thread per column of cells.
    if (t < SIDE * SIDE) {
        i32 x = t % SIDE, z = t / SIDE, corner = MARGIN + z * 9 + x;
        u32 cubes = drawn_cubes(site, shared.bits.columns + corner, x, z);
        shared.bits.drawn[corner] = (u16)cubes;
        if (cubes != 0) atomicOr(&shared.layers, cubes);
    }
    __syncthreads();
    u32 layers = shared.layers;
    if (layers == 0) {
        draw_nothing(params);
        return;
    }

    // The loads are in flight while edges and cubes are found.
    PaddedColumn samples = read_column(site, place, layers);
    // Three warps transpose and list edges. The fourth lists cubes and reserves output space.
    u32 edges = 0;
    if (warp() < CORNER_WARPS) {
        if (t < CORNERS) edges = column_edges(shared.bits.columns + MARGIN + t, shared.bits.drawn + MARGIN + t);
        u32 level = transpose(edges);
        if (lane() < LEVELS) shared.bits.runs[lane()][warp()].crossed = level;
    } else {
        list_cubes(params, shared);
    }
    put_column(site, shared, samples);
    __syncthreads();
    u64 reserved = 0;
    if (warp() < CORNER_WARPS) {
        number_edges(shared);
        list_edges(shared, edges);
    } else {
        u32 vertices = count_edges(shared);
        if (lane() == 0) {
            shared.vertices = vertices;
            reserved = reserve(params, shared);
        }
    }
    __syncthreads();

    // Warps compute their first vertices before they wait for the reservation.
    u32 batches = (shared.vertices + 31) / 32, all_batches = batches + (shared.cubes_in_all + 31) / 32;
    bool is_entered = false;
    for (u32 batch = warp(); batch < all_batches || !is_entered; batch += THREADS / 32) {
        Made made;
        if (batch < batches) made = make_vertices(site, shared, batch * 32);
        if (!is_entered) {
            if (t == CORNER_WARPS * 32) enter(params, shared, reserved);
            __syncthreads();
            if (shared.vertex == NONE) return;
            is_entered = true;
        }
        if (batch < batches) {
            write_vertices(params, shared, batch * 32, made);
        } else if (batch < all_batches) {
            write_cubes(params, shared, (batch - batches) * 32);
        }
    }
}
