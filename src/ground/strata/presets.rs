//! Preset strata: `alpine`, `desert` and `mine`.

use glam::Vec2;

use super::{Bedding, Interval, Strata, Stratum};
use crate::ground::material::MaterialId;

const ROCK: MaterialId = MaterialId(0);
const GRASS: MaterialId = MaterialId(1);
const SAND: MaterialId = MaterialId(2);
const SNOW: MaterialId = MaterialId(3);
const CLAY: MaterialId = MaterialId(4);
const COAL: MaterialId = MaterialId(6);
const GOLD: MaterialId = MaterialId(7);
const SOIL: MaterialId = MaterialId(8);
const SANDSTONE: MaterialId = MaterialId(9);
const SHALE: MaterialId = MaterialId(10);
const GRAVEL: MaterialId = MaterialId(11);
const IRON: MaterialId = MaterialId(12);
const COPPER: MaterialId = MaterialId(13);

impl Strata {
    /// The presets, by name.
    pub const PRESETS: [(&'static str, fn() -> Self); 3] =
        [("alpine", Self::alpine), ("desert", Self::desert), ("mine", Self::mine)];

    /// A preset by its name; `None` if there is none.
    pub fn preset(name: &str) -> Option<Self> {
        Self::PRESETS.iter().find(|(own, _)| *own == name).map(|(_, preset)| preset())
    }

    /// Mountains: turf over soil and clay on gentle slopes, gravel on steeper ones, snow on the heights; below, folded
    /// beds of rock, sandstone and shale with a seam of coal and veins of gold. Materials are those of the default
    /// `GroundLook`.
    ///
    /// Turf is 2 voxels thick; snow, gravel and the crust of rock faces are 3, so that slopes up to 60 degrees do not
    /// show what lies below in stripes. Rock faces show their beds between patches of crust.
    pub fn alpine() -> Self {
        let gentle = Interval::below(0.95);
        let skin =
            |material, slope| Stratum { depth: Interval::below(2.0), slope, ..Stratum::fill(material) };
        let snow = Stratum {
            height: Interval::above(92.0),
            depth: Interval::below(3.0),
            rough: 6.0,
            ..skin(SNOW, Interval::below(1.2))
        };
        let soil = |material, depth| Stratum {
            depth: Interval::below(depth),
            slope: gentle,
            rough: 0.5,
            rough_scale: 16,
            ..Stratum::fill(material)
        };
        Self {
            seed: 1,
            bedding: Bedding { dip: Vec2::new(0.10, 0.06), fold: 7.0, scale: 128 },
            strata: vec![
                snow,
                skin(GRASS, gentle),
                soil(SOIL, 3.6),
                soil(CLAY, 5.4),
                Stratum {
                    depth: Interval::below(3.0),
                    slope: Interval::between(0.95, 1.3),
                    ..Stratum::fill(GRAVEL)
                },
                // Weather leaves a crust, which hides the beds of natural faces in patches.
                Stratum { depth: Interval::below(3.0), ..Stratum::pocket(ROCK, 64, 0.5) },
                Stratum { depth: Interval::above(6.0), ..Stratum::vein(GOLD, 32, 0.006) },
                Stratum { rough: 0.4, depth: Interval::above(4.0), ..Stratum::beds(COAL, 15.0, 1.6, 40.0) },
                Stratum { rough: 1.5, ..Stratum::beds(SANDSTONE, 4.0, 9.0, 40.0) },
                Stratum { rough: 1.5, ..Stratum::beds(SHALE, 22.0, 8.0, 40.0) },
            ],
        }
    }

    /// Dunes over banded sandstone: loose sand, gravel in the hollows, beds of sandstone, clay and shale, and a seam of
    /// coal far below. Slopes too steep for sand show their beds in bands.
    pub fn desert() -> Self {
        let sand = |slope, depth| Stratum {
            depth: Interval::below(depth),
            slope,
            rough: 1.5,
            rough_scale: 64,
            ..Stratum::fill(SAND)
        };
        Self {
            seed: 2,
            bedding: Bedding { dip: Vec2::new(-0.03, 0.02), fold: 2.0, scale: 256 },
            strata: vec![
                sand(Interval::below(0.35), 5.0),
                sand(Interval::between(0.35, 0.8), 1.5),
                Stratum { depth: Interval::above(3.0), ..Stratum::pocket(GRAVEL, 16, 0.015) },
                Stratum { rough: 0.3, ..Stratum::beds(COAL, -30.0, 1.2, 60.0) },
                Stratum { rough: 0.5, ..Stratum::beds(CLAY, 0.0, 2.0, 12.0) },
                Stratum { rough: 0.5, ..Stratum::beds(SHALE, 6.0, 1.5, 24.0) },
                Stratum::fill(SANDSTONE),
            ],
        }
    }

    /// A mine: turf, soil and clay over rock with seams and pockets of coal, pockets of iron and copper, and gold in
    /// veins and, deeper down, in pockets. There is ore from 3 to 160 voxels below the surface.
    ///
    /// Turf is 2 voxels thick and soil reaches down to 3 or more, so that slopes up to 60 degrees do not show what lies
    /// below in stripes.
    pub fn mine() -> Self {
        let deep = |from| Interval::between(from, 160.0);
        Self {
            seed: 3,
            bedding: Bedding { dip: Vec2::new(0.15, -0.08), fold: 5.0, scale: 64 },
            strata: vec![
                Stratum { depth: Interval::below(2.0), slope: Interval::below(1.0), ..Stratum::fill(GRASS) },
                Stratum { depth: Interval::below(3.4), rough: 0.4, rough_scale: 16, ..Stratum::fill(SOIL) },
                Stratum { depth: Interval::below(4.8), rough: 0.6, rough_scale: 16, ..Stratum::fill(CLAY) },
                Stratum { depth: deep(6.0), ..Stratum::vein(GOLD, 16, 0.010) },
                Stratum { depth: deep(30.0), ..Stratum::pocket(GOLD, 16, 0.008) },
                Stratum { depth: deep(4.0), ..Stratum::pocket(COAL, 16, 0.020) },
                Stratum { depth: deep(3.0), rough: 0.5, ..Stratum::beds(COAL, 5.0, 1.5, 32.0) },
                Stratum { depth: deep(5.0), ..Stratum::pocket(IRON, 32, 0.020) },
                Stratum { depth: deep(8.0), ..Stratum::vein(COPPER, 32, 0.010) },
                Stratum { depth: deep(8.0), ..Stratum::pocket(COPPER, 16, 0.008) },
                Stratum { rough: 1.0, ..Stratum::beds(SHALE, 18.0, 6.0, 32.0) },
                Stratum { depth: Interval::above(100.0), ..Stratum::fill(SANDSTONE) },
                Stratum::fill(ROCK),
            ],
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use glam::IVec3;

    use super::*;
    use crate::ground::Ground;

    #[test]
    fn presets_are_valid_and_known_by_name() {
        for (name, preset) in Strata::PRESETS {
            let strata = preset();
            strata.check().unwrap();
            assert_eq!(Strata::preset(name), Some(strata.clone()));
            let json = serde_json::to_string(&strata).unwrap();
            assert_eq!(serde_json::from_str::<Strata>(&json).unwrap(), strata, "{name}");
        }
        assert_eq!(Strata::preset("moon"), None);
    }

    #[test]
    fn the_mine_has_three_ores_at_all_depths() {
        let ground = Ground::flat(128, 128, 120.0).unwrap().with_strata(&Strata::mine()).unwrap();
        let mut found: BTreeMap<MaterialId, [u32; 5]> = BTreeMap::new();
        for y in 15..115 {
            for (x, z) in (0..=128).flat_map(|z| (0..=128).map(move |x| (x, z))) {
                found.entry(ground.material(IVec3::new(x, y, z))).or_default()[(119 - y) as usize / 21] += 1;
            }
        }
        for ore in [COAL, IRON, COPPER, GOLD] {
            assert!(found[&ore].iter().all(|&voxels| voxels > 100), "{ore:?}: {found:?}");
        }
    }
}
