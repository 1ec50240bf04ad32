//! What the landscape is made of: turf, sand and snow on top, soil and clay below, then folded beds of rock with seams
//! of coal and veins of gold. Skins are two or three voxels thick, so that steep slopes do not show in stripes what
//! lies below.

use bevy::math::Vec2;
use bevy_burrow::prelude::*;

use crate::tools::hardness;
use crate::world::landscape::{BEDROCK, CLAY, COAL, GOLD, GRASS, ROCK, SAND, SANDSTONE, SHALE, SNOW, SOIL};

/// The steepest slope with turf and soil on it.
const SOIL_SLOPE: f32 = 0.95;

/// The strata, topmost first. Between them is rock. The seed decides where ore and folds are.
pub fn strata(seed: u32) -> Strata {
    let cover = |material, depth, slope| Stratum {
        depth: Interval::below(depth),
        slope: Interval::below(slope),
        ..Stratum::fill(material)
    };
    let from = |depth, stratum| Stratum { depth: Interval::above(depth), ..stratum };
    let rough = |rough, stratum| Stratum { rough, ..stratum };
    Strata {
        seed: seed.wrapping_add(11),
        bedding: Bedding { dip: Vec2::new(0.10, -0.06), fold: 6.0, scale: 128 },
        strata: vec![
            Stratum { height: Interval::below(hardness::BEDROCK as f32), ..Stratum::fill(BEDROCK) },
            rough(7.0, Stratum { height: Interval::above(94.0), ..cover(SNOW, 3.0, 1.2) }),
            rough(2.0, Stratum { height: Interval::below(8.0), ..cover(SAND, 3.0, 0.5) }),
            cover(GRASS, 2.0, SOIL_SLOPE),
            Stratum { rough_scale: 16, ..rough(0.5, cover(SOIL, 3.6, SOIL_SLOPE)) },
            Stratum { rough_scale: 16, ..rough(0.8, cover(CLAY, 5.2, SOIL_SLOPE)) },
            // Weather leaves a crust, which hides the beds of natural faces in patches.
            Stratum { depth: Interval::below(3.0), ..Stratum::pocket(ROCK, 64, 0.3) },
            from(5.0, Stratum::vein(GOLD, 16, 0.010)),
            from(3.5, Stratum::pocket(COAL, 16, 0.012)),
            rough(0.5, from(3.0, Stratum::beds(COAL, 12.0, 1.5, 30.0))),
            from(3.5, Stratum::pocket(CLAY, 16, 0.010)),
            rough(1.2, Stratum::beds(SANDSTONE, 2.0, 7.0, 30.0)),
            rough(1.2, Stratum::beds(SHALE, 18.0, 6.0, 30.0)),
        ],
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use bevy::math::IVec3;

    use super::*;

    #[test]
    fn what_nothing_breaks_looks_like_bedrock() {
        let ground =
            Ground::flat(32, 32, 20.0).expect("a world").with_strata(&strata(0)).expect("valid strata");
        for (y, is_bedrock) in [(hardness::BEDROCK - 1, true), (hardness::BEDROCK + 1, false)] {
            assert_eq!(ground.material(IVec3::new(9, y, 9)) == BEDROCK, is_bedrock, "at {y}");
        }
    }

    #[test]
    fn ore_is_in_reach_of_a_tunnel() {
        let ground =
            Ground::flat(128, 128, 60.0).expect("a world").with_strata(&strata(0)).expect("valid strata");
        let mut found = BTreeMap::<MaterialId, u32>::new();
        // A tunnel of 5 x 5 metres, 10 metres below the surface.
        for (y, z) in (48..53).flat_map(|y| (60..65).map(move |z| (y, z))) {
            for x in 0..128 {
                *found.entry(ground.material(IVec3::new(x, y, z))).or_default() += 1;
            }
        }
        assert!(
            [GOLD, COAL].iter().all(|ore| found.get(ore).is_some_and(|&voxels| voxels > 10)),
            "{found:?}"
        );
    }
}
