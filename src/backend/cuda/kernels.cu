// The work of a transaction on the device: bricks are brought there, edited, and meshed.
//
// Three kernels, a block of 128 threads for each job:
//
//   scatter  copies what the host sent to where it belongs
//   edit     applies edits to one brick        as volume/workpiece.rs does
//   mesh     draws the cells of one brick      as surface/block.rs does
//
// All give the very bits of the CPU. Densities are integers; floats are used in the same order of exactly rounded
// operations, which takes a compiler that fuses none of them (--fmad=false) and rounds divisions and roots exactly.
//
// Blocks share nothing but counters from which each reserves room for its output, so blocks come out in any order, while
// the order inside a block is fixed. Counters go on past the end of the room: the host then knows how much is needed.
// They are 32 bits wide; what one launch may ask for must fit (see layout.rs).
//
// The same file is compiled for the CPU by tools/emulator, as plain C++, to be tested where there is no device.

typedef unsigned char u8;
typedef short i16;
typedef unsigned short u16;
typedef int i32;
typedef unsigned int u32;
typedef long long i64;
typedef unsigned long long u64;

static const i32 THREADS = 128;
static const u32 WARP = 0xffffffff;

// Samples of a brick, and along one side of it.
static const i32 LEN = 512;
static const i32 SIDE = 8;
// Columns along a side of the window around a stack of bricks: one before it, two after. Also samples of an apron.
static const i32 WINDOW = 11;
static const i32 AREA = WINDOW * WINDOW;
// Corners of 8x8 cells.
static const i32 CORNERS = 81;

// Units of 1/256 voxel, of 1/4096 voxel.
static const i32 ONE = 256;
static const i32 SNAP = 4096;
// How far outside a shape samples still change, and how deep inside distances are told apart.
static const i32 BAND = 2 * ONE;
static const i32 DEPTH = 4 * ONE;
static const i32 OVERLAY_DEPTH = ONE + ONE / 2;

// A sample that nobody edited, and a material that nobody changed.
static const i32 PRISTINE = -32768;
static const u32 GROUND = 255;

// No brick; no entry.
static const u32 NONE = 0xffffffff;

// ---------------------------------------------------------------------------------------------------------------------
// What lies in memory. layout.rs has the same in Rust.
// ---------------------------------------------------------------------------------------------------------------------

// Sample (x, y, z) is at x + 8 z + 64 y; of the bits, layer y is a word of 64 bits, here two halves.
struct alignas(16) Brick {
    i16 samples[LEN];
    u32 solid[16];
    u32 edited[16];
    u8 materials[LEN];
};

// The columns around a stack of bricks, from one before its first on, x fastest.
struct alignas(16) Stack {
    i32 heights[AREA];
    // base | overlay << 8 | blend << 16
    u32 columns[AREA];
    u32 pad[2];
};

struct ScatterJob {
    u64 to, from;
    u32 bytes, pad;
};

struct ScatterParams {
    const ScatterJob* jobs;
};

struct EditJob {
    i32 brick[3];
    u32 base, target, stack;
    u32 first, count;
    u32 cuts;
    u32 pad[3];
};

enum Kind { SPHERE, CUBOID, CYLINDER, CAPSULE, CONE };
enum Operation { DIG, ADD, PAINT };

struct Tool {
    u32 kind, operation, material, is_rough;
    // The shape's origin: voxels, and 1/256 voxel from there.
    i32 home[3], rest[3];
    // The lattice points that it reaches, both ends included.
    i32 min[3], max[3];
    float constants[12];
    i32 amplitude, scale;
    u32 seed, pad;
};

enum ResultFlags { CHANGED = 1, EXTENDED = 2, UNIFORM = 4, HAS_MATERIALS = 8 };

struct EditResult {
    u64 hash;
    u32 flags, record, material, bounds, uniform, pad;
};

struct EditPart {
    u32 job, edit, part, bounds;
};

struct EditCount {
    u32 edit, fate, voxels, pad;
};

struct EditParams {
    Brick* bricks;
    const Stack* stacks;
    const EditJob* jobs;
    const u32* list;
    const Tool* tools;
    EditResult* results;
    // 72 and 32 to an entry.
    uint4* records;
    uint4* materials;
    EditPart* parts;
    EditCount* counts;
    // Records, materials, parts, counts.
    u32* counters;
    u32 record_capacity, material_capacity, part_capacity, count_capacity;
};

struct ColumnJob {
    u32 stack;
    i32 x, z;
    u32 pad;
    u64 mask, pad2;
    u32 borders[3][4];
};

struct MeshJob {
    u32 window, strides, column;
    i32 y;
    u32 cells, pad;
};

struct MeshResult {
    u32 vertex, vertices, index, indices;
};

struct MeshParams {
    const Brick* bricks;
    const Stack* stacks;
    const u32* windows;
    const ColumnJob* columns;
    const MeshJob* jobs;
    const u16 (*table)[16];
    MeshResult* results;
    ushort4* positions;
    float* normals;
    // Null where no mixes are wanted.
    uint2* mixes;
    u16* indices;
    // Vertices, indices.
    u32* counters;
    u32 vertex_capacity, index_capacity;
    // Cells of the world.
    i32 width, depth;
    u32 is_single, single_ids, single_weights, pad;
};

static_assert(sizeof(Brick) == 1664 && sizeof(Stack) == 976 && sizeof(ScatterJob) == 24, "see layout.rs");
static_assert(sizeof(EditJob) == 48 && sizeof(Tool) == 128 && sizeof(EditResult) == 32, "see layout.rs");
static_assert(sizeof(EditPart) == 16 && sizeof(EditCount) == 16 && sizeof(EditParams) == 104, "see layout.rs");
static_assert(sizeof(ColumnJob) == 80 && sizeof(MeshJob) == 24 && sizeof(MeshResult) == 16, "see layout.rs");
static_assert(sizeof(MeshParams) == 128, "see layout.rs");

// ---------------------------------------------------------------------------------------------------------------------
// Shared by the kernels
// ---------------------------------------------------------------------------------------------------------------------

__device__ inline i32 smallest(i32 a, i32 b) { return a < b ? a : b; }

__device__ inline i32 largest(i32 a, i32 b) { return a > b ? a : b; }

__device__ inline u32 lane() { return threadIdx.x & 31; }

__device__ inline u32 warp() { return threadIdx.x >> 5; }

// Lanes of the warp before this one.
__device__ inline u32 lanes_before() { return (1u << lane()) - 1; }

// Sum over this lane and those before it.
__device__ inline u32 running_sum(u32 value) {
    for (i32 step = 1; step < 32; step *= 2) {
        u32 other = __shfl_up_sync(WARP, value, step);
        if (lane() >= step) value += other;
    }
    return value;
}

// Is there room for so many entries from `first` on?
__device__ inline bool fits(u32 first, u32 count, u32 capacity) {
    return first <= capacity && count <= capacity - first;
}

// The ground's own material, where a voxel is so far above the surface.
__device__ inline u32 ground_material(u32 column, i32 distance) {
    bool is_overlay = distance >= -OVERLAY_DEPTH && column >> 16 >= 128;
    return (is_overlay ? column >> 8 : column) & 0xff;
}

// ---------------------------------------------------------------------------------------------------------------------
// scatter
// ---------------------------------------------------------------------------------------------------------------------

extern "C" __global__ void __launch_bounds__(THREADS) scatter(ScatterParams params) {
    ScatterJob job = params.jobs[blockIdx.x];
    const uint4* from = (const uint4*)job.from;
    uint4* to = (uint4*)job.to;
    for (u32 i = threadIdx.x; i < job.bytes / 16; i += THREADS) to[i] = from[i];
}

// ---------------------------------------------------------------------------------------------------------------------
// Distances to shapes: brush/distance.rs, brush/roughness.rs, brush/evaluator.rs
// ---------------------------------------------------------------------------------------------------------------------

struct Vector {
    float x, y, z;
};

// Like Rust's `if a > b { a } else { b }`; fmaxf treats zeroes otherwise.
__device__ inline float larger(float a, float b) { return a > b ? a : b; }

__device__ inline float smaller(float a, float b) { return a < b ? a : b; }

__device__ inline float length(float x, float y, float z) { return sqrtf(x * x + (y * y + z * z)); }

__device__ inline float dot(Vector p, const float* v) { return p.x * v[0] + (p.y * v[1] + p.z * v[2]); }

// From the point to the place `along` an axis.
__device__ inline float off_axis(Vector p, float along, const float* unit) {
    return length(p.x - along * unit[0], p.y - along * unit[1], p.z - along * unit[2]);
}

__device__ inline float sphere(Vector p, const float* constants) {
    return length(p.x, p.y, p.z) - constants[0];
}

__device__ inline float cuboid(Vector p, const float* constants) {
    const float* half = constants + 9;
    float qx = fabsf(dot(p, constants)) - half[0];
    float qy = fabsf(dot(p, constants + 3)) - half[1];
    float qz = fabsf(dot(p, constants + 6)) - half[2];
    float outside = length(larger(qx, 0.0f), larger(qy, 0.0f), larger(qz, 0.0f));
    return outside + smaller(larger(larger(qx, qy), qz), 0.0f);
}

__device__ inline float cylinder(Vector p, const float* constants) {
    float axis = constants[3], radius = constants[4];
    float along = dot(p, constants);
    float side = off_axis(p, along, constants) - radius;
    float half = axis * 0.5f;
    float end = fabsf(along - half) - half;
    float outside = length(larger(side, 0.0f), larger(end, 0.0f), 0.0f);
    return outside + smaller(larger(side, end), 0.0f);
}

__device__ inline float capsule(Vector p, const float* constants) {
    float axis = constants[3], radius = constants[4];
    float along = smaller(larger(dot(p, constants), 0.0f), axis);
    return off_axis(p, along, constants) - radius;
}

__device__ inline float cone(Vector p, const float* constants) {
    float radius = constants[4], slant = constants[5], rise = constants[6], run = constants[7];
    float along = dot(p, constants);
    float beyond = off_axis(p, along, constants) - radius;
    // Over the side's line, and how far that point is past either end of the side.
    float over = beyond * rise + along * run;
    float up = along * rise - beyond * run;
    float past = up - smaller(larger(up, 0.0f), slant);
    float to_side = over * over + past * past;
    float rim = larger(beyond, 0.0f);
    float to_base = rim * rim + along * along;
    float outside = sqrtf(smaller(to_side, to_base));
    float inside = larger(over, -along);
    return inside < 0.0f ? inside : outside;
}

__device__ inline float smooth_distance(const Tool& tool, Vector p) {
    switch (tool.kind) {
        case SPHERE: return sphere(p, tool.constants);
        case CUBOID: return cuboid(p, tool.constants);
        case CYLINDER: return cylinder(p, tool.constants);
        case CAPSULE: return capsule(p, tool.constants);
        default: return cone(p, tool.constants);
    }
}

// SplitMix64, as lattice/hash.rs has it.
__device__ inline u64 mix(u64 value) {
    u64 z = value + 0x9E3779B97F4A7C15ull;
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ull;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBull;
    return z ^ (z >> 31);
}

__device__ inline float lerp(float a, float b, float t) { return a + (b - a) * t; }

// A place among noise points: the cell, and the faded position between its ends.
struct Place {
    i32 cell;
    float t;
};

__device__ inline Place locate(i32 voxel, i32 scale) {
    const i32 RIM = 1 << 20;
    i32 place = smallest(largest(voxel, -RIM), RIM) * ONE;
    // Rounded down.
    i32 cell = place / scale - (place % scale < 0);
    float t = (float)(place - cell * scale) / (float)scale;
    return {cell, t * t * (3.0f - 2.0f * t)};
}

// The value of a noise point: 24 bits of a hash, in [-1, 1).
__device__ inline float noise_point(i32 x, i32 y, i32 z, u64 seed) {
    u64 place = (u64)(x & 0x1fffff) << 42 | (u64)(y & 0x1fffff) << 21 | (u64)(z & 0x1fffff);
    return (float)((i32)(mix(place ^ seed) >> 40) - (1 << 23)) / (float)(1 << 23);
}

// The noise on the plane of noise points with one x.
__device__ inline float noise_face(i32 x, Place y, Place z, u64 seed) {
    float near = lerp(noise_point(x, y.cell, z.cell, seed), noise_point(x, y.cell + 1, z.cell, seed), y.t);
    float far = lerp(noise_point(x, y.cell, z.cell + 1, seed), noise_point(x, y.cell + 1, z.cell + 1, seed), y.t);
    return lerp(near, far, z.t);
}

// Bumps at a lattice point.
__device__ inline float bumps(const Tool& tool, i32 x, i32 y, i32 z) {
    Place px = locate(x, tool.scale), py = locate(y, tool.scale), pz = locate(z, tool.scale);
    u64 seed = mix(tool.seed);
    float value = lerp(noise_face(px.cell, py, pz, seed), noise_face(px.cell + 1, py, pz, seed), px.t);
    if (value < -1.0f) value = -1.0f;
    if (value > 1.0f) value = 1.0f;
    return value * (float)tool.amplitude;
}

// To the nearest integer, halves to even, with an addition: next to 1.5 * 2^23, floats are the integers.
__device__ inline i32 round_distance(float distance) {
    const float SHIFT = 12582912.0f, HORIZON = 4194304.0f;
    float near = smaller(larger(distance, -HORIZON), HORIZON);
    return __float_as_int(near + SHIFT) - __float_as_int(SHIFT);
}

// Voxels from a shape's origin; they stop where no distance shows the difference.
__device__ inline i32 voxels_from(i32 voxel, i32 home) {
    const i64 FARTHEST = 65000;
    i64 voxels = (i64)voxel - home;
    return (i32)(voxels < -FARTHEST ? -FARTHEST : voxels > FARTHEST ? FARTHEST : voxels);
}

// The signed distance of the lattice point `offset` from a brick's lowest sample `low`. Rows along x begin at `low`, and
// only their first coordinate stops at the end of all distances, as on the CPU.
__device__ inline i32 distance_to(const Tool& tool, const i32* low, const i32* offset) {
    i32 y = low[1] + offset[1], z = low[2] + offset[2];
    Vector p = {
        (float)((voxels_from(low[0], tool.home[0]) + offset[0]) * ONE - tool.rest[0]),
        (float)(voxels_from(y, tool.home[1]) * ONE - tool.rest[1]),
        (float)(voxels_from(z, tool.home[2]) * ONE - tool.rest[2]),
    };
    float distance = smooth_distance(tool, p);
    if (tool.is_rough) distance += bumps(tool, low[0] + offset[0], y, z);
    return round_distance(distance);
}

// ---------------------------------------------------------------------------------------------------------------------
// edit
//
// A thread owns four samples of one column, two layers apart, from the first edit to the last, so edits wait for each
// other only to be entered: which samples they changed, as bits, and how many voxels of which material. That is kept
// twice, so that two warps write down one edit while all go on with the next.
// ---------------------------------------------------------------------------------------------------------------------

// How many samples a thread owns, and how many layers they are apart.
static const i32 OWN = LEN / THREADS;
static const i32 STEP = SIDE / OWN;

// What one edit did.
struct Effect {
    // Samples that changed, like the bits of a brick.
    u32 changed[16];
    // Voxels of each material that were removed, added or painted, whichever the edit does.
    u32 counts[256];
};

struct Workbench {
    Brick brick;
    Effect effects[2];
    // Samples that any edit changed.
    u32 changed[16];
    u64 hash;
    u32 flags;
    u32 record, material;
};

// What a thread's samples have in common.
struct OwnColumn {
    // The brick's lowest sample.
    i32 low[3];
    i32 x, z;
    // The lowest of its samples, counted from the brick's lowest.
    i32 first_y;
    i32 height;
    u32 materials;
};

__device__ inline i32 own_index(i32 k) { return k * THREADS + threadIdx.x; }

__device__ inline i32 own_y(const OwnColumn& column, i32 k) { return column.first_y + k * STEP; }

__device__ inline i32 pristine_distance(const OwnColumn& column, i32 k) {
    return (column.low[1] + own_y(column, k)) * ONE - column.height;
}

// Bits of the samples with a property, in order of the samples: each warp writes those of its own.
__device__ inline void store_bits(u32* words, i32 k, bool is_set) {
    u32 word = __ballot_sync(WARP, is_set);
    if (lane() == 0) words[k * 4 + warp()] = word;
}

// The box around the samples of a mask and some layers: lo x|y<<3|z<<6 | hi x<<9|y<<12|z<<15; `NONE` where it is empty.
__device__ inline u32 bounds_of(const u32* words, u64 mask, i32 first_y, i32 end_y) {
    u64 all = 0;
    i32 bottom = 0, top = 0;
    for (i32 y = end_y - 1; y >= first_y; y--) {
        u64 layer = ((u64)words[y * 2] | (u64)words[y * 2 + 1] << 32) & mask;
        if (layer == 0) continue;
        if (all == 0) top = y;
        bottom = y;
        all |= layer;
    }
    if (all == 0) return NONE;
    u32 row = (u32)all | (u32)(all >> 32);
    row |= row >> 16;
    row = (row | row >> 8) & 0xff;
    u32 low = (__ffs(row) - 1) | bottom << 3 | ((__ffsll(all) - 1) >> 3) << 6;
    u32 high = (31 - __clz(row)) | top << 3 | ((63 - __clzll(all)) >> 3) << 6;
    return low | high << 9;
}

// Of the samples along one side, those before the cut or those beyond it, as bits.
__device__ inline u32 side_bits(u32 cut, bool is_beyond) {
    u32 before = (1u << smallest(cut, SIDE)) - 1;
    return is_beyond ? 0xff & ~before : before;
}

// The samples of one part of the brick.
__device__ inline u32 part_bounds(const u32* changed, u32 cuts, u32 part) {
    u64 rows = side_bits(cuts & 15, part & 1) * 0x0101010101010101ull;
    u32 z = side_bits(cuts >> 8 & 15, part & 4), y = side_bits(cuts >> 4 & 15, part & 2);
    if (y == 0 || z == 0) return NONE;
    u64 level = 0;
    for (i32 i = 0; i < SIDE; i++) level |= (u64)(z >> i & 1 ? 0xff : 0) << (i * 8);
    return bounds_of(changed, rows & level, __ffs(y) - 1, 32 - __clz(y));
}

// Enters what an edit changed in each part of the brick. For one warp.
__device__ void enter_parts(const EditParams& params, u32 cuts, u32 edit, const u32* changed) {
    u32 bounds = lane() < 8 ? part_bounds(changed, cuts, lane()) : NONE;
    u32 filled = __ballot_sync(WARP, bounds != NONE);
    u32 first = 0;
    if (lane() == 0) first = atomicAdd(&params.counters[2], __popc(filled));
    u32 at = __shfl_sync(WARP, first, 0) + __popc(filled & lanes_before());
    if (bounds != NONE && at < params.part_capacity) {
        params.parts[at] = {blockIdx.x, edit, (u32)lane(), bounds};
    }
}

// Enters how many voxels an edit dealt with, and clears the counts. For one warp.
__device__ void enter_counts(const EditParams& params, u32 edit, u32 fate, u32* counts) {
    for (u32 base = 0; base < 256; base += 32) {
        u32 material = base + lane(), voxels = counts[material];
        u32 filled = __ballot_sync(WARP, voxels != 0);
        if (filled == 0) continue;
        u32 first = 0;
        if (lane() == 0) first = atomicAdd(&params.counters[3], __popc(filled));
        u32 at = __shfl_sync(WARP, first, 0) + __popc(filled & lanes_before());
        if (voxels != 0 && at < params.count_capacity) {
            params.counts[at] = {edit, fate | material << 8, voxels, 0};
        }
        counts[material] = 0;
    }
}

// Counts a voxel of this material, or none. Lanes of one material count as one.
__device__ inline void count_voxels(u32* counts, u32 material) {
    u32 rest = __ballot_sync(WARP, material != NONE);
    while (rest != 0) {
        i32 leader = __ffs(rest) - 1;
        u32 same = __ballot_sync(WARP, material == __shfl_sync(WARP, material, leader));
        if (lane() == leader) atomicAdd(&counts[material], __popc(same));
        rest &= ~same;
    }
}

// What became of a sample.
struct Outcome {
    bool is_changed;
    // The material of a voxel to be counted, or `NONE`.
    u32 counted;
};

__device__ inline u32 resolve(u32 stored, const OwnColumn& column, i32 pristine) {
    return stored == GROUND ? ground_material(column.materials, pristine) : stored;
}

// Digs or adds.
__device__ inline Outcome carve(const Tool& tool, i32 outside, const OwnColumn& column, i32 pristine, i16& sample, u8& material) {
    i32 raw = sample, before = raw == PRISTINE ? pristine : raw;
    i32 depth = largest(outside, -DEPTH);
    i32 after = tool.operation == DIG ? largest(before, -depth) : smallest(before, depth);
    i32 stored = smallest(largest(after, -32767), 32767);
    if (outside > BAND || after == before || stored == raw) return {false, NONE};
    sample = (i16)stored;
    if ((before < 0) == (after < 0)) return {true, NONE};
    if (after >= 0) {
        u32 removed = resolve(material, column, pristine);
        // Air is of no material.
        material = GROUND;
        return {true, removed};
    }
    if (tool.operation == ADD) material = (u8)tool.material;
    return {true, resolve(material, column, pristine)};
}

// Changes the material of a solid sample inside the shape.
__device__ inline Outcome paint(const Tool& tool, i32 outside, const OwnColumn& column, i32 pristine, i16& sample, u8& material) {
    i32 raw = sample, before = raw == PRISTINE ? pristine : raw;
    u32 old = material;
    if (outside > 0 || before >= 0 || (raw != PRISTINE && old == tool.material)) return {false, NONE};
    if (raw == PRISTINE) sample = (i16)largest(before, -32767);
    material = (u8)tool.material;
    u32 painted = resolve(tool.material, column, pristine);
    return {true, painted == resolve(old, column, pristine) ? NONE : painted};
}

// Copies the thread's samples from its brick, pristine ones where there is none.
__device__ inline void take(const Brick* base, bool has_materials, Brick& brick) {
    for (i32 k = 0; k < OWN; k++) {
        i32 index = own_index(k);
        brick.samples[index] = base ? base->samples[index] : (i16)PRISTINE;
        brick.materials[index] = has_materials ? base->materials[index] : (u8)GROUND;
    }
}

// Does any sample of the brick lie in an edit's reach?
__device__ inline bool is_reached(const Tool& tool, const i32* low) {
    bool is_reached = true;
    for (i32 axis = 0; axis < 3; axis++) {
        is_reached &= tool.min[axis] <= low[axis] + SIDE - 1 && low[axis] <= tool.max[axis];
    }
    return is_reached;
}

__device__ inline bool reaches(const Tool& tool, const i32* low, const i32* offset) {
    bool is_inside = true;
    for (i32 axis = 0; axis < 3; axis++) {
        i32 at = low[axis] + offset[axis];
        is_inside &= tool.min[axis] <= at && at <= tool.max[axis];
    }
    return is_inside;
}

// Applies one edit to the thread's samples; returns which of them changed, a bit for each. `has_materials` is set where
// a material was stored.
__device__ inline u32 apply(const Tool& tool, const OwnColumn& column, Brick& brick, Effect& effect, bool& has_materials) {
    u32 changed = 0;
    // Not unrolled: the code is long, and other warps are there to wait for.
#pragma unroll 1
    for (i32 k = 0; k < OWN; k++) {
        i32 index = own_index(k);
        i32 offset[3] = {column.x, own_y(column, k), column.z};
        Outcome outcome = {false, NONE};
        if (reaches(tool, column.low, offset)) {
            i32 outside = distance_to(tool, column.low, offset), pristine = pristine_distance(column, k);
            i16& sample = brick.samples[index];
            u8& material = brick.materials[index];
            outcome = tool.operation == PAINT ? paint(tool, outside, column, pristine, sample, material)
                                              : carve(tool, outside, column, pristine, sample, material);
            has_materials |= material != GROUND;
        }
        changed |= (u32)outcome.is_changed << k;
        store_bits(effect.changed, k, outcome.is_changed);
        count_voxels(effect.counts, outcome.counted);
    }
    return changed;
}

// What a sample adds to the world's hash; a pristine one adds nothing.
__device__ inline u64 sample_hash(u64 place, i32 y, i16 sample, u8 material) {
    if (sample == PRISTINE) return 0;
    return mix(place ^ (u64)(u32)y << 32 ^ (u64)(u16)sample << 8 ^ material);
}

// By how much the thread's samples change the world's hash, if they were these before.
__device__ inline u64 hash_change(const OwnColumn& column, const Brick& now, const Brick* base, bool had_materials, u32 changed) {
    u64 place = mix((u64)(u32)(column.low[0] + column.x) | (u64)(u32)(column.low[2] + column.z) << 32);
    u64 change = 0;
    for (i32 k = 0; k < OWN; k++) {
        if (!(changed >> k & 1)) continue;
        i32 index = own_index(k), y = column.low[1] + own_y(column, k);
        change += sample_hash(place, y, now.samples[index], now.materials[index]);
        if (base == nullptr) continue;
        u8 material = had_materials ? base->materials[index] : (u8)GROUND;
        change -= sample_hash(place, y, base->samples[index], material);
    }
    return change;
}

// Derives the bits of the brick and of what changed, and adds up what all threads know of it.
__device__ inline void sum_up(Workbench& bench, const OwnColumn& column, const Brick* base, u32 ref, u32 changed, bool has_materials) {
    Brick& brick = bench.brick;
    bool is_uniform = true, is_extended = false;
    for (i32 k = 0; k < OWN; k++) {
        i32 index = own_index(k), sample = brick.samples[index];
        bool is_edited = sample != PRISTINE, is_changed = changed >> k & 1;
        store_bits(brick.solid, k, (is_edited ? sample : pristine_distance(column, k)) < 0);
        store_bits(brick.edited, k, is_edited);
        store_bits(bench.changed, k, is_changed);
        is_uniform &= is_edited && sample == brick.samples[0] && brick.materials[index] == brick.materials[0];
        is_extended |= is_changed && (base == nullptr || base->samples[index] == PRISTINE);
    }
    u64 hash = hash_change(column, brick, base, ref & 1, changed);
    for (i32 step = 16; step > 0; step /= 2) hash += __shfl_down_sync(WARP, hash, step);

    u32 flags = __all_sync(WARP, is_uniform) ? 0 : UNIFORM;
    flags |= __any_sync(WARP, is_extended) ? EXTENDED : 0;
    flags |= __any_sync(WARP, has_materials) ? HAS_MATERIALS : 0;
    if (lane() == 0) {
        atomicAdd(&bench.hash, hash);
        // Uniform is what is nowhere otherwise.
        atomicOr(&bench.flags, flags);
    }
}

// Reserves room for the brick and writes its result. For one thread.
__device__ inline void reserve(const EditParams& params, Workbench& bench) {
    EditResult result = {bench.hash, (bench.flags ^ UNIFORM) | CHANGED, NONE, NONE, 0, 0, 0};
    if (result.flags & UNIFORM) {
        result.uniform = (u16)bench.brick.samples[0] | (u32)bench.brick.materials[0] << 16;
    } else {
        u32 record = atomicAdd(&params.counters[0], 1);
        if (record < params.record_capacity) result.record = record;
        if (result.flags & HAS_MATERIALS) {
            u32 material = atomicAdd(&params.counters[1], 1);
            if (material < params.material_capacity) result.material = material;
        }
    }
    result.bounds = bounds_of(bench.changed, ~0ull, 0, SIDE);
    bench.record = result.record;
    bench.material = result.material;
    params.results[blockIdx.x] = result;
}

// Writes the brick to its slot, and to the entries that were reserved for it.
__device__ inline void store(const EditParams& params, const Workbench& bench, Brick* target) {
    const i32 PIECES = sizeof(Brick) / sizeof(uint4), RECORD = PIECES - LEN / sizeof(uint4);
    i32 piece = threadIdx.x;
    if (piece >= PIECES) return;
    uint4 data = ((const uint4*)&bench.brick)[piece];
    if (piece < RECORD) {
        ((uint4*)target)[piece] = data;
        if (bench.record != NONE) params.records[(u64)bench.record * RECORD + piece] = data;
    } else if (bench.flags & HAS_MATERIALS) {
        ((uint4*)target)[piece] = data;
        if (bench.material != NONE) params.materials[(u64)bench.material * (PIECES - RECORD) + piece - RECORD] = data;
    }
}

extern "C" __global__ void __launch_bounds__(THREADS) edit(EditParams params) {
    __shared__ Workbench bench;
    const EditJob& job = params.jobs[blockIdx.x];
    const Brick* base = job.base == NONE ? nullptr : &params.bricks[job.base >> 1];
    bool has_materials = base != nullptr && job.base & 1;

    const Stack& stack = params.stacks[job.stack];
    i32 x = threadIdx.x % SIDE, z = threadIdx.x / SIDE % SIDE, window = (z + 1) * WINDOW + x + 1;
    OwnColumn column = {
        {job.brick[0] * SIDE, job.brick[1] * SIDE, job.brick[2] * SIDE},
        x,
        z,
        (i32)threadIdx.x / (SIDE * SIDE),
        stack.heights[window],
        stack.columns[window],
    };
    take(base, has_materials, bench.brick);
    for (i32 i = threadIdx.x; i < 512; i += THREADS) bench.effects[i / 256].counts[i % 256] = 0;
    if (threadIdx.x == 0) {
        bench.hash = 0;
        bench.flags = 0;
    }
    __syncthreads();

    u32 changed = 0, turn = 0;
    for (u32 i = 0; i < job.count; i++) {
        u32 number = params.list[job.first + i];
        const Tool& tool = params.tools[number];
        if (!is_reached(tool, column.low)) continue;
        Effect& effect = bench.effects[turn & 1];
        u32 own = apply(tool, column, bench.brick, effect, has_materials);
        changed |= own;
        if (!__syncthreads_or(own != 0)) continue;
        // While these two warps enter what was done, nobody can get past the next edit, which takes the other place.
        if (warp() == 0) enter_parts(params, job.cuts, number, effect.changed);
        if (warp() == 1) enter_counts(params, number, tool.operation, effect.counts);
        turn++;
    }
    // Whoever entered an edit since then did not change the brick.
    if (turn == 0) {
        if (threadIdx.x == 0) params.results[blockIdx.x] = {0, 0, NONE, NONE, 0, 0, 0};
        return;
    }
    sum_up(bench, column, base, job.base, changed, has_materials);
    __syncthreads();
    if (threadIdx.x == 0) reserve(params, bench);
    __syncthreads();
    store(params, bench, &params.bricks[job.target]);
}

// ---------------------------------------------------------------------------------------------------------------------
// mesh
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
// ---------------------------------------------------------------------------------------------------------------------

static const i32 LEVELS = 27;
// Warps that have a corner.
static const i32 CORNER_WARPS = 3;
// Most edges that cross a surface: 8 x 9 x 9 along each axis. Most triangles: five in each cube.
static const i32 MOST_VERTICES = 3 * 8 * 9 * 9;
static const i32 MOST_TRIANGLES = 5 * LEN;
// A thread's own cells: four in a row.
static const u32 CELLS_EACH = LEN / THREADS;

// Samples with their editedness in one number: twice the density, and one more if it is edited.
typedef i32 Marked;

struct MeshBench {
    // Bricks around, by (y * 3 + z) * 3 + x.
    u32 refs[27];
    i32 heights[AREA];
    // Each step of the plan has its own use for this.
    union alignas(8) {
        // Rows of solid samples, then of edited ones, of the eight bricks that hold corners.
        u8 rows[8][2][SIDE * SIDE];
        Marked apron[WINDOW * AREA];
        // cell | number in its cube << 9
        u16 triangles[MOST_TRIANGLES];
    };
    // Where each warp puts its output in order.
    union {
        float normals[THREADS / 32][96];
        u16 indices[THREADS / 32][96];
    };
    // By corner, with one column of nothing before and after, so that every corner has neighbours.
    u16 solid[CORNERS + 20], drawn[CORNERS + 20];
    // Places of the edges, in order of their vertices.
    u16 edges[MOST_VERTICES];
    // Of each level the edges of 32 corners, and how many come before them.
    u32 crossed[CORNER_WARPS][LEVELS];
    u16 first[CORNER_WARPS][LEVELS];
    u32 warp_triangles[THREADS / 32];
    // Layers that have a cube to draw.
    u32 layers;
    u32 vertex, vertices, index, triangles_in_all;
};

// From where the corner (0, 0) is in `solid` and `drawn`.
static const i32 MARGIN = 10;

// A brick and what its stack has.
struct Site {
    const MeshParams& params;
    const MeshJob& job;
    const ColumnJob& column;
    const Stack& stack;
    // Lowest sample.
    i32 low[3];
};

// The brick so far away, each -1, 0 or 1, as an index of `refs`.
__device__ inline i32 around(i32 dx, i32 dy, i32 dz) { return (dy * 3 + dz) * 3 + dx + 13; }

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
    u32 vertex = atomicAdd(&params.counters[0], vertices), index = atomicAdd(&params.counters[1], triangles * 3);
    bool is_room = fits(vertex, vertices, params.vertex_capacity) && fits(index, triangles * 3, params.index_capacity);
    bench.vertex = is_room ? vertex : NONE;
    bench.vertices = vertices;
    bench.index = index;
    bench.triangles_in_all = triangles;
    params.results[blockIdx.x] = {bench.vertex, vertices, is_room ? index : 0, triangles * 3};
}

// Where the surface crosses an edge between two densities, one of them negative: linear, to the nearest step of 1/4096,
// halves up, and not at the ends.
__device__ inline i32 linear_steps(i32 p, i32 q) {
    // Next to 1.5 * 2^52, floats are the integers. A quotient that is no half is 2^-26 away from one at least, so the bias
    // decides halves and nothing else.
    const double SHIFT = 6755399441055744.0, BIAS = 1.0 / (1 << 28);
    i32 from = p < 0 ? -p : p, sum = from + (q < 0 ? -q : q);
    double share = (double)SNAP * (double)from / (double)sum;
    i32 steps = __double2loint(share + BIAS + SHIFT);
    return smallest(largest(steps, 1), SNAP - 1);
}

// The vector of length 1; up where there is none. Products of its components are added in this order.
__device__ inline Vector unit(Vector v) {
    float length = sqrtf(v.x * v.x + v.y * v.y + v.z * v.z);
    return length > 0.0f ? Vector{v.x / length, v.y / length, v.z / length} : Vector{0.0f, 1.0f, 0.0f};
}

// A lattice edge with a vertex.
struct Edge {
    i32 axis;
    // Its lower end, from the brick's lowest sample.
    i32 x, y, z;
    // The lower end's column in the window of columns, and how far the other end's is.
    i32 window, next_window;
};

__device__ inline Edge edge_at(u32 place) {
    i32 level = place / CORNERS, corner = place % CORNERS, axis = level / 9;
    i32 x = corner % 9, z = corner / 9;
    return {axis, x, level % 9, z, (z + 1) * WINDOW + x + 1, axis == 0 ? 1 : axis == 1 ? 0 : WINDOW};
}

// What its samples say of an edge's crossing.
struct Crossing {
    // Steps of 1/4096 voxel from the lower end.
    i32 step;
    bool is_lower_solid;
    // Is no end edited; no sample that the gradients at both ends look at?
    bool is_pristine, is_stencil_pristine;
    // The gradient there, towards the air.
    Vector gradient;
};

__device__ inline Crossing crossing_on(const Marked* apron, const Edge& edge) {
    const i32 STRIDES[3] = {1, AREA, WINDOW};
    const Marked* p = apron + (edge.y + 1) * AREA + edge.window;
    const Marked* q = p + (edge.axis == 0 ? 1 : edge.axis == 1 ? AREA : WINDOW);
    Crossing crossing;
    crossing.is_lower_solid = *p < 0;
    crossing.is_pristine = !((*p | *q) & 1);
    // A pristine vertical edge is crossed at the height itself, its upper end included.
    bool is_exact = edge.axis == 1 && crossing.is_pristine;
    crossing.step = is_exact ? -(*p >> 1) * (SNAP / ONE) : linear_steps(*p >> 1, *q >> 1);

    float t = (float)crossing.step / (float)SNAP, components[3];
    Marked stencil = *p | *q;
#pragma unroll
    for (i32 i = 0; i < 3; i++) {
        Marked p0 = p[-STRIDES[i]], p1 = p[STRIDES[i]], q0 = q[-STRIDES[i]], q1 = q[STRIDES[i]];
        stencil |= p0 | p1 | q0 | q1;
        components[i] = lerp((float)((p1 >> 1) - (p0 >> 1)), (float)((q1 >> 1) - (q0 >> 1)), t);
    }
    crossing.is_stencil_pristine = !(stencil & 1);
    crossing.gradient = {components[0], components[1], components[2]};
    return crossing;
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
    float length = sqrtf(x * x + z * z + 1.0f);
    return {-x / length, 1.0f / length, -z / length};
}

// The tile's normal on an edge.
__device__ inline Vector sheet_normal(const Site& site, const i32* heights, const Edge& edge, i32 step) {
    Vector a = ground_normal(site, heights, edge.window);
    if (edge.axis == 1) return a;
    Vector b = ground_normal(site, heights, edge.window + edge.next_window);
    float t = (float)step / (float)SNAP;
    return unit({lerp(a.x, b.x, t), lerp(a.y, b.y, t), lerp(a.z, b.z, t)});
}

// ---- Materials: surface/mesh.rs ----

// Four ids, and their weights.
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

// Materials of both mixes, at most two of each, with their weights.
struct Shares {
    u32 ids[4];
    i32 weights[4];
    i32 count;
};

__device__ inline void add_share(Shares& shares, u32 id, i32 weight) {
    for (i32 i = 0; i < 4; i++) {
        if (i < shares.count && shares.ids[i] == id) {
            shares.weights[i] += weight;
            return;
        }
    }
    for (i32 i = 0; i < 4; i++) {
        if (i == shares.count) {
            shares.ids[i] = id;
            shares.weights[i] = weight;
        }
    }
    shares.count++;
}

// Sorts by weight, the largest first, then by id. Indices are constant once unrolled, so all stays in registers.
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

// The mix at `step` from `a` to `b`, in integers, of mixes of at most two materials.
__device__ inline Mix lerp_mix(Mix a, Mix b, i32 step) {
    if (a.ids == b.ids && a.weights == b.weights) return a;
    Shares shares = {{0, 0, 0, 0}, {0, 0, 0, 0}, 0};
    for (i32 i = 0; i < 2; i++) {
        u32 weight = a.weights >> (i * 8) & 0xff;
        if (weight) add_share(shares, a.ids >> (i * 8) & 0xff, weight * (SNAP - step));
    }
    for (i32 i = 0; i < 2; i++) {
        u32 weight = b.weights >> (i * 8) & 0xff;
        if (weight) add_share(shares, b.ids >> (i * 8) & 0xff, weight * step);
    }
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

// Materials where the ground shows its own, those of both columns blended as the tile does: the overlay within its depth
// below the pristine surface, the base below.
__device__ inline Mix own_mix(const Site& site, const i32* heights, const Edge& edge, i32 step) {
    i32 y = site.low[1] + edge.y, other = edge.window + edge.next_window;
    i32 upper = edge.axis == 1 ? y + 1 : y;
    i32 depth = between(heights[edge.window], heights[other], step) - between(y * ONE, upper * ONE, step);
    u32 a = site.stack.columns[edge.window], b = site.stack.columns[other];
    if (depth > OVERLAY_DEPTH) return lerp_mix(pure(a & 0xff), pure(b & 0xff), step);
    return lerp_mix(column_mix(a), column_mix(b), step);
}

// The material stored at an edge's solid end.
__device__ inline u32 stored_material(const Site& site, const u32* refs, const Edge& edge, bool is_lower) {
    i32 x = edge.x + (edge.axis == 0 && !is_lower);
    i32 y = edge.y + (edge.axis == 1 && !is_lower);
    i32 z = edge.z + (edge.axis == 2 && !is_lower);
    u32 ref = refs[around(x / SIDE, y / SIDE, z / SIDE)];
    if (ref == NONE || !(ref & 1)) return GROUND;
    return site.params.bricks[ref >> 1].materials[y % SIDE * 64 + z % SIDE * SIDE + x % SIDE];
}

__device__ inline Mix mix_at(const Site& site, const MeshBench& bench, const Edge& edge, const Crossing& crossing) {
    u32 stored = stored_material(site, bench.refs, edge, crossing.is_lower_solid);
    if (stored != GROUND) return pure(stored);
    if (site.params.is_single) return {site.params.single_ids, site.params.single_weights};
    return own_mix(site, bench.heights, edge, crossing.step);
}

// ---- The vertex function: surface/vertex.rs, surface/crossings.rs ----

__device__ inline ushort4 position_of(const Edge& edge, i32 step) {
    i32 x = edge.x * SNAP + (edge.axis == 0 ? step : 0);
    i32 y = edge.y * SNAP + (edge.axis == 1 ? step : 0);
    i32 z = edge.z * SNAP + (edge.axis == 2 ? step : 0);
    return {(u16)x, (u16)y, (u16)z, 0};
}

__device__ inline Vector normal_of(const Site& site, const MeshBench& bench, const Edge& edge, const Crossing& crossing) {
    bool is_sheet = crossing.is_pristine && (crossing.is_stencil_pristine || is_border(site.column, edge));
    return is_sheet ? sheet_normal(site, bench.heights, edge, crossing.step) : unit(crossing.gradient);
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
    Site site = {params, job, column, params.stacks[column.stack], {column.x * SIDE, job.y * SIDE, column.z * SIDE}};
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
