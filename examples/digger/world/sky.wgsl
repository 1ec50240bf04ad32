// The sky in each direction of view: haze, sun, moon, stars and clouds. `day.rs` computes the colours.

#import bevy_pbr::{
    forward_io::{Vertex, VertexOutput},
    mesh_view_bindings::view,
    view_transformations::position_world_to_clip,
}
#ifdef TONEMAP_IN_SHADER
#import bevy_core_pipeline::tonemapping::tone_mapping
#endif

struct Sky {
    sun: vec4<f32>,
    moon: vec4<f32>,
    zenith: vec4<f32>,
    horizon: vec4<f32>,
    glow: vec4<f32>,
    cloud_light: vec4<f32>,
    cloud_shade: vec4<f32>,
    // Brightness of the stars, drift of the clouds along x and z, and rotation of the stars.
    drift: vec4<f32>,
}

@group(#{MATERIAL_BIND_GROUP}) @binding(0) var<uniform> sky: Sky;
@group(#{MATERIAL_BIND_GROUP}) @binding(1) var noise: texture_2d<f32>;
@group(#{MATERIAL_BIND_GROUP}) @binding(2) var noise_sampler: sampler;

// The box is around the camera, and behind everything.
@vertex
fn vertex(vertex: Vertex) -> VertexOutput {
    var out: VertexOutput;
    let place = view.world_position + vertex.position * 10.0;
    out.world_position = vec4(place, 1.0);
    out.position = position_world_to_clip(place);
    out.position.z = 0.0;
    return out;
}

fn hash(cell: vec2<f32>) -> vec3<f32> {
    var p = fract(vec3(cell.xyx) * vec3(0.1031, 0.1030, 0.0973));
    p += dot(p, p.yxz + 33.33);
    return fract((p.xxy + p.yzz) * p.zyx);
}

// Some cells of a grid on the six sides of a cube have a star.
fn star(direction: vec3<f32>) -> f32 {
    let side = abs(direction);
    var at = direction.xy / side.z;
    if side.x > side.y && side.x > side.z { at = direction.yz / side.x + 7.0; }
    else if side.y > side.z { at = direction.xz / side.y + 19.0; }
    let grid = at * 46.0;
    let cell = floor(grid);
    let chance = hash(cell);
    let middle = 0.3 + 0.4 * chance.yz;
    let near = length(fract(grid) - middle);
    let size = 0.05 + 0.10 * chance.y;
    return step(0.86, chance.x) * smoothstep(size, 0.0, near) * (0.25 + chance.z * chance.z);
}

// How far two directions are apart in the picture, where a disc stays round however far it is from the middle.
fn apart(direction: vec3<f32>, body: vec3<f32>) -> vec2<f32> {
    let ahead = (view.view_from_world * vec4(direction, 0.0)).xyz;
    let there = (view.view_from_world * vec4(body, 0.0)).xyz;
    if ahead.z > -0.02 || there.z > -0.02 { return vec2(9.0); }
    return ahead.xy / -ahead.z - there.xy / -there.z;
}

fn clouds(at: vec2<f32>) -> f32 {
    let low = textureSampleLevel(noise, noise_sampler, at * 0.075, 0.0).r;
    let high = textureSampleLevel(noise, noise_sampler, at * 0.31 + 0.37, 0.0).r;
    return low * 0.72 + high * 0.28;
}

@fragment
fn fragment(in: VertexOutput) -> @location(0) vec4<f32> {
    let direction = normalize(in.world_position.xyz - view.world_position);
    let up = max(direction.y, 0.0);
    let sun = max(dot(direction, sky.sun.xyz), 0.0);
    let near_horizon = exp(-5.0 * up);
    let level = normalize(direction.xz + vec2(0.0001, 0.0));
    // Rounding may make this slightly negative, and `pow` of a negative number is undefined.
    let sunward = max(0.5 + 0.5 * dot(level, normalize(sky.sun.xz + vec2(0.0001, 0.0))), 0.0);
    let spread = 0.10 * pow(sun, 6.0) + 0.30 * pow(sun, 60.0) + sky.glow.a * exp(-7.0 * up) * pow(sunward, 3.0);
    let glow = sky.glow.rgb * spread;
    var color = mix(sky.zenith.rgb, sky.horizon.rgb, near_horizon) + glow * smoothstep(-0.06, 0.06, direction.y);

    // The stars rotate around the pole.
    if sky.drift.x > 0.001 && direction.y > 0.0 {
        let pole = vec3(0.0, 0.6187, -0.7857);
        let turn = sky.drift.w;
        let turned = direction * cos(turn) + cross(pole, direction) * sin(turn) + pole * dot(pole, direction) * (1.0 - cos(turn));
        color += vec3(0.85, 0.92, 1.0) * (star(turned) * sky.drift.x * smoothstep(0.0, 0.16, direction.y));
    }
    // The moon, with its maria.
    let at = apart(direction, sky.moon.xyz);
    if length(at) < 0.05 {
        let seas = textureSampleLevel(noise, noise_sampler, at * 4.0 + 0.2, 0.0).r;
        let disc = 1.0 - smoothstep(0.0431, 0.0458, length(at));
        color += vec3(0.82, 0.86, 0.92) * (0.55 + 0.55 * seas) * disc * sky.moon.a;
    }
    let from_sun = length(apart(direction, sky.sun.xyz));
    let disc = (1.0 - smoothstep(0.0173, 0.0283, from_sun)) * smoothstep(-0.02, 0.0, direction.y);
    color += sky.sun.a * vec3(1.0, 0.86, 0.64) * 4.0 * disc;

    // Clouds are on a plane overhead that bends down to the horizon.
    if up > 0.015 {
        let place = direction.xz / (up + 0.11) * 1.15 + sky.drift.yz;
        let here = clouds(place);
        let cover = smoothstep(0.50, 0.74, here) * smoothstep(0.02, 0.20, up);
        let thin = here - clouds(place + sky.sun.xz * 0.55);
        let shade = clamp(0.55 + 2.6 * thin, 0.0, 1.0);
        let cloud = mix(sky.cloud_shade.rgb, sky.cloud_light.rgb, shade) + glow * 0.8;
        color = mix(color, cloud, 0.92 * cover);
    }
    var out = vec4(color, 1.0);
#ifdef TONEMAP_IN_SHADER
    out = tone_mapping(out, view.color_grading);
#endif
    return out;
}
