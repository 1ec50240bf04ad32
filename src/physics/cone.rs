//! Contact normals of a triangle that knows its neighbours.
//!
//! A body that rolls from one triangle to the next touches the edge between them. A lone triangle's edge could push it
//! in any outward direction, which is a bump on flat ground. With the neighbours known, a contact normal leans over an
//! edge at most as far as the neighbour's own normal, and not at all where the ground is flat or concave.

use avian3d::parry::math::Vector;
use avian3d::parry::query::details::NormalConstraints;

/// How much farther than its neighbours a normal may lean, as a sine. Rounding must not decide between two triangles
/// when a body is right above their edge.
const SLACK: f32 = 1e-3;

/// The most rounds over the three sides. At a right angle each round halves the excess.
const ROUNDS: usize = 16;

/// The normals of one triangle and its three sides.
#[derive(Clone, Debug)]
pub(super) struct NormalCone {
    /// The triangle's own normal.
    pub face: Vector,
    /// For each side: the outward direction in the triangle's plane, and the neighbour's normal.
    pub sides: [(Vector, Vector); 3],
}

impl NormalCone {
    /// Rotates a normal back that leans too far over a side, and returns whether it did.
    fn turn(&self, normal: &mut Vector) -> bool {
        let mut is_turned = false;
        for (outwards, beyond) in &self.sides {
            let (lean, up) = (normal.dot(*outwards), normal.dot(self.face));
            let convex = beyond.dot(*outwards);
            let (most, above) = if convex > 0.0 { (convex, beyond.dot(self.face)) } else { (0.0, 1.0) };
            if lean * above - most * up > SLACK {
                let length = lean.hypot(up) / most.hypot(above);
                *normal += *outwards * (most * length - lean) + self.face * (above * length - up);
                is_turned = true;
            }
        }
        if is_turned {
            *normal = normal.normalize_or(self.face);
        }
        is_turned
    }
}

impl NormalConstraints for NormalCone {
    fn project_local_normal_mut(&self, normal: &mut Vector) -> bool {
        // Ground is one-sided.
        if normal.dot(self.face) < 0.0 {
            return false;
        }
        // After the correction for one side, the normal may lean over another.
        for _ in 0..ROUNDS {
            if !self.turn(normal) {
                return true;
            }
        }
        *normal = self.face;
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A level triangle whose neighbour across its first side, towards +x, has this normal. The others are level.
    fn beside(beyond: Vector) -> NormalCone {
        let diagonal = Vector::new(-1.0, 0.0, 1.0).normalize();
        NormalCone {
            face: Vector::Y,
            sides: [(Vector::X, beyond), (diagonal, Vector::Y), (Vector::NEG_Z, Vector::Y)],
        }
    }

    fn pushed(cone: &NormalCone, normal: Vector) -> Option<Vector> {
        cone.project_local_normal(normal.normalize())
    }

    #[test]
    fn level_ground_pushes_straight_up() {
        let cone = beside(Vector::Y);
        for lean in [Vector::X, Vector::Z, Vector::NEG_Z, Vector::new(-1.0, 0.0, 0.3)] {
            let up = pushed(&cone, Vector::Y + lean).expect("from above");
            assert!(up.abs_diff_eq(Vector::Y, 2.0 * SLACK), "{lean} gives {up}");
        }
    }

    #[test]
    fn a_ridge_pushes_to_both_sides_but_no_farther_than_its_slopes() {
        let slope = Vector::new(1.0, 1.0, 0.0).normalize();
        let cone = beside(slope);
        let within = Vector::new(0.5, 1.0, 0.0).normalize();
        let free = pushed(&cone, within).expect("from above");
        assert!(free.abs_diff_eq(within, 1e-6), "{free}");
        let beyond = pushed(&cone, Vector::new(2.0, 1.0, 0.0)).expect("from above");
        assert!(beyond.abs_diff_eq(slope, 1e-6), "{beyond}");
    }

    #[test]
    fn a_hollow_does_not_push_back() {
        let cone = beside(Vector::new(-1.0, 1.0, 0.0).normalize());
        let up = pushed(&cone, Vector::new(1.0, 1.0, 0.0)).expect("from above");
        assert!(up.abs_diff_eq(Vector::Y, 1e-6), "{up}");
    }

    #[test]
    fn an_overhang_pushes_sideways() {
        let cone = beside(Vector::new(1.0, -1.0, 0.0).normalize());
        let sideways = Vector::new(1.0, 0.05, 0.0).normalize();
        let free = pushed(&cone, sideways).expect("from above");
        assert!(free.abs_diff_eq(sideways, 1e-6), "{free}");
    }

    #[test]
    fn ground_is_not_felt_from_below() {
        assert_eq!(pushed(&beside(Vector::Y), Vector::NEG_Y), None);
    }
}
