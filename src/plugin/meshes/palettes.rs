//! The materials of triangles: up to four, the same ones in the same order at all corners.
//!
//! Numbers of materials can't be blended, but weights can. So a shader needs one list of materials for a whole
//! triangle, and the weight of each at every corner. Nearly all meshes have four materials at most, and so one list. In
//! others, triangles are grouped by lists, and vertices on the border between groups are copied.

use std::collections::HashMap;

use crate::surface::{Indices, MaterialMix};

/// A set of material ids.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Set([u64; 4]);

impl Set {
    fn of(mix: MaterialMix) -> Self {
        let mut set = Self::default();
        weighted(mix).for_each(|(id, _)| set.insert(id));
        set
    }

    fn insert(&mut self, id: u8) {
        self.0[usize::from(id >> 6)] |= 1 << (id & 63);
    }

    fn union(self, other: Self) -> Self {
        Self(std::array::from_fn(|word| self.0[word] | other.0[word]))
    }

    fn len(self) -> u32 {
        self.0.iter().map(|word| word.count_ones()).sum()
    }

    /// The first four ids, ascending, then zeros.
    fn list(self) -> [u8; 4] {
        let mut list = [0; 4];
        let ids = (0..=u8::MAX).filter(|&id| self.0[usize::from(id >> 6)] >> (id & 63) & 1 == 1);
        list.iter_mut().zip(ids).for_each(|(place, id)| *place = id);
        list
    }
}

/// The materials of a mix that have weight.
fn weighted(mix: MaterialMix) -> impl Iterator<Item = (u8, u8)> {
    mix.ids.into_iter().zip(mix.weights).filter(|&(_, weight)| weight > 0)
}

/// The mix with its weights in the order of a list. Those of materials that the list lacks go to the heaviest one.
fn in_order(mix: MaterialMix, list: [u8; 4]) -> MaterialMix {
    let (mut weights, mut rest) = ([0u8; 4], 0u8);
    for (id, weight) in weighted(mix) {
        match list.iter().position(|&listed| listed == id) {
            Some(place) => weights[place] = weight.saturating_add(weights[place]),
            None => rest = weight.saturating_add(rest),
        }
    }
    if let Some(heaviest) = weights.iter_mut().max() {
        *heaviest = heaviest.saturating_add(rest);
    }
    MaterialMix { ids: list, weights }
}

/// The materials of a mesh's vertices, while it is built.
pub(super) struct Palettes {
    mixes: Vec<MaterialMix>,
    all: Set,
}

/// Materials with one list for each triangle.
pub(super) struct Arranged {
    pub ids: Vec<[u8; 4]>,
    pub weights: Vec<[u8; 4]>,
    /// The vertices of which copies follow after the others.
    pub copies: Vec<u32>,
    pub indices: Indices,
}

impl Palettes {
    pub fn with_capacity(vertices: usize) -> Self {
        Self { mixes: Vec::with_capacity(vertices), all: Set::default() }
    }

    /// Adds further vertices.
    pub fn extend(&mut self, mixes: impl Iterator<Item = MaterialMix>) {
        let first = self.mixes.len();
        self.mixes.extend(mixes);
        let mut last = None;
        for mix in &self.mixes[first..] {
            // Neighbours mostly have the same materials.
            if last != Some(mix) {
                self.all = self.all.union(Set::of(*mix));
                last = Some(mix);
            }
        }
    }

    /// Makes all corners of each triangle list the same materials.
    pub fn arrange(mut self, indices: &Indices) -> Arranged {
        if self.all.len() <= 4 {
            let list = self.all.list();
            // Neighbours mostly have the same materials.
            let mut last = MaterialMix::default();
            let mut ordered = in_order(last, list);
            let weights = self.mixes.iter().map(|&mix| {
                if mix != last {
                    (last, ordered) = (mix, in_order(mix, list));
                }
                ordered.weights
            });
            let weights = weights.collect();
            let ids = vec![list; self.mixes.len()];
            return Arranged { ids, weights, copies: Vec::new(), indices: indices.clone() };
        }
        let (copies, indices) = self.group(indices);
        Arranged {
            ids: self.mixes.iter().map(|mix| mix.ids).collect(),
            weights: self.mixes.iter().map(|mix| mix.weights).collect(),
            copies,
            indices,
        }
    }

    /// Groups triangles so that each group has four materials at most, and returns which vertices were copied, and the
    /// triangles.
    fn group(&mut self, indices: &Indices) -> (Vec<u32>, Indices) {
        const NONE: usize = usize::MAX;
        let mut groups: Vec<Set> = Vec::new();
        let mut group_of = vec![NONE; self.mixes.len()];
        let (mut copies, mut copied) = (Vec::new(), HashMap::new());
        let mut list = Vec::with_capacity(indices.len());
        for triangle in indices.triangles() {
            let needed = strongest(triangle.map(|corner| self.mixes[corner as usize]));
            let has_room = |group: &Set| group.union(needed).len() <= 4;
            let found = groups.iter().position(|group| group.union(needed) == *group);
            let group = found.or_else(|| groups.iter().position(has_room)).unwrap_or(groups.len());
            match groups.get_mut(group) {
                Some(own) => *own = own.union(needed),
                None => groups.push(needed),
            }
            for corner in triangle {
                let own = &mut group_of[corner as usize];
                if *own == NONE {
                    *own = group;
                }
                list.push(if *own == group {
                    corner
                } else {
                    *copied.entry((corner, group)).or_insert_with(|| {
                        copies.push((corner, group));
                        (self.mixes.len() + copies.len() - 1) as u32
                    })
                });
            }
        }
        let lists: Vec<[u8; 4]> = groups.into_iter().map(Set::list).collect();
        let of_copies = copies.iter().map(|&(of, group)| in_order(self.mixes[of as usize], lists[group]));
        let of_copies: Vec<MaterialMix> = of_copies.collect();
        for (mix, group) in self.mixes.iter_mut().zip(group_of) {
            // A vertex without triangles stays as it is.
            if let Some(&list) = lists.get(group) {
                *mix = in_order(*mix, list);
            }
        }
        self.mixes.extend(of_copies);
        let mut indices = Indices::with_capacity(self.mixes.len(), list.len());
        indices.extend(&list);
        (copies.into_iter().map(|(of, _)| of).collect(), indices)
    }
}

/// The four materials that weigh most in a triangle.
fn strongest(corners: [MaterialMix; 3]) -> Set {
    let all = corners.into_iter().fold(Set::default(), |all, mix| all.union(Set::of(mix)));
    if all.len() <= 4 {
        return all;
    }
    let mut totals = [0u32; 256];
    for (id, weight) in corners.into_iter().flat_map(weighted) {
        totals[usize::from(id)] += u32::from(weight);
    }
    let mut ids: Vec<u8> = (0..=u8::MAX).filter(|&id| totals[usize::from(id)] > 0).collect();
    ids.sort_by_key(|&id| std::cmp::Reverse(totals[usize::from(id)]));
    let mut set = Set::default();
    ids.into_iter().take(4).for_each(|id| set.insert(id));
    set
}

#[cfg(test)]
mod tests {
    use super::*;
    use fastrand::Rng;

    fn mix(rng: &mut Rng, materials: u8) -> MaterialMix {
        let (first, second) = (rng.u8(..materials), rng.u8(..materials));
        let weight = if first == second { 255 } else { rng.u8(128..) };
        MaterialMix { ids: [first, second, 0, 0], weights: [weight, 255 - weight, 0, 0] }
    }

    /// The weights of a mix, independent of the order.
    fn said(mix: MaterialMix) -> Vec<(u8, u8)> {
        let mut said: Vec<_> = weighted(mix).collect();
        said.sort_unstable();
        said
    }

    #[test]
    fn corners_of_a_triangle_list_the_same_materials_and_vertices_keep_theirs() {
        let rng = &mut Rng::with_seed(7);
        for materials in [1, 2, 4, 5, 9, 200] {
            let count = rng.usize(3..400);
            let mixes: Vec<_> = (0..count).map(|_| mix(rng, materials)).collect();
            let mut palettes = Palettes::with_capacity(count);
            palettes.extend(mixes.iter().copied());
            let corners: Vec<u32> = (0..rng.usize(1..300) * 3).map(|_| rng.u32(..count as u32)).collect();
            let mut indices = Indices::with_capacity(count, corners.len());
            indices.extend(&corners);
            let Arranged { ids, weights, copies, indices } = palettes.arrange(&indices);
            assert_eq!((ids.len(), weights.len()), (count + copies.len(), count + copies.len()));
            assert!(materials > 4 || copies.is_empty());
            let all: Vec<u32> = indices.triangles().flatten().collect();
            assert_eq!(all.len(), corners.len());
            for (triangle, before) in all.chunks(3).zip(corners.chunks(3)) {
                let is_few = strongest([0, 1, 2].map(|at| mixes[before[at] as usize]));
                let sum = before.iter().map(|&at| Set::of(mixes[at as usize]));
                let is_whole = sum.fold(Set::default(), Set::union) == is_few;
                for (&at, &was) in triangle.iter().zip(before) {
                    let of = if (at as usize) < count { at } else { copies[at as usize - count] };
                    assert_eq!((of, ids[at as usize]), (was, ids[triangle[0] as usize]));
                    let found = MaterialMix { ids: ids[at as usize], weights: weights[at as usize] };
                    assert_eq!(found.weights.iter().map(|&weight| u32::from(weight)).sum::<u32>(), 255);
                    assert!(!is_whole || said(found) == said(mixes[was as usize]), "{found:?}");
                }
            }
        }
    }
}
