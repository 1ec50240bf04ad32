// The ground as a map: contour lines, shaded relief from the north-west, dug ground warm and built ground blue.

#import bevy_burrow::position::position_of
#import bevy_pbr::mesh_functions

struct Map {
    shallow: vec4<f32>,
    deep: vec4<f32>,
    step: f32,
}

@group(#{MATERIAL_BIND_GROUP}) @binding(0) var<uniform> map: Map;

struct Vertex {
    @builtin(instance_index) instance_index: u32,
    @location(0) position: vec3<f32>,
    @location(1) normal: vec3<f32>,
    @location(2) color: vec4<f32>,
    // Voxels below the surface that was there before anyone dug.
    @location(3) depth: f32,
}

struct Varying {
    // Invariant, so that it has the same bits in the prepass: else a camera with a `DepthPrepass` may see holes.
    @invariant @builtin(position) position: vec4<f32>,
    @location(0) place: vec3<f32>,
    @location(1) normal: vec3<f32>,
    @location(2) color: vec3<f32>,
    @location(3) depth: f32,
}

@vertex
fn vertex(in: Vertex) -> Varying {
    let position = position_of(in.position, in.instance_index);
    var out: Varying;
    out.position = position.clip;
    out.place = position.world.xyz;
    out.normal = mesh_functions::mesh_normal_local_to_world(in.normal, in.instance_index);
    out.color = in.color.rgb;
    out.depth = in.depth;
    return out;
}

// 1 on a line at each multiple of `step`, 0 elsewhere; `width` in pixels.
fn line(height: f32, step: f32, width: f32) -> f32 {
    let at = height / step;
    let off = abs(fract(at - 0.5) - 0.5) / max(fwidth(at), 0.0001);
    return 1.0 - smoothstep(width - 0.5, width + 0.5, off);
}

@fragment
fn fragment(in: Varying) -> @location(0) vec4<f32> {
    // From the north-west, as on every map.
    let light = dot(normalize(in.normal), normalize(vec3(-0.6, 0.8, -0.5)));
    let dug = smoothstep(0.3, 1.0, in.depth);
    let warm = mix(map.shallow.rgb, map.deep.rgb, saturate(in.depth / 16.0));
    // Built ground has a blue tint.
    let built = smoothstep(0.3, 1.0, -in.depth);
    var color = mix(mix(in.color, warm, dug), vec3(0.35, 0.55, 0.75), 0.7 * built);
    color *= 0.35 + 0.75 * max(light, 0.0);
    let ink = max(0.35 * line(in.place.y, map.step, 0.6), 0.75 * line(in.place.y, 5.0 * map.step, 1.1));
    return vec4(mix(color, vec3(0.16, 0.10, 0.06), ink), 1.0);
}
