// Layers of ground over Bevy's own material. The uniform is `GroundUniform` in material.rs.

#import bevy_burrow::position::position_of
#import bevy_pbr::{
    decal::clustered::apply_decals,
    mesh_functions,
    mesh_view_bindings::view,
    pbr_fragment::pbr_input_from_vertex_output,
    pbr_types,
}

#ifdef PREPASS_PIPELINE
#import bevy_pbr::{
    pbr_prepass_functions::calculate_motion_vector,
    prepass_io::{FragmentOutput, VertexOutput},
}
#ifdef DEFERRED_PREPASS
#import bevy_pbr::pbr_deferred_functions::deferred_output
#endif
#else
#import bevy_pbr::{
    forward_io::{FragmentOutput, VertexOutput},
    pbr_functions::{apply_pbr_lighting, main_pass_post_lighting_processing},
}
#ifdef SCREEN_SPACE_AMBIENT_OCCLUSION
#import bevy_pbr::{
    lighting::perceptualRoughnessToRoughness,
    mesh_view_bindings::screen_space_ambient_occlusion_texture,
    ssao_utils::ssao_multibounce,
}
#endif
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
    // The strength of the large relief of each layer.
    broad: array<vec4<f32>, 4>,
    // How much the colour map tints each layer.
    map_tints: array<vec4<f32>, 4>,
    // Metres from the camera at which the colour map begins to show, and from which on it shows fully.
    map_distance: vec2<f32>,
    // What turns metres into the width and height of the colour map.
    per_side: vec2<f32>,
    near: f32,
    far: f32,
    variety: f32,
    layer_count: f32,
    is_piece: u32,
    voxel: f32,
}

// What this material has in common with Bevy's standard one.
struct Base {
    color: vec4<f32>,
    reflectance: f32,
    is_unlit: u32,
    has_fog: u32,
}

@group(#{MATERIAL_BIND_GROUP}) @binding(99) var<uniform> base: Base;
@group(#{MATERIAL_BIND_GROUP}) @binding(100) var<uniform> ground: Ground;
@group(#{MATERIAL_BIND_GROUP}) @binding(101) var albedo_texture: texture_2d_array<f32>;
@group(#{MATERIAL_BIND_GROUP}) @binding(102) var layer_sampler: sampler;
@group(#{MATERIAL_BIND_GROUP}) @binding(103) var relief_texture: texture_2d_array<f32>;
#ifdef GROUND_COLOR_MAP
@group(#{MATERIAL_BIND_GROUP}) @binding(104) var color_map: texture_2d<f32>;
#endif
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
    // The share of the sky that lights this place; how many voxels it was dug below the surface, `CUT_VOXELS` at most; and the
    // share of daylight, which under roofs is also that of ground in the open.
    @location(7) sky_light: vec3<f32>,
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
    out.sky_light = in.sky_light.xyz * vec3(1.0, CUT_VOXELS, 1.0);
#endif
#ifdef PREPASS_PIPELINE
#ifdef MOTION_VECTOR_PREPASS
    let previous = mesh_functions::get_previous_world_from_local(in.instance_index);
    out.previous_world_position = mesh_functions::mesh_position_local_to_world(previous, vec4(in.position, 1.0));
#endif
#endif
    return out;
}

// Borders between layers: the size of a cell on the screen in pixels, how many voxels the noise spans, its strength, and the
// largest power of two by which it multiplies a weight, near the camera and where cells are larger than voxels.
const BORDER_PIXELS: f32 = 9.0;
const BORDER_VOXELS: f32 = 3.0;
const BORDER_NOISE: f32 = 4.0;
const BORDER_MOST: f32 = 2.0;
const BORDER_MOST_FAR: f32 = 2.6;
// How much heights move a border, and how wide it is: near the camera, and where cells are larger than voxels, as their weights
// are the shares of what lies in them.
const HEIGHT_SHIFT: f32 = 0.4;
const BORDER_WIDTH: f32 = 0.10;
const BORDER_WIDTH_FAR: f32 = 0.25;

// How many times larger textures are far away, and how much coarser than a pixel asks for. Each time that the distance grows by
// `FAR_STEP`, they do too: ground looks as rough as the same ground nearer by.
const FAR_SCALE: f32 = 6.0;
const FAR_STEP: f32 = 4.0;
const FAR_BLUR: f32 = 2.0;
// How many texels along its side a texture has at most, far away.
const FAR_TEXELS: f32 = 64.0;
const SOFT_TEXELS: f32 = 72.0;
// The part of a step, on a scale of logarithms, in which one size gives way to the next one.
const FAR_MIX: f32 = 0.2;
// The relief is larger and turned the other way, so that the repetition of both does not add up.
const RELIEF_SCALE: f32 = 2.3;
// Metres from the camera up to which the large relief shows, and from which it has faded.
const BROAD_NEAR: f32 = 900.0;
const BROAD_FAR: f32 = 3000.0;
const FAR_ROUGHNESS: f32 = 0.95;
const STEEP_TINT: vec3<f32> = vec3(0.62, 0.56, 0.50);

// Dug faces: how deep meshes tell, by how many voxels the height of the texture moves their rim, their colour, and that of the
// band below the rim.
const CUT_VOXELS: f32 = 8.0;
const CUT_CRUMBS: f32 = 0.7;
const CUT_TINT: vec3<f32> = vec3(0.90, 0.86, 0.82);
const RIM_TINT: vec3<f32> = vec3(0.62, 0.55, 0.49);

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
    // How many times larger textures are there, and how much the next size shows.
    scale: f32,
    next_scale: f32,
    // How much of the large relief shows: 1, and 0 farther away.
    broad: f32,
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
    return textureSampleGrad(albedo_texture, layer_sampler, uv, layer, dx, dy);
#endif
}

// A layer's normal, occlusion and roughness.
fn relief_at(layer: i32, uv: vec2<f32>, dx: vec2<f32>, dy: vec2<f32>) -> vec4<f32> {
#ifdef WITHOUT_ANISOTROPY
    return textureSampleGrad(relief_texture, noise_sampler, uv, layer, dx, dy);
#else
    return textureSampleGrad(relief_texture, layer_sampler, uv, layer, dx, dy);
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

// How strong the large relief of a layer is.
fn broad_relief(layer: u32) -> f32 {
    return ground.broad[layer >> 2u][layer & 3u];
}

// A layer far from the camera, laid on from one side, several times as large.
fn far_side(layer: u32, side: u32, site: Site, times: f32) -> Texels {
    let settings = ground.layers[layer];
    let scale = settings.per_metre / times;
    // Turned, so that large and small do not lie alike; but bedded rock keeps its beds level.
    let is_level = is_bedded(layer) && side != Y;
    let way = select(vec2(0.8, 0.6), vec2(1.0, 0.0), is_level);
    let turn = mat2x2<f32>(way.x, way.y, -way.y, way.x);
    let at = on_side(site.place, side) * scale;
    let texture = texture_of(layer, side);
    let size = f32(textureDimensions(albedo_texture).x) * scale;
    let level = 0.5 * log2(max(dot(site.dx, site.dx), dot(site.dy, site.dy))) + log2(size);
    // From coarse levels: joints and stones several times as large as they are would be seen as what they are.
    let coarse = max(level + log2(FAR_BLUR), log2(f32(textureDimensions(albedo_texture).x) / FAR_TEXELS));
    let color = textureSampleLevel(albedo_texture, noise_sampler, turn * at, texture, coarse);
    let broad = broad_relief(layer);
    let strength = site.broad * broad;
    if strength <= 0.0 {
        return Texels(color, vec2(1.0, FAR_ROUGHNESS), vec3(0.0));
    }
    // The other way round.
    let large = select(1.0 / RELIEF_SCALE, 1.0, is_level);
    // That of layer 0, as other layers have stones and blades in it; but beds are beds at any size. Soft layers have none of its
    // cracks.
    let soft = (1.0 - smoothstep(0.5, 0.75, broad)) * log2(f32(textureDimensions(relief_texture).x) / SOFT_TEXELS);
    let relief = textureSampleLevel(
        relief_texture, noise_sampler, (at * turn) * large, select(0, texture, is_level), max(level + log2(large), soft));
    let lean = turn * ((relief.xy * 2.0 - 1.0) * strength);
    return Texels(color, vec2(mix(1.0, relief.z, strength), FAR_ROUGHNESS), off_side(lean, side));
}

// A layer far from the camera, from the sides that show.
fn far_at(layer: u32, site: Site, times: f32) -> Texels {
    var texels = far_side(layer, site.side, site, times);
    if site.next_weight > 0.0 {
        texels = mix_texels(texels, far_side(layer, site.next_side, site, times), site.next_weight);
    }
    return texels;
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
        var broad = far_at(layer, site, site.scale);
        if site.next_scale > 0.0 {
            broad = mix_texels(broad, far_at(layer, site, FAR_STEP * site.scale), site.next_scale);
        }
        texels = mix_texels(texels, broad, site.far);
    }
    texels.color = vec4(texels.color.rgb * ground.tints[layer].color, texels.color.a);
    return texels;
}

#ifdef GROUND_COLOR_MAP
// A layer in the colours of the map: its texture's own differences from its mean stay.
fn mapped(color: vec3<f32>, layer: u32, side: u32, site: Site, distance: f32) -> vec3<f32> {
    let share = ground.map_tints[layer >> 2u][layer & 3u] * smoothstep(ground.map_distance.x, ground.map_distance.y, distance);
    if share <= 0.0 {
        return color;
    }
    // The sampler repeats; the map does not.
    let half = 0.5 / vec2<f32>(textureDimensions(color_map));
    let at = clamp(site.place.xz * ground.per_side, half, 1.0 - half);
    let dx = site.dx.xz * ground.per_side;
    let dy = site.dy.xz * ground.per_side;
    let map = textureSampleGrad(color_map, noise_sampler, at, dx, dy).rgb;
    // The coarsest level of a texture is its mean.
    let mean = textureSampleLevel(albedo_texture, noise_sampler, vec2(0.5), texture_of(layer, side), 16.0).rgb;
    let tinted = max(mean * ground.tints[layer].color, vec3(0.004));
    return mix(color, clamp(color / tinted, vec3(0.0), vec3(4.0)) * map, share);
}
#endif

// The two strongest layers of a place, the share of the second one, 0 to 0.5, and how wide the border between them is.
struct Choice {
    layers: vec2<u32>,
    share: f32,
    width: f32,
}

// How many octaves cells of the ground are larger than a voxel at a distance from the camera: levels of detail draw cells of
// several pixels.
fn octave_of(distance: f32) -> f32 {
    // An orthographic lens shows all distances alike.
    let depth = select(distance, 1.0, view.clip_from_view[3][3] == 1.0);
    let pixels_per_metre = 0.5 * view.viewport.w * view.clip_from_view[1][1] / depth;
    return max(log2(BORDER_PIXELS / (pixels_per_metre * ground.voxel)), 0.0);
}

// Noise of about the size of a cell.
fn border_noise(place: vec3<f32>, octave: f32) -> vec4<f32> {
    let metres = BORDER_VOXELS * ground.voxel * exp2(floor(octave));
    let noise = noise_at(place, metres);
    if octave <= 0.0 {
        return noise;
    }
    return mix(noise, noise_at(place, 2.0 * metres), fract(octave));
}

// The noise of a layer: no two layers have the same one. By the layer's number, since its place in the list may be another one
// in the next mesh.
fn noise_of(noise: vec4<f32>, layer: u32) -> f32 {
    return dot(noise, select(vec4(-0.5), vec4(0.5), (vec4(layer) & vec4(1u, 2u, 4u, 8u)) != vec4(0u)));
}

// Noise moves the borders between layers. It multiplies weights, so a layer shows only where a corner of the triangle has it, and
// near the camera a border strays from the middle between two corners by less than half a voxel.
fn choose(in: Varying, site: Site, distance: f32) -> Choice {
#ifdef GROUND_ATTRIBUTES
    let layers = in.layers;
    var weights = in.weights;
    let octave = octave_of(distance);
    let across = dpdx(in.weights);
    let down = dpdy(in.weights);
    if max(max(weights.x, weights.y), max(weights.z, weights.w)) < 0.999 {
        let noise = border_noise(site.place, octave);
        var rise =
            vec4(noise_of(noise, layers.x), noise_of(noise, layers.y), noise_of(noise, layers.z), noise_of(noise, layers.w));
        // Only differences count: what all that show have in common would use up the limit.
        rise = BORDER_NOISE * (rise - dot(weights, rise));
        // Weights that change slowly move little: or borders would stray farther than half a cell.
        let along = dot(site.dx, site.dy);
        let squares = vec2(dot(site.dx, site.dx), dot(site.dy, site.dy));
        let area = max(squares.x * squares.y - along * along, 1e-12);
        let slopes = across * across * squares.y - 2.0 * along * across * down + down * down * squares.x;
        let slope = sqrt(max(max(max(slopes.x, slopes.y), max(slopes.z, slopes.w)), 0.0) / area);
        let share = min(slope * ground.voxel * exp2(octave), 1.0);
        let most = vec4(share * mix(BORDER_MOST, BORDER_MOST_FAR, min(octave, 1.0)));
        weights *= exp2(clamp(rise, -most, most));
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
    let share = (second - third) / max(won.x + won.y - rival + second - 2.0 * third, 0.00001);
    return Choice(vec2(best, next), share, mix(BORDER_WIDTH, BORDER_WIDTH_FAR, min(octave, 1.0)));
#else
    return Choice(vec2(0u), 0.0, BORDER_WIDTH);
#endif
}

// A normal bent towards the eye, where relief turns away from it more than the ground does: what can be seen is not turned
// away, and a lamp at the eye lights it.
fn facing(normal: vec3<f32>, ground_normal: vec3<f32>, eye: vec3<f32>) -> vec3<f32> {
    let lacking = 0.3 * max(dot(ground_normal, eye), 0.0) - dot(normal, eye);
    return normalize(normal + max(lacking, 0.0) * eye);
}

// Depth and motion alone, behind the vertex stage of `prepass.wgsl`.
#ifdef GROUND_PLAIN_PREPASS
#ifdef PREPASS_FRAGMENT
@fragment
fn fragment(in: VertexOutput) -> FragmentOutput {
#ifdef VISIBILITY_RANGE_DITHER
    pbr_functions::visibility_range_dither(in.position, in.visibility_range_dither);
#endif
    var out: FragmentOutput;
#ifdef UNCLIPPED_DEPTH_ORTHO_EMULATION
    out.frag_depth = in.unclipped_depth;
#endif
#ifdef MOTION_VECTOR_PREPASS
    out.motion_vector = calculate_motion_vector(in.world_position, in.previous_world_position);
#endif
    return out;
}
#else
@fragment
fn fragment(in: VertexOutput) {
#ifdef VISIBILITY_RANGE_DITHER
    pbr_functions::visibility_range_dither(in.position, in.visibility_range_dither);
#endif
}
#endif
#else
// The share of reflected light that reaches a place, which is that of the sky above it, and the share of ambient light.
fn sky_light_of(in: Varying) -> vec2<f32> {
#ifdef GROUND_SKY_LIGHT
    return in.sky_light.xz;
#else
    return vec2(1.0);
#endif
}

// How much a place is a dug face, and how much it is the band below the rim of one, whose edge crumbles: by the height of the
// texture there.
fn cut_of(in: Varying, height: f32) -> vec2<f32> {
#ifdef GROUND_SKY_LIGHT
    let deep = in.sky_light.y + CUT_CRUMBS * (height - 0.5) * smoothstep(0.0, 0.3, in.sky_light.y);
    let cut = smoothstep(0.1, 0.4, deep);
    return vec2(cut, cut * (1.0 - smoothstep(0.9, 2.6, deep)));
#else
    return vec2(0.0);
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
    var pbr_input = pbr_input_from_vertex_output(plain, is_front, false);
    pbr_input.material.flags = pbr_types::STANDARD_MATERIAL_FLAGS_ALPHA_MODE_OPAQUE
        | select(0u, pbr_types::STANDARD_MATERIAL_FLAGS_UNLIT_BIT, base.is_unlit != 0u)
        | select(0u, pbr_types::STANDARD_MATERIAL_FLAGS_FOG_ENABLED_BIT, base.has_fog != 0u);
    pbr_input.material.reflectance = vec3(base.reflectance);

    var site: Site;
    let place = place_from_world(in.instance_index);
    let turn = mat3x3<f32>(place[0].xyz, place[1].xyz, place[2].xyz);
    site.place = (place * in.world_position).xyz;
    site.dx = dpdx(site.place);
    site.dy = dpdy(site.place);
    site.normal = normalize(turn * in.world_normal);
    face(&site);
    let distance = length(view.world_position - in.world_position.xyz);
    site.far = smoothstep(ground.near, ground.far, distance);
    site.broad = 1.0 - smoothstep(BROAD_NEAR, BROAD_FAR, distance);
    let steps = max(log2(distance / ground.far) / log2(FAR_STEP), 0.0);
    site.scale = FAR_SCALE * pow(FAR_STEP, floor(steps));
    site.next_scale = smoothstep(1.0 - FAR_MIX, 1.0, fract(steps));

    let choice = choose(in, site, distance);
    let best = choice.layers.x;
    let next = choice.layers.y;
    var texels = layer_at(best, site);
    var metallic = ground.layers[best].metallic;
#ifdef GROUND_COLOR_MAP
    // Dug faces show what is there.
    let map_distance = select(distance, 0.0, cut_of(in, texels.color.a).x > 0.5);
    texels.color = vec4(mapped(texels.color.rgb, best, site.side, site, map_distance), texels.color.a);
#endif
    if choice.share > 0.5 - 2.0 * choice.width {
        var other = layer_at(next, site);
#ifdef GROUND_COLOR_MAP
        other.color = vec4(mapped(other.color.rgb, next, site.side, site, map_distance), other.color.a);
#endif
        // What stands high covers what lies low.
        let rise = clamp(HEIGHT_SHIFT * (other.color.a - texels.color.a), -choice.width, choice.width);
        // Half on the border itself, from either side.
        let share = smoothstep(0.5 - choice.width, 0.5 + choice.width, choice.share + rise);
        texels = mix_texels(texels, other, share);
        metallic = mix(metallic, ground.layers[next].metallic, share);
    }
    var color = texels.color.rgb;
    // No two places have quite the same tint.
    color *= mix(vec3(1.0), vec3(1.32, 1.16, 0.90), max(in.mood.x, 0.0)) * mix(vec3(1.0), vec3(0.66, 0.76, 0.78), max(-in.mood.x, 0.0));
    color *= 1.0 + (0.16 + 0.3 * site.far) * in.mood.y;
    // Dug faces are fresh: moist, rough, and darkest below the rim, where roots and crumbs are.
    let cut = cut_of(in, texels.color.a) * min(2.0 * ground.variety, 1.0);
    color *= mix(vec3(1.0), CUT_TINT, cut.x) * mix(vec3(1.0), RIM_TINT, cut.y);
    texels.finish.y = mix(texels.finish.y, 1.0, 0.5 * cut.x);
    texels.finish.x *= 1.0 - 0.25 * cut.y;
    texels.lean *= 1.0 + 0.35 * cut.x;
    let lean = texels.lean - dot(texels.lean, site.normal) * site.normal;
    let bent = normalize(site.normal + lean);
    // Nothing gathers on steep ground: it is darker, and warmer than what lies above and below.
    color *= mix(vec3(1.0), STEEP_TINT, ground.variety * site.far * smoothstep(0.1, 0.6, 1.0 - bent.y));

    pbr_input.material.base_color = vec4(base.color.rgb * color, 1.0);
    pbr_input.material.perceptual_roughness = clamp(texels.finish.y, 0.089, 1.0);
    pbr_input.material.metallic = metallic;
    let open_sky = texels.finish.x * sky_light_of(in);
    pbr_input.diffuse_occlusion = vec3(open_sky.y);
    pbr_input.specular_occlusion = open_sky.x;
    pbr_input.N = facing(normalize(bent * turn), normalize(in.world_normal), pbr_input.V);
    // What changes from pixel to pixel would sparkle: it is rough (Tokuyoshi and Kaplanyan 2019).
    let bend_x = dpdx(pbr_input.N);
    let bend_y = dpdy(pbr_input.N);
    let variance = min(0.5 * (dot(bend_x, bend_x) + dot(bend_y, bend_y)), 0.2);
    let roughness = pbr_input.material.perceptual_roughness;
    pbr_input.material.perceptual_roughness = sqrt(sqrt(min(roughness * roughness * roughness * roughness + variance, 1.0)));
#ifdef SCREEN_SPACE_AMBIENT_OCCLUSION
    // As Bevy's standard material has it (Lagarde and Rousiers 2014).
    let open = textureLoad(screen_space_ambient_occlusion_texture, vec2<i32>(in.position.xy), 0i).r;
    let dullness = exp2(-16.0 * perceptualRoughnessToRoughness(pbr_input.material.perceptual_roughness) - 1.0);
    let facing_eye = max(dot(pbr_input.N, pbr_input.V), 0.0001);
    pbr_input.diffuse_occlusion *= ssao_multibounce(open, pbr_input.material.base_color.rgb);
    pbr_input.specular_occlusion *= saturate(pow(facing_eye + open, dullness) - 1.0 + open);
#endif

#ifdef PREPASS_PIPELINE
#ifdef DEFERRED_PREPASS
    apply_decals(&pbr_input);
    return deferred_output(plain, pbr_input);
#else
    var out: FragmentOutput;
#ifdef NORMAL_PREPASS
    out.normal = vec4(0.5 * pbr_input.N + 0.5, 1.0);
#endif
#ifdef MOTION_VECTOR_PREPASS
    out.motion_vector = calculate_motion_vector(in.world_position, in.previous_world_position);
#endif
    return out;
#endif
#else
    apply_decals(&pbr_input);
    var out: FragmentOutput;
    if base.is_unlit == 0u {
        out.color = apply_pbr_lighting(pbr_input);
    } else {
        out.color = pbr_input.material.base_color;
    }
    out.color = main_pass_post_lighting_processing(pbr_input, out.color);
    return out;
#endif
}
#endif
