//! Many bodies on ground that is dug and built under their feet.
//!
//! `BURROW_CROWD=1000` sets the number of balls; there are a tenth as many walkers, and the test lasts a minute. The
//! default is a tenth of that, for a few seconds. `BURROW_SEED` selects another landscape, bodies and edits.

use std::collections::HashMap;

use avian3d::prelude::*;
use bevy::prelude::*;
use bevy_burrow::lattice::Column;
use bevy_burrow::physics::{Character, CharacterSteering, PhysicsFigures};
use bevy_burrow::prelude::*;
use bevy_burrow::terrain::World as Model;
use fastrand::Rng;

use crate::stage::{STEP, Stage};

/// Cells along each side of the landscape.
const SIDE: u32 = 128;

/// The number of balls.
fn crowd() -> usize {
    std::env::var("BURROW_CROWD").ok().and_then(|count| count.parse().ok()).unwrap_or(100)
}

/// The seed of landscape, bodies and edits.
fn seed() -> u32 {
    std::env::var("BURROW_SEED").ok().and_then(|seed| seed.parse().ok()).unwrap_or(0)
}

fn landscape(amplitude: f64, scale: f64) -> Terrain {
    let noise =
        NoiseHeights { seed: 11 + seed(), kind: NoiseKind::Fractal, octaves: 3, scale, amplitude, base: 4.0 };
    let ground = Ground::from_noise(SIDE, SIDE, &noise).expect("valid hills");
    Terrain::new(ground, &TerrainSettings { chunk_size: 16, voxel_size: 1.0 }).expect("valid settings")
}

/// Walls around the world that keep bodies in it.
fn fence(stage: &mut Stage) {
    let side = SIDE as f32;
    for (x, z, width, depth) in [
        (-1.0, side / 2.0, 4.0, side + 8.0),
        (side + 1.0, side / 2.0, 4.0, side + 8.0),
        (side / 2.0, -1.0, side + 8.0, 4.0),
        (side / 2.0, side + 1.0, side + 8.0, 4.0),
    ] {
        let wall = Collider::cuboid(width, 400.0, depth);
        stage.app.world_mut().spawn((RigidBody::Static, wall, Transform::from_xyz(x, 0.0, z)));
    }
}

/// A position over the world, away from its walls.
fn random_position(rng: &mut Rng) -> Vec2 {
    let mut along = || 3.0 + rng.f32() * (SIDE as f32 - 6.0);
    Vec2::new(along(), along())
}

fn height(model: &Model, place: Vec2) -> f32 {
    model.height(place.x.into(), place.y.into()).expect("in the world") as f32
}

/// Tunnels through the hills, crossing all chunks.
fn tunnels() -> impl Iterator<Item = Brush> {
    let side = SIDE as f32;
    (0..4).flat_map(move |number| {
        let (at, y) = (20.0 + 29.0 * number as f32, 2.0 - number as f32);
        [
            Brush::dig(Shape::capsule(Vec3::new(8.0, y, at), Vec3::new(side - 8.0, y + 2.0, at), 3.0)),
            Brush::dig(Shape::capsule(Vec3::new(at, y + 1.0, 8.0), Vec3::new(at, y, side - 8.0), 3.0)),
        ]
    })
}

/// A brush near the ground, as players send them. With `builds` unset it never adds ground.
fn edit(rng: &mut Rng, model: &Model, builds: bool) -> Brush {
    let place = random_position(rng);
    let center = Vec3::new(place.x, height(model, place) + rng.f32() * 4.0 - 3.0, place.y);
    let radius = 1.5 + 2.5 * rng.f32();
    match rng.u8(0..4) {
        0 if builds => Brush::add(Shape::sphere(center, radius), MaterialId(2)),
        1 => Brush::dig(Shape::cuboid(center, Vec3::new(radius, 2.0 * radius, radius))),
        _ => Brush::dig(Shape::sphere(center, radius)),
    }
}

/// Whether an edit is sent in this frame: ten a second.
fn is_due(frame: u32) -> bool {
    frame * 10 / 64 != (frame + 1) * 10 / 64
}

/// How many edits changed the ground before, and the physics time at the start.
struct Edits {
    changed: usize,
    seconds: f32,
}

impl Edits {
    fn begin(stage: &Stage) -> Self {
        Self { changed: stage.changed(), seconds: stage.seconds() }
    }

    /// Checks that edits changed the ground ten times a second since; a tenth of them may have found nothing to change.
    fn check(&self, stage: &mut Stage, sent: usize) {
        let seconds = stage.seconds() - self.seconds;
        stage.catch_up();
        let changed = stage.changed() - self.changed;
        println!("{sent} edits were sent in {seconds} s of physics, and {changed} changed the ground");
        assert!(seconds > 1.0 && changed <= sent, "{changed} changes of {sent} edits in {seconds} s");
        assert!(changed as f32 >= 9.0 * seconds, "{changed} changes of {sent} edits in {seconds} s");
    }
}

/// Bodies inside the ground, and for how many frames in a row.
#[derive(Default)]
struct Buried {
    frames: HashMap<Entity, u32>,
    longest: u32,
    /// Bodies that were in the ground for three frames.
    through: usize,
    /// Bodies that entered the ground in a frame that did not change it.
    sank: usize,
    worst: f64,
    revision: u64,
    is_same: bool,
}

impl Buried {
    /// Starts a frame.
    fn begin(&mut self, model: &Model) {
        self.is_same = model.revision() == self.revision;
        self.revision = model.revision();
    }

    /// Checks a body. One that was built over may be in the ground in the frame of the commit, but no longer.
    fn look(&mut self, model: &Model, body: Entity, place: Vec3) {
        let is_under = !place.is_finite() || model.is_solid(place.as_dvec3());
        if !is_under {
            self.frames.remove(&body);
            return;
        }
        let frames = self.frames.entry(body).or_default();
        self.sank += usize::from(*frames == 0 && self.is_same);
        *frames += 1;
        self.longest = self.longest.max(*frames);
        if *frames == 3 {
            self.through += 1;
        }
        let top = model.height(place.x.into(), place.z.into()).unwrap_or_default();
        self.worst = self.worst.max(top - f64::from(place.y));
    }
}

#[test]
fn no_body_falls_through_ground_that_is_dug_and_built_under_a_crowd() {
    let figures = play(true);
    println!("{} were built over, or squeezed, and lifted", figures.lifted);
}

#[test]
fn few_bodies_are_lifted_where_a_crowd_only_digs() {
    let figures = play(false);
    println!("{} got stuck in cracks, and were lifted", figures.lifted);
    assert!(figures.lifted <= crowd() as u64 / 20, "{} of {} were lifted", figures.lifted, crowd());
}

/// Plays a crowd on ground that is dug, and also built if `builds` is set. No body may fall through.
fn play(builds: bool) -> PhysicsFigures {
    let (balls, walkers) = (crowd(), crowd() / 10);
    let seconds = if balls >= 1000 { 60.0 } else { 8.0 };
    let (mut stage, terrain) = Stage::with_ground(landscape(14.0, 40.0));
    fence(&mut stage);
    stage.dig(tunnels());
    let mut rng = Rng::with_seed(3 + 64 * u64::from(seed()));

    let mut bodies = Vec::new();
    for _ in 0..balls {
        let place = random_position(&mut rng);
        // Half of them start below the open sky, the others wherever there is air, tunnels included.
        let spans = stage.terrain(terrain).world().spans(place.x.into(), place.y.into());
        let span = if rng.bool() { spans.last() } else { rng.choice(spans.iter()) };
        let Some(span) = span else { continue };
        let room = span.ceiling.map_or(12.0, |top| (top - span.floor - 1.0).max(0.0)) as f32;
        let y = span.floor as f32 + 0.5 + rng.f32() * room;
        let push = Vec3::new(rng.f32() - 0.5, 0.0, rng.f32() - 0.5) * 10.0;
        bodies.push(stage.ball(Vec3::new(place.x, y, place.y), 0.25 + 0.25 * rng.f32(), push));
    }
    let mut people = Vec::new();
    for _ in 0..walkers {
        let place = random_position(&mut rng);
        let feet = Vec3::new(place.x, height(stage.terrain(terrain).world(), place) + 0.1, place.y);
        people.push(stage.character(feet, Vec2::from_angle(rng.f32() * 6.3)));
    }
    let mut buried = Buried::default();
    let (mut sent, mut steps) = (0, 0);
    let edits = Edits::begin(&stage);
    let start = std::time::Instant::now();
    for frame in 0..(seconds / STEP) as u32 {
        if is_due(frame) {
            let brush = edit(&mut rng, stage.terrain(terrain).world(), builds);
            stage.send(brush);
            sent += 1;
        }
        if frame % 32 == 0 {
            for &person in &people {
                let mut steering =
                    stage.app.world_mut().get_mut::<CharacterSteering>(person).expect("is there");
                steering.direction = Vec2::from_angle(rng.f32() * 6.3);
                steering.jump = rng.u8(0..4) == 0;
                steering.run = rng.bool();
            }
        }
        stage.frame();
        steps += 1;
        let model = stage.terrain(terrain).world();
        buried.begin(model);
        for &body in bodies.iter().chain(&people) {
            buried.look(model, body, stage.place(body));
        }
    }
    let took = start.elapsed();
    edits.check(&mut stage, sent);
    stage.settle();
    let model = stage.terrain(terrain).world();
    let below =
        bodies.iter().chain(&people).filter(|&&body| model.is_solid(stage.place(body).as_dvec3())).count();
    let awake = bodies.len()
        - bodies.iter().filter(|&&body| stage.app.world().get::<Sleeping>(body).is_some()).count();
    println!(
        "{} balls, {} walkers, {sent} edits in {steps} steps ({seconds} s; took {took:.1?}): {} fell through, {} sank in, \
         {below} below at the end; longest inside {} frames, deepest {:.2}; {awake} awake; {:?}",
        bodies.len(),
        people.len(),
        buried.through,
        buried.sank,
        buried.longest,
        buried.worst,
        stage.figures(),
    );
    assert_eq!((buried.through, buried.sank, below), (0, 0, 0));
    assert!(stage.receipts() >= sent, "{} receipts", stage.receipts());
    let spread = people.iter().filter(|&&person| stage.feet(person).is_finite()).count();
    assert_eq!(spread, walkers);
    stage.figures().clone()
}

/// A tunnel with a level floor deep below all hills, from one side of the world to the other.
struct Tunnel {
    floor: f32,
    ceiling: f32,
}

impl Tunnel {
    fn below(model: &Model) -> Self {
        let lowest = (model.ground().height_range().0 as f32 / 256.0).floor();
        Self { floor: lowest - 29.5, ceiling: lowest - 23.5 }
    }

    fn brush(&self) -> Brush {
        let (middle, tall) = (SIDE as f32 / 2.0, self.ceiling - self.floor);
        let half = Vec3::new(middle + 4.0, tall / 2.0, 5.0);
        Brush::dig(Shape::cuboid(Vec3::new(middle, self.floor + tall / 2.0, middle), half))
    }

    /// The position on its floor below the given one, away from its walls.
    fn at(&self, place: Vec2) -> Vec3 {
        Vec3::new(place.x, self.floor, SIDE as f32 / 2.0 + 6.0 * (place.y / SIDE as f32 - 0.5))
    }

    /// A hole near a body, but out of its way: below the surface of the hills, or in the tunnel's ceiling. The surface
    /// under the bodies keeps its shape, but its mesh and collider are rebuilt.
    fn hole(&self, rng: &mut Rng, model: &Model, body: Vec3) -> Brush {
        let radius = 1.5 + rng.f32();
        let aside = 4.0 * Vec2::new(rng.f32() - 0.5, rng.f32() - 0.5);
        let place = (body.xz() + aside).clamp(Vec2::splat(4.0), Vec2::splat(SIDE as f32 - 4.0));
        let is_inside = body.y < self.ceiling;
        // Away from the surface by more than the two voxels around a brush in which samples change.
        let y = if is_inside { self.ceiling } else { height(model, place) - 4.0 - radius };
        Brush::dig(Shape::sphere(Vec3::new(place.x, y, place.y), radius))
    }
}

/// The tile or chunk that draws the ground below a position.
fn drawn_below(model: &Model, place: Vec3) -> (bool, IVec3) {
    let cell = place.floor().as_ivec3();
    let column = Column::new(cell.x, cell.z);
    // That far below the pristine surface, tiles draw nothing.
    let is_deep = 256 * (cell.y + 8) < model.ground().height(column);
    let is_dug = is_deep || model.mask().contains(column);
    let chunk = cell.div_euclid(IVec3::splat(16));
    (is_dug, if is_dug { chunk } else { chunk.with_y(0) })
}

/// Jumps: how much each vertical step differs from the one before, in voxels.
#[derive(Default)]
struct Jumps {
    all: Vec<f32>,
}

impl Jumps {
    fn figures(&mut self) -> (usize, f32, f32) {
        self.all.sort_by(f32::total_cmp);
        let at = |share: f32| {
            self.all.get(((self.all.len() as f32 - 1.0) * share) as usize).copied().unwrap_or(0.0)
        };
        (self.all.len(), at(0.99), at(1.0))
    }
}

/// On gentle hills only a bump makes a body on the ground jump, so all jumps count, at seams and elsewhere. A fifth
/// of the bodies are on the level floor of a tunnel below the hills. Ten times a second the ground below a body is
/// painted, or a hole is dug nearby, out of its way. That gives new seams, meshes and colliders for the same surface.
#[test]
fn bodies_on_gentle_hills_do_not_jump_at_seams_while_edits_fall() {
    let (balls, walkers) = (crowd(), crowd() / 10);
    let seconds = if balls >= 1000 { 60.0 } else { 6.0 };
    let (mut stage, terrain) = Stage::with_ground(landscape(7.0, 90.0));
    fence(&mut stage);
    let mut rng = Rng::with_seed(4 + 64 * u64::from(seed()));
    let model = stage.terrain(terrain).world();
    // Patches drawn by marching cubes that look as before, on chunk borders and away from them.
    let patches: Vec<Brush> = (0..120)
        .map(|number| {
            let mut place = random_position(&mut rng);
            if number % 2 == 0 {
                place.x = (place.x / 16.0).round() * 16.0;
            }
            let center = Vec3::new(place.x, height(model, place), place.y);
            Brush::paint(Shape::sphere(center, 2.0 + 4.0 * rng.f32()), MaterialId(2))
        })
        .collect();
    let tunnel = Tunnel::below(model);
    stage.dig(patches.into_iter().chain([tunnel.brush()]));
    // The start and the direction of each body.
    let start = |stage: &Stage, rng: &mut Rng, number: usize| {
        let (place, way) = (random_position(rng), Vec2::from_angle(rng.f32() * 6.3));
        if number.is_multiple_of(5) {
            (tunnel.at(place), if rng.bool() { Vec2::X } else { Vec2::NEG_X })
        } else {
            let y = height(stage.terrain(terrain).world(), place);
            (Vec3::new(place.x, y, place.y), way)
        }
    };
    // Bodies do not collide with each other here: only the ground matters.
    let layers = CollisionLayers::new(LayerMask(2), LayerMask(1));
    let mut bodies = Vec::new();
    for number in 0..balls {
        let ((place, way), radius) = (start(&stage, &mut rng, number), 0.3 + 0.4 * rng.f32());
        let push = way * (2.0 + 6.0 * rng.f32());
        let ball = stage.ball(place + Vec3::Y * (radius + 0.05), radius, Vec3::new(push.x, 0.0, push.y));
        stage.app.world_mut().entity_mut(ball).insert(layers);
        bodies.push((ball, radius));
    }
    for number in 0..walkers {
        let (place, way) = start(&stage, &mut rng, number);
        let person = stage.character(place + Vec3::Y * 0.05, way);
        stage.app.world_mut().entity_mut(person).insert(layers);
        bodies.push((person, Character::default().height / 2.0));
    }
    stage.frames(32);
    let (edits, swaps) = (Edits::begin(&stage), stage.figures().swaps);
    let (mut sent, mut holes, mut waits, mut in_tunnel) = (0, 0, 0, 0);
    let mut before = HashMap::<Entity, Vec<Vec3>>::new();
    let (mut at_seams, mut elsewhere) =
        ([Jumps::default(), Jumps::default()], [Jumps::default(), Jumps::default()]);
    for frame in 0..(seconds / STEP) as u32 {
        if is_due(frame) {
            // Each edit is a transaction of its own. On a slow machine, the bodies wait for it.
            if !stage.is_idle() {
                stage.catch_up();
                waits += 1;
            }
            let body = stage.place(bodies[rng.usize(0..bodies.len())].0);
            let brush = if sent % 3 == 0 {
                holes += 1;
                tunnel.hole(&mut rng, stage.terrain(terrain).world(), body)
            } else {
                let shape = Shape::sphere(body, 3.0 + 3.0 * rng.f32());
                Brush::paint(shape, MaterialId(3 + (frame % 7) as u8))
            };
            stage.send(brush);
            sent += 1;
        }
        stage.frame();
        for (number, &(body, reach)) in bodies.iter().enumerate() {
            let place = stage.place(body);
            let way = before.entry(body).or_default();
            way.push(place);
            let inside = place.xz().cmpgt(Vec2::splat(4.0)).all()
                && place.xz().cmplt(Vec2::splat(SIDE as f32 - 4.0)).all();
            let model = stage.terrain(terrain).world();
            let &[.., a, b, c] = &way[..] else { continue };
            if !inside || c.y - reach > height(model, c.xz()) + 1.0 {
                continue;
            }
            in_tunnel += usize::from(c.y < tunnel.ceiling);
            let jump = (c.y - 2.0 * b.y + a.y).abs();
            // The body's whole width counts as touching the border.
            let around = [Vec2::ZERO, Vec2::X, Vec2::Y, Vec2::NEG_X, Vec2::NEG_Y];
            let mut drawn = around.map(|side| {
                let side = c + Vec3::new(side.x, 0.0, side.y) * 0.3 - Vec3::Y * reach;
                drawn_below(model, side)
            });
            drawn.sort_by_key(|(is_dug, chunk)| (*is_dug, chunk.to_array()));
            let kind = usize::from(number >= balls);
            let jumps = if drawn[0] == drawn[4] { &mut elsewhere } else { &mut at_seams };
            jumps[kind].all.push(jump);
        }
    }
    edits.check(&mut stage, sent);
    stage.settle();
    let swapped = stage.figures().swaps - swaps;
    println!(
        "{holes} of them were holes; {swapped} colliders were swapped, bodies waited {waits} times; \
         {in_tunnel} samples are from the tunnel"
    );
    assert!(swapped > sent as u64, "{swapped} colliders were swapped by {sent} edits");
    assert!(in_tunnel > 1000, "{in_tunnel} samples from the tunnel");
    for (kind, name) in ["balls", "walkers"].iter().enumerate() {
        let (seams, plain) = (at_seams[kind].figures(), elsewhere[kind].figures());
        println!("{name}: (samples, p99, highest) at seams and borders {seams:?}, elsewhere {plain:?}");
        assert!(seams.0 > 100, "{name} met {} seams", seams.0);
        assert!(seams.2.max(plain.2) < 0.05, "{name} jump: {seams:?}, elsewhere {plain:?}");
    }
}
