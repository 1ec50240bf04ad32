//! Levels of detail: a far horizon, a far pit, edges coloured by level; and how much a change of levels shows.

use bevy::prelude::*;
use bevy_burrow::debug::BurrowDebug;
use bevy_burrow::ground::NoiseSource;
use bevy_burrow::prelude::*;

use crate::album::{Album, flip};
use crate::studio::{SIZE, Studio};

/// Cells along a side of the world.
const SIDE: u32 = 4096;

/// The largest mean FLIP that a change of levels may make. Measured: 0.005.
const SHOWS: f32 = 0.015;

/// Mountains of 4 x 4 km.
pub fn mountains() -> Ground {
    let heights = NoiseHeights {
        seed: 7,
        kind: NoiseKind::Ridged,
        octaves: 7,
        scale: 1400.0,
        amplitude: 260.0,
        base: 0.0,
    };
    let source = NoiseSource::new(&heights).expect("valid noise");
    let ground = Ground::from_source(SIDE, SIDE, source).expect("a valid size");
    ground.with_strata(&Strata::alpine()).expect("valid strata")
}

/// Over the highest of some places in the world's middle.
fn summit(studio: &mut Studio) -> Vec3 {
    let places = (0..400).map(|at| (1500.0 + (at % 20 * 40) as f32, 1500.0 + (at / 20 * 40) as f32));
    let places = places.map(|(x, z)| Vec3::new(x, studio.height(x, z), z));
    places.max_by(|a, b| a.y.total_cmp(&b.y)).expect("some places") + Vec3::Y * 40.0
}

/// Where the eye looks.
const AHEAD: Vec3 = Vec3::new(10.0, -3.0, 9.0);

/// Updates the app until all is drawn as the cameras need it.
pub fn settle(studio: &mut Studio) {
    studio.app.update();
    // Twice: a change of levels begins the frame after the camera moved.
    for _ in 0..2 {
        studio.until("levels", |app| {
            let world = app.world_mut();
            let mut levels = world.query::<(&ShownLevels, &Terrain)>();
            levels.iter(world).all(|(shown, terrain)| shown.waiting == 0 && !terrain.is_busy())
        });
        studio.app.update();
    }
}

/// Gives the only terrain levels of detail, for what the camera sees up to a distance.
pub fn watch_levels(studio: &mut Studio, view_distance: f32) {
    watch(studio, view_distance);
    let world = studio.app.world_mut();
    let terrain = world.query_filtered::<Entity, With<Terrain>>().single(world).expect("one terrain");
    world.entity_mut(terrain).insert(LevelsOfDetail { view_distance, ..default() });
}

/// Has the camera see up to a distance, and levels of detail be chosen for it.
pub fn watch(studio: &mut Studio, view_distance: f32) {
    let far = Projection::from(PerspectiveProjection { far: view_distance.max(8_000.0) * 1.25, ..default() });
    let camera = studio.camera;
    let world = studio.app.world_mut();
    world.entity_mut(camera).insert(far);
    // The studio turns its camera off while it waits.
    world.spawn((ChildOf(camera), DetailSource { picture_height: SIZE.1 as f32, ..default() }));
}

pub fn shoot(studio: &mut Studio, album: &mut Album) {
    studio.terrain(mountains(), GroundLook::default());
    let fog = DistanceFog { falloff: FogFalloff::from_visibility_squared(8000.0), ..default() };
    let camera = studio.camera;
    studio.app.world_mut().entity_mut(camera).insert(fog);
    watch_levels(studio, 4000.0);
    let eye = summit(studio);
    studio.look(eye, eye + AHEAD);
    studio.until("levels", |app| {
        let world = app.world_mut();
        world.query::<&ShownLevels>().iter(world).any(|shown| shown.progress() > 0.0)
    });
    settle(studio);
    let horizon = studio.picture();
    album.compare("levels_horizon", &horizon);

    let below = (AHEAD - Vec3::Y).as_dvec3();
    let hit = studio.one::<Terrain>().world().raycast(eye.as_dvec3(), below, 4000.0);
    let pit = hit.expect("ground is ahead").position.as_vec3();
    studio.apply([Brush::dig(Shape::sphere(pit, 20.0))]);
    let fresh = studio.picture();
    let (apart, _) = flip(&horizon, &fresh);
    println!("a pit of radius 20, {:.0} m away: FLIP {apart:.5}", pit.distance(eye));
    album.check(apart > 1e-4, || format!("the far pit is not seen: FLIP {apart:.5}"));
    settle(studio);
    album.compare("levels_far_pit", &studio.picture());

    studio.app.world_mut().insert_resource(BurrowDebug {
        levels: true,
        focus: Some(pit),
        radius: 500.0,
        max_lines: 200_000,
        ..default()
    });
    (0..3).for_each(|_| studio.app.update());
    album.compare("levels_wires", &studio.picture());
    studio.app.world_mut().insert_resource(BurrowDebug::default());

    // From place to place: what is drawn at first, still at the levels of the place before, and then.
    let mut most = 0.0f32;
    for step in 1..=4 {
        let eye = eye + Vec3::new(30.0, 2.0, 25.0) * step as f32;
        studio.look(eye, eye + AHEAD);
        let before = studio.picture();
        settle(studio);
        let (apart, _) = flip(&before, &studio.picture());
        most = most.max(apart);
    }
    println!("changes of levels within 40 m: FLIP at most {most:.5}");
    album.check(most < SHOWS, || format!("changes of levels show: FLIP {most:.5}"));
    studio.close_terrain();
}
