// Layers of ground over Bevy's own material. The uniform is `GroundUniform` in material.rs.

#import bevy_pbr::{
    decal::clustered::apply_decals,
    mesh_functions,
    mesh_view_bindings::view,
    pbr_fragment::pbr_input_from_standard_material,
    view_transformations::position_world_to_clip,
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
#import bevy_pbr::pbr_functions::visibility_range_dither;
#endif

struct Layer {
    per_metre: f32,
    relief: f32,
    metallic: f32,
    // 0 body, 1 skin, 2 strata.
    kind: f32,
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
    soil_layer: f32,
    subsoil_layer: f32,
    soil_depth: f32,
    subsoil_depth: f32,
    beds: vec4<f32>,
    bed_height: f32,
    bend: f32,
    seam_layer: f32,
    seam_thickness: f32,
    seam_depth: f32,
    vein_layer: f32,
    vein_thickness: f32,
    vein_depth: f32,
    // Cosines of the slopes on which no skin is left, and where it begins to give way.
    bare: f32,
    skinned: f32,
    near: f32,
    far: f32,
    variety: f32,
    quality: f32,
    // Metres of a voxel.
    voxel: f32,
    layer_count: f32,
    is_piece: u32,
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
    @location(10) depth: f32,
    @location(11) cover: vec4<f32>,
#endif
}

struct Varying {
    @builtin(position) position: vec4<f32>,
    @location(0) world_position: vec4<f32>,
    @location(1) world_normal: vec3<f32>,
    @location(2) @interpolate(flat) instance_index: u32,
#ifdef VISIBILITY_RANGE_DITHER
    @location(3) @interpolate(flat) visibility_range_dither: i32,
#endif
#ifdef GROUND_ATTRIBUTES
    // Depth in metres, cover, own.
    @location(4) origin: vec3<f32>,
    // The weight of each layer.
    @location(5) weights_0: vec4<f32>,
    @location(6) weights_1: vec4<f32>,
    @location(7) weights_2: vec4<f32>,
    @location(8) weights_3: vec4<f32>,
#endif
#ifdef PREPASS_PIPELINE
#ifdef MOTION_VECTOR_PREPASS
    @location(9) previous_world_position: vec4<f32>,
#endif
#endif
}

// The weight of each of sixteen layers. No arrays: with an index that is known only at run time, they live in memory.
struct Mass {
    a: vec4<f32>,
    b: vec4<f32>,
    c: vec4<f32>,
    d: vec4<f32>,
}

// `weight` at `layer` of four layers from `first` on.
fn at_layer(layer: u32, first: u32, weight: f32) -> vec4<f32> {
    return select(vec4(0.0), vec4(weight), vec4(layer) == vec4(first, first + 1u, first + 2u, first + 3u));
}

fn put(mass: Mass, layer: u32, weight: f32) -> Mass {
    return Mass(
        mass.a + at_layer(layer, 0u, weight),
        mass.b + at_layer(layer, 4u, weight),
        mass.c + at_layer(layer, 8u, weight),
        mass.d + at_layer(layer, 12u, weight),
    );
}

fn kinds_from(first: u32) -> vec4<f32> {
    return vec4(
        ground.layers[first].kind,
        ground.layers[first + 1u].kind,
        ground.layers[first + 2u].kind,
        ground.layers[first + 3u].kind,
    );
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

@vertex
fn vertex(in: Vertex) -> Varying {
    var out: Varying;
    let world_from_local = mesh_functions::get_world_from_local(in.instance_index);
    out.world_position = mesh_functions::mesh_position_local_to_world(world_from_local, vec4(in.position, 1.0));
    out.position = position_world_to_clip(out.world_position.xyz);
    out.world_normal = mesh_functions::mesh_normal_local_to_world(in.normal, in.instance_index);
    out.instance_index = in.instance_index;
#ifdef VISIBILITY_RANGE_DITHER
    out.visibility_range_dither =
        mesh_functions::get_visibility_range_dither_level(in.instance_index, world_from_local[3]);
#endif
#ifdef GROUND_ATTRIBUTES
    out.origin = vec3(in.depth * ground.voxel, in.cover.xy);
    // Ids can't be blended between vertices; weights of layers can.
    let ids = min(in.ids, vec4(u32(ground.layer_count) - 1u));
    var mass = Mass(vec4(0.0), vec4(0.0), vec4(0.0), vec4(0.0));
    mass = put(mass, ids.x, in.weights.x);
    mass = put(mass, ids.y, in.weights.y);
    mass = put(mass, ids.z, in.weights.z);
    mass = put(mass, ids.w, in.weights.w);
    out.weights_0 = mass.a;
    out.weights_1 = mass.b;
    out.weights_2 = mass.c;
    out.weights_3 = mass.d;
#endif
#ifdef PREPASS_PIPELINE
#ifdef MOTION_VECTOR_PREPASS
    let previous = mesh_functions::get_previous_world_from_local(in.instance_index);
    out.previous_world_position = mesh_functions::mesh_position_local_to_world(previous, vec4(in.position, 1.0));
#endif
#endif
    return out;
}

// How much coarser colours are far away.
const FAR_BLUR: f32 = 3.0;

// A place on the ground, as far as textures care.
struct Site {
    // Metres in the terrain's space, and how it changes from pixel to pixel.
    place: vec3<f32>,
    dx: vec3<f32>,
    dy: vec3<f32>,
    normal: vec3<f32>,
    // Weights of the sides from which textures are laid on: along x, y, z.
    sides: vec3<f32>,
    // 0 near, 1 far.
    far: f32,
}

// What textures say, weighted: colour and height; occlusion and roughness; by how much the normal leans.
struct Texels {
    color: vec4<f32>,
    finish: vec2<f32>,
    lean: vec3<f32>,
}

// What one side of one layer says.
struct Pair {
    albedo: vec4<f32>,
    relief: vec4<f32>,
}

fn is_fine() -> bool {
    return ground.quality > 0.5;
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
    weights = weights * weights * weights;
    weights = max(weights / (weights.x + weights.y + weights.z) - 0.07, vec3(0.0));
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

// A layer laid on from one side. One that is bedded is not turned, far away, on walls: its beds stay level.
fn fetch_side(layer: i32, uv: vec2<f32>, dx: vec2<f32>, dy: vec2<f32>, far: f32, is_level: bool) -> Pair {
    var sum = Pair(vec4(0.0), vec4(0.0));
    if far < 1.0 {
        if is_fine() {
            sum = add(sum, fetch_pieces(layer, uv, dx, dy), 1.0 - far);
        } else {
            sum = add(sum, fetch(layer, uv, dx, dy), 1.0 - far);
        }
    }
    if far > 0.0 {
        // Six times as large, and turned, so that it does not repeat along with the near one.
        let way = select(vec2(0.8, 0.6), vec2(1.0, 0.0), is_level);
        let turn = mat2x2<f32>(way.x, way.y, -way.y, way.x);
        let scale = turn * (1.0 / 6.0);
        let at = scale * uv;
        let at_dx = scale * dx;
        let at_dy = scale * dy;
        // Colours from coarser levels: joints six times as large as they are would be seen as what they are.
        let large = Pair(
            albedo_at(layer, at, FAR_BLUR * at_dx, FAR_BLUR * at_dy),
            relief_at(layer, at, at_dx, at_dy),
        );
        // The relief is turned back; far away it is half of it.
        let lean = (large.relief.xy - 0.5) * turn * 0.6 + 0.5;
        sum = add(sum, Pair(large.albedo, vec4(lean, large.relief.zw)), far);
    }
    return sum;
}

// The sine of the slope and not its tangent: up to 45 degrees, and not up to walls that turn away from lamp and eye.
fn lean_of(relief: vec4<f32>) -> vec2<f32> {
    return relief.xy * 2.0 - 1.0;
}

// A layer from all sides that show.
fn layer_at(layer: u32, site: Site) -> Texels {
    let settings = ground.layers[layer];
    // What shows from above and below, if that is another one: then this one is bedded.
    let top = ground.tints[layer].top;
    let is_bedded = top >= 0.0 && top < f32(textureNumLayers(albedo_texture));
    let place = site.place * settings.per_metre;
    let dx = site.dx * settings.per_metre;
    let dy = site.dy * settings.per_metre;
    var texels = Texels(vec4(0.0), vec2(0.0), vec3(0.0));
    for (var side = 0; side < 3; side++) {
        let is_x = side == 0;
        let is_y = side == 1;
        let weight = select(select(site.sides.z, site.sides.y, is_y), site.sides.x, is_x);
        if weight > 0.0 {
            // Upright on walls: v runs down.
            let uv = select(select(vec2(place.x, -place.y), place.xz, is_y), vec2(place.z, -place.y), is_x);
            let uv_dx = select(select(vec2(dx.x, -dx.y), dx.xz, is_y), vec2(dx.z, -dx.y), is_x);
            let uv_dy = select(select(vec2(dy.x, -dy.y), dy.xz, is_y), vec2(dy.z, -dy.y), is_x);
            let texture = select(i32(layer), i32(top), is_y && is_bedded);
            let pair = fetch_side(texture, uv, uv_dx, uv_dy, site.far, is_bedded && !is_y);
            let lean = lean_of(pair.relief);
            texels.color += pair.albedo * weight;
            texels.finish += pair.relief.zw * weight;
            let up = select(vec3(lean.x, -lean.y, 0.0), vec3(lean.x, 0.0, lean.y), is_y);
            texels.lean += select(up, vec3(0.0, -lean.y, lean.x), is_x) * weight;
        }
    }
    texels.color = vec4(texels.color.rgb * ground.tints[layer].color, texels.color.a);
    texels.lean *= settings.relief;
    return texels;
}

// Noise in space, about -1 to 1, four kinds of it.
fn noise_at(place: vec3<f32>, metres: f32) -> vec4<f32> {
    return textureSampleLevel(noise_texture, noise_sampler, place / metres, 0.0) * 2.0 - 1.0;
}

// The strongest layers, and how strong; the last weight is that of the first one that is left out.
struct Choice {
    layers: vec3<u32>,
    weights: vec4<f32>,
}

fn offer(choice: Choice, layer: u32, weight: f32) -> Choice {
    let w = choice.weights;
    let l = choice.layers;
    if weight <= w.w {
        return choice;
    }
    let above = vec3(weight) > w.xyz;
    let weights = vec4(
        select(w.x, weight, above.x),
        select(select(w.y, weight, above.y), w.x, above.x),
        select(select(w.z, weight, above.z), w.y, above.y),
        select(weight, w.z, above.z),
    );
    let layers = vec3(
        select(l.x, layer, above.x),
        select(select(l.y, layer, above.y), l.x, above.x),
        select(select(l.z, layer, above.z), l.y, above.y),
    );
    return Choice(layers, weights);
}

fn offer_four(choice: Choice, first: u32, weights: vec4<f32>) -> Choice {
    var best = offer(choice, first, weights.x);
    best = offer(best, first + 1u, weights.y);
    best = offer(best, first + 2u, weights.z);
    return offer(best, first + 3u, weights.w);
}

#ifdef GROUND_ATTRIBUTES
// A place on the ground, as far as strata care.
struct Depth {
    // Metres below the surface that was there before anyone dug; the same where borders between strata are ragged.
    sunk: f32,
    ragged: f32,
    // Noise there, in space: over the land, over a few steps, and within one, which is 0 on the surface itself.
    broad: vec4<f32>,
    fine: vec4<f32>,
    grit: vec4<f32>,
}

fn depth_at(site: Site, sunk: f32, broad: vec4<f32>, fine: vec4<f32>) -> Depth {
    // Borders between strata are ragged, but not at the surface itself.
    var ragged = sunk;
    var grit = vec4(0.0);
    if sunk > 0.0 {
        let inside = min(1.4 * sunk, 1.0);
        grit = noise_at(site.place, 5.0) * inside;
        ragged = max(sunk + 0.7 * grit.x + (0.35 * fine.x + 0.5 * broad.x) * inside, 0.0);
    }
    return Depth(sunk, ragged, broad, fine, grit);
}

// What is left of four layers when the strata have taken what is theirs: of skins, where these are `bare`, and all of the
// ground's own that stands for strata.
fn less_strata(weights: vec4<f32>, kinds: vec4<f32>, own: f32, bare: f32) -> vec4<f32> {
    return weights * (1.0 - select(step(vec4(0.5), kinds) * bare, vec4(own), kinds > vec4(1.5)));
}

// Soil and subsoil, of all that the strata fill: what lies under a skin, and what is the ground's own body.
fn soils(depth: Depth, under_skin: f32, body: f32, all: f32, cover: f32) -> vec2<f32> {
    let covered = max(cover, under_skin / all);
    let soil_depth = ground.soil_depth * covered * (1.0 + 0.5 * depth.broad.y);
    let in_soil = 1.0 - smoothstep(0.75 * soil_depth, soil_depth + 0.02, depth.ragged);
    // Bare rock has no soil on its face.
    let below = smoothstep(0.02, 0.30, depth.ragged);
    let soil = in_soil * (under_skin + body * below);
    let subsoil_depth = soil_depth + ground.subsoil_depth * covered * (1.0 + 0.5 * depth.broad.w);
    let in_subsoil = (1.0 - in_soil) * (1.0 - smoothstep(0.85 * subsoil_depth, subsoil_depth + 0.05, depth.ragged));
    let subsoil = step(0.001, ground.subsoil_depth) * in_subsoil * all * below;
    return vec2(soil, subsoil);
}

// Where between two repetitions of the beds a place is, from 0 to 1. Beds dip, roll and bend.
fn within_beds(site: Site, depth: Depth) -> f32 {
    let flat_place = site.place.xz;
    let roll = 0.012 * dot(flat_place, vec2(0.8, -0.6))
        + sin(0.013 * flat_place.x + 1.6 * sin(0.009 * flat_place.y));
    let up = site.place.y + ground.bend * (roll + 0.7 * depth.broad.z + 0.16 * depth.fine.z);
    return fract(up / ground.bed_height);
}

// What of the rock is the seam, which lies in the beds.
fn seam_in(rock: f32, depth: Depth, within: f32) -> f32 {
    let off = abs(within - 0.61) * ground.bed_height + 0.15 * depth.fine.x + 0.12 * depth.grit.y;
    return rock * step(0.001, ground.seam_thickness) * smoothstep(0.8, 1.0, depth.sunk / max(ground.seam_depth, 0.01))
        * (1.0 - smoothstep(0.30, 0.52, off / max(ground.seam_thickness, 0.001)));
}

// What of the rock is a vein. Veins are where two kinds of noise cross 0 together: threads in space. They thin out, so that
// heights of the textures draw their outline.
fn vein_in(rock: f32, depth: Depth) -> f32 {
    let thread = length(depth.fine.yw + 0.25 * depth.broad.yw + 0.05 * depth.grit.zw);
    let width = 0.22 * ground.vein_thickness * smoothstep(-0.1, 0.25, depth.broad.x);
    return rock * step(0.001, ground.vein_thickness) * smoothstep(0.8, 1.0, depth.sunk / max(ground.vein_depth, 0.01))
        * (1.0 - smoothstep(0.25, 1.0, thread / max(width, 0.001)));
}

// Lays rock in four beds, each as thick as noise has it: borders stray from the quarters by up to 0.36 of one.
fn lay_beds(mass: Mass, rock: f32, depth: Depth, within: f32) -> Mass {
    let bed = within * 4.0;
    let quarter = floor(bed);
    let broad = depth.broad;
    let borders = clamp(0.8 * vec4(broad.x, broad.w, broad.y, -broad.x), vec4(-0.36), vec4(0.36));
    let odd = quarter == 1.0 || quarter == 3.0;
    let below_it = select(select(borders.w, borders.x, odd), select(borders.y, borders.z, odd), quarter >= 2.0);
    let above_it = select(select(borders.x, borders.y, odd), select(borders.z, borders.w, odd), quarter >= 2.0);
    let part = bed - quarter;
    // The nearest border, and the bed below it.
    let is_low = part < 0.5;
    let off = select(part - 1.0 - above_it, part - below_it, is_low);
    let number = u32(quarter + select(4.0, 3.0, is_low)) % 4u;
    let here = ground.beds[number];
    let next = ground.beds[(number + 1u) % 4u];
    let soft = min(0.02 * ground.bed_height, 0.5);
    let passed = smoothstep(-soft, soft, 0.25 * ground.bed_height * off + 0.7 * soft * depth.grit.x);
    // Weather leaves a crust, which hides the beds of natural faces in patches.
    let spread = smoothstep(-0.03, 0.22, 0.8 * broad.y + 0.5 * depth.fine.x);
    let crust = rock * spread * (1.0 - smoothstep(0.4, 1.6, depth.sunk));
    let rest = rock - crust;
    var laid = put(mass, u32(ground.beds.x), crust);
    laid = put(laid, u32(here), rest * (1.0 - passed));
    return put(laid, u32(next), rest * passed);
}

// Puts rock with its seam and veins where it lies.
fn lay_rock(mass: Mass, rock: f32, site: Site, depth: Depth) -> Mass {
    let within = within_beds(site, depth);
    let seam = seam_in(rock, depth, within);
    let beside_seam = rock - seam;
    let vein = vein_in(beside_seam, depth);
    var laid = put(mass, u32(ground.seam_layer), seam);
    laid = put(laid, u32(ground.vein_layer), vein);
    return lay_beds(laid, beside_seam - vein, depth, within);
}

// What vertices say, and below the surface what lies there.
fn ground_at(in: Varying, site: Site, broad: vec4<f32>, fine: vec4<f32>) -> Mass {
    let given = Mass(in.weights_0, in.weights_1, in.weights_2, in.weights_3);
    let own = in.origin.z;
    let cover = in.origin.y;
    let depth = depth_at(site, max(in.origin.x, 0.0), broad, fine);
    let steep = 1.0 - smoothstep(ground.bare, ground.skinned, site.normal.y + 0.08 * fine.y);
    let bare = own * max(steep, smoothstep(0.10, 0.40, depth.ragged));
    let kinds = Mass(kinds_from(0u), kinds_from(4u), kinds_from(8u), kinds_from(12u));
    var mass = Mass(
        less_strata(given.a, kinds.a, own, bare),
        less_strata(given.b, kinds.b, own, bare),
        less_strata(given.c, kinds.c, own, bare),
        less_strata(given.d, kinds.d, own, bare),
    );
    // What the strata fill: under turf, and where the ground itself shows.
    let taken = given.a + given.b + given.c + given.d - (mass.a + mass.b + mass.c + mass.d);
    let all = dot(taken, vec4(1.0));
    if all > 0.001 {
        let body = own * (
            dot(given.a, step(vec4(1.5), kinds.a)) + dot(given.b, step(vec4(1.5), kinds.b))
            + dot(given.c, step(vec4(1.5), kinds.c)) + dot(given.d, step(vec4(1.5), kinds.d)));
        let soil = soils(depth, max(all - body, 0.0), body, all, cover);
        mass = put(mass, u32(ground.soil_layer), soil.x);
        mass = put(mass, u32(ground.subsoil_layer), soil.y);
        let rock = max(all - soil.x - soil.y, 0.0);
        if rock > 0.0 {
            mass = lay_rock(mass, rock, site, depth);
        }
    }
    return mass;
}
#endif

// Where layers meet, they do so in patches, and not along the lattice.
fn in_patches(mass: Mass, site: Site) -> Mass {
    let most = max(max(mass.a, mass.b), max(mass.c, mass.d));
    if max(max(most.x, most.y), max(most.z, most.w)) < 0.985 {
        let patches = clamp(1.0 + 1.5 * noise_at(site.place, 4.5), vec4(0.15), vec4(2.0));
        return Mass(mass.a * patches, mass.b * patches, mass.c * patches, mass.d * patches);
    }
    return mass;
}

// The layers that show in a place.
fn choose(in: Varying, site: Site, broad: vec4<f32>, fine: vec4<f32>) -> Choice {
#ifdef GROUND_ATTRIBUTES
    let mass = in_patches(ground_at(in, site, broad, fine), site);
#else
    let mass = in_patches(Mass(vec4(1.0, 0.0, 0.0, 0.0), vec4(0.0), vec4(0.0), vec4(0.0)), site);
#endif
    var best = Choice(vec3(0u), vec4(0.0));
    best = offer_four(best, 0u, mass.a);
    best = offer_four(best, 4u, mass.b);
    best = offer_four(best, 8u, mass.c);
    best = offer_four(best, 12u, mass.d);
    // Less what the first one that is left out has, so that none comes or goes with a jump.
    let left_out = select(best.weights.z, best.weights.w, is_fine());
    best.weights = max(best.weights - left_out, vec4(0.0));
    // Where all are alike, little is left of any: the first one counts as whole, or the place would be black.
    best.weights.x = max(best.weights.x, 0.00001);
    best.weights /= best.weights.x;
    return best;
}

// A normal bent towards the eye, where relief turns away from it more than the ground does: what can be seen is not turned
// away, and a lamp at the eye lights it.
fn facing(normal: vec3<f32>, ground_normal: vec3<f32>, eye: vec3<f32>) -> vec3<f32> {
    let lacking = 0.3 * max(dot(ground_normal, eye), 0.0) - dot(normal, eye);
    return normalize(normal + max(lacking, 0.0) * eye);
}

@fragment
fn fragment(in: Varying, @builtin(front_facing) is_front: bool) -> FragmentOutput {
#ifdef VISIBILITY_RANGE_DITHER
    visibility_range_dither(in.position, in.visibility_range_dither);
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
    var sides = site.normal * site.normal;
    sides = sides * sides;
    sides = sides * sides;
    // The weakest side is left out, but where all are alike.
    sides = max(sides - 0.995 * min(sides.x, min(sides.y, sides.z)), vec3(0.0));
    sides = max(sides / (sides.x + sides.y + sides.z) - 0.06, vec3(0.0));
    site.sides = sides / (sides.x + sides.y + sides.z);
    let distance = length(view.world_position - in.world_position.xyz);
    site.far = smoothstep(ground.near, ground.far, distance);

    let broad = noise_at(site.place, 150.0);
    let fine = noise_at(site.place, 27.0);
    let choice = choose(in, site, broad, fine);

    // What stands high covers what lies low.
    var sum = Texels(vec4(0.0), vec2(0.0), vec3(0.0));
    var metallic = 0.0;
    var total = 0.0001;
    for (var i = 0; i < 3; i++) {
        let weight = select(select(choice.weights.z, choice.weights.y, i == 1), choice.weights.x, i == 0);
        if weight > 0.01 {
            let layer = select(select(choice.layers.z, choice.layers.y, i == 1), choice.layers.x, i == 0);
            let texels = layer_at(layer, site);
            var score = weight * (0.3 + texels.color.a);
            score *= score * score;
            sum.color += texels.color * score;
            sum.finish += texels.finish * score;
            sum.lean += texels.lean * score;
            metallic += ground.layers[layer].metallic * score;
            total += score;
        }
    }
    var color = sum.color.rgb / total;
    let finish = sum.finish / total;
    var lean = sum.lean / total;
    metallic /= total;
    // No two places have quite the same tint.
    let mood = clamp(0.9 * broad.y + 0.55 * fine.w, -1.0, 1.0) * ground.variety;
    color *= mix(vec3(1.0), vec3(1.32, 1.16, 0.90), max(mood, 0.0)) * mix(vec3(1.0), vec3(0.66, 0.76, 0.78), max(-mood, 0.0));
    color *= 1.0 + (0.16 + 0.3 * site.far) * ground.variety * fine.z;

    pbr_input.material.base_color = vec4(pbr_input.material.base_color.rgb * color, 1.0);
    pbr_input.material.perceptual_roughness = clamp(finish.y, 0.089, 1.0);
    pbr_input.material.metallic = metallic;
    pbr_input.diffuse_occlusion *= finish.x;
    pbr_input.specular_occlusion *= finish.x;
    lean -= dot(lean, site.normal) * site.normal;
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
