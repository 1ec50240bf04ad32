//! Small pictures, drawn with letters: the name of the game, the tools, and a swatch for each material.

use bevy::asset::RenderAssetUsages;
use bevy::image::ImageSampler;
use bevy::prelude::*;
use bevy::render::render_resource::{Extent3d, TextureDimension, TextureFormat};

/// Letters of five by seven.
const LETTERS: [(char, [&str; 7]); 5] = [
    ('D', ["####.", "#...#", "#...#", "#...#", "#...#", "#...#", "####."]),
    ('I', ["#####", "..#..", "..#..", "..#..", "..#..", "..#..", "#####"]),
    ('G', [".####", "#....", "#....", "#.###", "#...#", "#...#", ".###."]),
    ('E', ["#####", "#....", "#....", "####.", "#....", "#....", "#####"]),
    ('R', ["####.", "#...#", "#...#", "####.", "#.#..", "#..#.", "#...#"]),
];

/// What each letter of a picture looks like; all others are clear.
const INKS: [(char, [u8; 3]); 14] = [
    ('k', [24, 22, 26]),
    ('w', [128, 84, 46]),
    ('W', [92, 58, 30]),
    ('s', [148, 156, 168]),
    ('S', [208, 216, 226]),
    ('g', [104, 160, 62]),
    ('y', [255, 206, 84]),
    ('Y', [255, 240, 170]),
    ('r', [214, 74, 50]),
    ('o', [240, 142, 50]),
    ('b', [86, 140, 210]),
    ('c', [190, 188, 182]),
    ('C', [140, 138, 134]),
    ('d', [60, 60, 68]),
];

/// The tools, in the order of the slots.
const TOOLS: [[&str; 16]; 8] = [
    [
        "................",
        "....ssSSS.......",
        "...s.....SSw....",
        "..........WwS...",
        ".........Ww.S...",
        "........Ww...S..",
        ".......Ww....S..",
        "......Ww.....S..",
        ".....Ww......s..",
        "....Ww.......s..",
        "...Ww........s..",
        "..Ww............",
        ".Ww.............",
        ".w..............",
        "................",
        "................",
    ],
    [
        "................",
        "...........ww...",
        "..........w..w..",
        "...........ww...",
        "..........Ww....",
        ".........Ww.....",
        "........Ww......",
        ".......Ww.......",
        "...sSSWw........",
        "..sSSSSS........",
        "..sSSSSs........",
        "..sSSSSs........",
        "..sSSSs.........",
        "...sss..........",
        "................",
        "................",
    ],
    [
        "................",
        "................",
        "..dddd..........",
        ".ddrrdddd.......",
        ".drrrrddssS.....",
        ".drrrrddsSsSs...",
        ".drrrrddssSsSsS.",
        ".drrrrddsSsSs...",
        ".ddrrdddssS.....",
        "..dddd..........",
        "...ww...........",
        "...ww...........",
        "...Ww...........",
        "...WW...........",
        "................",
        "................",
    ],
    [
        "................",
        "................",
        "......cccc......",
        "....cccccccc....",
        "..cccccccccccc..",
        "..CcccccccccCC..",
        "..CCCccccccCCC..",
        "..CCCCCccCCCCd..",
        "..CCCCCCdCCCdd..",
        "..CCCCCCdCCddd..",
        "..CCCCCCddCddd..",
        "....CCCCdddd....",
        "......CCdd......",
        "................",
        "................",
        "................",
    ],
    [
        "................",
        "..........gggg..",
        ".........gggggg.",
        "........gggggg..",
        ".......ggggggs..",
        "......sgggggs...",
        ".....ssssggs....",
        "....Wwsssss.....",
        "...Ww.ssss......",
        "..Ww............",
        ".Ww.............",
        ".w..............",
        "................",
        "................",
        "................",
        "................",
    ],
    [
        "................",
        ".........yY.....",
        "........Yoy.....",
        ".......w.y......",
        "......w.........",
        ".....dddd.......",
        "....dddddd......",
        "...ddSddddd.....",
        "..ddSdddddkk....",
        "..dddddddkkk....",
        "..ddddddkkkk....",
        "...ddddkkkk.....",
        "....ddkkkk......",
        ".....kkkk.......",
        "................",
        "................",
    ],
    [
        "................",
        "......dddd......",
        ".....d....d.....",
        ".....dddddd.....",
        "....sYYYYYYs....",
        "....sYyyyyYs....",
        "....sYyooyYs....",
        "....sYyooyYs....",
        "....sYyyyyYs....",
        "....sYYYYYYs....",
        ".....dddddd.....",
        "....dddddddd....",
        "................",
        "................",
        "................",
        "................",
    ],
    [
        "................",
        "................",
        ".....rrrrrr.....",
        "...rrrrrrrrrr...",
        "..rroorrrrrrrr..",
        "..roorrrrrrrYY..",
        ".rrorrrrrrYYYYr.",
        ".rrrrrrrYYYYrrr.",
        ".rrrrrYYYYrrrrr.",
        ".rrrYYYYrrrrrrr.",
        ".rYYYYrrrrrrrrk.",
        "..YYrrrrrrrrrk..",
        "..rrrrrrrrrrkk..",
        "...rrrrrrrrkk...",
        ".....rrrkkk.....",
        "................",
    ],
];

/// The pictures, once they are drawn.
#[derive(Resource)]
pub struct Art {
    /// The name of the game.
    pub logo: Handle<Image>,
    /// In the order of the slots.
    pub tools: [Handle<Image>; 8],
    /// A rough square, white; materials tint it.
    pub swatch: Handle<Image>,
    /// A soft disc, for smoke and sparks.
    pub puff: Handle<Image>,
}

impl FromWorld for Art {
    fn from_world(world: &mut World) -> Self {
        let mut images = world.resource_mut::<Assets<Image>>();
        let tools = TOOLS.map(|rows| images.add(drawing(&rows)));
        Self { logo: images.add(logo()), tools, swatch: images.add(swatch()), puff: images.add(puff()) }
    }
}

/// Draws the pictures.
pub struct ArtPlugin;

impl Plugin for ArtPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<Art>();
    }
}

/// An image of texels with sharp edges.
fn image(width: u32, height: u32, texel: impl Fn(u32, u32) -> [u8; 4]) -> Image {
    let texels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).flat_map(|(x, y)| texel(x, y));
    let size = Extent3d { width, height, depth_or_array_layers: 1 };
    let mut image = Image::new(
        size,
        TextureDimension::D2,
        texels.collect(),
        TextureFormat::Rgba8UnormSrgb,
        RenderAssetUsages::RENDER_WORLD,
    );
    image.sampler = ImageSampler::nearest();
    image
}

fn drawing(rows: &[&str; 16]) -> Image {
    image(16, 16, |x, y| {
        let letter = rows.get(y as usize).and_then(|row| row.chars().nth(x as usize)).unwrap_or('.');
        let ink = INKS.iter().find(|(name, _)| *name == letter);
        ink.map_or([0; 4], |&(_, [r, g, b])| [r, g, b, 255])
    })
}

/// The name of the game in the ground's own colours: grass on soil on rock, with some gold in it.
fn logo() -> Image {
    const NAME: &str = "DIGGER";
    const DOT: u32 = 3;
    let glyphs: Vec<&[&str; 7]> = NAME
        .chars()
        .filter_map(|letter| LETTERS.iter().find(|(name, _)| *name == letter).map(|(_, rows)| rows))
        .collect();
    let width = (glyphs.len() as u32 * 6 - 1) * DOT + 1;
    let is_ink = |x: i32, y: i32| {
        let (x, y) = (x.div_euclid(DOT as i32), y.div_euclid(DOT as i32));
        x >= 0
            && y >= 0
            && glyphs
                .get(x as usize / 6)
                .and_then(|rows| rows.get(y as usize))
                .is_some_and(|row| row.as_bytes().get(x as usize % 6) == Some(&b'#'))
    };
    image(width, 7 * DOT + 1, |x, y| {
        let (column, row) = (x as i32, y as i32);
        let noise =
            (x.wrapping_mul(0x9E37_79B1) ^ y.wrapping_mul(0x85EB_CA6B)).wrapping_mul(0xC2B2_AE35) >> 24;
        if is_ink(column, row) {
            let shade = 1.0 - 0.18 * (noise as f32 / 255.0);
            let depth = y / DOT;
            let [r, g, b] = match depth {
                0 => [132, 190, 76],
                1 => {
                    if noise < 90 {
                        [132, 190, 76]
                    } else {
                        [150, 104, 66]
                    }
                }
                2 => [158, 108, 68],
                3 => [132, 116, 102],
                _ if noise > 236 => [255, 208, 84],
                4 => [128, 122, 118],
                5 => [112, 108, 108],
                _ => [96, 92, 96],
            };
            let lit = if !is_ink(column, row - 1) { 1.18 } else { 1.0 };
            let channel = |c: i32| (c as f32 * shade * lit).min(255.0) as u8;
            [channel(r), channel(g), channel(b), 255]
        } else if is_ink(column - 1, row - 1) {
            [10, 10, 14, 190]
        } else {
            [0; 4]
        }
    })
}

fn swatch() -> Image {
    image(8, 8, |x, y| {
        let noise =
            (x.wrapping_mul(0x9E37_79B1) ^ y.wrapping_mul(0x85EB_CA6B)).wrapping_mul(0xC2B2_AE35) >> 24;
        let edge = if y == 0 || x == 0 {
            30
        } else if y == 7 || x == 7 {
            -40
        } else {
            0
        };
        let grey = (200 + noise as i32 / 6 + edge).clamp(0, 255) as u8;
        [grey, grey, grey, 255]
    })
}

fn puff() -> Image {
    const SIDE: u32 = 32;
    let mut puff = image(SIDE, SIDE, |x, y| {
        let at = |c: u32| (c as f32 + 0.5) / SIDE as f32 * 2.0 - 1.0;
        let inside = (1.0 - Vec2::new(at(x), at(y)).length()).clamp(0.0, 1.0);
        let alpha = inside * inside * (3.0 - 2.0 * inside);
        [255, 255, 255, (255.0 * alpha) as u8]
    });
    puff.sampler = ImageSampler::linear();
    puff
}
