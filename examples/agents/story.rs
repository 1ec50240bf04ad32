//! What happens: figures cross the pass, a wall closes it, a tunnel opens another way.

use bevy::prelude::*;
use bevy_burrow::paths::bevy_landmass::prelude::*;
use bevy_burrow::prelude::*;

use crate::figures::{COUNT, Figure};
use crate::scene::{PASS, PLAIN};

/// How far along it is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum Chapter {
    /// All walk to the pass.
    #[default]
    Crossing,
    /// The pass is closed.
    Wall,
    /// There is a tunnel.
    Tunnel,
    /// All are there.
    Arrived,
}

#[derive(Resource, Default)]
pub struct Story {
    pub chapter: Chapter,
    /// Seconds in this chapter.
    pub seconds: f32,
    /// Figures without a path when the pass was closed.
    pub stopped: usize,
    pub arrived: usize,
    /// The most figures that were seen in the tunnel at once.
    pub in_tunnel: usize,
}

/// The middle of the tunnel along x.
const TUNNEL: f32 = 64.0;

pub fn advance_story(
    mut story: ResMut<Story>,
    figures: Query<(&Figure, &Transform, &AgentState)>,
    time: Res<Time>,
    mut brushes: MessageWriter<Brush>,
) {
    story.seconds += time.delta_secs();
    let places = || figures.iter().map(|(_, place, _)| place.translation);
    let is_near = |(figure, place, _): &(&Figure, &Transform, &AgentState)| {
        place.translation.xz().distance(figure.goal.xz()) < 2.0
    };
    story.arrived = figures.iter().filter(is_near).count();
    let next = match story.chapter {
        Chapter::Crossing => {
            let across = places().filter(|place| place.z > PASS.y + 10.0).count();
            let is_free = places().all(|place| (place.z - PASS.y).abs() > 7.0);
            (across >= 3 && is_free).then(|| {
                let middle = Vec3::new(PASS.x, PLAIN + 4.0, PASS.y);
                let wall = Shape::cuboid(middle, Vec3::new(12.0, 12.0, 4.0));
                brushes.write(Brush::add(wall, MaterialId(2)));
                Chapter::Wall
            })
        }
        Chapter::Wall => {
            story.stopped = figures.iter().filter(|(.., state)| **state == AgentState::NoPath).count();
            (story.seconds > 2.5).then(|| {
                let end = |z: f32| Vec3::new(TUNNEL, PLAIN + 2.0, z);
                brushes.write(Brush::dig(Shape::capsule(end(PASS.y - 17.0), end(PASS.y + 17.0), 3.5)));
                Chapter::Tunnel
            })
        }
        Chapter::Tunnel => {
            let is_inside = |place: &Vec3| (place.x - TUNNEL).abs() < 4.0 && (place.z - PASS.y).abs() < 12.0;
            story.in_tunnel = story.in_tunnel.max(places().filter(is_inside).count());
            (story.arrived == COUNT).then_some(Chapter::Arrived)
        }
        Chapter::Arrived => None,
    };
    if let Some(next) = next {
        (story.chapter, story.seconds) = (next, 0.0);
    }
}
