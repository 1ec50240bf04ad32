//! The marching-cubes case table, derived instead of copied.
//!
//! Corner `i` of a cube lies at `(i & 1, i >> 1 & 1, i >> 2 & 1)`; bit `i` of a case is set when corner `i`
//! is solid. The rule, for every face of the cube: where the face is ambiguous (two solid corners across a
//! diagonal), each solid corner is cut off separately. Two cubes that share a face so draw the same segments
//! there, whatever else they hold, and the union of all cubes is closed. Triangles are counter-clockwise seen
//! from the air.
//!
//! Tables that treat a case like its complement, and tests that look at values on a face, break that rule and leave
//! holes.

use std::sync::LazyLock;

use glam::IVec3;

/// A cube edge: 4 edges along x, then 4 along y, then 4 along z; see [`edge_corners`].
pub type Edge = u8;

/// The triangles of one case, three cube edges each.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Case {
    edges: [Edge; 15],
    count: u8,
}

impl Case {
    /// The triangles: the cube edges that their vertices lie on.
    pub fn triangles(&self) -> impl Iterator<Item = [Edge; 3]> {
        self.edges[..usize::from(self.count) * 3].chunks_exact(3).map(|t| [t[0], t[1], t[2]])
    }
}

/// The table of all 256 cases.
pub fn table() -> &'static [Case; 256] {
    static TABLE: LazyLock<[Case; 256]> = LazyLock::new(|| std::array::from_fn(derive));
    &TABLE
}

/// The position of a corner in its cube.
pub const fn corner(index: usize) -> [i32; 3] {
    [(index & 1) as i32, (index >> 1 & 1) as i32, (index >> 2 & 1) as i32]
}

/// The lower corner of an edge and the axis it runs along.
pub const fn edge_corners(edge: Edge) -> (usize, usize) {
    let axis = edge as usize / 4;
    let (u, v) = match axis {
        0 => (1, 2),
        1 => (0, 2),
        _ => (0, 1),
    };
    let number = edge as usize % 4;
    ((number & 1) << u | (number >> 1) << v, axis)
}

/// The case of the cube whose lowest corner is `low`.
pub fn case_of(low: IVec3, is_solid: impl Fn(IVec3) -> bool) -> usize {
    (0..8).fold(0, |case, i| case | usize::from(is_solid(low + IVec3::from_array(corner(i)))) << i)
}

/// The lattice edge that a cube's edge lies on: its lower end and its axis.
pub fn lattice_edge(low: IVec3, edge: Edge) -> (IVec3, usize) {
    let (start, axis) = edge_corners(edge);
    (low + IVec3::from_array(corner(start)), axis)
}

/// The edge between two corners that differ along one axis.
fn edge_between(a: usize, b: usize) -> Edge {
    let low = a.min(b);
    let axis = (a ^ b).trailing_zeros() as usize;
    (0..12).find(|&edge| edge_corners(edge) == (low, axis)).unwrap_or_default()
}

/// The corners of each face, counter-clockwise seen from outside the cube.
fn faces() -> [[usize; 4]; 6] {
    std::array::from_fn(|face| {
        let (axis, side) = (face / 2, face % 2);
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        let mut ring = [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(a, b)| side << axis | a << u | b << v);
        if side == 0 {
            ring.reverse();
        }
        ring
    })
}

/// Closed loops of crossed edges around the solid corners of a case.
fn loops(case: usize) -> Vec<Vec<Edge>> {
    let mut follow = [None; 12];
    for ring in faces() {
        let solid = ring.map(|corner| case >> corner & 1 == 1);
        let edge: [Edge; 4] = std::array::from_fn(|i| edge_between(ring[i], ring[(i + 1) % 4]));
        let ambiguous = solid[0] == solid[2] && solid[1] == solid[3] && solid[0] != solid[1];
        for i in 0..4 {
            let enters = !solid[(i + 3) % 4] && solid[i];
            if !enters {
                continue;
            }
            // From the edge where solid begins to the edge where it ends; at once, where the corner stands alone.
            let leave = (i..i + 4).find(|&j| ambiguous || !solid[(j + 1) % 4]).unwrap_or(i);
            follow[usize::from(edge[(i + 3) % 4])] = Some(edge[leave % 4]);
        }
    }
    let mut found = Vec::new();
    while let Some(start) = follow.iter().position(Option::is_some) {
        let (mut path, mut at) = (Vec::new(), start);
        while let Some(next) = follow[at].take() {
            path.push(at as Edge);
            at = usize::from(next);
        }
        found.push(path);
    }
    found
}

/// Every triangulation of a polygon that is given by its corners in order.
fn triangulations(polygon: &[Edge]) -> Vec<Vec<[Edge; 3]>> {
    let (Some(&first), Some(&last)) = (polygon.first(), polygon.last()) else { return vec![vec![]] };
    if polygon.len() < 3 {
        return vec![vec![]];
    }
    let mut all = Vec::new();
    for i in 1..polygon.len() - 1 {
        for left in triangulations(&polygon[..=i]) {
            for right in triangulations(&polygon[i..]) {
                all.push([left.clone(), right, vec![[first, polygon[i], last]]].concat());
            }
        }
    }
    all
}

/// Returns `true` if the two edges lie in a common face of the cube.
fn share_face(a: Edge, b: Edge) -> bool {
    let ends = |edge| {
        let (low, axis) = edge_corners(edge);
        [low, low | 1 << axis]
    };
    let on = |ring: &[usize; 4], edge| ends(edge).iter().all(|corner| ring.contains(corner));
    faces().iter().any(|ring| on(ring, a) && on(ring, b))
}

/// How many inner diagonals lie in a cube face. Such a diagonal would lie flat in the face that two cubes share.
fn flat_diagonals(triangles: &[[Edge; 3]], polygon: &[Edge]) -> usize {
    let neighbours = |a: Edge, b: Edge| {
        let at = |edge| polygon.iter().position(|&other| other == edge).unwrap_or_default();
        let apart = at(a).abs_diff(at(b));
        apart == 1 || apart == polygon.len() - 1
    };
    let sides = |t: &[Edge; 3]| [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])];
    triangles.iter().flat_map(sides).filter(|&(a, b)| !neighbours(a, b) && share_face(a, b)).count()
}

/// How little a triangulation is like a tile's, which splits its cells along (x, z)-(x + 1, z + 1): first without that
/// diagonal, then by triangles that touch none of its ends. Where the ground is gentle, cubes so draw the very
/// triangles of the tile.
fn unlike_tile(triangles: &[[Edge; 3]]) -> (bool, usize) {
    const OVER_LOW_COLUMN: Edge = 4;
    const OVER_HIGH_COLUMN: Edge = 7;
    let touches =
        |triangle: &[Edge; 3]| [OVER_LOW_COLUMN, OVER_HIGH_COLUMN].map(|edge| triangle.contains(&edge));
    let has_diagonal = triangles.iter().any(|triangle| touches(triangle) == [true; 2]);
    (!has_diagonal, triangles.iter().filter(|triangle| touches(triangle) == [false; 2]).count())
}

fn derive(case: usize) -> Case {
    let mut result = Case { edges: [0; 15], count: 0 };
    for polygon in loops(case) {
        let best = triangulations(&polygon)
            .into_iter()
            .min_by_key(|triangles| (flat_diagonals(triangles, &polygon), unlike_tile(triangles)));
        for triangle in best.unwrap_or_default() {
            let at = usize::from(result.count) * 3;
            result.edges[at..at + 3].copy_from_slice(&triangle);
            result.count += 1;
        }
    }
    result
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_solid_corner_gives_one_triangle_that_faces_away_from_it() {
        for solid in 0..8 {
            let triangles: Vec<_> = table()[1 << solid].triangles().collect();
            assert_eq!(triangles.len(), 1);
            let [a, b, c] = triangles[0].map(|edge| {
                let (low, axis) = edge_corners(edge);
                let mut middle = glam::Vec3::from_array(corner(low).map(|v| v as f32));
                middle[axis] += 0.5;
                middle
            });
            let corner = glam::Vec3::from_array(corner(solid).map(|v| v as f32));
            assert!((b - a).cross(c - a).dot(a - corner) > 0.0, "corner {solid}");
        }
    }

    #[test]
    fn the_table_has_820_triangles_and_none_lies_flat_in_a_face() {
        assert_eq!(table().iter().map(|case| case.triangles().count()).sum::<usize>(), 820);
        for case in 0..256 {
            for polygon in loops(case) {
                let flat = triangulations(&polygon).iter().map(|t| flat_diagonals(t, &polygon)).min();
                assert_eq!(flat, Some(0), "case {case}");
            }
        }
    }

    #[test]
    fn level_ground_is_split_like_a_tile() {
        let bottom = 1 << 0 | 1 << 1 | 1 << 4 | 1 << 5;
        assert_eq!(edge_corners(4), (0, 1));
        assert_eq!(edge_corners(7), (5, 1));
        assert!(table()[bottom].triangles().all(|triangle| triangle.contains(&4) && triangle.contains(&7)));
    }

    #[test]
    fn cubes_that_share_a_face_draw_the_same_segments_there() {
        let sides = |case: usize, ring: &[usize; 4]| {
            let edges: Vec<Edge> = (0..4).map(|i| edge_between(ring[i], ring[(i + 1) % 4])).collect();
            let mut found: Vec<(Edge, Edge)> = table()[case]
                .triangles()
                .flat_map(|t| [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])])
                .filter(|(a, b)| edges.contains(a) && edges.contains(b))
                .collect();
            found.sort_unstable();
            found
        };
        for ring in faces() {
            for pattern in 0..16 {
                let cases = (0..256).filter(|case| (0..4).all(|i| case >> ring[i] & 1 == pattern >> i & 1));
                let drawn: Vec<_> = cases.map(|case| sides(case, &ring)).collect();
                assert!(
                    drawn.windows(2).all(|pair| pair[0] == pair[1]),
                    "face {ring:?} pattern {pattern:04b}"
                );
            }
        }
    }
}
