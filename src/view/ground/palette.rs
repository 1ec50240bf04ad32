//! The layers that the project paints itself, from noise alone: rock, grass, sand, snow, clay, concrete, coal, gold, soil,
//! sandstone, shale, gravel, iron and copper.

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
    /// Its name, for logs.
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
            count: 26_000,
            size: [0.045, 0.0028],
            colors: [[0.13, 0.19, 0.07], [0.44, 0.48, 0.21]],
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

/// Grey and craggy, with lichen. Joints are a matter of relief more than of colour, and most of them end somewhere: a net of
/// dark lines would make the repetition of the layer visible.
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

/// The soil between blades of grass.
fn turf(u: f32, v: f32) -> Point {
    let clump = octaves(u, v, 10, 4, 21);
    let color = mix([0.12, 0.14, 0.06], [0.23, 0.24, 0.11], 0.5 + 0.5 * clump);
    Point { color, height: 0.18 + 0.12 * clump, roughness: 0.95 }
}

/// Ripples of fine grains.
fn sand(u: f32, v: f32) -> Point {
    let bend = 0.05 * octaves(u, v, 3, 3, 31);
    let phase = (v + bend) * 16.0;
    let wave = phase - phase.floor();
    // Gentle on one side and steep on the other, like blown sand.
    let ripple = if wave < 0.7 { smooth(0.0, 0.7, wave) } else { 1.0 - smooth(0.7, 1.0, wave) };
    let calm = smooth(-0.35, 0.35, octaves(u, v, 3, 2, 32));
    let grain = gradient(u, v, 170, 33);
    let height = 0.35 + 0.32 * ripple * calm + 0.15 * octaves(u, v, 5, 3, 34) + 0.05 * grain;
    let tone = 0.5 + 0.22 * octaves(u, v, 6, 3, 35) + 0.16 * grain + 0.18 * (ripple - 0.5) * calm;
    let color = mix([0.66, 0.54, 0.36], [0.86, 0.76, 0.57], tone.clamp(0.0, 1.0));
    Point { color, height: height.clamp(0.0, 1.0), roughness: 0.93 }
}

/// Soft drifts with a crust.
fn snow(u: f32, v: f32) -> Point {
    let drift = octaves(u, v, 3, 4, 41);
    let crust = octaves(u, v, 36, 3, 42);
    let height = 0.5 + 0.35 * drift + 0.05 * crust;
    let color =
        mix([0.80, 0.85, 0.92], [0.955, 0.965, 0.98], (0.55 + 0.5 * drift + 0.25 * crust).clamp(0.0, 1.0));
    Point { color, height: height.clamp(0.0, 1.0), roughness: 0.62 + 0.12 * crust }
}

/// Red-brown, smooth, cracked where it dried.
fn clay(u: f32, v: f32) -> Point {
    let (wu, wv) = (u + 0.02 * octaves(u, v, 6, 3, 51), v + 0.02 * octaves(u, v, 6, 3, 52));
    let plate = cells(wu, wv, 8, 53);
    let crack = smooth(0.0, 0.06, plate.second - plate.nearest);
    let smear = octaves(u, v, 5, 4, 54);
    let grain = octaves(u, v, 60, 2, 55);
    let height = (0.62 + 0.22 * smear + 0.05 * grain) * (0.55 + 0.45 * crack);
    let tone = (0.5 + 0.35 * smear + 0.12 * grain + 0.2 * (plate.name - 0.5)).clamp(0.0, 1.0);
    let color = mix([0.35, 0.215, 0.145], [0.57, 0.385, 0.275], tone);
    Point {
        color: lit(color, 0.6 + 0.4 * crack),
        height: height.clamp(0.0, 1.0),
        roughness: 0.72 + 0.1 * grain,
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

/// Black and shiny.
fn coal(u: f32, v: f32) -> Point {
    let (tilt, edge, name) = facets(u, v, 9, 71);
    let (small, chip, _) = facets(u, v, 24, 75);
    let height = (0.7 * tilt + 0.3 * small) * (0.4 + 0.6 * edge) * (0.85 + 0.15 * chip);
    let tone = 0.3 + 0.5 * name * small + 0.1 * octaves(u, v, 40, 2, 79);
    let color = mix([0.045, 0.045, 0.05], [0.17, 0.17, 0.185], tone.clamp(0.0, 1.0));
    Point { color: lit(color, 0.5 + 0.5 * edge), height, roughness: 0.34 + 0.3 * name }
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

/// Rust-red lumps in dark stone, with a dull shine where they broke.
fn iron(u: f32, v: f32) -> Point {
    let (tilt, edge, name) = facets(u, v, 9, 121);
    let lump = cells(u + 0.02 * octaves(u, v, 9, 3, 125), v, 11, 126);
    let ore = 1.0 - smooth(0.22, 0.42, lump.nearest);
    let stone = mix([0.20, 0.185, 0.18], [0.34, 0.315, 0.30], 0.5 * name + 0.4 * tilt);
    let rust =
        mix([0.33, 0.15, 0.09], [0.62, 0.33, 0.20], (0.5 + 0.6 * octaves(u, v, 22, 3, 127)).clamp(0.0, 1.0));
    let height = (0.34 * tilt * (0.5 + 0.5 * edge) + 0.5 * ore).clamp(0.0, 1.0);
    Point { color: mix(lit(stone, 0.8 + 0.2 * edge), rust, ore), height, roughness: 0.80 - 0.22 * ore * name }
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

/// Crumbs, pebbles, and rootlets.
fn soil(u: f32, v: f32) -> Point {
    let crumb = octaves(u, v, 20, 4, 91);
    let clod = cells(u + 0.01 * crumb, v, 18, 92);
    let lump = 1.0 - smooth(0.1, 0.6, clod.nearest);
    let stone = cells(u, v, 14, 93);
    let pebble = if stone.name > 0.74 { 1.0 - smooth(0.16, 0.30, stone.nearest) } else { 0.0 };
    let height = (0.35 + 0.2 * crumb + 0.25 * lump + 0.3 * pebble).clamp(0.0, 1.0);
    let tone =
        (0.45 + 0.4 * crumb + 0.25 * (clod.name - 0.5) + 0.2 * octaves(u, v, 4, 3, 94)).clamp(0.0, 1.0);
    let earth = mix([0.17, 0.115, 0.07], [0.38, 0.27, 0.175], tone);
    let root = smooth(0.93, 0.985, ridges(u + 0.02 * crumb, v, 5, 1, 95))
        * smooth(-0.2, 0.3, octaves(u, v, 4, 2, 96));
    let earth = mix(earth, [0.50, 0.41, 0.28], 0.7 * root);
    let color = mix(earth, [0.47, 0.43, 0.37], pebble * (0.6 + 0.4 * stone.name));
    Point { color: lit(color, 0.7 + 0.45 * height), height, roughness: 0.95 - 0.1 * pebble }
}

/// Layers along `v`, each with a number and a thickness of its own: laminae of sediment. The number, and the way to the next
/// border, 0 there and 1 in the middle.
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

/// Sheets that lie flat, each worn away up to a ragged border: what [`laminae`] are from above. As they, a number and the
/// way to the next border.
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

/// Round stones of many colours.
fn gravel(u: f32, v: f32) -> Point {
    let big = cells(u, v, 11, 121);
    let small = cells(u, v, 26, 122);
    let dome = |cell: &super::noise::Cell, size: f32| {
        (1.0 - (cell.nearest / size) * (cell.nearest / size)).max(0.0).sqrt()
    };
    let (a, b) = (dome(&big, 0.52), 0.6 * dome(&small, 0.55));
    let (height, name, is_big) = if a > b { (a, big.name, 1.0) } else { (b, small.name, 0.0) };
    let grain = octaves(u, v, 60, 2, 123);
    let stone = mix([0.32, 0.30, 0.28], [0.66, 0.63, 0.58], name);
    let stone = mix(stone, [0.50, 0.38, 0.29], if name * 17.0 % 1.0 > 0.7 { 0.6 } else { 0.0 });
    let color = mix([0.15, 0.13, 0.11], stone, smooth(0.1, 0.45, height));
    Point {
        color: lit(color, 0.8 + 0.1 * grain + 0.1 * is_big),
        height: (0.1 + 0.85 * height).clamp(0.0, 1.0),
        roughness: 0.8,
    }
}
