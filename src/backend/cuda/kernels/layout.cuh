// Data structures that the host and the kernels exchange, and constants of the lattice. layout/ is the Rust
// counterpart.
#pragma once

typedef unsigned char u8;
typedef short i16;
typedef unsigned short u16;
typedef int i32;
typedef unsigned int u32;
typedef long long i64;
typedef unsigned long long u64;

constexpr i32 THREADS = 128;
constexpr u32 WARP = 0xffffffff;

// Samples of a brick, and along one of its sides.
constexpr i32 LEN = 512;
constexpr i32 SIDE = 8;
// Columns along a side of the window around a stack of bricks: one before the stack, its eight, two after. Padded
// samples have the same side.
constexpr i32 WINDOW = 11;
constexpr i32 AREA = WINDOW * WINDOW;
// Corners of 8x8 cells.
constexpr i32 CORNERS = 81;

// Units: one voxel in 1/256 voxel, and in 1/4096 voxel.
constexpr i32 ONE = 256;
constexpr i32 SNAP = 4096;
// Samples change up to BAND outside a shape. Edits clamp densities at DEPTH inside it.
constexpr i32 BAND = 2 * ONE;
constexpr i32 DEPTH = 4 * ONE;
constexpr i32 OVERLAY_DEPTH = ONE + ONE / 2;

// The value of an unedited sample, and of a material that was never changed.
constexpr i32 PRISTINE = -32768;
constexpr u32 GROUND = 255;

// No brick, or no entry.
constexpr u32 NONE = 0xffffffff;

// Sample (x, y, z) has index x + 8 z + 64 y. In the bit arrays, layer y is one 64-bit word, here as two halves.
struct alignas(16) Brick {
    i16 samples[LEN];
    u32 solid[16];
    u32 edited[16];
    u8 materials[LEN];
};

// The columns around a stack of bricks, starting one before its first; x varies fastest.
struct alignas(16) Stack {
    i32 heights[AREA];
    // base | overlay << 8 | blend << 16; with strata base | skin << 8 | conditions << 16
    u32 columns[AREA];
    u32 pad[2];
};

enum Body { FILL, BED, VEIN, POCKET };

// A stratum. Lengths are in 1/256 voxel; ends of ranges are excluded.
struct StratumRecord {
    u32 material, body;
    // The bit of its condition in a column's word; 0 without one.
    u32 condition, seed;
    // Width of the body's noise in voxels, as a power of two.
    u32 scale;
    // Veins: how far both noises may be from 0. Pockets: what the noise must exceed.
    i32 limit;
    // By how much noise moves ends, and its width in voxels as a power of two.
    i32 rough;
    u32 rough_scale;
    i32 depth[2], height[2];
    // Beds: lower face, thickness, distance from one to the next or 0.
    i32 bed[3];
    // The lowest y, and the first beyond.
    i32 ys[2];
};

struct Bedding {
    // In 1/65536 voxel per voxel; in 1/256 voxel.
    i32 dip[2], fold;
    u32 scale, seed;
};

constexpr i32 MOST_STRATA = 32;

struct StrataTable {
    Bedding bedding;
    // The last columns of the world along x and z.
    i32 last[2];
    u32 count;
    StratumRecord strata[MOST_STRATA];
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
    // Stencil edits only: the brick's entry in `windows`, and the strides to its neighbours, x | z << 16. The
    // stride along y is 1.
    u32 window, strides;
    // Fills and carves only: the number of the brick's `SurfaceJob`, or `NONE`.
    u32 surface;
};

enum Operation { DIG, ADD, PAINT };

struct EditRecord {
    u32 kind, operation, material, is_rough;
    // The shape's origin: whole voxels, and the remainder in 1/256 voxel.
    i32 origin_voxel[3], origin_fraction[3];
    // Inclusive bounds of the lattice points within the shape's reach.
    i32 min[3], max[3];
    float constants[12];
    i32 amplitude, scale;
    u32 seed;
    // The point that noise is tied to, in 1/256 voxel.
    i32 noise_origin[3];
    // Distance outside the rough shape up to which samples may change.
    i32 band;
    // Grids: the shape's index in `grids`.
    u32 grid;
};

// A shape that is given by distances on a grid.
struct GridRecord {
    // Rows of the rotation's matrix, and their divisor.
    i64 rows[3][3], squared;
    // Spacing of the samples in 1/256 voxel.
    i64 scale;
    // Number of samples along each side.
    u32 size[3];
    // Index of the first sample of its image in `images`. After a first row, the image has the distances: x varies
    // fastest, then y, then z. Materials may follow, two in a sample.
    u32 image;
    u32 has_materials, pad;
};

// What a distance of 0 is stored as in the image of a grid.
constexpr i32 GRID_ZERO = 0x8000;

// How an edit changes samples, apart from digging, adding and painting (PLAIN). UNION and SUBTRACTION have rounded
// edges: they are fills and carves.
enum Stroke { PLAIN, SMOOTH, SHARPEN, FLATTEN, LEVEL, SHIFT, STAMP, TERRACE, UNION, SUBTRACTION };

// What a stencil edit needs in addition to its EditRecord.
struct SculptParams {
    // `material` is the material of new ground, or `NONE` to take it from a union's grid or from the surroundings.
    u32 operation, material;
    // Strength in 1/256, falloff in 1/256 voxel.
    i32 strength, falloff;
    // Level: the height. Shift: the amount added to densities. Terrace: step and base. Union, subtraction: the radius.
    i32 amounts[2];
    // Flatten: a point on the plane. Stamp: the centre of the image.
    i32 point[3];
    // Stamp: half extents, and the height of white.
    i32 half[2], height;
    // Stamp: index of the first sample of its image in `images`, and the image's size.
    u32 image, columns, rows;
    // The hardness that it can remove; negative if no rule applies.
    i32 power;
    // Stamp: a rotation, and its divisor. Flatten: the first row is the normal.
    i64 matrix[3][3], squared;
    // Flatten: length of the normal.
    double length;
};

enum ResultFlags { CHANGED = 1, EXTENDED = 2, UNIFORM = 4, HAS_MATERIALS = 8, TOO_FAR = 16 };

struct EditResult {
    u64 hash;
    u32 flags, record, material, bounds, uniform, pad;
};

struct EditPart {
    u32 job, edit, part, bounds;
};

struct EditCount {
    u32 edit, outcome, voxels, pad;
};

struct EditParams {
    Brick* bricks;
    const Stack* stacks;
    const EditJob* jobs;
    const u32* list;
    const EditRecord* edit_records;
    EditResult* results;
    // Entries of 72 and of 32 `uint4`.
    uint4* records;
    uint4* materials;
    EditPart* parts;
    EditCount* counts;
    // Numbers of records, materials, parts, counts.
    u32* counters;
    u32 record_capacity, material_capacity, part_capacity, count_capacity;
    // Null without strata.
    const StrataTable* strata;
    const GridRecord* grids;
    // Samples of images, of stamps and of grids.
    const u16* images;
};

// Rules that forbid or slow down edits.
struct Rules {
    // By material.
    u8 hardness[256];
    // One bit per material that no edit may remove or paint over.
    u32 unbreakable[8];
    // Nothing solid below this height is removed.
    i32 bedrock;
    u32 boxes;
};

// Inclusive bounds of samples that no edit changes.
struct Protected {
    i32 min[3], max[3];
};

struct StencilEditParams {
    EditParams edit;
    const u32* windows;
    // One per edit record.
    const SculptParams* sculpt_params;
    // Distances to the surface, in the format of `SurfaceStartParams`.
    const i16* surface;
    // Null if there are no rules. Protected boxes follow directly.
    const Rules* rules;
    // How many bricks the windows extend up and down.
    i32 look;
    // The last columns of the world along x and z.
    i32 last[2];
    u32 pad;
};

// A brick whose samples' distances to the surface of the ground are computed.
struct SurfaceJob {
    i32 brick[3];
    // As in `EditJob`.
    u32 stack, window, strides;
    // The jobs of the 27 bricks around, x fastest, then z, then y; `NONE` where there is none.
    u32 around[27];
    u32 pad;
};

// The first step: distances of the samples next to the surface.
struct SurfaceStartParams {
    const Brick* bricks;
    const Stack* stacks;
    const u32* windows;
    const SurfaceJob* jobs;
    // LEN per job, in 1/256 voxel. Those of solid samples are inverted bit by bit.
    i16* distances;
    // The greatest distance.
    i32 horizon;
    // The last columns of the world along x and z.
    i32 last[2];
    u32 pad;
};

// A further step: distances spread within each brick, and into it from the bricks around.
struct SurfaceSpreadParams {
    const SurfaceJob* jobs;
    // Distances before and after the step.
    const i16* from;
    i16* to;
};

struct alignas(16) ColumnJob {
    u32 stack;
    i32 x, z;
    u32 pad;
    u64 mask, pad2;
    u32 borders[3][4];
};

struct alignas(8) MeshJob {
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
    // Null if mixes are not needed.
    uint2* mixes;
    u16* indices;
    // Numbers of vertices and indices.
    u32* counters;
    u32 vertex_capacity, index_capacity;
    // Size of the world in cells.
    i32 width, depth;
    u32 is_single, single_ids, single_weights, pad;
    // Null without strata.
    const StrataTable* strata;
};

struct HeightsParams {
    // 256 numbers of 8 bits per octave.
    const u32* tables;
    i32* heights;
    double scale, origin[2], frequency, lacunarity, persistence, weighting, factor, peak, amplitude, base;
    // Columns of the world, x fastest: the first one, their number, and the length of a row.
    u32 first, count, row_len;
    u32 octaves, is_ridged, pad;
};

static_assert(sizeof(Brick) == 1664 && sizeof(Stack) == 976 && sizeof(ScatterJob) == 24, "see layout/");
static_assert(sizeof(EditJob) == 48 && sizeof(EditRecord) == 144 && sizeof(EditResult) == 32, "see layout/");
static_assert(sizeof(SculptParams) == 152 && sizeof(StencilEditParams) == 176, "see layout/");
static_assert(sizeof(GridRecord) == 112 && sizeof(SurfaceJob) == 136, "see layout/");
static_assert(sizeof(SurfaceStartParams) == 56 && sizeof(SurfaceSpreadParams) == 24, "see layout/");
static_assert(sizeof(Rules) == 296 && sizeof(Protected) == 24, "see layout/");
static_assert(sizeof(EditPart) == 16 && sizeof(EditCount) == 16, "see layout/");
static_assert(sizeof(ColumnJob) == 80 && sizeof(MeshJob) == 24 && sizeof(MeshResult) == 16, "see layout/");
static_assert(sizeof(EditParams) == 128 && sizeof(MeshParams) == 136, "see layout/");
static_assert(sizeof(StratumRecord) == 68 && sizeof(StrataTable) == 2208, "see layout/");
static_assert(sizeof(HeightsParams) == 128, "see layout/");
