//! Chooses the cut for a set of viewpoints by the size of cells and errors on the screen.

use glam::Vec3;

use super::{Cut, LodGrid, Node};

/// Factor by which all limits grow each time there would be too many nodes.
const GROWTH: f32 = 1.2;

/// The least of all limits in pixels: what is less, or no number, counts as this.
const LEAST_PIXELS: f32 = 0.01;

/// Steps of the search for the place on an axis that is nearest to a box: it ends within 1/3,000 of the axis.
const AXIS_STEPS: usize = 20;

/// The least share of limits at which a node stays split: with none, nothing would ever be merged.
const LEAST_STAY: f32 = 0.01;

/// The maximum number of times that limits grow: by then they are so large that only nodes around an eye are split.
const MAX_GROWTHS: u32 = 60;

/// A viewpoint that the level of detail is chosen for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Viewpoint {
    /// Position, in voxels.
    pub position: Vec3,
    /// Velocity, in voxels a second.
    pub velocity: Vec3,
    /// Pixels that one voxel covers. In perspective, one voxel away: the height of the picture over twice the tangent
    /// of half the angle of view.
    pub pixels: f32,
    /// How sizes change with distance.
    pub view: View,
}

/// How sizes on the screen change with distance.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum View {
    /// Objects at twice the distance have half the size.
    #[default]
    Perspective,
    /// Everything in view has the same size, as in an orthographic projection. Objects out of view count as smaller, by
    /// how many radii it is away from the axis.
    Parallel {
        /// From the eye to the far end of the view, in voxels.
        axis: Vec3,
        /// The greatest distance of what is in view from the axis, in voxels.
        radius: f32,
    },
}

impl Viewpoint {
    /// The distance of a box from the eye, or, in a parallel view, from its axis.
    pub fn distance(&self, low: Vec3, high: Vec3) -> f32 {
        self.distance_from(self.position, low, high)
    }

    /// The distance if the eye were at this place.
    fn distance_from(&self, place: Vec3, low: Vec3, high: Vec3) -> f32 {
        let high = high.max(low);
        let to_box = |place: Vec3| place.distance(place.clamp(low, high));
        match self.view {
            View::Perspective => to_box(place),
            View::Parallel { axis, .. } => {
                // The distance is a convex function of the place on the axis.
                let [mut from, mut to] = [0.0, 1.0];
                for _ in 0..AXIS_STEPS {
                    let [a, b] = [from + (to - from) / 3.0, to - (to - from) / 3.0];
                    if to_box(place + axis * a) <= to_box(place + axis * b) {
                        to = b;
                    } else {
                        from = a;
                    }
                }
                to_box(place + axis * ((from + to) / 2.0))
            }
        }
    }

    /// How many times smaller than `pixels` a voxel is at this distance.
    fn reduction(&self, distance: f32) -> f32 {
        match self.view {
            // One voxel away it is large enough in any case.
            View::Perspective => distance.max(1.0),
            View::Parallel { radius, .. } => (distance / radius.max(1.0)).max(1.0),
        }
    }

    /// Whether all numbers are finite.
    pub fn is_finite(&self) -> bool {
        let is_view_finite = match self.view {
            View::Perspective => true,
            View::Parallel { axis, radius } => axis.is_finite() && radius.is_finite(),
        };
        self.position.is_finite() && self.pixels.is_finite() && is_view_finite
    }
}

/// The properties of a node that a choice depends on.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct NodeFacts {
    /// The node's lowest and highest point, in voxels.
    pub heights: [f32; 2],
    /// Greatest distance from the finer surface, in voxels.
    pub error: f32,
    /// Whether anything was dug or built there.
    pub has_edits: bool,
}

/// Limits by which nodes are split. Each is a size on the screen in pixels.
///
/// A node is split if its cells are larger than `cell_pixels` and its error larger than `error_pixels`; or if it has
/// edits and its cells are larger than `edited_pixels`.
#[derive(Clone, Debug, PartialEq)]
pub struct LodSettings {
    /// The least size of cells, 12 unless set otherwise.
    pub cell_pixels: f32,
    /// The greatest error, 2 unless set otherwise.
    pub error_pixels: f32,
    /// The greatest size of cells in nodes with edits, 4 unless set otherwise.
    pub edited_pixels: f32,
    /// A node that was split stays so until it is below this share of the limits, 0.7 unless set otherwise. So levels
    /// do not flicker while a viewpoint moves back and forth.
    pub hysteresis: f32,
    /// The choice also considers where each viewpoint will be in this many seconds; 0.5 by default.
    pub look_ahead: f32,
    /// Nodes farther from all viewpoints than this many voxels are not split; 8,192 by default.
    pub view_distance: f32,
    /// The most nodes, about 2,400 unless set otherwise: beyond them, all limits grow.
    pub max_nodes: usize,
}

impl Default for LodSettings {
    fn default() -> Self {
        Self {
            cell_pixels: 12.0,
            error_pixels: 2.0,
            edited_pixels: 4.0,
            hysteresis: 0.7,
            look_ahead: 0.5,
            view_distance: 8192.0,
            max_nodes: 2400,
        }
    }
}

impl LodSettings {
    /// The cut that these viewpoints need together, wherever they look: turning changes nothing. `before` is the
    /// previous cut. Viewpoints whose numbers are not finite are ignored.
    pub fn cut(&self, before: &Cut, eyes: &[Viewpoint], facts: impl Fn(Node) -> NodeFacts) -> Cut {
        let grid = before.grid();
        let eyes: Vec<Viewpoint> = eyes.iter().filter(|eye| eye.is_finite()).copied().collect();
        let with_limits = |growth: f32| {
            Cut::new(grid, |node| {
                let share = if before.is_split(node) { self.hysteresis.clamp(LEAST_STAY, 1.0) } else { 1.0 };
                self.is_split(grid, node, facts(node), &eyes, [share, growth])
            })
        };
        let mut cut = with_limits(1.0);
        for times in 1..=MAX_GROWTHS {
            if cut.nodes().count() <= self.max_nodes {
                break;
            }
            cut = with_limits(GROWTH.powi(times as i32));
        }
        cut
    }

    /// Returns `true` if a node is near and large enough on the screen to be split. The limits are scaled by
    /// `share`, times their growth.
    fn is_split(
        &self,
        grid: LodGrid,
        node: Node,
        facts: NodeFacts,
        eyes: &[Viewpoint],
        [share, growth]: [f32; 2],
    ) -> bool {
        let limit = |pixels: f32| pixels.max(LEAST_PIXELS) * share * growth;
        let (low, high) = grid.columns(node);
        let low = Vec3::new(low.x as f32, facts.heights[0], low.z as f32);
        let high = Vec3::new(high.x as f32, facts.heights[1], high.z as f32);
        let stride = node.stride() as f32;
        let has_edits = facts.has_edits;
        eyes.iter().any(|eye| {
            let places = [eye.position, eye.position + eye.velocity * self.look_ahead];
            let distance = |place: Vec3| eye.distance_from(place, low, high);
            let distance = places.map(distance).into_iter().fold(f32::INFINITY, f32::min);
            let pixels = eye.pixels / eye.reduction(distance);
            let is_rough =
                stride * pixels > limit(self.cell_pixels) && facts.error * pixels > limit(self.error_pixels);
            let is_edited = has_edits && stride * pixels > limit(self.edited_pixels);
            distance * share <= self.view_distance && (is_rough || is_edited)
        })
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::super::cut::hash_node;
    use super::super::cut::tests::assert_is_cut;
    use super::*;
    use crate::lattice::ChunkGrid;

    /// Pixels of a picture 1,440 high at 45 degrees.
    const PIXELS: f32 = 1738.0;

    /// 16 x 16 km of mountains: errors as a surface of fractal noise has them.
    fn mountains(node: Node) -> NodeFacts {
        let rough = 0.05 + (hash_node(node, 3) >> 11) as f32 / (1u64 << 53) as f32 * 0.4;
        NodeFacts { heights: [0.0, 300.0], error: rough * node.stride() as f32, has_edits: false }
    }

    fn eye(x: f32, z: f32) -> Viewpoint {
        let (position, velocity) = (Vec3::new(x, 302.0, z), Vec3::ZERO);
        Viewpoint { position, velocity, pixels: PIXELS, view: View::Perspective }
    }

    fn world() -> LodGrid {
        LodGrid::new(ChunkGrid::new(32, 16_384, 16_384), 6)
    }

    #[test]
    fn nodes_grow_little_with_the_view() {
        let coarsest = Cut::coarsest(world());
        let counts = [512.0, 1024.0, 2048.0, 4096.0, 8192.0, 16_384.0].map(|view_distance| {
            let choice = LodSettings { view_distance, ..LodSettings::default() };
            let cut = choice.cut(&coarsest, &[eye(8000.0, 8100.0)], mountains);
            cut.nodes().count()
        });
        assert!(counts.iter().all(|&count| count <= 2400), "{counts:?}");
        assert!(counts.windows(2).all(|pair| pair[1] <= pair[0] + 350), "{counts:?}");
        assert!(counts[4] > counts[0], "{counts:?}");
    }

    #[test]
    fn limits_grow_until_there_are_few_enough_nodes() {
        let rough = |node| NodeFacts { error: 1e6, ..mountains(node) };
        for max_nodes in [400, 1200] {
            let choice = LodSettings { max_nodes, cell_pixels: 1.0, ..LodSettings::default() };
            let eyes = [eye(4000.0, 4000.0), eye(12_000.0, 9000.0)];
            let cut = choice.cut(&Cut::coarsest(world()), &eyes, rough);
            let count = cut.nodes().count();
            assert!(count <= max_nodes && count > max_nodes / 3, "{count} of {max_nodes}");
        }
    }

    #[test]
    fn the_ground_below_an_eye_is_drawn_in_full() {
        let cut = LodSettings::default().cut(&Cut::coarsest(world()), &[eye(5000.0, 9000.0)], mountains);
        assert_is_cut(&cut);
        let tile = world().chunks().tile_of_cell(crate::lattice::Column::new(5000, 9000));
        assert_eq!(cut.node_at(tile).map(|node| node.level), Some(0));
    }

    /// A parallel view straight down, of a picture of this many voxels' height and 1,080 pixels.
    fn view_from_above(x: f32, z: f32, height: f32) -> Viewpoint {
        let view = View::Parallel { axis: Vec3::NEG_Y * 2000.0, radius: height };
        let position = Vec3::new(x, 1500.0, z);
        Viewpoint { position, velocity: Vec3::ZERO, pixels: 1080.0 / height, view }
    }

    #[test]
    fn a_parallel_view_is_as_fine_as_its_picture_needs_and_coarse_elsewhere() {
        let choice = LodSettings { cell_pixels: 12.0, error_pixels: 0.01, ..LodSettings::default() };
        let mut before = None;
        for height in [40.0, 400.0, 4000.0] {
            let cut =
                choice.cut(&Cut::coarsest(world()), &[view_from_above(8000.0, 8000.0, height)], mountains);
            let level = |x, z| {
                let tile = world().chunks().tile_of_cell(crate::lattice::Column::new(x, z));
                cut.node_at(tile).map(|node| node.level).expect("inside the world")
            };
            let below = level(8000, 8000);
            // The coarsest cells that are smaller than the limit, and no finer.
            let cell = 1080.0 / height * f32::from(1u16 << below);
            assert!(below == 0 || cell / 2.0 <= 12.0 && cell > 5.9, "{height}: level {below}");
            assert!(before.is_none_or(|before| before <= below), "farther views are no finer");
            assert!(level(200, 200) >= below, "{height}");
            before = Some(below);
        }
        // A view of all of the world from above needs few nodes, one of a house from above few around it.
        let few = choice.cut(&Cut::coarsest(world()), &[view_from_above(8000.0, 8000.0, 40.0)], mountains);
        assert!(few.nodes().count() < 1500, "{}", few.nodes().count());
    }

    #[test]
    fn the_distance_from_an_axis_is_that_of_its_nearest_place() {
        let mut rng = fastrand::Rng::with_seed(3);
        for _ in 0..200 {
            let mut place = |size: f32| Vec3::new(rng.f32(), rng.f32(), rng.f32()) * size - size / 2.0;
            let (position, axis, low) = (place(100.0), place(200.0), place(100.0));
            let high = low + place(30.0).abs();
            let view = View::Parallel { axis, radius: 1.0 };
            let eye = Viewpoint { position, velocity: Vec3::ZERO, pixels: 1.0, view };
            let along = (0..=4000).map(|step| position + axis * (step as f32 / 4000.0));
            let expected = along.map(|at| at.distance(at.clamp(low, high))).fold(f32::INFINITY, f32::min);
            assert!((eye.distance(low, high) - expected).abs() < 0.2, "{eye:?} {low} {high}");
        }
    }

    proptest! {
        #[test]
        fn an_eye_that_moves_to_and_fro_soon_changes_nothing(x in 200f32..16_000.0, z in 200f32..16_000.0, step in -8f32..8.0) {
            let choice = LodSettings { max_nodes: usize::MAX, ..LodSettings::default() };
            let mut cut = choice.cut(&Cut::coarsest(world()), &[eye(x, z)], mountains);
            let mut changes = 0;
            for at in [x + step, x].repeat(4) {
                let next = choice.cut(&cut, &[eye(at, z)], mountains);
                prop_assert!(cut.split_nodes().all(|node| next.is_split(node)));
                changes = if next == cut { 0 } else { changes + 1 };
                cut = next;
            }
            prop_assert_eq!(changes, 0);
        }

        #[test]
        fn several_eyes_see_what_each_would(places in prop::collection::vec((200f32..16_000.0, 200f32..16_000.0), 1..4)) {
            let choice = LodSettings { max_nodes: usize::MAX, ..LodSettings::default() };
            let coarsest = Cut::coarsest(world());
            let eyes: Vec<Viewpoint> = places.iter().map(|&(x, z)| eye(x, z)).collect();
            let all = choice.cut(&coarsest, &eyes, mountains);
            for own in eyes {
                let cut = choice.cut(&coarsest, &[own], mountains);
                prop_assert!(cut.split_nodes().all(|node| all.is_split(node)));
            }
        }
    }

    #[test]
    fn limits_that_make_no_sense_give_a_cut_of_few_nodes() {
        for odd in [f32::NAN, f32::NEG_INFINITY, -5.0, 0.0, f32::INFINITY] {
            for choice in [
                LodSettings {
                    cell_pixels: odd,
                    error_pixels: odd,
                    edited_pixels: odd,
                    ..LodSettings::default()
                },
                LodSettings {
                    view_distance: odd,
                    look_ahead: odd,
                    hysteresis: odd,
                    ..LodSettings::default()
                },
            ] {
                for eye in [eye(8000.0, 8000.0), eye(odd, 0.0), Viewpoint { pixels: odd, ..eye(9.0, 9.0) }] {
                    let cut = choice.cut(&Cut::coarsest(world()), &[eye], mountains);
                    let count = cut.nodes().count();
                    assert!(count <= choice.max_nodes, "{count} nodes for {choice:?}, {eye:?}");
                }
            }
        }
    }

    #[test]
    fn edits_are_seen_from_farther_away() {
        let flat = |has_edits| move |_| NodeFacts { has_edits, ..NodeFacts::default() };
        let coarsest = Cut::coarsest(world());
        let count = |has_edits| {
            LodSettings::default().cut(&coarsest, &[eye(8000.0, 8000.0)], flat(has_edits)).nodes().count()
        };
        assert_eq!(count(false), coarsest.nodes().count());
        assert!(count(true) > count(false));
    }
}
