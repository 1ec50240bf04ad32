//! Texels from recipes: colour with height, slope with occlusion and roughness, all mip levels.

use rayon::prelude::*;

use super::noise::{chance, octaves};
use super::palette::{Point, Recipe, Scatter};

pub(super) fn byte(share: f32) -> u8 {
    (share.clamp(0.0, 1.0) * 255.0 + 0.5) as u8
}

/// One layer: colour and height, slope with occlusion and roughness, each with all its mip levels.
pub(super) fn paint(recipe: &Recipe, number: u32, side: u32) -> (Vec<u8>, Vec<u8>) {
    let along = |texel: u32| (texel as f32 + 0.5) / side as f32;
    let mut points: Vec<Point> = (0..side * side)
        .into_par_iter()
        .map(|texel| (recipe.paint)(along(texel % side), along(texel / side)))
        .collect();
    if let Some(scatter) = &recipe.scatter {
        scatter_blades(&mut points, side, scatter, number);
    }
    let heights: Vec<f32> = points.iter().map(|point| point.height).collect();
    let low = blurred(&heights, side);
    let at = |x: u32, y: u32| heights[((y % side) * side + x % side) as usize];
    let steep = recipe.relief / (2.0 * recipe.metres / side as f32);
    let (mut albedo, mut relief) = (Vec::with_capacity(points.len()), Vec::with_capacity(points.len()));
    for (texel, point) in points.iter().enumerate() {
        let (x, y) = (texel as u32 % side, texel as u32 / side);
        let [dx, dy] = [at(x + 1, y) - at(x + side - 1, y), at(x, y + 1) - at(x, y + side - 1)];
        let [dx, dy] = [dx, dy].map(|rise| rise * steep);
        let length = (dx * dx + dy * dy + 1.0).sqrt();
        let occlusion = 1.0 - (1.6 * (low[texel] - point.height)).clamp(0.0, 0.75);
        let [r, g, b] = point.color;
        albedo.push([byte(r), byte(g), byte(b), byte(point.height)]);
        let normal = [-dx / length, -dy / length].map(|part| byte(0.5 + 0.5 * part));
        relief.push([normal[0], normal[1], byte(occlusion), byte(point.roughness)]);
    }
    let to_light = light_of_values();
    (levels(albedo, side, |four| mean_color(four, &to_light)), levels(relief, side, mean_relief))
}

/// Draws blades over a layer, later ones on top, repeating across its borders.
fn scatter_blades(points: &mut [Point], side: u32, scatter: &Scatter, seed: u32) {
    let [length, width] = scatter.size.map(|part| part * side as f32);
    for blade in 0..scatter.count as i32 {
        let dice = |face: u32| chance(blade, face.cast_signed(), seed ^ 0xb1ad);
        let from = [dice(0), dice(1)].map(|share| share * side as f32);
        // Directions without sines, whose last bits differ from machine to machine: a point in a disc.
        let (x, y) = (dice(2) - 0.5, dice(3) - 0.5);
        let norm = (x * x + y * y).sqrt().max(0.01);
        let (x, y) = (x / norm, y / norm);
        let length = length * (0.5 + 0.7 * dice(4));
        let bow = (dice(5) - 0.5) * 0.5;
        let [u, v] = from.map(|at| at / side as f32);
        let patch = octaves(u, v, 4, 3, seed + 5);
        // Tufts, with bare ground between them.
        let tuft = octaves(u, v, 9, 3, seed + 6);
        if dice(10) > 0.72 + 0.9 * tuft {
            continue;
        }
        let bright = (dice(6) * 0.7 + 0.16 + 0.34 * patch + 0.25 * tuft).clamp(0.0, 1.0);
        let [dark, light] = scatter.colors;
        let dry = if dice(7) > 0.90 - 0.25 * octaves(u, v, 3, 3, seed + 7) { 0.6 } else { 0.0 };
        let color: [f32; 3] = std::array::from_fn(|i| {
            let fresh = dark[i] + (light[i] - dark[i]) * bright;
            fresh + ([0.60, 0.52, 0.28][i] - fresh) * dry
        });
        let steps = (length * 1.5).max(1.0) as i32;
        for step in 0..steps {
            let t = step as f32 / steps as f32;
            let aside = bow * t * t * length;
            let centre = [from[0] + x * t * length - y * aside, from[1] + y * t * length + x * aside];
            let half = (width * (1.0 - t) * 0.5).max(0.3);
            let reach = half.ceil() as i32;
            for across in -reach..=reach {
                let off = across as f32;
                if off.abs() > half {
                    continue;
                }
                let place = [centre[0] - y * off, centre[1] + x * off];
                let [px, py] = place.map(|at| (at.floor() as i32).rem_euclid(side.cast_signed()) as usize);
                // Blades rise to their tip; those below are hidden.
                let height = 0.30 + 0.12 * tuft + 0.48 * t * (0.6 + 0.4 * dice(8)) + 0.1 * dice(9);
                if let Some(point) = points.get_mut(py * side as usize + px)
                    && height >= point.height
                {
                    let shade = 0.45 + 0.65 * t - 0.12 * (off / half.max(0.5));
                    *point = Point { color: color.map(|part| part * shade), height, roughness: 0.8 };
                }
            }
        }
    }
}

/// Heights averaged over a sixteenth of the side, by a box that runs along rows and then along columns.
fn blurred(heights: &[f32], side: u32) -> Vec<f32> {
    let (side, reach) = (side as usize, (side / 32).max(1) as usize);
    let run = |from: &[f32]| -> Vec<f32> {
        // Averages along rows, written as columns: done twice, both directions are back in place.
        let mut to = vec![0.0; from.len()];
        for (y, row) in from.chunks_exact(side).enumerate() {
            let mut sum: f32 = (0..2 * reach + 1).map(|i| row[(i + side - reach) % side]).sum();
            for x in 0..side {
                to[x * side + y] = sum / (2 * reach + 1) as f32;
                sum += row[(x + reach + 1) % side] - row[(x + side - reach) % side];
            }
        }
        to
    };
    run(&run(heights))
}

/// A picture and all its mip levels, one after another; `mean` makes one texel of four.
pub(super) fn levels(picture: Vec<[u8; 4]>, side: u32, mean: impl Fn([[u8; 4]; 4]) -> [u8; 4]) -> Vec<u8> {
    let mut bytes: Vec<u8> = picture.as_flattened().to_vec();
    let (mut level, mut side) = (picture, side as usize);
    while side > 1 {
        let half = side / 2;
        level = (0..half * half)
            .map(|texel| {
                let at = 2 * (texel / half) * side + 2 * (texel % half);
                mean([at, at + 1, at + side, at + side + 1].map(|at| level[at]))
            })
            .collect();
        bytes.extend_from_slice(level.as_flattened());
        side = half;
    }
    bytes
}

/// The light of each value of an sRGB channel.
fn light_of_values() -> [f32; 256] {
    std::array::from_fn(|value| {
        let value = value as f32 / 255.0;
        if value <= 0.040_45 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
    })
}

/// Colours are averaged as light, heights as they are.
fn mean_color(four: [[u8; 4]; 4], to_light: &[f32; 256]) -> [u8; 4] {
    let from_light = |light: f32| {
        if light <= 0.003_130_8 { light * 12.92 } else { 1.055 * light.powf(1.0 / 2.4) - 0.055 }
    };
    std::array::from_fn(|channel| {
        let value = four.map(|texel| texel[channel]);
        if channel == 3 {
            return byte(value.map(|value| f32::from(value) / 255.0).iter().sum::<f32>() / 4.0);
        }
        byte(from_light(value.map(|value| to_light[usize::from(value)]).iter().sum::<f32>() / 4.0))
    })
}

/// Directions and occlusion are averaged as they are. What directions vary by makes the mean rougher, or it would
/// sparkle.
fn mean_relief(four: [[u8; 4]; 4]) -> [u8; 4] {
    let mean = |channel: usize| four.iter().map(|texel| f32::from(texel[channel]) / 255.0).sum::<f32>() / 4.0;
    let roughness = mean_roughness(four);
    [byte(mean(0)), byte(mean(1)), byte(mean(2)), byte(roughness)]
}

/// The roughness of four texels, 0 to 1, seen as one: that of their microfacets, and that of their directions.
pub(super) fn mean_roughness(four: [[u8; 4]; 4]) -> f32 {
    let mean = |of: &dyn Fn([u8; 4]) -> f32| four.iter().map(|&texel| of(texel)).sum::<f32>() / 4.0;
    let lean = |axis: usize| move |texel: [u8; 4]| f32::from(texel[axis]) / 127.5 - 1.0;
    let variance = [0, 1].map(|axis| {
        let (middle, lean) = (mean(&lean(axis)), lean(axis));
        mean(&|texel| (lean(texel) - middle) * (lean(texel) - middle))
    });
    let facets = mean(&|texel| {
        let square = (f32::from(texel[3]) / 255.0) * (f32::from(texel[3]) / 255.0);
        square * square
    });
    (facets + variance[0] + variance[1]).min(1.0).sqrt().sqrt()
}

#[cfg(test)]
mod tests {
    use super::super::palette::RECIPES;
    use super::*;

    #[test]
    fn layers_are_told_apart_by_their_colour() {
        let mean = |recipe: &Recipe| {
            let (albedo, _) = paint(recipe, 1, 32);
            let last = albedo.len() - 4;
            [albedo[last], albedo[last + 1], albedo[last + 2]]
        };
        // The last two are the same rocks from above.
        let means: Vec<_> = RECIPES[..14].iter().map(mean).collect();
        let from_above = [(9, 14), (10, 15)].map(|(wall, floor)| (means[wall], mean(&RECIPES[floor])));
        for (wall, floor) in from_above {
            assert!(wall.iter().zip(floor).all(|(a, b)| a.abs_diff(b) < 10), "{wall:?} is not {floor:?}");
        }
        for (i, a) in means.iter().enumerate() {
            for (j, b) in means.iter().enumerate().skip(i + 1) {
                let apart: u32 = a.iter().zip(b).map(|(a, b)| u32::from(a.abs_diff(*b))).sum();
                assert!(apart > 12, "{} {a:?} looks like {} {b:?}", RECIPES[i].name, RECIPES[j].name);
            }
        }
    }

    #[test]
    fn directions_that_vary_are_rough_from_afar() {
        let even = [[160, 90, 255, 100]; 4];
        assert_eq!(mean_relief(even), even[0]);
        let mut uneven = even;
        (uneven[0][0], uneven[3][1]) = (40, 200);
        assert!(mean_relief(uneven)[3] > 120, "{:?}", mean_relief(uneven));
        // Seen from so far that all is one texel, no layer shines more than its texels do, and polished ones less.
        for (number, recipe) in RECIPES.iter().enumerate() {
            let (_, relief) = paint(recipe, number as u32, 32);
            let texels = relief[..32 * 32 * 4].chunks_exact(4);
            let mean = texels.map(|texel| u32::from(texel[3])).sum::<u32>() / (32 * 32);
            assert!(u32::from(relief[relief.len() - 1]) >= mean, "{}", recipe.name);
        }
    }

    #[test]
    fn heights_spread_so_that_layers_can_meet_by_them() {
        for (number, recipe) in RECIPES.iter().enumerate() {
            let (albedo, _) = paint(recipe, number as u32, 64);
            let mut heights: Vec<u8> = albedo[..64 * 64 * 4].chunks_exact(4).map(|texel| texel[3]).collect();
            heights.sort_unstable();
            let (low, high) = (heights[heights.len() / 20], heights[heights.len() * 19 / 20]);
            assert!(high - low > 12, "{}: {low} to {high}", recipe.name);
        }
    }
}
