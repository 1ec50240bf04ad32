// Where a vertex is drawn, for every pass.
//
// A depth prepass writes the depth of each pixel, and the main pass keeps only what has exactly that depth. So both have to
// compute the same bits. Compilers promise that for equal expressions whose result is `@invariant`, and for nothing else:
// take the position from `position_of` in every vertex shader, and declare it `@invariant @builtin(position)`.

#define_import_path bevy_burrow::position

#import bevy_pbr::{mesh_functions, view_transformations::position_world_to_clip}

struct Position {
    world: vec4<f32>,
    clip: vec4<f32>,
}

// The position of a vertex of a mesh that is neither skinned nor morphed, from its position in the mesh.
fn position_of(local: vec3<f32>, instance_index: u32) -> Position {
    let world_from_local = mesh_functions::get_world_from_local(instance_index);
    var out: Position;
    out.world = mesh_functions::mesh_position_local_to_world(world_from_local, vec4(local, 1.0));
    out.clip = position_world_to_clip(out.world.xyz);
    return out;
}
