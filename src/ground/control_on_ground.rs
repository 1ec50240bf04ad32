//! Evaluates a material control on a ground, column by column.

use super::control::{MaterialControl, id};
use super::error::GroundError;
use super::grey_image::{GreyImage, LinePosition};
use super::material::ColumnMaterial;
use super::rules::apply;
use super::stored_materials::Materials;
use super::world::Ground;
use crate::lattice::{Column, ONE};

impl MaterialControl {
    /// The materials of a column.
    pub(super) fn at(&self, ground: &Ground, column: Column) -> ColumnMaterial {
        self.of_column(ground, column, || (ground.height(column), ground.slope(column)))
    }

    /// The material of a column, with access to its height and slope.
    pub(super) fn of_column(
        &self,
        ground: &Ground,
        column: Column,
        height_and_slope: impl FnOnce() -> (i32, f64),
    ) -> ColumnMaterial {
        match self {
            Self::Uniform(material) => *material,
            Self::Rules { base, rules } => {
                let (height, slope) = height_and_slope();
                apply(*base, rules, f64::from(height) / f64::from(ONE), slope)
            }
            Self::Blend { mask, base, overlay } => {
                let grey = ground.stretched(mask, column).grey();
                let blend = (grey / 65_535.0 * 255.0).round() as u8;
                ColumnMaterial { base: *base, overlay: *overlay, blend }
            }
            Self::Ids { map, base } => {
                let overlay = id(ground.stretched(map, column).nearest());
                ColumnMaterial { base: *base, overlay, blend: 255 }
            }
            Self::Map(map) => {
                let [x, z] = ground.place_on((map.width(), map.height()), column).map(LinePosition::nearest);
                map.column(x, z)
            }
        }
    }
}

impl Ground {
    /// This ground, with materials as `control` decides.
    ///
    /// # Errors
    /// [`GroundError::Parameter`] for a rule with a parameter out of its range, and if a material is
    /// [`MaterialId::GROUND`](super::MaterialId::GROUND); [`GroundError::Memory`] if the machine has too little.
    pub fn with_materials(self, control: &MaterialControl) -> Result<Self, GroundError> {
        control.check()?;
        let materials = match control {
            MaterialControl::Uniform(material) => Materials::Uniform(*material),
            _ if self.source().is_some() => Materials::OnDemand(Some(Box::new(control.clone()))),
            _ => Materials::from_columns(self.extent().fill_rows(|z, row| {
                for (x, place) in (0..).zip(row) {
                    *place = control.at(&self, Column::new(x, z));
                }
                Ok(())
            })?),
        };
        self.replace_materials(materials).with_new_tops()
    }

    /// Where a column of the world lies on an image stretched over it.
    pub(super) fn stretched<'a>(&self, image: &'a GreyImage, column: Column) -> ImagePoint<'a> {
        let [x, z] = self.place_on((image.width(), image.height()), column);
        ImagePoint { image, x, z }
    }

    /// Where a column of the world lies on samples of this size, along x and z.
    fn place_on(&self, (width, height): (u32, u32), column: Column) -> [LinePosition; 2] {
        let along = |column: i32, cells: i32, samples: u32| {
            LinePosition::of_long(
                u64::from(column.unsigned_abs()) * u64::from(samples - 1),
                cells.unsigned_abs(),
            )
        };
        [along(column.x, self.width(), width), along(column.z, self.depth(), height)]
    }
}

/// A point on an image.
pub(super) struct ImagePoint<'a> {
    image: &'a GreyImage,
    x: LinePosition,
    z: LinePosition,
}

impl ImagePoint<'_> {
    /// Grey here, 0 to 65535, linear between the four samples around.
    pub(super) fn grey(&self) -> f64 {
        let (x, z) = (self.x.sample, self.z.sample);
        let row = |z| lerp(self.image.grey(x, z).into(), self.image.grey(x + 1, z).into(), self.x.fraction);
        lerp(row(z), row(z + 1), self.z.fraction)
    }

    /// The sample nearest to here.
    fn nearest(&self) -> u16 {
        self.image.grey(self.x.nearest(), self.z.nearest())
    }
}

fn lerp(from: f64, to: f64, t: f64) -> f64 {
    from + (to - from) * t
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ground::{GreyImage, MAX_SIZE, MaterialId, MaterialRule};
    use glam::IVec3;
    use proptest::prelude::*;

    const ROCK: MaterialId = MaterialId(1);
    const GRASS: MaterialId = MaterialId(2);

    fn grass_where_flat() -> MaterialControl {
        let grass = MaterialRule { overlay: GRASS, slope: (0.0, 0.5), ..MaterialRule::default() };
        MaterialControl::Rules { base: ROCK, rules: vec![grass] }
    }

    #[test]
    fn grass_grows_where_it_is_flat_and_rock_lies_beneath() {
        let terrace = Ground::from_fn(12, 2, |x, _| f64::from(x.clamp(4, 8) * 2)).unwrap();
        let ground = terrace.with_materials(&grass_where_flat()).unwrap();
        let skin = |x| ground.column_material(Column::new(x, 1)).skin();
        assert_eq!([0, 3, 4, 6, 8, 9, 12].map(skin), [GRASS, GRASS, ROCK, ROCK, ROCK, GRASS, GRASS]);
        assert_eq!(ground.material(IVec3::new(0, 7, 0)), GRASS);
        assert_eq!(ground.material(IVec3::new(0, 6, 0)), ROCK);
    }

    #[test]
    fn a_bad_rule_is_named() {
        let rules =
            vec![MaterialRule::default(), MaterialRule { slope_fade: f64::NAN, ..MaterialRule::default() }];
        let made =
            Ground::flat(2, 2, 0.0).unwrap().with_materials(&MaterialControl::Rules { base: ROCK, rules });
        let message = made.unwrap_err().to_string();
        assert_eq!(message, "the fade of slopes of material rule 1 is NaN: it must be finite and at least 0");
    }

    #[test]
    fn no_ground_is_made_of_what_the_ground_has() {
        let (none, image) =
            (MaterialId::GROUND, |grey| GreyImage::from_samples(2, 1, vec![0, grey]).unwrap());
        let rule = MaterialRule { overlay: none, ..MaterialRule::default() };
        let solid = ColumnMaterial::solid(ROCK);
        for (control, what) in [
            (MaterialControl::Uniform(ColumnMaterial { base: none, ..solid }), "the base material"),
            (MaterialControl::Uniform(ColumnMaterial { overlay: none, ..solid }), "the overlay material"),
            (MaterialControl::Rules { base: none, rules: vec![] }, "the base material"),
            (
                MaterialControl::Rules { base: ROCK, rules: vec![MaterialRule::default(), rule] },
                "the overlay of material rule 1",
            ),
            (MaterialControl::Blend { mask: image(0), base: none, overlay: ROCK }, "the base material"),
            (MaterialControl::Blend { mask: image(0), base: ROCK, overlay: none }, "the overlay material"),
            (MaterialControl::Ids { map: image(0), base: none }, "the base material"),
            (MaterialControl::Ids { map: image(0xff00), base: ROCK }, "an id of the material map"),
        ] {
            let error = Ground::flat(2, 2, 0.0).unwrap().with_materials(&control).unwrap_err();
            let allowed = "it must be 0 to 254, as 255 means whatever the ground has";
            assert_eq!(error.to_string(), format!("{what} is 255: {allowed}"));
        }
        let last = MaterialControl::Ids { map: image(0xfeff), base: ROCK };
        assert!(Ground::flat(2, 2, 0.0).unwrap().with_materials(&last).is_ok());
    }

    #[test]
    fn a_mask_is_stretched_over_the_world() {
        let mask = GreyImage::from_samples(2, 2, vec![0, 65_535, 0, 65_535]).unwrap();
        let control = MaterialControl::Blend { mask, base: ROCK, overlay: GRASS };
        let ground = Ground::flat(255, 9, 0.0).unwrap().with_materials(&control).unwrap();
        for x in 0..=255 {
            let expected = ColumnMaterial { base: ROCK, overlay: GRASS, blend: x as u8 };
            assert_eq!(ground.column_material(Column::new(x, 5)), expected);
        }
    }

    #[test]
    fn a_map_gives_the_nearest_id() {
        let map = GreyImage::from_samples(3, 1, [7, 8, 254].map(|id| id * 257).to_vec()).unwrap();
        let control = MaterialControl::Ids { map, base: ROCK };
        let ground = Ground::flat(8, 3, 0.0).unwrap().with_materials(&control).unwrap();
        let overlay = |x| ground.column_material(Column::new(x, 2)).overlay.0;
        assert_eq!([0, 1, 2, 4, 5, 6, 8].map(overlay), [7, 7, 8, 8, 8, 254, 254]);
    }

    #[test]
    fn the_largest_image_stretches_over_the_largest_world() {
        let side = MAX_SIZE as usize + 1;
        let map = GreyImage::from_samples(MAX_SIZE + 1, 1, (0..side).map(|i| i as u16).collect()).unwrap();
        let ground = Ground::flat(MAX_SIZE, 1, 0.0).unwrap();
        let ground = ground.with_materials(&MaterialControl::Ids { map, base: ROCK }).unwrap();
        assert_eq!(ground.column_material(Column::new(i32::MAX, 0)).overlay, MaterialId(64));
    }

    #[test]
    fn materials_count_for_the_hash_however_they_are_stored() {
        let flat = || Ground::flat(3, 3, 1.0).unwrap();
        let uniform = |material| flat().with_materials(&MaterialControl::Uniform(material)).unwrap();
        let rock = ColumnMaterial { base: ROCK, overlay: GRASS, blend: 255 };
        let columns = flat().with_materials(&grass_where_flat()).unwrap();
        assert_ne!(flat().hash(), uniform(rock).hash());
        assert_eq!(columns.hash(), uniform(rock).hash());
        assert_eq!(columns, uniform(rock));
    }

    proptest! {
        #[test]
        fn any_rule_makes_materials_or_an_error(
            low: f64, high: f64, height_fade: f64, steep: (f64, f64), slope_fade: f64,
        ) {
            let rule = MaterialRule { overlay: GRASS, height: (low, high), height_fade, slope: steep, slope_fade };
            let control = MaterialControl::Rules { base: ROCK, rules: vec![rule, rule] };
            let ground = Ground::from_heights(1, 1, vec![-99, 1 << 23, 0, -(1 << 23)]).unwrap();
            match ground.with_materials(&control) {
                Ok(ground) => {
                    for (x, z) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                        let material = ground.column_material(Column::new(x, z));
                        prop_assert_eq!(material.base, ROCK);
                        prop_assert!(material.blend == 0 || material.overlay == GRASS, "{:?}", material);
                    }
                }
                Err(GroundError::Parameter { .. }) => {}
                Err(error) => prop_assert!(false, "{error}"),
            }
        }

        #[test]
        fn any_image_stretches_over_any_world(
            size in (1..9_u32, 1..9_u32), world in (1..9_u32, 1..9_u32), grey: u16,
        ) {
            let image = GreyImage::from_samples(size.0, size.1, vec![grey; (size.0 * size.1) as usize]).unwrap();
            let flat = || Ground::flat(world.0, world.1, 0.0).unwrap();
            let blend = MaterialControl::Blend { mask: image.clone(), base: ROCK, overlay: GRASS };
            let ids = MaterialControl::Ids { map: image, base: ROCK };
            let (blend, ids) = (flat().with_materials(&blend).unwrap(), flat().with_materials(&ids));
            prop_assert_eq!(ids.is_err(), grey >> 8 == 255);
            for (x, z) in (0..9).flat_map(|z| (0..9).map(move |x| (x, z))) {
                let expected = (f64::from(grey) / 257.0).round() as u8;
                prop_assert_eq!(blend.column_material(Column::new(x, z)).blend, expected);
                if let Ok(ids) = &ids {
                    let overlay = ids.column_material(Column::new(x, z)).overlay;
                    prop_assert_eq!(overlay, MaterialId((grey >> 8) as u8));
                }
            }
        }
    }
}
