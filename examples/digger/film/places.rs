//! Good places to dig and build: a steep hillside for a tunnel, a ravine for a bridge, a chunk corner for a pit.
//!
//! They are found by searching the real land, so that they fit any heightmap at any scale. The game starts at the
//! hillside. All places are in space, whose origin is a corner of the real land.

use bevy::math::DVec3;
use bevy::prelude::*;
use bevy_burrow::ground::Ground;
use bevy_burrow::lattice::{Column, ONE};
use bevy_burrow::terrain::World as Model;

use crate::world::landscape::{ORIGIN, REAL_SIZE};
use crate::world::light::SUN;

/// The side of the terrain's chunks.
pub const CHUNK: i32 = 32;
/// Radius of the tunnel.
pub const TUNNEL_RADIUS: f32 = 2.9;
/// Radius of the room.
pub const ROOM_RADIUS: f32 = 8.0;
/// Metres from the mouth to the bend, and from there to the room.
const LEGS: (f32, f32) = (36.0, 34.0);
/// Slope of the tunnel.
const GRADE: f32 = 0.03;
/// Least distance from the rim of the real land.
const MARGIN: i32 = 100;

/// All places.
#[derive(Resource, Clone, Debug)]
pub struct Places {
    /// For the tunnel.
    pub hillside: Hillside,
    /// For the bridge.
    pub ravine: Ravine,
    /// A corner of four chunks on level ground, for the pit.
    pub corner: Vec3,
}

/// Level ground in front of a steep hill.
#[derive(Clone, Copy, Debug)]
pub struct Hillside {
    /// The ground at the foot of the slope.
    pub mouth: Vec3,
    /// The direction into the hill, as (x, z).
    pub inward: Vec2,
    /// The direction of the tunnel after its bend.
    pub onward: Vec2,
}

/// Two banks with lower ground between them.
#[derive(Clone, Copy, Debug)]
pub struct Ravine {
    /// The ground of one bank.
    pub from: Vec3,
    /// The ground of the other, along +x or +z.
    pub to: Vec3,
    /// The ground some metres behind each bank.
    pub behind: [Vec3; 2],
    /// The height of the lowest ground between.
    pub bottom: f32,
}

impl Places {
    /// Searches the ground.
    ///
    /// # Errors
    /// If a place was not found.
    pub fn find(ground: &Ground) -> Result<Self, String> {
        let relief = Relief::new(ground);
        let hillside = relief.hillside().ok_or("no hillside is steep and high enough for the tunnel")?;
        let far_from_tunnel = |place: Vec2| place.distance(hillside.mouth.xz()) > 110.0;
        let ravine = relief
            .ravine(&hillside, far_from_tunnel)
            .ok_or("no ravine is deep and narrow enough for the bridge")?;
        let free = |place: Vec2| far_from_tunnel(place) && place.distance(ravine.from.xz()) > 110.0;
        let corner = relief.corner(&hillside, free).ok_or("no chunk corner lies on level ground")?;
        Ok(Self { hillside, ravine, corner })
    }
}

impl Hillside {
    /// Where the player starts.
    pub fn start(&self) -> Vec2 {
        self.mouth.xz() - self.inward * 44.0
    }

    /// Points on the tunnel's floor: in front of the mouth, at the bend, and where the room begins.
    pub fn floor(&self) -> [Vec3; 3] {
        let rise = |xz: Vec2, along: f32| Vec3::new(xz.x, self.mouth.y + GRADE * along, xz.y);
        let mouth = self.mouth.xz();
        let bend = mouth + self.inward * LEGS.0;
        let end = bend + self.onward * LEGS.1;
        [rise(mouth - self.inward * 2.0, 0.0), rise(bend, LEGS.0), rise(end, LEGS.0 + LEGS.1)]
    }

    /// The middle of the room.
    pub fn room(&self) -> Vec3 {
        let [_, _, end] = self.floor();
        end + flat(self.onward) * (ROOM_RADIUS - 2.0) + Vec3::Y * (ROOM_RADIUS - 2.0)
    }
}

impl Ravine {
    /// How many points on the deck and the arch of a bridge over it are visible from a place, whether or not the bridge
    /// is built.
    pub fn points_visible_from(&self, land: &Land, eye: Vec3) -> usize {
        /// The bridge itself is nearer to its middle line than this.
        const BRIDGE: f32 = 4.0;
        let across = (self.to - self.from).cross(Vec3::Y).normalize();
        let open = 1.0 - (BRIDGE / (eye - self.from).dot(across).abs()).min(1.0);
        let points = (1..12).map(|i| self.from.lerp(self.to, i as f32 / 12.0));
        let points = points.flat_map(|bank| [1.0, -4.0].map(|up| bank + Vec3::Y * up));
        points.filter(|&point| land.is_free(eye, eye + open * (point - eye))).count()
    }
}

/// The ground as it is now, at its place in space.
pub struct Land<'a> {
    pub model: &'a Model,
    /// The voxel at the origin of space.
    pub origin: IVec3,
}

impl Land<'_> {
    fn voxel(&self, place: Vec3) -> DVec3 {
        (place + self.origin.as_vec3()).as_dvec3()
    }

    /// The height of the ground; `None` outside the world.
    pub fn height(&self, place: Vec2) -> Option<f32> {
        let DVec3 { x, z, .. } = self.voxel(flat(place));
        self.model.height(x, z).map(|height| height as f32 - self.origin.y as f32)
    }

    /// Whether there is no ground between two places.
    fn is_free(&self, from: Vec3, to: Vec3) -> bool {
        let direction = (to - from).as_dvec3();
        self.model.raycast(self.voxel(from), direction, direction.length()).is_none()
    }
}

/// The real land, with heights in metres.
struct Relief<'a> {
    ground: &'a Ground,
    /// Heights of its columns, row by row: the search needs each of them many times.
    heights: Vec<i32>,
}

impl<'a> Relief<'a> {
    fn new(ground: &'a Ground) -> Self {
        let [width, depth] = REAL_SIZE;
        let places = (0..=depth).flat_map(|z| (0..=width).map(move |x| (x, z)));
        let heights = places.map(|(x, z)| ground.height(Column::new(ORIGIN.x + x, ORIGIN.z + z))).collect();
        Self { ground, heights }
    }

    fn height(&self, place: Vec2) -> f32 {
        let [x, z] = [place.x, place.y].map(|at| at.round() as i32);
        let [width, depth] = REAL_SIZE;
        let is_inside = (0..=width).contains(&x) && (0..=depth).contains(&z);
        let height = if is_inside {
            self.heights[(z * (width + 1) + x) as usize]
        } else {
            self.ground.height(Column::new(ORIGIN.x + x, ORIGIN.z + z))
        };
        height as f32 / ONE as f32
    }

    fn at(&self, place: Vec2) -> Vec3 {
        Vec3::new(place.x, self.height(place), place.y)
    }

    /// A grid of places, away from the rim.
    fn places(&self, step: i32) -> impl Iterator<Item = Vec2> {
        let along = move |cells: i32| (MARGIN + step - 1) / step..=(cells - MARGIN) / step;
        let [width, depth] = REAL_SIZE;
        along(depth)
            .flat_map(move |z| along(width).map(move |x| Vec2::new((x * step) as f32, (z * step) as f32)))
    }

    /// A place where the ground rises by more than 10 within 12 voxels and by 30 behind, with a level path to it, and
    /// enough rock above a tunnel and a room. It is in the sun.
    fn hillside(&self) -> Option<Hillside> {
        let headings = (0..16).map(|i| Vec2::from_angle(i as f32 * std::f32::consts::TAU / 16.0));
        let found = self.places(6).flat_map(|foot| {
            headings.clone().filter_map(move |inward| {
                let mouth = self.at(foot);
                let rise = |along: f32| self.height(foot + inward * along) - mouth.y;
                let steep = rise(12.0);
                let hill = (30..=80).step_by(5).map(|along| rise(along as f32)).fold(0.0, f32::max);
                let path: Vec<f32> = (0..=26).map(|i| rise(-2.0 * i as f32)).collect();
                let roughness = path.windows(2).map(|pair| (pair[0] - pair[1]).abs()).fold(0.0, f32::max);
                let uneven = path.iter().map(|rise| rise.abs()).fold(0.0, f32::max);
                if steep <= 10.0 || hill < 30.0 || roughness > 1.6 || uneven > 8.0 {
                    return None;
                }
                let open = [-28.0, 28.0].into_iter().all(|aside| {
                    [12.0, 26.0].into_iter().all(|back| {
                        self.height(foot - inward * back + inward.perp() * aside) < mouth.y + 12.0
                    })
                });
                let sunny = (0..5).all(|i| self.is_sunny(self.at(foot - inward * (8 * i - 4) as f32)));
                if !(open && sunny) {
                    return None;
                }
                let bends = [-0.75, 0.75].map(|angle| Hillside {
                    mouth,
                    inward,
                    onward: Vec2::from_angle(angle).rotate(inward),
                });
                let covered = bends.into_iter().find(|hillside| self.covers(hillside))?;
                let sun = -inward.dot(SUN.xz().normalize());
                let score = steep.min(18.0) + 0.1 * hill.min(70.0) + 12.0 * sun - uneven - 4.0 * roughness;
                Some((score, covered))
            })
        });
        found.max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, hillside)| hillside)
    }

    /// Whether this ground is in the sun.
    fn is_sunny(&self, place: Vec3) -> bool {
        (2..=60).map(|i| place + Vec3::Y + SUN * 3.0 * i as f32).all(|high| self.height(high.xz()) < high.y)
    }

    /// Whether there is rock above the tunnel, except for its first metres, and around its room.
    fn covers(&self, hillside: &Hillside) -> bool {
        let [mouth, bend, end] = hillside.floor();
        let under = |place: Vec3, ceiling: f32| self.height(place.xz()) >= place.y + ceiling + 3.0;
        let along = |from: Vec3, to: Vec3| (0..=12).map(move |i| from.lerp(to, i as f32 / 12.0));
        let roof = 2.0 * TUNNEL_RADIUS;
        let tunnel = along(mouth, bend).skip(4).chain(along(bend, end)).all(|place| under(place, roof));
        let room = hillside.room();
        let around = (0..8).map(|i| Vec2::from_angle(i as f32 * std::f32::consts::TAU / 8.0) * ROOM_RADIUS);
        tunnel && around.into_iter().all(|offset| under(room + flat(offset), ROOM_RADIUS))
    }

    /// Two banks of similar height over lower ground, along an axis, so that the bridge has straight edges.
    fn ravine(&self, hillside: &Hillside, allowed: impl Fn(Vec2) -> bool) -> Option<Ravine> {
        let allowed = &allowed;
        let spans = [Vec2::X, Vec2::Y]
            .into_iter()
            .flat_map(|axis| (24..=40).step_by(4).map(move |length| (axis, length as f32)));
        let found = self.places(6).filter(|&place| allowed(place)).flat_map(|place| {
            spans.clone().filter_map(move |(axis, length)| {
                let (from, to) = (self.at(place), self.at(place + axis * length));
                let between: Vec<f32> =
                    (1..20).map(|i| self.height(place + axis * length * i as f32 / 20.0)).collect();
                let low = from.y.min(to.y);
                let bottom = between.iter().copied().fold(f32::INFINITY, f32::min);
                let middle = between[5..14].iter().copied().fold(f32::NEG_INFINITY, f32::max);
                let top = between.iter().copied().fold(f32::NEG_INFINITY, f32::max);
                let behind = [(from, -axis), (to, axis)].map(|(bank, out)| self.at(bank.xz() + out * 12.0));
                let banks = [(from, -axis), (to, axis)].into_iter().all(|(bank, out)| {
                    let beside = [out * 6.0, out * 12.0, axis.perp() * 4.0, axis.perp() * -4.0];
                    beside.into_iter().all(|offset| (self.height(bank.xz() + offset) - bank.y).abs() < 3.0)
                });
                let depth = low - bottom;
                let fits = (from.y - to.y).abs() <= 1.5
                    && (8.0..=20.0).contains(&depth)
                    && low - middle > 4.0
                    && top <= low + 0.5;
                let apart = place.distance(hillside.mouth.xz());
                let score = depth - 2.0 * (from.y - to.y).abs() - 0.1 * length - 0.015 * apart;
                (fits && banks).then_some((score, Ravine { from, to, behind, bottom }))
            })
        });
        found.max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, ravine)| ravine)
    }

    /// A place where four chunks meet, with level ground around it.
    fn corner(&self, hillside: &Hillside, allowed: impl Fn(Vec2) -> bool) -> Option<Vec3> {
        let offsets = (0..24)
            .map(|i| Vec2::from_angle(i as f32 * std::f32::consts::TAU / 8.0) * (6 + i / 8 * 8) as f32);
        let found = self.places(CHUNK).filter(|&place| allowed(place)).map(|place| {
            let here = self.at(place);
            let uneven = offsets
                .clone()
                .map(|offset| (self.height(place + offset) - here.y).abs())
                .fold(0.0, f32::max);
            (uneven + 0.01 * place.distance(hillside.mouth.xz()), here)
        });
        found.min_by(|a, b| a.0.total_cmp(&b.0)).filter(|(score, _)| *score < 20.0).map(|(_, corner)| corner)
    }
}

/// A horizontal direction in world space.
pub fn flat(direction: Vec2) -> Vec3 {
    Vec3::new(direction.x, 0.0, direction.y)
}

#[cfg(test)]
mod tests {
    use bevy_burrow::prelude::*;

    use super::*;
    use crate::film::scripted_brushes;

    #[test]
    fn hills_hide_a_bridge_but_the_bridge_does_not_hide_itself() {
        let height = |x: i32, z: i32| match (x, z) {
            (_, 80..90) => 40.0,
            (42..71, _) => 10.0,
            _ => 20.0,
        };
        let ground = Ground::from_fn(128, 128, height).expect("a small world");
        let mut terrain = Terrain::new(ground, &TerrainSettings::default()).expect("default settings");
        let bank = |x: f32| Vec3::new(x, 20.0, 64.0);
        let ravine =
            Ravine { from: bank(41.0), to: bank(71.0), behind: [bank(29.0), bank(83.0)], bottom: 10.0 };
        let [before, behind] = [30.0, 98.0].map(|z| Vec3::new(56.0, 30.0, z));
        let seen = |terrain: &Terrain| {
            let land = Land { model: terrain.world(), origin: IVec3::ZERO };
            [before, behind].map(|eye| ravine.points_visible_from(&land, eye))
        };
        assert_eq!(seen(&terrain), [22, 0]);
        terrain.apply(scripted_brushes::bridge(&ravine));
        assert_eq!(seen(&terrain), [22, 0], "the bridge does not hide itself");
    }
}
