// Layers of ground over Bevy's own material. The uniform is `GroundUniform` in material.rs.

#import bevy_burrow::position::position_of
#import bevy_pbr::{
    decal::clustered::apply_decals,
    mesh_functions,
    mesh_view_bindings::view,
    pbr_fragment::pbr_input_from_standard_material,
}

#ifdef PREPASS_PIPELINE
#import bevy_pbr::{
    pbr_deferred_functions::deferred_output,
    prepass_io::{FragmentOutput, VertexOutput},
}
#else
#import bevy_pbr::{
    forward_io::{FragmentOutput, VertexOutput},
    pbr_functions::{apply_pbr_lighting, main_pass_post_lighting_processing},
    pbr_types::STANDARD_MATERIAL_FLAGS_UNLIT_BIT,
}
#endif

#ifdef VISIBILITY_RANGE_DITHER
// By its module: an item of that name would hide the field of `Varying`.
#import bevy_pbr::pbr_functions
#endif

struct Layer {
    per_metre: f32,
    relief: f32,
    metallic: f32,
    // 1 if the texture is cut into pieces, so that it does not repeat.
    pieces: f32,
}

struct Tint {
    color: vec3<f32>,
    // The texture that shows from above, less than 0 for the same one.
    top: f32,
}

struct Ground {
    place: mat4x4<f32>,
    layers: array<Layer, 16>,
    tints: array<Tint, 16>,
    near: f32,
    far: f32,
    variety: f32,
    layer_count: f32,
    is_piece: u32,
    voxel: f32,
}

@group(#{MATERIAL_BIND_GROUP}) @binding(100) var<uniform> ground: Ground;
@group(#{MATERIAL_BIND_GROUP}) @binding(101) var albedo_texture: texture_2d_array<f32>;
@group(#{MATERIAL_BIND_GROUP}) @binding(102) var albedo_sampler: sampler;
@group(#{MATERIAL_BIND_GROUP}) @binding(103) var relief_texture: texture_2d_array<f32>;
@group(#{MATERIAL_BIND_GROUP}) @binding(104) var relief_sampler: sampler;
@group(#{MATERIAL_BIND_GROUP}) @binding(105) var noise_texture: texture_3d<f32>;
@group(#{MATERIAL_BIND_GROUP}) @binding(106) var noise_sampler: sampler;

struct Vertex {
    @builtin(instance_index) instance_index: u32,
    @location(0) position: vec3<f32>,
    @location(1) normal: vec3<f32>,
#ifdef GROUND_ATTRIBUTES
    @location(8) ids: vec4<u32>,
    @location(9) weights: vec4<f32>,
#endif
#ifdef GROUND_SKY_LIGHT
    @location(10) sky_light: vec4<f32>,
#endif
}

struct Varying {
    @invariant @builtin(position) position: vec4<f32>,
    @location(0) world_position: vec4<f32>,
    @location(1) world_normal: vec3<f32>,
    @location(2) @interpolate(flat) instance_index: u32,
#ifdef VISIBILITY_RANGE_DITHER
    @location(3) @interpolate(flat) visibility_range_dither: i32,
#endif
    // By how much the tint and the brightness of this place differ from the layer's.
    @location(4) mood: vec2<f32>,
#ifdef GROUND_ATTRIBUTES
    // Up to four layers, the same at all corners of a triangle, and the weight of each.
    @location(5) @interpolate(flat) layers: vec4<u32>,
    @location(6) weights: vec4<f32>,
#endif
#ifdef GROUND_SKY_LIGHT
    @location(7) sky_light: f32,
#endif
#ifdef PREPASS_PIPELINE
#ifdef MOTION_VECTOR_PREPASS
    @location(9) previous_world_position: vec4<f32>,
#endif
#endif
}

// From world space to metres of the terrain, as it was when the mesh was part of it.
fn place_from_world(instance_index: u32) -> mat4x4<f32> {
    if ground.is_piece == 0u {
        return ground.place;
    }
    // Of a mesh that is turned, moved and scaled the same along all axes.
    let mesh = mesh_functions::get_world_from_local(instance_index);
    let turn = transpose(mat3x3<f32>(mesh[0].xyz, mesh[1].xyz, mesh[2].xyz)) * (1.0 / dot(mesh[0].xyz, mesh[0].xyz));
    let local_from_world =
        mat4x4<f32>(vec4(turn[0], 0.0), vec4(turn[1], 0.0), vec4(turn[2], 0.0), vec4(-(turn * mesh[3].xyz), 1.0));
    return ground.place * local_from_world;
}

// Noise in space, about -1 to 1, four kinds of it.
fn noise_at(place: vec3<f32>, metres: f32) -> vec4<f32> {
    return textureSampleLevel(noise_texture, noise_sampler, place / metres, 0.0) * 2.0 - 1.0;
}

@vertex
fn vertex(in: Vertex) -> Varying {
    var out: Varying;
    let position = position_of(in.position, in.instance_index);
    out.world_position = position.world;
    out.position = position.clip;
    out.world_normal = mesh_functions::mesh_normal_local_to_world(in.normal, in.instance_index);
    out.instance_index = in.instance_index;
#ifdef VISIBILITY_RANGE_DITHER
    out.visibility_range_dither =
        mesh_functions::get_visibility_range_dither_level(
            in.instance_index, mesh_functions::get_world_from_local(in.instance_index)[3]);
#endif
    // This noise changes little from one vertex to the next.
    let place = (place_from_world(in.instance_index) * out.world_position).xyz;
    let broad = noise_at(place, 150.0);
    let fine = noise_at(place, 27.0);
    out.mood = vec2(clamp(0.9 * broad.y + 0.55 * fine.w, -1.0, 1.0), fine.z) * ground.variety;
#ifdef GROUND_ATTRIBUTES
    out.layers = min(in.ids, vec4(u32(ground.layer_count) - 1u));
    out.weights = in.weights;
#endif
#ifdef GROUND_SKY_LIGHT
    out.sky_light = in.sky_light.x;
#endif
#ifdef PREPASS_PIPELINE
#ifdef MOTION_VECTOR_PREPASS
    let previous = mesh_functions::get_previous_world_from_local(in.instance_index);
    out.previous_world_position = mesh_functions::mesh_position_local_to_world(previous, vec4(in.position, 1.0));
#endif
#endif
    return out;
}

// How much coarser colours are far away, and how rough the ground is there.
const FAR_BLUR: f32 = 3.0;
const FAR_ROUGHNESS: f32 = 0.92;

// Sides from which textures are laid on: along x, y, z.
const X: u32 = 0u;
const Y: u32 = 1u;
const Z: u32 = 2u;

// A place on the ground, as far as textures care.
struct Site {
    // Metres in the terrain's space, and how it changes from pixel to pixel.
    place: vec3<f32>,
    dx: vec3<f32>,
    dy: vec3<f32>,
    normal: vec3<f32>,
    // The side that the ground faces most, the next one, and how much that one shows: 0 to 0.5.
    side: u32,
    next_side: u32,
    next_weight: f32,
    // 0 near, 1 far.
    far: f32,
}

// What textures say: colour and height; occlusion and roughness; by how much the normal leans.
struct Texels {
    color: vec4<f32>,
    finish: vec2<f32>,
    lean: vec3<f32>,
}

fn mix_texels(a: Texels, b: Texels, share: f32) -> Texels {
    return Texels(mix(a.color, b.color, share), mix(a.finish, b.finish, share), mix(a.lean, b.lean, share));
}

// How a direction runs in the texture of a side: upright on walls, v runs down.
fn on_side(v: vec3<f32>, side: u32) -> vec2<f32> {
    return select(select(vec2(v.x, -v.y), v.xz, side == Y), vec2(v.z, -v.y), side == X);
}

// The other way round.
fn off_side(v: vec2<f32>, side: u32) -> vec3<f32> {
    return select(select(vec3(v.x, -v.y, 0.0), vec3(v.x, 0.0, v.y), side == Y), vec3(0.0, -v.y, v.x), side == X);
}

// The sides from which the ground at a place shows textures.
fn face(site: ptr<function, Site>) {
    var sides = (*site).normal * (*site).normal;
    sides = sides * sides;
    sides = sides * sides;
    let is_y = sides.y >= max(sides.x, sides.z);
    let is_x = !is_y && sides.x >= sides.z;
    let first = max(max(sides.x, sides.y), sides.z);
    let last = min(min(sides.x, sides.y), sides.z);
    let next = sides.x + sides.y + sides.z - first - last;
    (*site).side = select(select(Z, X, is_x), Y, is_y);
    // The side that is neither the first nor the last one.
    let is_next_x = !is_x && sides.x > select(sides.y, sides.z, is_y);
    let is_next_y = !is_y && !is_next_x && select(sides.x, sides.z, is_x) <= sides.y;
    (*site).next_side = select(select(Z, X, is_next_x), Y, is_next_y);
    // Less what the last one has, so that none comes or goes with a jump.
    let share = (next - last) / max(first + next - 2.0 * last, 0.00001);
    (*site).next_weight = max(share - 0.12, 0.0) / 0.76;
}

// What one side of one layer says.
struct Pair {
    albedo: vec4<f32>,
    relief: vec4<f32>,
}

// A layer's colour and height.
fn albedo_at(layer: i32, uv: vec2<f32>, dx: vec2<f32>, dy: vec2<f32>) -> vec4<f32> {
#ifdef WITHOUT_ANISOTROPY
    // The sampler of the noise repeats and filters too, but alike in all directions.
    return textureSampleGrad(albedo_texture, noise_sampler, uv, layer, dx, dy);
#else
    return textureSampleGrad(albedo_texture, albedo_sampler, uv, layer, dx, dy);
#endif
}

// A layer's normal, occlusion and roughness.
fn relief_at(layer: i32, uv: vec2<f32>, dx: vec2<f32>, dy: vec2<f32>) -> vec4<f32> {
#ifdef WITHOUT_ANISOTROPY
    return textureSampleGrad(relief_texture, noise_sampler, uv, layer, dx, dy);
#else
    return textureSampleGrad(relief_texture, relief_sampler, uv, layer, dx, dy);
#endif
}

fn fetch(layer: i32, uv: vec2<f32>, dx: vec2<f32>, dy: vec2<f32>) -> Pair {
    return Pair(albedo_at(layer, uv, dx, dy), relief_at(layer, uv, dx, dy));
}

fn add(to: Pair, more: Pair, weight: f32) -> Pair {
    return Pair(to.albedo + more.albedo * weight, to.relief + more.relief * weight);
}

// Where in the texture a hexagon begins.
fn shift_of(hexagon: vec2<f32>, layer: i32) -> vec2<f32> {
    let at = vec2<u32>(vec2<i32>(hexagon));
    var word = (at.x * 0x8da6b343u) ^ (at.y * 0xd8163841u) ^ (u32(layer) * 0xcb1ab31fu);
    word = (word ^ (word >> 15u)) * 0x2c1b3c6du;
    word = (word ^ (word >> 12u)) * 0x297a2d39u;
    word = word ^ (word >> 15u);
    return vec2(f32(word & 0xffffu), f32(word >> 16u)) / 65536.0;
}

// A layer without repetition: each corner of a grid of triangles has its own piece of the texture, and rules the hexagon
// around it.
fn fetch_pieces(layer: i32, uv: vec2<f32>, dx: vec2<f32>, dy: vec2<f32>) -> Pair {
    let skewed = vec2(uv.x - 0.57735027 * uv.y, 1.15470054 * uv.y) * 1.7;
    let base = floor(skewed);
    let part = skewed - base;
    let rest = 1.0 - part.x - part.y;
    let upper = select(0.0, 1.0, rest < 0.0);
    let sign = 2.0 * upper - 1.0;
    var weights = vec3(-rest * sign, upper - part.y * sign, upper - part.x * sign);
    // Narrow borders: what is mixed loses contrast, and most pixels need one piece only.
    weights = weights * weights;
    weights = weights * weights;
    weights = weights * weights;
    weights = max(weights / (weights.x + weights.y + weights.z) - 0.1, vec3(0.0));
    weights /= weights.x + weights.y + weights.z;
    var sum = Pair(vec4(0.0), vec4(0.0));
    for (var i = 0; i < 3; i++) {
        let weight = select(select(weights.z, weights.y, i == 1), weights.x, i == 0);
        if weight > 0.0 {
            let across = vec2(select(upper, 1.0 - upper, i == 2), select(upper, 1.0 - upper, i == 1));
            sum = add(sum, fetch(layer, uv + shift_of(base + across, layer), dx, dy), weight);
        }
    }
    return sum;
}

// A layer near the camera, laid on from one side.
fn near_side(layer: u32, side: u32, site: Site) -> Texels {
    let settings = ground.layers[layer];
    let uv = on_side(site.place, side) * settings.per_metre;
    let dx = on_side(site.dx, side) * settings.per_metre;
    let dy = on_side(site.dy, side) * settings.per_metre;
    let texture = texture_of(layer, side);
    var pair: Pair;
#ifdef GROUND_FINE
    if settings.pieces > 0.5 {
        pair = fetch_pieces(texture, uv, dx, dy);
    } else {
        pair = fetch(texture, uv, dx, dy);
    }
#else
    pair = fetch(texture, uv, dx, dy);
#endif
    // The sine of the slope and not its tangent: up to 45 degrees, and not up to walls that turn away from lamp and eye.
    let lean = (pair.relief.xy * 2.0 - 1.0) * settings.relief;
    return Texels(pair.albedo, pair.relief.zw, off_side(lean, side));
}

// A layer far from the camera, laid on from one side: its colours alone, six times as large.
fn far_side(layer: u32, side: u32, site: Site) -> vec4<f32> {
    let scale = ground.layers[layer].per_metre / 6.0;
    // Turned, so that large and small do not lie alike; but bedded rock keeps its beds level.
    let way = select(vec2(0.8, 0.6), vec2(1.0, 0.0), is_bedded(layer) && side != Y);
    let turn = mat2x2<f32>(way.x, way.y, -way.y, way.x);
    // From coarser levels: joints six times as large as they are would be seen as what they are.
    let size = f32(textureDimensions(albedo_texture).x) * scale * FAR_BLUR;
    let level = 0.5 * log2(max(dot(site.dx, site.dx), dot(site.dy, site.dy))) + log2(size);
    return textureSampleLevel(albedo_texture, noise_sampler, turn * on_side(site.place, side) * scale, texture_of(layer, side), level);
}

// Another texture shows from above: the layer's own has beds.
fn is_bedded(layer: u32) -> bool {
    let top = ground.tints[layer].top;
    return top >= 0.0 && top < f32(textureNumLayers(albedo_texture));
}

fn texture_of(layer: u32, side: u32) -> i32 {
    return select(i32(layer), i32(ground.tints[layer].top), side == Y && is_bedded(layer));
}

// A layer from the sides that show.
fn layer_at(layer: u32, site: Site) -> Texels {
    var texels: Texels;
    if site.far < 1.0 {
        texels = near_side(layer, site.side, site);
        if site.next_weight > 0.0 {
            texels = mix_texels(texels, near_side(layer, site.next_side, site), site.next_weight);
        }
    }
    if site.far > 0.0 {
        var color = far_side(layer, site.side, site);
        if site.next_weight > 0.0 {
            color = mix(color, far_side(layer, site.next_side, site), site.next_weight);
        }
        texels = mix_texels(texels, Texels(color, vec2(1.0, FAR_ROUGHNESS), vec3(0.0)), site.far);
    }
    texels.color = vec4(texels.color.rgb * ground.tints[layer].color, texels.color.a);
    return texels;
}

// The two strongest layers of a place, and the share of the second one, 0 to 0.5.
struct Choice {
    layers: vec2<u32>,
    share: f32,
}

// Noise moves the borders between layers: together with heights by less than half the way to the next vertex.
fn choose(in: Varying, place: vec3<f32>) -> Choice {
#ifdef GROUND_ATTRIBUTES
    let layers = in.layers;
    var weights = in.weights;
    if max(max(weights.x, weights.y), max(weights.z, weights.w)) < 0.999 {
        let patches = clamp(1.0 + noise_at(place, 4.5), vec4(0.7), vec4(1.3));
        // By the layer's number: its place in the list may be another one in the next mesh.
        weights *= vec4(patches[layers.x & 3u], patches[layers.y & 3u], patches[layers.z & 3u], patches[layers.w & 3u]);
    }
    // The winner and the loser of each half.
    let is_left = weights.xz >= weights.yw;
    let won = max(weights.xz, weights.yw);
    let lost = min(weights.xz, weights.yw);
    let winners = select(layers.yw, layers.xz, is_left);
    let losers = select(layers.xz, layers.yw, is_left);
    // The second one is the other half's winner, or the loser of the winner's own half.
    let is_first = won.x >= won.y;
    let rival = min(won.x, won.y);
    let mate = select(lost.y, lost.x, is_first);
    let is_rival = rival >= mate;
    let second = max(rival, mate);
    let third = max(min(rival, mate), select(lost.x, lost.y, is_first));
    let best = select(winners.y, winners.x, is_first);
    let next = select(select(losers.y, losers.x, is_first), select(winners.x, winners.y, is_first), is_rival);
    // Less what the third one has, so that none comes or goes with a jump.
    return Choice(vec2(best, next), (second - third) / max(won.x + won.y - rival + second - 2.0 * third, 0.00001));
#else
    return Choice(vec2(0u), 0.0);
#endif
}

// A normal bent towards the eye, where relief turns away from it more than the ground does: what can be seen is not turned
// away, and a lamp at the eye lights it.
fn facing(normal: vec3<f32>, ground_normal: vec3<f32>, eye: vec3<f32>) -> vec3<f32> {
    let lacking = 0.3 * max(dot(ground_normal, eye), 0.0) - dot(normal, eye);
    return normalize(normal + max(lacking, 0.0) * eye);
}

// The share of ambient and indirect light that reaches a place: that of the sky above it.
fn sky_light_of(in: Varying) -> f32 {
#ifdef GROUND_SKY_LIGHT
    return in.sky_light;
#else
    return 1.0;
#endif
}

@fragment
fn fragment(in: Varying, @builtin(front_facing) is_front: bool) -> FragmentOutput {
#ifdef VISIBILITY_RANGE_DITHER
    pbr_functions::visibility_range_dither(in.position, in.visibility_range_dither);
#endif
    var plain: VertexOutput;
    plain.position = in.position;
    plain.world_position = in.world_position;
    plain.instance_index = in.instance_index;
#ifdef PREPASS_PIPELINE
#ifdef NORMAL_PREPASS_OR_DEFERRED_PREPASS
    plain.world_normal = in.world_normal;
#endif
#ifdef MOTION_VECTOR_PREPASS
    plain.previous_world_position = in.previous_world_position;
#endif
#else
    plain.world_normal = in.world_normal;
#endif
#ifdef VERTEX_COLORS
    plain.color = vec4(1.0);
#endif
    var pbr_input = pbr_input_from_standard_material(plain, is_front);

    var site: Site;
    let place = place_from_world(in.instance_index);
    let turn = mat3x3<f32>(place[0].xyz, place[1].xyz, place[2].xyz);
    site.place = (place * in.world_position).xyz;
    site.dx = dpdx(site.place);
    site.dy = dpdy(site.place);
    site.normal = normalize(turn * in.world_normal);
    face(&site);
    site.far = smoothstep(ground.near, ground.far, length(view.world_position - in.world_position.xyz));

    let choice = choose(in, site.place);
    let best = choice.layers.x;
    let next = choice.layers.y;
    var texels = layer_at(best, site);
    var metallic = ground.layers[best].metallic;
    // A height counts at most three times as much as another one: what is much weaker does not show.
    if choice.share > 0.05 {
        let other = layer_at(next, site);
        // What stands high covers what lies low.
        let scores = vec2(1.0 - choice.share, choice.share) * (vec2(texels.color.a, other.color.a) + 0.5);
        let cubes = scores * scores * scores;
        let share = cubes.y / (cubes.x + cubes.y);
        texels = mix_texels(texels, other, share);
        metallic = mix(metallic, ground.layers[next].metallic, share);
    }
    var color = texels.color.rgb;
    // No two places have quite the same tint.
    color *= mix(vec3(1.0), vec3(1.32, 1.16, 0.90), max(in.mood.x, 0.0)) * mix(vec3(1.0), vec3(0.66, 0.76, 0.78), max(-in.mood.x, 0.0));
    color *= 1.0 + (0.16 + 0.3 * site.far) * in.mood.y;

    pbr_input.material.base_color = vec4(pbr_input.material.base_color.rgb * color, 1.0);
    pbr_input.material.perceptual_roughness = clamp(texels.finish.y, 0.089, 1.0);
    pbr_input.material.metallic = metallic;
    pbr_input.diffuse_occlusion *= texels.finish.x * sky_light_of(in);
    pbr_input.specular_occlusion *= texels.finish.x * sky_light_of(in);
    let lean = texels.lean - dot(texels.lean, site.normal) * site.normal;
    pbr_input.N = facing(normalize(normalize(site.normal + lean) * turn), normalize(in.world_normal), pbr_input.V);
    apply_decals(&pbr_input);

#ifdef PREPASS_PIPELINE
    return deferred_output(plain, pbr_input);
#else
    var out: FragmentOutput;
    if (pbr_input.material.flags & STANDARD_MATERIAL_FLAGS_UNLIT_BIT) == 0u {
        out.color = apply_pbr_lighting(pbr_input);
    } else {
        out.color = pbr_input.material.base_color;
    }
    out.color = main_pass_post_lighting_processing(pbr_input, out.color);
    return out;
#endif
}
