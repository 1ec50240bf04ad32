// The vertex stage of plants in all passes. A mesh holds copies of one plant; each copy takes the plant of its slot.

#import bevy_pbr::{
    mesh_functions,
    mesh_view_bindings::view,
    view_transformations::position_world_to_clip,
}
#ifdef PREPASS_PIPELINE
#import bevy_pbr::prepass_io::Vertex
#import bevy_render::globals::Globals
@group(0) @binding(1) var<uniform> globals: Globals;
#else
#import bevy_pbr::{forward_io::Vertex, mesh_view_bindings::globals}
#endif

struct PlantUniform {
    begin: f32,
    end: f32,
    fade: f32,
    sway: f32,
    tint: f32,
    slope: f32,
    voxels: f32,
}

@group(#{MATERIAL_BIND_GROUP}) @binding(100) var<uniform> plants: PlantUniform;
// x: place along x and z in 1/256 voxel; y: height in voxels; z: turn and size; w: rise along x and z, and a random number.
@group(#{MATERIAL_BIND_GROUP}) @binding(101) var<storage, read> records: array<vec4<u32>>;
// A bit for each slot whose plant does not stand.
@group(#{MATERIAL_BIND_GROUP}) @binding(102) var<storage, read> gone: array<u32>;

struct Varying {
    // Prepasses and main pass must agree on every bit of the depth.
    @invariant @builtin(position) position: vec4<f32>,
#ifdef PREPASS_PIPELINE
#ifdef VERTEX_UVS_A
    @location(0) uv: vec2<f32>,
#endif
#ifdef VERTEX_UVS_B
    @location(1) uv_b: vec2<f32>,
#endif
#ifdef NORMAL_PREPASS_OR_DEFERRED_PREPASS
    @location(2) world_normal: vec3<f32>,
#endif
    @location(4) world_position: vec4<f32>,
#ifdef MOTION_VECTOR_PREPASS
    @location(5) previous_world_position: vec4<f32>,
#endif
#ifdef UNCLIPPED_DEPTH_ORTHO_EMULATION
    @location(6) unclipped_depth: f32,
#endif
#ifdef VERTEX_OUTPUT_INSTANCE_INDEX
    @location(7) instance_index: u32,
#endif
#ifdef VERTEX_COLORS
    @location(8) color: vec4<f32>,
#endif
#ifdef VISIBILITY_RANGE_DITHER
    @location(9) @interpolate(flat) visibility_range_dither: i32,
#endif
#else
    @location(0) world_position: vec4<f32>,
    @location(1) world_normal: vec3<f32>,
#ifdef VERTEX_UVS_A
    @location(2) uv: vec2<f32>,
#endif
#ifdef VERTEX_UVS_B
    @location(3) uv_b: vec2<f32>,
#endif
#ifdef VERTEX_COLORS
    @location(5) color: vec4<f32>,
#endif
#ifdef VERTEX_OUTPUT_INSTANCE_INDEX
    @location(6) @interpolate(flat) instance_index: u32,
#endif
#ifdef VISIBILITY_RANGE_DITHER
    @location(7) @interpolate(flat) visibility_range_dither: i32,
#endif
#endif
}

// A copy of the mesh in its place, relative to the patch.
struct Placed {
    position: vec3<f32>,
    // Cosine and sine of its turn.
    turn: vec2<f32>,
    // What its colour is multiplied by.
    tint: vec3<f32>,
    is_drawn: bool,
}

fn turned(turn: vec2<f32>, v: vec3<f32>) -> vec3<f32> {
    return vec3(turn.x * v.x + turn.y * v.z, v.y, turn.x * v.z - turn.y * v.x);
}

fn signed_byte(word: u32, at: u32) -> f32 {
    return f32(extractBits(i32(word), at, 8u)) / 32.0;
}

fn place(local: vec3<f32>, slot: u32, world_from_local: mat4x4<f32>) -> Placed {
    var out: Placed;
    let record = records[slot];
    let root = vec3(f32(record.x & 0xffffu) / 256.0, bitcast<f32>(record.y), f32(record.x >> 16u) / 256.0);
    let angle = f32(record.z & 0xffffu) * (6.2831853 / 65536.0);
    let random = f32(record.w >> 16u) / 65536.0;
    out.turn = vec2(cos(angle), sin(angle));
    // Brighter or darker, and more yellow or more blue.
    let hue = fract(16.0 * random) - 0.5;
    out.tint = (1.0 + plants.tint * (random - 0.5)) * (1.0 + plants.tint * hue * vec3(0.8, 0.0, -0.8));
    let root_world = (world_from_local * vec4(root, 1.0)).xyz;
    let distance = distance(root_world, view.lod_view_world_position);
    // Not all at the same distance, so that no line moves over the ground.
    let spread = 1.0 - 0.15 * random;
    let begin = plants.begin * spread;
    let end = plants.end * spread;
    let is_gone = (gone[slot >> 5u] >> (slot & 31u) & 1u) == 1u;
    out.is_drawn = !is_gone && distance >= begin && distance < end;
    let rest = select(1.0, saturate((end - distance) / max(plants.fade * end, 0.001)), plants.fade > 0.0);
    var p = turned(out.turn, local) * (f32(record.z >> 16u) / 256.0 * rest);
    // The wind bends what is high, in gusts that cross the ground.
    let gust = sin(globals.time * 1.7 + root_world.x * 0.13 + root_world.z * 0.09)
        + 0.4 * sin(globals.time * 4.3 + root_world.x * 0.7 + random * 6.28);
    let bend = plants.sway * gust * max(p.y, 0.0) * min(p.y, 4.0);
    p += vec3(bend, 0.0, 0.6 * bend);
    let rise = vec2(signed_byte(record.w, 0u), signed_byte(record.w, 8u));
    p.y += plants.slope * dot(rise, p.xz);
    out.position = root + p * plants.voxels;
    return out;
}

@vertex
fn vertex(in: Vertex) -> Varying {
    var out: Varying;
    let world_from_local = mesh_functions::get_world_from_local(in.instance_index);
#ifdef VERTEX_UVS_B
    let slot = mesh_functions::get_tag(in.instance_index) + u32(in.uv_b.x + 0.5);
#else
    let slot = mesh_functions::get_tag(in.instance_index);
#endif
    let placed = place(in.position, slot, world_from_local);
    let world = world_from_local * vec4(placed.position, 1.0);
    out.world_position = world;
    // Plants that are not drawn have triangles without area, outside the picture.
    out.position = select(vec4(2.0, 2.0, 2.0, 1.0), position_world_to_clip(world.xyz), placed.is_drawn);
#ifdef PREPASS_PIPELINE
#ifdef UNCLIPPED_DEPTH_ORTHO_EMULATION
    out.unclipped_depth = out.position.z;
    out.position.z = min(out.position.z, 1.0);
#endif
#ifdef MOTION_VECTOR_PREPASS
    out.previous_world_position = world;
#endif
#ifdef NORMAL_PREPASS_OR_DEFERRED_PREPASS
#ifdef VERTEX_NORMALS
    out.world_normal =
        mesh_functions::mesh_normal_local_to_world(turned(placed.turn, in.normal), in.instance_index);
#endif
#endif
#else
#ifdef VERTEX_NORMALS
    out.world_normal =
        mesh_functions::mesh_normal_local_to_world(turned(placed.turn, in.normal), in.instance_index);
#endif
#endif
#ifdef VERTEX_UVS_A
    out.uv = in.uv;
#endif
#ifdef VERTEX_UVS_B
    out.uv_b = in.uv_b;
#endif
#ifdef VERTEX_COLORS
    out.color = vec4(in.color.rgb * placed.tint, in.color.a);
#endif
#ifdef VERTEX_OUTPUT_INSTANCE_INDEX
    out.instance_index = in.instance_index;
#endif
#ifdef VISIBILITY_RANGE_DITHER
    out.visibility_range_dither =
        mesh_functions::get_visibility_range_dither_level(in.instance_index, world_from_local[3]);
#endif
    return out;
}
