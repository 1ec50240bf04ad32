// Applies edits to one brick, like edits/brick_editor.rs. Stencil edits are in stencil_edit.cuh.
//
// From the first edit to the last, a thread owns four samples of one column, two layers apart. Before distances are
// computed, the kernel skips bricks too far from the shape, and samples that no distance could change: much of what
// brushes reach is air. Two warps write what an edit did: the changed samples as bits, and the voxels by material.
#pragma once

#include "shapes.cuh"
#include "strata.cuh"

// How many samples a thread owns, and the layers between them.
constexpr i32 OWN = LEN / THREADS;
constexpr i32 STEP = SIDE / OWN;

// What one edit did.
struct Effect {
    // Changed samples, in the format of a brick's bits.
    u32 changed[16];
    // Voxels removed, added or painted, depending on the operation, by material.
    u32 counts[256];
};

struct EditMemory {
    Brick brick;
    Effect effect;
    // Noise of the current edit, if it is rough.
    float noise[MOST_POINTS];
    // Samples that any edit changed.
    u32 changed[16];
    u64 hash;
    // `ResultFlags` and `NOT_UNIFORM`.
    u32 flags;
    // Entries reserved for the brick, and bounds of the changed samples, in the format of `EditResult`.
    u32 record, material, bounds;
};

constexpr u32 NOT_UNIFORM = 32;

// What a thread's samples have in common.
struct OwnColumn {
    // The brick's minimum corner.
    i32 low[3];
    i32 x, z;
    // Layer of its lowest sample within the brick.
    i32 first_y;
    i32 height;
    u32 materials;
    // Null without strata.
    const StrataTable* strata;
};

__device__ inline i32 own_index(i32 k) { return k * THREADS + threadIdx.x; }

__device__ inline i32 own_y(const OwnColumn& column, i32 k) { return column.first_y + k * STEP; }

__device__ inline i32 pristine_distance(const OwnColumn& column, i32 k) {
    return (column.low[1] + own_y(column, k)) * ONE - column.height;
}

// Collects one bit per sample; each warp writes the words of its own samples.
__device__ inline void store_bits(u32* words, i32 k, bool is_set) {
    u32 word = __ballot_sync(WARP, is_set);
    if (lane() == 0) words[k * 4 + warp()] = word;
}

// Bounds of the samples within a mask and a range of layers, packed as lo x|y<<3|z<<6 | hi x<<9|y<<12|z<<15; `NONE`
// if empty.
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

// The samples along one side that lie before the cut, or beyond it, as bits.
__device__ inline u32 side_bits(u32 cut, bool is_beyond) {
    u32 before = (1u << smallest(cut, SIDE)) - 1;
    return is_beyond ? 0xff & ~before : before;
}

// Bounds of the changed samples in one part of the brick.
__device__ inline u32 part_bounds(const u32* changed, u32 cuts, u32 part) {
    u64 rows = side_bits(cuts & 15, part & 1) * 0x0101010101010101ull;
    u32 z = side_bits(cuts >> 8 & 15, part & 4), y = side_bits(cuts >> 4 & 15, part & 2);
    if (y == 0 || z == 0) return NONE;
    u64 level = 0;
    for (i32 i = 0; i < SIDE; i++) level |= (u64)(z >> i & 1 ? 0xff : 0) << (i * 8);
    return bounds_of(changed, rows & level, __ffs(y) - 1, 32 - __clz(y));
}

// Writes what an edit changed in each part of the brick. Called by one warp.
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

// Writes how many voxels an edit affected, and clears the counts. Called by one warp.
__device__ void enter_counts(const EditParams& params, u32 edit, u32 outcome, u32* counts) {
    for (u32 base = 0; base < 256; base += 32) {
        u32 material = base + lane(), voxels = counts[material];
        u32 filled = __ballot_sync(WARP, voxels != 0);
        if (filled == 0) continue;
        u32 first = 0;
        if (lane() == 0) first = atomicAdd(&params.counters[3], __popc(filled));
        u32 at = __shfl_sync(WARP, first, 0) + __popc(filled & lanes_before());
        if (voxels != 0 && at < params.count_capacity) {
            params.counts[at] = {edit, outcome | material << 8, voxels, 0};
        }
        counts[material] = 0;
    }
}

// Counts a voxel of this material; `NONE` counts nothing. Lanes with the same material share one atomic.
__device__ inline void count_voxels(u32* counts, u32 material) {
    u32 rest = __ballot_sync(WARP, material != NONE);
    while (rest != 0) {
        i32 leader = __ffs(rest) - 1;
        u32 same = __ballot_sync(WARP, material == __shfl_sync(WARP, material, leader));
        if (lane() == leader) atomicAdd(&counts[material], __popc(same));
        rest &= ~same;
    }
}

// The result of an edit at one sample.
struct Outcome {
    bool is_changed;
    // The material of the voxel to count, or `NONE`.
    u32 counted;
};

// The material that a stored one stands for, `y` layers above the brick's minimum corner.
__device__ inline u32 resolve(u32 stored, const OwnColumn& column, i32 y) {
    if (stored != GROUND) return stored;
    Voxel voxel = {column.low[0] + column.x, column.low[1] + y, column.low[2] + column.z, column.height, column.materials};
    return ground_material(column.strata, voxel);
}

__device__ inline Outcome carve(
    const EditRecord& record, i32 outside, const OwnColumn& column, i32 k, i16& sample, u8& material
) {
    i32 raw = sample, before = raw == PRISTINE ? pristine_distance(column, k) : raw, y = own_y(column, k);
    i32 depth = largest(outside, -DEPTH);
    i32 after = record.operation == DIG ? largest(before, -depth) : smallest(before, depth);
    i32 stored = smallest(largest(after, -32767), 32767);
    if (outside > BAND || after == before || stored == raw) return {false, NONE};
    sample = (i16)stored;
    if ((before < 0) == (after < 0)) return {true, NONE};
    if (after >= 0) {
        u32 removed = resolve(material, column, y);
        // Air has no material.
        material = GROUND;
        return {true, removed};
    }
    if (record.operation == ADD) material = (u8)record.material;
    return {true, resolve(material, column, y)};
}

// Changes the material of a solid sample inside the shape.
__device__ inline Outcome paint(
    const EditRecord& record, i32 outside, const OwnColumn& column, i32 k, i16& sample, u8& material
) {
    i32 raw = sample, before = raw == PRISTINE ? pristine_distance(column, k) : raw, y = own_y(column, k);
    u32 old = material;
    if (outside > 0 || before >= 0 || (raw != PRISTINE && old == record.material)) return {false, NONE};
    if (raw == PRISTINE) sample = (i16)largest(before, -32767);
    material = (u8)record.material;
    u32 painted = resolve(record.material, column, y);
    return {true, painted == resolve(old, column, y) ? NONE : painted};
}

// Copies the thread's samples from the base brick; without one they are pristine.
__device__ inline void take(const Brick* base, bool has_materials, Brick& brick) {
    for (i32 k = 0; k < OWN; k++) {
        i32 index = own_index(k);
        brick.samples[index] = base ? base->samples[index] : (i16)PRISTINE;
        brick.materials[index] = has_materials ? base->materials[index] : (u8)GROUND;
    }
}

// Loads the brick into shared memory. Called by the whole block.
__device__ inline void begin(EditMemory& shared, const Brick* base, bool had_materials) {
    take(base, had_materials, shared.brick);
    for (i32 i = threadIdx.x; i < 256; i += THREADS) shared.effect.counts[i] = 0;
    if (threadIdx.x == 0) {
        shared.hash = 0;
        shared.flags = 0;
    }
}

// Whether an edit may change a sample of the brick.
__device__ inline bool may_change(const EditParams& params, const EditRecord& record, const i32* low) {
    bool is_reached = true;
    for (i32 axis = 0; axis < 3; axis++) {
        is_reached &= record.min[axis] <= low[axis] + SIDE - 1 && low[axis] <= record.max[axis];
    }
    return is_reached && !is_out_of_reach(params, record, low);
}

// Whether the operation leaves a sample with this density unchanged, whatever its distance from the shape.
__device__ inline bool is_settled(u32 operation, i32 density) {
    if (operation == DIG) return density >= DEPTH;
    return operation == ADD ? density <= -DEPTH : density >= 0;
}

// Which of the thread's samples an edit may change, one bit each: those within its reach. Unless the edit reads
// neighbours, settled samples are excluded.
__device__ inline u32 open_samples(const EditRecord& record, const OwnColumn& column, const Brick& brick, bool looks_around) {
    i32 x = column.low[0] + column.x, z = column.low[2] + column.z;
    if (x < record.min[0] || x > record.max[0] || z < record.min[2] || z > record.max[2]) return 0;
    u32 open = 0;
    for (i32 k = 0; k < OWN; k++) {
        i32 y = column.low[1] + own_y(column, k), raw = brick.samples[own_index(k)];
        i32 density = raw == PRISTINE ? pristine_distance(column, k) : raw;
        bool is_open = record.min[1] <= y && y <= record.max[1] && (looks_around || !is_settled(record.operation, density));
        open |= (u32)is_open << k;
    }
    return open;
}

// Applies one edit to the thread's open samples and returns which of them changed, one bit each. Sets
// `has_materials` if a material was stored.
__device__ inline u32 apply(
    const EditParams& params, const EditRecord& record, const OwnColumn& column, u32 open, const Noise& noise,
    EditMemory& shared, bool& has_materials
) {
    Brick& brick = shared.brick;
    Place along_x = place_of(noise, 0, column.x), along_z = place_of(noise, 2, column.z);
    u32 changed = 0;
    // Not unrolled: the code is long, and other warps hide the latency.
#pragma unroll 1
    for (i32 k = 0; k < OWN; k++) {
        i32 index = own_index(k), y = own_y(column, k);
        Place along_y = place_of(noise, 1, y);
        Outcome outcome = {false, NONE};
        if (open >> k & 1) {
            i32 offset[3] = {column.x, y, column.z};
            float distance = smooth_distance(params, record, from_origin(record, column.low, offset));
            if (record.is_rough) distance += bumps(record, noise, shared.noise, along_x, along_y, along_z);
            i32 outside = round_distance(distance);
            i16& sample = brick.samples[index];
            u8& material = brick.materials[index];
            outcome = record.operation == PAINT ? paint(record, outside, column, k, sample, material)
                                              : carve(record, outside, column, k, sample, material);
            has_materials |= material != GROUND;
        }
        changed |= (u32)outcome.is_changed << k;
        store_bits(shared.effect.changed, k, outcome.is_changed);
        count_voxels(shared.effect.counts, outcome.counted);
    }
    return changed;
}

// A sample's contribution to the world's hash; 0 if it is pristine.
__device__ inline u64 sample_hash(u64 place, i32 y, i16 sample, u8 material) {
    if (sample == PRISTINE) return 0;
    return mix(place ^ (u64)(u32)y << 32 ^ (u64)(u16)sample << 8 ^ material);
}

// How much the thread's changed samples add to the world's hash, compared with the base brick.
__device__ inline u64 hash_change(
    const OwnColumn& column, const Brick& now, const Brick* base, bool had_materials, u32 changed
) {
    u64 place = mix((u64)(u32)(column.low[0] + column.x) | (u64)(u32)(column.low[2] + column.z) << 32);
    u64 change = 0;
    // Not unrolled, here and in `sum_up`: fetching the longer code costs more than the loop.
#pragma unroll 1
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

// Derives the bits of the brick and of the changed samples, and combines hash and flags of all threads.
__device__ inline void sum_up(
    EditMemory& shared, const OwnColumn& column, const Brick* base, bool had_materials, bool has_materials,
    u32 changed
) {
    Brick& brick = shared.brick;
    bool is_uniform = true, is_extended = false;
#pragma unroll 1
    for (i32 k = 0; k < OWN; k++) {
        i32 index = own_index(k), sample = brick.samples[index];
        bool is_edited = sample != PRISTINE, is_changed = changed >> k & 1;
        store_bits(brick.solid, k, (is_edited ? sample : pristine_distance(column, k)) < 0);
        store_bits(brick.edited, k, is_edited);
        store_bits(shared.changed, k, is_changed);
        is_uniform &= is_edited && sample == brick.samples[0] && brick.materials[index] == brick.materials[0];
        is_extended |= is_changed && (base == nullptr || base->samples[index] == PRISTINE);
    }
    u64 hash = hash_change(column, brick, base, had_materials, changed);
    for (i32 step = 16; step > 0; step /= 2) hash += __shfl_down_sync(WARP, hash, step);

    u32 flags = __all_sync(WARP, is_uniform) ? 0 : NOT_UNIFORM;
    flags |= __any_sync(WARP, is_extended) ? EXTENDED : 0;
    flags |= __any_sync(WARP, has_materials) ? HAS_MATERIALS : 0;
    if (lane() == 0) {
        atomicAdd(&shared.hash, hash);
        atomicOr(&shared.flags, flags);
    }
}

__device__ inline bool is_uniform(const EditMemory& shared) { return !(shared.flags & NOT_UNIFORM); }

// Reserves output entries for the brick. Called by one thread.
__device__ inline void reserve(const EditParams& params, EditMemory& shared) {
    shared.record = shared.material = NONE;
    if (is_uniform(shared)) return;
    // One atomic for both counters.
    bool has_materials = shared.flags & HAS_MATERIALS;
    u64 first = atomicAdd((u64*)params.counters, 1 | (u64)has_materials << 32);
    u32 record = (u32)first, material = (u32)(first >> 32);
    if (record < params.record_capacity) shared.record = record;
    if (has_materials && material < params.material_capacity) shared.material = material;
}

__device__ inline EditResult result_of(const EditMemory& shared) {
    u32 flags = CHANGED | (shared.flags & (EXTENDED | HAS_MATERIALS | TOO_FAR)), uniform = 0;
    if (is_uniform(shared)) {
        flags |= UNIFORM;
        uniform = (u16)shared.brick.samples[0] | (u32)shared.brick.materials[0] << 16;
    }
    return {shared.hash, flags, shared.record, shared.material, shared.bounds, uniform, 0};
}

// Writes the brick to its slot and to its reserved output entries.
__device__ inline void store(const EditParams& params, const EditMemory& shared, Brick* target) {
    const u32 MATERIALS = LEN / sizeof(uint4), RECORD = sizeof(Brick) / sizeof(uint4) - MATERIALS;
    u32 piece = threadIdx.x;
    if (piece >= RECORD + MATERIALS) return;
    bool is_record = piece < RECORD;
    if (!is_record && !(shared.flags & HAS_MATERIALS)) return;
    uint4 data = ((const uint4*)&shared.brick)[piece];
    ((uint4*)target)[piece] = data;
    u64 entry = is_record ? shared.record : shared.material;
    if (entry == NONE) return;
    uint4* entries = is_record ? params.records + entry * RECORD : params.materials + entry * MATERIALS;
    entries[is_record ? piece : piece - RECORD] = data;
}

// For jobs without stencil edits.
struct PlainEditor {
    static constexpr bool LOOKS = false;
};

// Applies the edits of the block's job. `StencilEditor` also applies stencil edits.
template <typename Editor>
__device__ inline void edit_brick(const EditParams& params, EditMemory& shared, Editor& editor) {
    const EditJob job = params.jobs[blockIdx.x];
    const Brick* base = job.base == NONE ? nullptr : &params.bricks[job.base >> 1];
    const bool had_materials = base != nullptr && job.base & 1;

    const Stack& stack = params.stacks[job.stack];
    i32 x = threadIdx.x % SIDE, z = threadIdx.x / SIDE % SIDE, window = (z + 1) * WINDOW + x + 1;
    OwnColumn column = {
        {job.brick[0] * SIDE, job.brick[1] * SIDE, job.brick[2] * SIDE},
        x,
        z,
        (i32)threadIdx.x / (SIDE * SIDE),
        stack.heights[window],
        stack.columns[window],
        params.strata,
    };
    u32 changed = 0;
    bool has_materials = had_materials, is_taken = false, is_changed = false;
    for (u32 start = 0; start < job.count; start += 32) {
        // Each lane tests one edit. All warps test the same ones.
        u32 number = start + lane() < job.count ? params.list[job.first + start + lane()] : NONE;
        u32 reaching = __ballot_sync(WARP, number != NONE && may_change(params, params.edit_records[number], column.low));
        for (; reaching != 0; reaching &= reaching - 1) {
            u32 edit = __shfl_sync(WARP, number, __ffs(reaching) - 1);
            const EditRecord& record = params.edit_records[edit];
            if (!is_taken) begin(shared, base, had_materials);
            is_taken = true;
            bool looks_around = false;
            if constexpr (Editor::LOOKS) looks_around = editor.begin(job, stack, edit);
            u32 open = open_samples(record, column, shared.brick, looks_around);
            if (!__syncthreads_or(open != 0)) continue;
            Noise noise = {{0, 0.0f}, 0, 0};
            if (record.is_rough) {
                noise = hash_noise(record, column.low, shared.noise);
                __syncthreads();
            }
            if constexpr (Editor::LOOKS) {
                if (looks_around) {
                    u32 own = editor.apply(edit, column, open, noise, shared, has_materials);
                    changed |= own;
                    bool has_changed = __syncthreads_or(own != 0);
                    is_changed |= has_changed;
                    if (has_changed || editor.params.rules) editor.enter(job, edit);
                    continue;
                }
            }
            u32 own = apply(params, record, column, open, noise, shared, has_materials);
            changed |= own;
            if (!__syncthreads_or(own != 0)) continue;
            is_changed = true;
            // The next edit synchronises before it overwrites what these two warps read.
            if (warp() == 0) enter_parts(params, job.cuts, edit, shared.effect.changed);
            if (warp() == 1) enter_counts(params, edit, record.operation, shared.effect.counts);
        }
    }
    bool is_too_far = false;
    if constexpr (Editor::LOOKS) is_too_far = __syncthreads_or(editor.is_too_far);
    if (!is_changed) {
        u32 flags = is_too_far ? (u32)TOO_FAR : 0;
        if (threadIdx.x == 0) params.results[blockIdx.x] = {0, flags, NONE, NONE, 0, 0, 0};
        return;
    }
    sum_up(shared, column, base, had_materials, has_materials, changed);
    if (is_too_far && threadIdx.x == 0) atomicOr(&shared.flags, TOO_FAR);
    __syncthreads();
    if (threadIdx.x == 0) reserve(params, shared);
    if (warp() == 1 && lane() == 0) shared.bounds = bounds_of(shared.changed, ~0ull, 0, SIDE);
    __syncthreads();
    store(params, shared, &params.bricks[job.target]);
    if (threadIdx.x == THREADS - 1) params.results[blockIdx.x] = result_of(shared);
}

extern "C" __global__ void __launch_bounds__(THREADS) edit(EditParams params) {
    __shared__ EditMemory shared;
    PlainEditor none;
    edit_brick(params, shared, none);
}
