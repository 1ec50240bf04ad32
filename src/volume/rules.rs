//! Digging rules: hardness of materials, bedrock, protected boxes.

use std::collections::{BTreeMap, BTreeSet};

use super::{MaterialCounts, VoxelOutcome};
use crate::ground::MaterialId;
use crate::lattice::{LatticeBox, ONE};

/// Restrictions on brushes. Without rules, brushes may change everything.
///
/// Equal edits under equal rules make equal worlds, bit for bit. Rules restrict every operation: it *takes
/// away* wherever it makes a sample's density higher, whether the sample is solid or not.
///
/// ```
/// use bevy_burrow::prelude::*;
/// use glam::Vec3;
///
/// let mut terrain = Terrain::new(Ground::flat(64, 64, 10.0)?, &TerrainSettings::default())?;
/// terrain.set_rules(DiggingRules::default().with_hardness(MaterialId(0), 100).with_bedrock(4))?;
/// let dig = Brush::dig(Shape::sphere(Vec3::new(32.0, 10.0, 32.0), 4.0));
/// let receipts = terrain.apply([dig.clone().with_power(50), dig.clone().with_power(75), dig]);
/// let outcomes = receipts.into_iter().filter_map(|receipt| receipt.outcome.ok());
/// let refused: Vec<Refused> = outcomes.map(|applied| applied.refused).collect();
/// assert!(refused[0].too_hard.total() > 100);
/// assert!(refused[1].slowed.total() > 10);
/// assert!(refused[2].is_empty());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DiggingRules {
    /// Hardness of materials; others have hardness 0. A brush with at least that power digs at full speed, one with
    /// half of it or less takes nothing away, and in between its speed grows linearly. Painting is not restricted:
    /// ground that is painted with a softer material is softer from then on.
    pub hardness: BTreeMap<MaterialId, u8>,
    /// Materials that no brush removes or paints over.
    pub unbreakable: BTreeSet<MaterialId>,
    /// No solid ground below this height, in voxels, is removed.
    pub bedrock: Option<i32>,
    /// Samples that no operation changes at all, paint included. Each edit searches all boxes, each brick only those
    /// near the edits of its batch.
    pub protected: Vec<LatticeBox>,
}

impl DiggingRules {
    /// The rules with another hardness of a material.
    #[must_use]
    pub fn with_hardness(mut self, material: MaterialId, hardness: u8) -> Self {
        self.hardness.insert(material, hardness);
        self
    }

    /// The rules with one more material that no brush removes.
    #[must_use]
    pub fn with_unbreakable(mut self, material: MaterialId) -> Self {
        self.unbreakable.insert(material);
        self
    }

    /// The rules with bedrock below a height, in voxels.
    #[must_use]
    pub fn with_bedrock(self, below: i32) -> Self {
        Self { bedrock: Some(below), ..self }
    }

    /// The rules with one more protected box.
    #[must_use]
    pub fn with_protected(mut self, samples: LatticeBox) -> Self {
        self.protected.push(samples);
        self
    }

    /// Checks that every rule can apply to something.
    ///
    /// # Errors
    /// When a rule is for [`MaterialId::GROUND`], which stands for the ground's own materials; name these instead.
    pub fn check(&self) -> Result<(), RulesError> {
        let ground = MaterialId::GROUND;
        if self.unbreakable.contains(&ground) || self.hardness.contains_key(&ground) {
            return Err(RulesError::Ground);
        }
        Ok(())
    }

    /// Returns `true` if there is no rule.
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }

    /// Bytes of its lists.
    pub(crate) fn bytes(&self) -> usize {
        // Trees have room for some more entries than they hold.
        let trees = 4 * (self.hardness.len() + self.unbreakable.len());
        trees + self.protected.capacity() * size_of::<LatticeBox>()
    }

    pub(crate) fn is_unbreakable(&self, material: MaterialId) -> bool {
        self.unbreakable.contains(&material)
    }

    /// Which part of a change that takes away solid ground a brush of this power makes, in 1/256, and why not all of
    /// it.
    pub(crate) fn pace(&self, material: MaterialId, y: i32, power: u8) -> (i32, Option<VoxelOutcome>) {
        if self.bedrock.is_some_and(|bedrock| y < bedrock) || self.is_unbreakable(material) {
            return (0, Some(VoxelOutcome::Unbreakable));
        }
        let (power, hardness) = (i32::from(power), i32::from(*self.hardness.get(&material).unwrap_or(&0)));
        if power >= hardness {
            return (ONE, None);
        }
        match ((2 * power - hardness) * ONE / hardness).max(0) {
            0 => (0, Some(VoxelOutcome::TooHard)),
            part => (part, Some(VoxelOutcome::Slowed)),
        }
    }
}

/// An error of setting rules.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum RulesError {
    /// A rule is for a material that nothing has.
    #[error(
        "a rule refers to `MaterialId::GROUND`, which is a placeholder: name the materials of the ground instead"
    )]
    Ground,
}

/// Voxels that an operation would have changed but for the rules, by the material that they have, or would have got.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Refused {
    /// Voxels in protected boxes: not removed, not filled, not painted.
    pub protected: MaterialCounts,
    /// Voxels of unbreakable materials, or below bedrock.
    pub unbreakable: MaterialCounts,
    /// Voxels too hard for the brush's power.
    pub too_hard: MaterialCounts,
    /// Voxels that one pass of the brush only slowed down.
    pub slowed: MaterialCounts,
}

impl Refused {
    /// Returns `true` if nothing was refused.
    pub fn is_empty(&self) -> bool {
        self.total() == 0
    }

    /// All voxels that were refused.
    pub fn total(&self) -> u64 {
        [&self.protected, &self.unbreakable, &self.too_hard, &self.slowed]
            .map(MaterialCounts::total)
            .iter()
            .sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rules_come_back_from_json() {
        let samples = LatticeBox { min: glam::IVec3::new(-3, 0, 7), max: glam::IVec3::splat(9) };
        let rules = DiggingRules::default()
            .with_hardness(MaterialId(1), 100)
            .with_unbreakable(MaterialId(2))
            .with_bedrock(-5)
            .with_protected(samples);
        let json = r#"{"hardness":{"1":100},"unbreakable":[2],"bedrock":-5,"protected":[{"min":[-3,0,7],"max":[9,9,9]}]}"#;
        assert_eq!(serde_json::to_string(&rules).unwrap(), json);
        assert_eq!(serde_json::from_str::<DiggingRules>(json).unwrap(), rules);
        assert_eq!(serde_json::from_str::<DiggingRules>("{}").unwrap(), DiggingRules::default());
        assert!(serde_json::from_str::<DiggingRules>(r#"{"hard":1}"#).is_err());
    }

    #[test]
    fn power_goes_all_the_way_or_a_part_of_it_or_nowhere() {
        let rules = DiggingRules::default()
            .with_hardness(MaterialId(1), 100)
            .with_unbreakable(MaterialId(2))
            .with_bedrock(-5);
        let pace = |material, y, power| {
            let (part, outcome) = rules.pace(MaterialId(material), y, power);
            (part, outcome.is_some())
        };
        assert_eq!(pace(0, 0, 0), (256, false));
        assert_eq!(
            [0, 50, 51, 75, 99, 100, 255].map(|power| pace(1, 0, power).0),
            [0, 0, 5, 128, 250, 256, 256]
        );
        assert_eq!(
            (pace(2, 0, 255), pace(0, -6, 255), pace(0, -5, 255)),
            ((0, true), (0, true), (256, false))
        );
    }
}
