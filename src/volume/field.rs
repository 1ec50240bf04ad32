//! Fields: connected regions of edits, and the paper's scenarios by which they come, grow and merge.

use crate::lattice::LatticeBox;

/// Identifies a field; an id is never used again.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct FieldId(pub u64);

/// A region of edits inside one chunk.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Field {
    /// The field's name.
    pub id: FieldId,
    /// Box around its edited samples.
    pub bounds: LatticeBox,
    /// Counts the edits that changed it.
    pub revision: u64,
}

/// How an edit changed the fields of one chunk (paper, section Scenarios, 1 to 4). An edit that reaches over several
/// chunks is cut, and each chunk has a separate scenario (5).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Scenario {
    /// 1: no field was near; one was created to fit the edit.
    Created,
    /// 2: the edit lies inside a field.
    Changed,
    /// 3: the edit reaches out of a field, which was extended.
    Extended,
    /// 4: the edit joined several fields into one.
    Merged {
        /// Number of fields that became one, at least 2.
        fields: usize,
    },
}

/// The change of a chunk's fields.
pub(crate) struct Absorbed {
    /// The scenario that took place.
    pub scenario: Scenario,
    /// The field that now holds the edit.
    pub field: FieldId,
    /// Fields that were merged into it and are gone.
    pub gone: Vec<FieldId>,
}

/// The fields of one chunk, by age. No two of them meet: a cell touches at most one.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Fields(Vec<Field>);

/// The fields of a chunk without any.
pub(crate) static NO_FIELDS: Fields = Fields(Vec::new());

impl Fields {
    /// Fields that were saved. `None` if two have the same name, or one has an empty box.
    pub fn restored(mut fields: Vec<Field>) -> Option<Self> {
        fields.sort_by_key(|field| field.id);
        let is_valid = |field: &Field| field.bounds.min.cmple(field.bounds.max).all();
        let is_unique = |pair: &[Field]| pair[0].id < pair[1].id;
        (fields.iter().all(is_valid) && fields.windows(2).all(is_unique)).then_some(Self(fields))
    }

    /// Every field of the chunk.
    pub fn iter(&self) -> impl Iterator<Item = &Field> {
        self.0.iter()
    }

    /// The number of fields.
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// Returns `true` if there is no field.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// A field by its name.
    pub fn get(&self, id: FieldId) -> Option<&Field> {
        self.0.binary_search_by_key(&id, |field| field.id).ok().map(|at| &self.0[at])
    }

    /// Bytes of the list.
    pub(crate) fn bytes(&self) -> usize {
        self.0.capacity() * size_of::<Field>()
    }

    /// Takes in the box of an edit's changed samples. Of merged fields the oldest survives; `fresh` names a
    /// new one.
    pub(crate) fn absorb(&mut self, edit: LatticeBox, fresh: impl FnOnce() -> FieldId) -> Absorbed {
        if let Some(field) = self.0.iter_mut().find(|field| field.bounds.encloses(edit)) {
            field.revision = field.revision.saturating_add(1);
            return Absorbed { scenario: Scenario::Changed, field: field.id, gone: Vec::new() };
        }
        let mut bounds = edit;
        let mut met: Vec<Field> = Vec::new();
        while let Some(at) = self.0.iter().position(|field| field.bounds.meets(bounds)) {
            let field = self.0.swap_remove(at);
            bounds = bounds.union(field.bounds);
            met.push(field);
        }
        met.sort_by_key(|field| field.id);
        let scenario = match met.len() {
            0 => Scenario::Created,
            1 => Scenario::Extended,
            fields => Scenario::Merged { fields },
        };
        let id = met.first().map_or_else(fresh, |oldest| oldest.id);
        let revision =
            met.iter().map(|field| field.revision).max().map_or(0, |newest| newest.saturating_add(1));
        self.0.reserve_exact(1);
        self.0.push(Field { id, bounds, revision });
        if met.len() > 1 {
            self.0.shrink_to_fit();
        }
        self.0.sort_by_key(|field| field.id);
        Absorbed { scenario, field: id, gone: met.iter().skip(1).map(|field| field.id).collect() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::IVec3;

    fn cube(low: i32, high: i32) -> LatticeBox {
        LatticeBox::new(IVec3::splat(low), IVec3::splat(high)).unwrap()
    }

    #[test]
    fn the_four_scenarios_of_a_chunk() {
        let mut fields = Fields::default();
        let mut next = 0;
        let mut absorb = |edit| {
            fields.absorb(edit, || {
                next += 1;
                FieldId(next)
            })
        };
        assert_eq!(absorb(cube(0, 4)).scenario, Scenario::Created);
        assert_eq!(absorb(cube(1, 3)).scenario, Scenario::Changed);
        assert_eq!(absorb(cube(3, 6)).scenario, Scenario::Extended);
        assert_eq!(absorb(cube(12, 14)).scenario, Scenario::Created);
        let merged = absorb(cube(7, 11));
        assert_eq!(merged.scenario, Scenario::Merged { fields: 2 });
        assert_eq!((merged.field, merged.gone), (FieldId(1), vec![FieldId(2)]));
        assert_eq!(fields.iter().map(|field| field.bounds).collect::<Vec<_>>(), [cube(0, 14)]);
    }

    #[test]
    fn a_field_that_grows_takes_in_what_its_new_box_meets() {
        let mut fields = Fields::default();
        let corner = |x, z| LatticeBox::new(IVec3::new(x, 0, z), IVec3::new(x + 2, 2, z + 2)).unwrap();
        fields.absorb(corner(0, 0), || FieldId(1));
        fields.absorb(corner(0, 10), || FieldId(2));
        // The edit meets only the first field, but the box around both reaches the second one.
        let long = LatticeBox::new(IVec3::new(3, 0, 0), IVec3::new(12, 2, 12)).unwrap();
        assert_eq!(fields.absorb(long, || FieldId(3)).scenario, Scenario::Merged { fields: 2 });
        assert_eq!(fields.len(), 1);
    }
}
