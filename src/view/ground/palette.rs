//! The layers that the project paints itself, from noise alone: rock, grass, sand, snow, clay, concrete, coal, gold,
//! soil, sandstone, shale, gravel, iron and copper.

use super::noise::{cells, chance, gradient, octaves, ridges, smooth};

/// A point of a layer before it becomes texels.
#[derive(Clone, Copy, Debug)]
pub(super) struct Point {
    /// sRGB, 0 to 1.
    pub color: [f32; 3],
    /// 0 low to 1 high, for relief, and for blending: higher points stay on top.
    pub height: f32,
    /// Perceptual roughness.
    pub roughness: f32,
}

/// How a layer is painted.
pub(super) struct Recipe {
    /// The recipe's name, for logs.
    pub name: &'static str,
    /// Metres from height 0 to height 1, as wide as [`Recipe::metres`].
    pub relief: f32,
    /// Metres that the picture covers.
    pub metres: f32,
    /// The point at a position, both coordinates from 0 to 1.
    pub paint: fn(f32, f32) -> Point,
    /// Blades or stones scattered over it.
    pub scatter: Option<Scatter>,
}

/// Strokes over a layer, long and thin like grass.
pub(super) struct Scatter {
    /// How many, for a picture of 512 x 512 texels.
    pub count: u32,
    /// Length and width, as parts of the picture.
    pub size: [f32; 2],
    /// sRGB of the darkest and the brightest.
    pub colors: [[f32; 3]; 2],
}

/// All layers, in the order of the default material ids.
pub(super) const RECIPES: [Recipe; 16] = [
    Recipe { name: "rock", relief: 0.45, metres: 6.0, paint: rock, scatter: None },
    Recipe {
        name: "grass",
        relief: 0.10,
        metres: 3.0,
        paint: turf,
        scatter: Some(Scatter {
            count: 24_000,
            size: [0.055, 0.0032],
            colors: [[0.115, 0.17, 0.055], [0.43, 0.48, 0.20]],
        }),
    },
    Recipe { name: "sand", relief: 0.07, metres: 4.0, paint: sand, scatter: None },
    Recipe { name: "snow", relief: 0.12, metres: 6.0, paint: snow, scatter: None },
    Recipe { name: "clay", relief: 0.10, metres: 4.0, paint: clay, scatter: None },
    Recipe { name: "concrete", relief: 0.02, metres: 4.0, paint: concrete, scatter: None },
    Recipe { name: "coal", relief: 0.18, metres: 2.5, paint: coal, scatter: None },
    Recipe { name: "gold", relief: 0.10, metres: 2.5, paint: gold, scatter: None },
    Recipe { name: "soil", relief: 0.14, metres: 3.0, paint: soil, scatter: None },
    Recipe { name: "sandstone", relief: 0.28, metres: 5.0, paint: sandstone, scatter: None },
    Recipe { name: "shale", relief: 0.26, metres: 4.0, paint: shale, scatter: None },
    Recipe { name: "gravel", relief: 0.16, metres: 2.5, paint: gravel, scatter: None },
    Recipe { name: "iron", relief: 0.14, metres: 2.5, paint: iron, scatter: None },
    Recipe { name: "copper", relief: 0.12, metres: 2.5, paint: copper, scatter: None },
    // What bedded layers show from above; no materials of their own.
    Recipe { name: "sandstone from above", relief: 0.22, metres: 5.0, paint: sandstone_top, scatter: None },
    Recipe { name: "shale from above", relief: 0.18, metres: 4.0, paint: shale_top, scatter: None },
];

fn mix(a: [f32; 3], b: [f32; 3], t: f32) -> [f32; 3] {
    std::array::from_fn(|i| a[i] + (b[i] - a[i]) * t)
}

fn lit(color: [f32; 3], factor: f32) -> [f32; 3] {
    color.map(|part| part * factor)
}

/// Grey and craggy, with lichen. Joints are a matter of relief more than of colour, and most of them end somewhere: a
/// net of dark lines would make the repetition of the layer visible.
fn rock(u: f32, v: f32) -> Point {
    let (wu, wv) = (u + 0.06 * octaves(u, v, 4, 4, 11), v + 0.06 * octaves(u, v, 4, 4, 12));
    let crag = ridges(wu, wv, 3, 6, 13);
    let slab = cells(wu, wv, 5, 14);
    let small = cells(wu, wv, 13, 15);
    let open = smooth(-0.15, 0.45, octaves(u, v, 3, 3, 20));
    let crack = 1.0 - open * (1.0 - smooth(0.0, 0.07, slab.second - slab.nearest));
    let chip = 1.0 - 0.6 * (1.0 - open) * (1.0 - smooth(0.0, 0.10, small.second - small.nearest));
    let grain = octaves(u, v, 40, 4, 16);
    let tilt = slab.offset[0] * (slab.name - 0.5) + slab.offset[1] * (slab.name * 7.0 % 1.0 - 0.5);
    let facet = 0.5 + 0.5 * tilt * smooth(0.0, 0.3, slab.second - slab.nearest);
    let lump = octaves(wu, wv, 7, 5, 21);
    let height = 0.22 * facet + 0.42 * crag * crag + 0.26 * lump + 0.05 * grain + 0.08;
    let height = (height * (0.70 + 0.30 * crack) * (0.88 + 0.12 * chip)).clamp(0.0, 1.0);
    let tone = 0.40 + 0.10 * (slab.name - 0.5) + 0.18 * octaves(u, v, 3, 5, 17) + 0.20 * lump + 0.16 * grain;
    let color = mix([0.33, 0.305, 0.275], [0.62, 0.595, 0.56], tone.clamp(0.0, 1.0) * 1.15);
    let rust = smooth(0.20, 0.75, octaves(u, v, 5, 5, 18));
    let color = mix(color, [0.49, 0.385, 0.28], 0.45 * rust);
    let lichen = smooth(0.25, 0.60, octaves(u, v, 9, 5, 19)) * smooth(0.3, 0.6, height);
    let color = mix(color, [0.52, 0.54, 0.40], 0.30 * lichen);
    let dark = (0.86 + 0.14 * crack) * (0.95 + 0.05 * chip) * (0.70 + 0.60 * height);
    Point { color: lit(color, dark), height, roughness: 0.88 + 0.08 * grain }
}

/// The ground between blades of grass: moss, dead leaves of grass and bare earth, in patches.
fn turf(u: f32, v: f32) -> Point {
    let clump = octaves(u, v, 10, 4, 21);
    let patch = octaves(u, v, 3, 4, 22);
    let litter = ridges(u + 0.02 * clump, v, 34, 2, 23);
    let color = mix([0.125, 0.135, 0.06], [0.24, 0.25, 0.11], 0.5 + 0.5 * clump);
    let color = mix(color, [0.25, 0.19, 0.115], 0.65 * smooth(0.10, 0.45, patch + 0.3 * clump));
    let color = mix(color, [0.47, 0.41, 0.23], 0.5 * smooth(0.90, 0.97, litter));
    Point { color, height: 0.18 + 0.12 * clump + 0.05 * litter, roughness: 0.95 }
}

/// Ripples of fine grains, blown over a surface that dips and swells, with coarser grains in the troughs.
fn sand(u: f32, v: f32) -> Point {
    let swell = octaves(u, v, 2, 3, 34);
    let bend = 0.05 * octaves(u, v, 3, 3, 31) + 0.012 * octaves(u, v, 11, 2, 36);
    let phase = (v + bend) * 18.0;
    let wave = phase - phase.floor();
    // Gentle on one side and steep on the other, like blown sand.
    let ripple = if wave < 0.72 { smooth(0.0, 0.72, wave) } else { 1.0 - smooth(0.72, 1.0, wave) };
    let calm = 0.25 + 0.75 * smooth(-0.45, 0.25, octaves(u, v, 3, 2, 32));
    let grain = gradient(u, v, 170, 33);
    let coarse = smooth(0.35, 0.7, gradient(u, v, 96, 37)) * (1.0 - ripple * calm);
    let height = 0.38 + 0.22 * (ripple - 0.4) * calm + 0.26 * swell + 0.05 * grain;
    let tone =
        0.5 + 0.20 * octaves(u, v, 6, 3, 35) + 0.14 * grain + 0.16 * (ripple - 0.5) * calm + 0.16 * swell;
    let color = mix([0.65, 0.53, 0.355], [0.87, 0.77, 0.58], tone.clamp(0.0, 1.0));
    Point {
        color: mix(color, [0.50, 0.41, 0.30], 0.5 * coarse),
        height: height.clamp(0.0, 1.0),
        roughness: 0.93,
    }
}

/// Soft drifts, carved by the wind, with a crust that glitters where it froze.
fn snow(u: f32, v: f32) -> Point {
    let (wu, wv) = (u + 0.05 * octaves(u, v, 3, 3, 43), v + 0.02 * octaves(u, v, 5, 3, 44));
    let drift = octaves(u, v, 2, 4, 41);
    let carved = ridges(wu, wv, 5, 3, 45);
    let ridge = smooth(0.62, 0.98, carved);
    let crust = octaves(u, v, 48, 3, 42);
    let ice = smooth(0.15, 0.55, octaves(u, v, 4, 4, 46));
    let height = 0.40 + 0.34 * drift + 0.20 * ridge + 0.035 * crust * (1.0 - 0.6 * ice);
    let tone = (0.50 + 0.42 * drift + 0.22 * ridge + 0.22 * crust).clamp(0.0, 1.0);
    let color = mix([0.76, 0.825, 0.915], [0.955, 0.965, 0.98], tone);
    let color = mix(color, [0.80, 0.865, 0.935], 0.45 * ice);
    Point { color, height: height.clamp(0.0, 1.0), roughness: 0.70 + 0.10 * crust - 0.16 * ice }
}

/// Red-brown and dense: smeared where it is moist, cracked where it dried.
fn clay(u: f32, v: f32) -> Point {
    let (wu, wv) = (u + 0.03 * octaves(u, v, 6, 4, 51), v + 0.03 * octaves(u, v, 6, 4, 52));
    let plate = cells(wu, wv, 7, 53);
    let dry = smooth(-0.20, 0.25, octaves(u, v, 3, 3, 56));
    let crack = 1.0 - dry * (1.0 - smooth(0.0, 0.07, plate.second - plate.nearest));
    let smear = octaves(u, v, 5, 5, 54);
    let drag = octaves(u, v + 0.04 * smear, 18, 3, 57);
    let grain = octaves(u, v, 60, 2, 55);
    // Dry plates curl up at their rims.
    let curl = dry * smooth(0.35, 0.05, plate.second - plate.nearest);
    let height = (0.50 + 0.20 * smear + 0.10 * drag + 0.05 * grain + 0.10 * curl) * (0.50 + 0.50 * crack);
    let tone =
        (0.42 + 0.30 * smear + 0.16 * drag + 0.10 * grain + 0.22 * dry * (plate.name - 0.3)).clamp(0.0, 1.0);
    let color = mix([0.33, 0.20, 0.135], [0.59, 0.40, 0.29], tone);
    Point {
        color: lit(color, 0.62 + 0.38 * crack),
        height: height.clamp(0.0, 1.0),
        roughness: 0.66 + 0.20 * dry + 0.1 * grain,
    }
}

/// Cast in panels, with pores and stains.
fn concrete(u: f32, v: f32) -> Point {
    let edge = |at: f32| {
        let at = (at * 2.0).fract();
        at.min(1.0 - at)
    };
    let joint = smooth(0.004, 0.012, edge(u).min(edge(v)));
    let pore = cells(u, v, 40, 61);
    let hole = if pore.name > 0.72 { smooth(0.10, 0.2, pore.nearest) } else { 1.0 };
    let stain = octaves(u, v, 4, 4, 62);
    let grain = octaves(u, v, 90, 2, 63);
    let tone = (0.5 + 0.3 * stain + 0.16 * grain).clamp(0.0, 1.0);
    let color = mix([0.50, 0.50, 0.49], [0.68, 0.675, 0.66], tone);
    let height = (0.8 + 0.05 * grain) * (0.3 + 0.7 * joint) * (0.6 + 0.4 * hole);
    Point {
        color: lit(color, (0.55 + 0.45 * joint) * (0.7 + 0.3 * hole)),
        height,
        roughness: 0.8 + 0.06 * grain,
    }
}

/// Stones of a broken material: facets that lean this way and that.
fn facets(u: f32, v: f32, period: i32, seed: u32) -> (f32, f32, f32) {
    let (wu, wv) = (u + 0.012 * octaves(u, v, 8, 2, seed), v + 0.012 * octaves(u, v, 8, 2, seed + 1));
    let big = cells(wu, wv, period, seed + 2);
    let lean = [big.name * 13.0 % 1.0 - 0.5, big.name * 29.0 % 1.0 - 0.5];
    let tilt = big.offset[0] * lean[0] + big.offset[1] * lean[1];
    let edge = smooth(0.0, 0.12, big.second - big.nearest);
    ((0.5 + 0.7 * tilt).clamp(0.0, 1.0), edge, big.name)
}

/// Black blocks in bands, dull ones and shiny ones.
fn coal(u: f32, v: f32) -> Point {
    let bend = 0.02 * octaves(u, v, 5, 3, 70);
    let (band, _) = laminae(u, v + bend, 10, 0.03, 69);
    let (tilt, edge, name) = facets(u, v, 8, 71);
    let (small, chip, chipped) = facets(u, v, 25, 75);
    let open = smooth(-0.25, 0.3, octaves(u, v, 4, 3, 68));
    let joint = 1.0 - open * (1.0 - edge);
    let height =
        (0.12 + 0.55 * tilt + 0.30 * small + 0.12 * band) * (0.5 + 0.5 * joint) * (0.88 + 0.12 * chip);
    let shiny = smooth(0.45, 0.7, band + 0.25 * (chipped - 0.5));
    let tone = 0.25 + 0.4 * name * small + 0.18 * octaves(u, v, 40, 3, 79) + 0.15 * (1.0 - shiny);
    let color = mix([0.040, 0.040, 0.046], [0.175, 0.172, 0.178], tone.clamp(0.0, 1.0));
    Point {
        color: lit(color, 0.6 + 0.4 * joint),
        height: height.clamp(0.0, 1.0),
        roughness: 0.78 - 0.34 * shiny + 0.08 * chipped,
    }
}

/// Nuggets and threads in dark quartz. The metal is high and the stone low, so where a vein thins out, the metal
/// continues for a short distance into the surrounding material.
fn gold(u: f32, v: f32) -> Point {
    let (tilt, edge, name) = facets(u, v, 8, 81);
    let (wu, wv) = (u + 0.07 * octaves(u, v, 4, 4, 85), v + 0.07 * octaves(u, v, 4, 4, 86));
    let rich = octaves(u, v, 3, 3, 90);
    let vein = smooth(0.86 - 0.05 * rich, 0.96, ridges(wu, wv, 4, 2, 87));
    let nugget = cells(wu, wv, 15, 88);
    let size = 0.12 + 0.30 * (nugget.name - 0.6) + 0.08 * rich;
    let lump = if nugget.name > 0.6 { 1.0 - smooth(0.5 * size, 1.3 * size, nugget.nearest) } else { 0.0 };
    let metal = (vein + lump).min(1.0);
    let stone = mix([0.27, 0.245, 0.23], [0.45, 0.42, 0.395], name * 0.5 + 0.2 * tilt + 0.15 + 0.2 * rich);
    let shine =
        mix([0.66, 0.44, 0.10], [0.98, 0.80, 0.34], (0.5 + 0.6 * octaves(u, v, 24, 3, 89)).clamp(0.0, 1.0));
    let height = (0.26 * tilt * (0.5 + 0.5 * edge) + 0.6 * metal).clamp(0.0, 1.0);
    Point { color: mix(lit(stone, 0.85 + 0.15 * edge), shine, metal), height, roughness: 0.75 - 0.40 * metal }
}

/// Bands and lumps of red ore in dark stone, streaked by rust where water ran over them.
fn iron(u: f32, v: f32) -> Point {
    let (wu, wv) = (u + 0.05 * octaves(u, v, 4, 4, 125), v + 0.05 * octaves(u, v, 4, 4, 128));
    let (tilt, edge, name) = facets(u, v, 9, 121);
    let band = smooth(0.02, 0.32, octaves(wu, wv, 3, 4, 129));
    let lump = cells(wu, wv, 13, 126);
    let size = 0.18 + 0.34 * lump.name;
    let ore = (1.0 - smooth(0.6 * size, size, lump.nearest)) * smooth(0.25, 0.5, lump.name + 0.5 * band);
    let ore = (0.85 * band + ore).min(1.0);
    let streak = 0.6 * smooth(0.0, 0.5, octaves(u + 0.01 * tilt, v, 12, 3, 124));
    let stone = mix([0.20, 0.185, 0.18], [0.35, 0.325, 0.31], 0.5 * name + 0.4 * tilt);
    let stone = mix(stone, [0.42, 0.25, 0.165], 0.55 * streak);
    let rust = mix(
        [0.27, 0.12, 0.08],
        [0.60, 0.31, 0.185],
        (0.45 + 0.7 * octaves(u, v, 22, 4, 127)).clamp(0.0, 1.0),
    );
    let rough = octaves(u, v, 30, 3, 130);
    let height = (0.10 + 0.38 * tilt * (0.5 + 0.5 * edge) + 0.34 * ore + 0.10 * rough * ore).clamp(0.0, 1.0);
    Point {
        color: mix(lit(stone, 0.75 + 0.25 * edge), rust, ore),
        height,
        roughness: 0.84 - 0.20 * ore * lump.name,
    }
}

/// Green crusts and threads of bright metal in pale stone.
fn copper(u: f32, v: f32) -> Point {
    let (tilt, edge, name) = facets(u, v, 7, 131);
    let (wu, wv) = (u + 0.06 * octaves(u, v, 5, 4, 135), v + 0.06 * octaves(u, v, 5, 4, 136));
    let crust = smooth(-0.05, 0.30, octaves(wu, wv, 5, 4, 137));
    let thread = smooth(0.90, 0.97, ridges(wu, wv, 5, 2, 138));
    let stone = mix([0.34, 0.31, 0.28], [0.50, 0.46, 0.42], 0.5 * name + 0.3 * tilt);
    let green =
        mix([0.13, 0.34, 0.27], [0.36, 0.63, 0.52], (0.5 + 0.6 * octaves(u, v, 26, 3, 139)).clamp(0.0, 1.0));
    let color = mix(mix(lit(stone, 0.85 + 0.15 * edge), green, 0.9 * crust), [0.80, 0.44, 0.26], thread);
    let height = (0.30 * tilt * (0.5 + 0.5 * edge) + 0.25 * crust + 0.4 * thread).clamp(0.0, 1.0);
    Point { color, height, roughness: 0.82 - 0.35 * thread }
}

/// Crumbs, clods, stones of all sizes, and rootlets.
fn soil(u: f32, v: f32) -> Point {
    let crumb = octaves(u, v, 20, 4, 91);
    let (wu, wv) = (u + 0.012 * crumb, v + 0.012 * octaves(u, v, 20, 3, 97));
    let clod = cells(wu, wv, 18, 92);
    let lump = 1.0 - smooth(0.1, 0.6, clod.nearest);
    let (large, on_large) = pebble(u, v, 9, 0.80, 93);
    let (small, on_small) = pebble(u, v, 27, 0.72, 98);
    let stone = if large > small { large } else { small };
    let name = if large > small { on_large } else { on_small };
    let height = (0.30 + 0.2 * crumb + 0.22 * lump + 0.34 * stone).clamp(0.0, 1.0);
    let damp = octaves(u, v, 3, 4, 94);
    let tone = (0.42 + 0.4 * crumb + 0.22 * (clod.name - 0.5) + 0.26 * damp).clamp(0.0, 1.0);
    let earth = mix([0.16, 0.105, 0.062], [0.39, 0.275, 0.18], tone);
    let root = smooth(0.93, 0.985, ridges(u + 0.02 * crumb, v, 5, 1, 95))
        * smooth(-0.2, 0.3, octaves(u, v, 4, 2, 96));
    let earth = mix(earth, [0.50, 0.41, 0.28], 0.6 * root);
    let grey = mix([0.34, 0.29, 0.235], [0.53, 0.48, 0.41], name);
    let color = mix(earth, grey, smooth(0.05, 0.35, stone));
    Point { color: lit(color, 0.7 + 0.45 * height), height, roughness: 0.95 - 0.08 * stone }
}

/// Stones that lie apart, irregular: one in each of some cells. The height, and a random number for each stone.
fn pebble(u: f32, v: f32, period: i32, seldom: f32, seed: u32) -> (f32, f32) {
    let bump = 0.10 / period as f32;
    let (wu, wv) = (
        u + bump * octaves(u, v, 2 * period, 2, seed + 1),
        v + bump * octaves(u, v, 2 * period, 2, seed + 2),
    );
    let stone = cells(wu, wv, period, seed);
    if stone.name < seldom {
        return (0.0, 0.0);
    }
    let number = (stone.name - seldom) / (1.0 - seldom);
    let size = 0.16 + 0.26 * (number * 7.0 % 1.0);
    // Longer one way than the other, and flat on top.
    let slant = number * 13.0 % 1.0;
    let across = stone.offset[0] * slant + stone.offset[1] * (1.0 - slant);
    let far = (stone.nearest * stone.nearest + 0.9 * across * across) / (size * size);
    let dome = (1.0 - far).max(0.0);
    ((2.0 * dome).min(0.75 + 0.25 * dome), number * 29.0 % 1.0)
}

/// Layers along `v`, each with a number and a thickness of its own: laminae of sediment. The number, and the way to the
/// next border, 0 there and 1 in the middle.
fn laminae(u: f32, v: f32, count: i32, bend: f32, seed: u32) -> (f32, f32) {
    let at = (v + bend * octaves(u, v, 3, 4, seed)) * count as f32;
    let border = |number: i32| number as f32 + 0.7 * (chance(number.rem_euclid(count), 8, seed) - 0.5);
    let near = at.floor() as i32;
    let layer = if at < border(near) {
        near - 1
    } else if at < border(near + 1) {
        near
    } else {
        near + 1
    };
    let (low, high) = (border(layer), border(layer + 1));
    let within = (at - low) / (high - low);
    (chance(layer.rem_euclid(count), 7, seed), within.min(1.0 - within) * 2.0)
}

/// Sheets that lie flat, each worn away up to a ragged border: what [`laminae`] are from above. As they, a number and
/// the way to the next border.
fn sheets(u: f32, v: f32, count: f32, seed: u32) -> (f32, f32) {
    let at = (1.5 + octaves(u, v, 2, 6, seed)) * count;
    let within = at - at.floor();
    (chance(at.floor() as i32, 9, seed), within.min(1.0 - within) * 2.0)
}

/// Warm, in soft beds.
fn sandstone(u: f32, v: f32) -> Point {
    let (bed, middle) = laminae(u, v, 9, 0.035, 101);
    let (fine, _) = laminae(u, v, 46, 0.035, 101);
    let grain = octaves(u, v, 70, 3, 104);
    let worn = octaves(u, v, 5, 5, 105);
    // Joints between beds open and close.
    let ledge = 1.0 - smooth(-0.35, 0.35, octaves(u, v, 4, 3, 106)) * (1.0 - smooth(0.0, 0.35, middle));
    let height = ((0.35 + 0.30 * bed) * (0.65 + 0.35 * ledge) + 0.08 * fine + 0.24 * worn + 0.06 * grain)
        .clamp(0.0, 1.0);
    let color = sand_color(0.25 + 0.26 * bed + 0.18 * fine + 0.20 * worn + 0.14 * grain);
    let color = mix(color, [0.56, 0.36, 0.25], 0.45 * smooth(0.72, 0.95, bed + 0.15 * worn));
    Point { color: lit(color, 0.82 + 0.18 * ledge), height, roughness: 0.92 }
}

/// Sandstone from above: grain, and in some places a sheet that is worn away.
fn sandstone_top(u: f32, v: f32) -> Point {
    let (sheet, middle) = sheets(u, v, 2.5, 131);
    let grain = octaves(u, v, 70, 3, 134);
    let worn = octaves(u, v, 5, 5, 135);
    let edge = smooth(0.0, 0.12, middle);
    let height = (0.34 + 0.16 * sheet + 0.26 * worn + 0.07 * grain).clamp(0.0, 1.0) * (0.9 + 0.1 * edge);
    let color = sand_color(0.38 + 0.14 * sheet + 0.26 * worn + 0.16 * grain);
    let rust = smooth(0.1, 0.8, octaves(u, v, 3, 5, 136));
    let color = mix(color, [0.56, 0.36, 0.25], 0.30 * rust);
    Point { color: lit(color, 0.92 + 0.06 * edge), height, roughness: 0.93 }
}

fn sand_color(tone: f32) -> [f32; 3] {
    mix([0.45, 0.35, 0.255], [0.74, 0.64, 0.485], tone.clamp(0.0, 1.0))
}

/// Dark plates, thin and sharp.
fn shale(u: f32, v: f32) -> Point {
    let (plate, middle) = laminae(u, v, 22, 0.03, 111);
    let block = cells(u + 0.02 * octaves(u, v, 6, 4, 112), v * 0.999, 7, 114);
    let open = smooth(-0.1, 0.4, octaves(u, v, 4, 3, 113));
    let joint = 1.0 - open * (1.0 - smooth(0.0, 0.05, block.second - block.nearest));
    let ledge = smooth(0.0, 0.45, middle);
    let worn = octaves(u, v, 8, 5, 115);
    let height =
        ((0.25 + 0.4 * plate) * (0.65 + 0.35 * ledge) * (0.75 + 0.25 * joint) + 0.20 * worn).clamp(0.0, 1.0);
    let color = shale_color(u, v, 0.3 + 0.36 * plate + 0.25 * worn + 0.12 * (block.name - 0.5));
    Point {
        color: lit(color, (0.76 + 0.24 * ledge) * (0.84 + 0.16 * joint)),
        height,
        roughness: 0.7 + 0.12 * worn,
    }
}

/// Shale from above: flakes.
fn shale_top(u: f32, v: f32) -> Point {
    let (sheet, middle) = sheets(u, v, 6.0, 141);
    let flake = cells(u + 0.03 * octaves(u, v, 6, 4, 142), v + 0.03 * octaves(u, v, 6, 4, 143), 9, 144);
    let worn = octaves(u, v, 8, 5, 145);
    let edge = smooth(0.0, 0.25, middle);
    let height =
        (0.20 + 0.35 * sheet + 0.10 * flake.name + 0.20 * worn).clamp(0.0, 1.0) * (0.85 + 0.15 * edge);
    let color = shale_color(u, v, 0.32 + 0.24 * sheet + 0.25 * worn + 0.16 * (flake.name - 0.5));
    Point { color: lit(color, 0.82 + 0.14 * edge), height, roughness: 0.7 + 0.12 * worn }
}

fn shale_color(u: f32, v: f32, tone: f32) -> [f32; 3] {
    let color = mix([0.18, 0.185, 0.205], [0.42, 0.425, 0.44], tone.clamp(0.0, 1.0));
    mix(color, [0.40, 0.32, 0.255], 0.35 * smooth(0.1, 0.6, octaves(u, v, 4, 5, 116)))
}

/// Broken stones of many colours and sizes, worn at their corners.
fn gravel(u: f32, v: f32) -> Point {
    let bump = octaves(u, v, 40, 3, 123);
    let (wu, wv) = (u + 0.010 * octaves(u, v, 16, 3, 124), v + 0.010 * octaves(u, v, 16, 3, 125));
    let stone_at = |period: i32, seed: u32| {
        let stone = cells(wu, wv, period, seed);
        let lean = [stone.name * 13.0 % 1.0 - 0.5, stone.name * 29.0 % 1.0 - 0.5];
        let tilt = 0.5 + 0.9 * (stone.offset[0] * lean[0] + stone.offset[1] * lean[1]);
        let edge = stone.second - stone.nearest;
        let body = smooth(0.02, 0.34, edge);
        (body * (0.55 + 0.45 * tilt), body, stone.name)
    };
    let (big, small) = (stone_at(9, 121), stone_at(24, 122));
    // Large ones lie among small ones.
    let is_large = big.2 > 0.52 && big.1 > 0.25;
    let (height, body, name) =
        if is_large { (0.30 + 0.70 * big.0, big.1, big.2) } else { (0.55 * small.0, small.1, small.2) };
    let stone = mix([0.34, 0.325, 0.305], [0.66, 0.635, 0.59], name * 3.0 % 1.0);
    let stone = mix(stone, [0.49, 0.375, 0.29], if name * 17.0 % 1.0 > 0.68 { 0.65 } else { 0.0 });
    let stone = mix(stone, [0.27, 0.285, 0.30], if name * 23.0 % 1.0 > 0.75 { 0.7 } else { 0.0 });
    let color = mix([0.16, 0.135, 0.11], stone, smooth(0.1, 0.6, body));
    Point {
        color: lit(color, 0.88 + 0.16 * bump),
        height: (0.08 + 0.85 * height + 0.04 * bump).clamp(0.0, 1.0),
        roughness: 0.84,
    }
}
