//! The game without a window, run frame by frame by a script that walks, digs and takes pictures.
//!
//! The script plays like a player: it steers the same character with [`CharacterSteering`] and sends the same [`Brush`]
//! messages. While it only walks and digs, the camera is off, and frames are fast.

#[path = "../../shared/holes.rs"]
mod holes;
#[path = "../../shared/photo.rs"]
mod photo;

use std::f32::consts::PI;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use avian3d::prelude::Position;
use bevy::core_pipeline::prepass::DepthPrepass;
use bevy::prelude::*;
use bevy::render::renderer::RenderAdapterInfo;
use bevy::render::settings::RenderResources;
use bevy::time::TimeUpdateStrategy;
use bevy_burrow::physics::{Character, CharacterMotion, CharacterSteering, HeldByGround};
use bevy_burrow::prelude::*;
use bevy_burrow::view::GroundLoading;
use holes::Holes;
use photo::Photographer;
pub use photo::{Developed, PATIENCE, pixels};

use crate::Options;
use crate::film::places::Land;
use crate::film::report::{Durations, EditLog};
use crate::offscreen;
use crate::player::camera::{DetachedCamera, PlayerCamera};
use crate::player::game_state::GameState;
use crate::player::headlamp::HeadlampSwitch;
use crate::player::input::{Action, Actions};
use crate::player::{Player, Scripted};
use crate::tools::Hand;
use crate::tools::tool_in_hand::ShowTool;
use crate::ui::hud::ShowHud;
use crate::ui::settings::{Quality, Settings, SettingsFile};
use crate::ui::widgets::scale_for;
use crate::world::day::Clock;
use crate::world::landscape::ORIGIN;

/// Metres within which pictures are searched for holes.
const HOLES_WITHIN: f32 = 400.0;

/// Game time of a frame.
const FRAME: Duration = Duration::from_nanos(1_000_000_000 / 60);

/// The position of the player.
#[derive(Clone, Copy, Debug)]
struct Stance {
    feet: Vec3,
    eye: Vec3,
}

/// An app without a window, and the results of its edits and pictures.
pub struct Studio {
    pub app: App,
    eyes: Entity,
    player: Entity,
    /// Takes the pictures; `None` without a renderer.
    pub photographer: Option<Photographer>,
    /// The folder for the pictures.
    pub folder: PathBuf,
    is_warm: bool,
    /// Game time of a frame.
    pub frame: Duration,
    /// Times of frames without a picture.
    pub frames: Durations,
    /// Times of frames that were drawn.
    pub drawn: Durations,
    /// Time of each transaction.
    pub transactions: Durations,
    /// Time from each brush to its receipt.
    pub receipts: Durations,
    /// Pictures that were written.
    pub pictures: Vec<PathBuf>,
    /// The ground that they show, and the ground that is missing in them.
    pub holes: Holes,
}

impl Studio {
    /// Builds the app and waits for the landscape.
    ///
    /// # Errors
    /// If the folder cannot be created or the landscape does not load.
    pub fn open(options: &Options, renderer: Option<RenderResources>) -> Result<Self> {
        std::fs::create_dir_all(&options.out)
            .map_err(|error| format!("{}: {error}", options.out.display()))?;
        let renders = renderer.is_some();
        let engine = options.backend.engine();
        // Without this, a short script could end before a GPU is found.
        engine.wait(PATIENCE);
        let mut app = offscreen::build(renderer, |app| {
            app.insert_resource(TimeUpdateStrategy::ManualDuration(FRAME));
            // Software renderers filter alike in all directions: so does every renderer in pictures that are compared.
            if options.low {
                app.insert_resource(GroundTextures::Baked { side: 512, anisotropy: 1 });
            }
            crate::game(app, engine, SettingsFile::default(), options.saved_world(), options.party());
            // Without colliders: a scripted player does not walk round trees.
            if options.plants {
                app.add_plugins(crate::world::plants::PlantEffectsPlugin);
            }
        });
        // One frame, for the systems that spawn the camera.
        app.update();
        let eyes = app.world_mut().query_filtered::<Entity, With<PlayerCamera>>().single(app.world())?;
        // The camera is off until the landscape has loaded.
        let size = (options.width, options.height);
        let mut photographer = Photographer::new(&mut app, eyes, size);
        keep_levels(&mut app, eyes, size.into());
        let player = wait_for_player(&mut app, renders)?;
        let world = app.world_mut();
        world.entity_mut(player).insert(Scripted);
        world.resource_mut::<UiScale>().0 = scale_for(options.width as f32, options.height as f32, 1.0, true);
        // It stays a bright afternoon, and the title is skipped.
        world.resource_mut::<Clock>().runs = false;
        world.resource_mut::<ShowHud>().0 = false;
        world.resource_mut::<ShowTool>().0 = false;
        world.resource_mut::<Hand>().preview = false;
        if options.low {
            world.resource_mut::<Settings>().quality = Quality::Low;
        }
        world.resource_mut::<NextState<GameState>>().set(GameState::Playing);
        app.update();
        photographer.draws_all = options.draw_all;
        photographer.film_runs(&mut app, options.draw_all);
        Ok(Self {
            app,
            eyes,
            player,
            photographer: renders.then_some(photographer),
            folder: options.out.clone(),
            is_warm: false,
            frame: FRAME,
            frames: Durations::default(),
            drawn: Durations::default(),
            transactions: Durations::default(),
            receipts: Durations::default(),
            pictures: Vec::new(),
            holes: Holes::default(),
        })
    }

    /// The name of the renderer.
    pub fn renderer(&self) -> Option<String> {
        self.app.world().get_resource::<RenderAdapterInfo>().map(|info| info.name.clone())
    }

    /// A copy of a resource.
    pub fn resource<R: Resource + Clone>(&self) -> R {
        self.app.world().resource::<R>().clone()
    }

    /// The app's world.
    pub fn world(&mut self) -> &mut World {
        self.app.world_mut()
    }

    /// The terrain's model.
    ///
    /// # Errors
    /// If there is not exactly one terrain.
    pub fn terrain(&mut self) -> Result<&Terrain> {
        let world = self.app.world_mut();
        let mut terrains = world.query::<&Terrain>();
        Ok(terrains.single(world)?)
    }

    /// The ground as it is now.
    ///
    /// # Errors
    /// If there is not exactly one terrain.
    pub fn land(&mut self) -> Result<Land<'_>> {
        Ok(Land { model: self.terrain()?.world(), origin: ORIGIN })
    }

    /// Whether all ground is drawn at the levels of detail that the camera needs. A camera that moved is noticed in the
    /// second frame.
    pub fn is_detailed(&mut self) -> bool {
        let world = self.app.world_mut();
        let mut terrains = world.query::<(&Terrain, &ShownLevels)>();
        terrains.iter(world).all(|(terrain, shown)| shown.waiting == 0 && !terrain.is_busy())
    }

    /// Waits until it is.
    ///
    /// # Errors
    /// If it takes too long.
    fn wait_for_details(&mut self) -> Result {
        self.wait(2);
        let start = Instant::now();
        while !self.is_detailed() {
            if start.elapsed() > PATIENCE {
                return Err("the ground was not drawn in detail".into());
            }
            std::thread::sleep(Duration::from_millis(1));
            self.step();
        }
        Ok(())
    }

    /// One frame.
    fn step(&mut self) {
        if self.is_held() {
            // Colliders are built in tasks, which take longer than frames without pictures.
            std::thread::sleep(Duration::from_millis(1));
        }
        let start = Instant::now();
        self.app.update();
        if self.photographer.as_ref().is_some_and(|photographer| photographer.draws_all) {
            photo::finish_drawing(&self.app);
        }
        self.frames.push(start.elapsed());
    }

    /// Runs some frames.
    pub fn wait(&mut self, frames: u32) {
        for _ in 0..frames {
            self.step();
        }
    }

    /// Switches the headlamp.
    pub fn lamp(&mut self, on: bool) {
        self.app.world_mut().resource_mut::<HeadlampSwitch>().0 = on;
    }

    fn body(&self) -> Result<Stance> {
        let player = self.app.world().get_entity(self.player)?;
        let parts = player.get::<Character>().zip(player.get::<Transform>());
        let (character, place) = parts.ok_or("the player has no body")?;
        let middle = place.translation;
        Ok(Stance { feet: character.feet(middle), eye: character.eyes(middle) })
    }

    /// Whether the player waits for colliders.
    fn is_held(&self) -> bool {
        self.app.world().get::<HeldByGround>(self.player).is_some()
    }

    fn put<C: Component>(&mut self, component: C) -> Result {
        self.app.world_mut().get_entity_mut(self.player)?.insert(component);
        Ok(())
    }

    /// Moves the player to the ground at a place.
    pub fn move_to(&mut self, place: Vec2) -> Result {
        let height = self.land()?.height(place).ok_or("the script left the world")?;
        self.stand_at(Vec3::new(place.x, height, place.y))?;
        self.wait(10);
        Ok(())
    }

    /// Moves the player's feet to a place.
    ///
    /// # Errors
    /// If the ground there gets no colliders.
    pub fn stand_at(&mut self, feet: Vec3) -> Result {
        let place = Character::default().standing_at(feet);
        self.put(place)?;
        // Physics would read the transform in its next step, but no time passes between the scenes of a film.
        self.put(Position(place.translation))?;
        self.put(CharacterMotion::default())?;
        // In the first frame, the plugin notices that colliders are missing.
        self.step();
        let start = Instant::now();
        while self.is_held() {
            if start.elapsed() > PATIENCE {
                return Err(format!("there is no ground to stand on at {feet}").into());
            }
            self.step();
        }
        Ok(())
    }

    /// The position of the player's feet.
    pub fn feet(&self) -> Result<Vec3> {
        Ok(self.body()?.feet)
    }

    /// Walks in a direction from now on, at most 1 long.
    pub fn walk(&mut self, direction: Vec2) {
        if let Some(mut steering) = self.app.world_mut().get_mut::<CharacterSteering>(self.player) {
            *steering = CharacterSteering { direction, run: false, jump: false };
        }
    }

    /// Turns the player's head towards a place: the angle shrinks by a factor of e in `1 / rate` seconds of the film,
    /// whatever its frames per second.
    pub fn turn_towards(&mut self, place: Vec3, rate: f32) -> Result {
        let part = 1.0 - (-rate * self.frame.as_secs_f32()).exp();
        let eye = self.body()?.eye;
        let mut player = self.app.world_mut().get_mut::<Player>(self.player).ok_or("there is no player")?;
        let goal = Player::looking(eye, place);
        let turn = (goal.yaw - player.yaw + PI).rem_euclid(2.0 * PI) - PI;
        player.yaw += turn * part;
        player.pitch += (goal.pitch - player.pitch) * part;
        Ok(())
    }

    /// Holds actions down from now on.
    pub fn hold(&mut self, actions: &[Action]) {
        self.app.world_mut().resource_mut::<Actions>().scripted = actions.to_vec();
    }

    /// Moves the camera away from the player.
    pub fn detach_camera(&mut self, eye: Vec3, at: Vec3) {
        let place = Transform::from_translation(eye).looking_at(at, Vec3::Y);
        self.app.world_mut().entity_mut(self.eyes).insert((DetachedCamera, place));
    }

    /// Lets the camera follow the player again.
    pub fn attach_camera(&mut self) {
        self.app.world_mut().entity_mut(self.eyes).remove::<DetachedCamera>();
    }

    /// Turns the player's head to a place.
    pub fn look_at(&mut self, place: Vec3) -> Result {
        let eye = self.body()?.eye;
        self.put(Player::looking(eye, place))
    }

    /// Walks straight to a place.
    ///
    /// # Errors
    /// If something is in the way.
    pub fn walk_to(&mut self, place: Vec2, run: bool) -> Result {
        const NEAR: f32 = 0.6;
        let start = self.body()?.feet.xz();
        // Somewhat more than twice the time that it should take.
        let frames = 120 + (24.0 * start.distance(place)) as u32;
        for _ in 0..frames {
            let body = self.body()?;
            let to_place = place - body.feet.xz();
            if to_place.length() < NEAR {
                self.put(CharacterSteering::default())?;
                self.wait(15);
                return Ok(());
            }
            self.look_at(Vec3::new(place.x, body.eye.y, place.y))?;
            self.put(CharacterSteering { direction: to_place.normalize(), run, jump: false })?;
            self.step();
        }
        let body = self.body()?;
        Err(format!("the walk from {start} to {place} ended at {}", body.feet).into())
    }

    /// Sends a brush and waits for its receipt.
    ///
    /// # Errors
    /// If the receipt does not arrive, or the brush was rejected.
    pub fn edit(&mut self, brush: Brush) -> Result {
        let answered = self.app.world().resource::<EditLog>().answered();
        let start = Instant::now();
        self.app.world_mut().write_message(brush.with_tag(answered as u64 + 1));
        while self.app.world().resource::<EditLog>().answered() == answered {
            self.step();
            if start.elapsed() > PATIENCE {
                return Err("a brush got no receipt".into());
            }
        }
        let receipt = start.elapsed();
        let edit_log = self.app.world().resource::<EditLog>();
        if let Some(rejection) = &edit_log.rejection {
            return Err(format!("a brush was rejected: {rejection}").into());
        }
        let transaction = self.app.world().resource::<BurrowFigures>().last_transaction;
        self.transactions.push(transaction);
        self.receipts.push(receipt);
        Ok(())
    }

    /// Takes a picture through the player's eyes.
    pub fn shoot(&mut self, name: &str) -> Result {
        // Whatever falls comes to rest.
        self.wait(90);
        if self.photographer.is_some() {
            self.wait_for_details()?;
        }
        let Some(photographer) = &self.photographer else { return Ok(()) };
        let path = self.folder.join(name).with_extension("png");
        // Lights need a few frames after a pause in drawing, and the first picture needs more.
        let frames = if self.is_warm { 3 } else { 6 };
        self.is_warm = true;
        let drawn = &mut self.drawn;
        // Nothing sways from one picture to the next.
        self.app.world_mut().resource_mut::<Time<Virtual>>().pause();
        let first = photographer.shoot_after(frames, &mut self.app, &path, |app| draw(app, drawn));
        // Ground that is missing in it is there without the prepass.
        let (camera, whole) = (self.eyes, path.with_extension("whole.png"));
        self.app.world_mut().entity_mut(camera).remove::<DepthPrepass>();
        let second = photographer.shoot_after(2, &mut self.app, &whole, |app| draw(app, drawn));
        self.app.world_mut().entity_mut(camera).insert(DepthPrepass);
        self.app.world_mut().resource_mut::<Time<Virtual>>().unpause();
        first.and(second)?;
        let [drawn, reference] =
            [&path, &whole].map(|path| image::open(path).map(image::DynamicImage::into_rgb8));
        let found = holes::count_against(&self.app, camera, &drawn?, &reference?, HOLES_WITHIN);
        if found.holes == 0 {
            std::fs::remove_file(&whole)?;
        }
        self.holes.ground += found.ground;
        self.holes.holes += found.holes;
        self.pictures.push(path);
        Ok(())
    }

    /// Takes a picture from another place.
    pub fn shoot_from(&mut self, name: &str, eye: Vec3, at: Vec3) -> Result {
        self.detach_camera(eye, at);
        let shot = self.shoot(name);
        self.attach_camera();
        shot
    }

    /// Turns drawing on or off.
    pub fn draw_frames(&mut self, runs: bool) {
        if let Some(photographer) = &self.photographer {
            photographer.film_runs(&mut self.app, runs);
        }
    }

    /// Runs a frame and waits until it is drawn.
    pub fn step_and_draw(&mut self) {
        draw(&mut self.app, &mut self.drawn);
    }
}

/// Levels of detail are chosen for cameras that are on, and the player's is off between pictures. This keeps them as it
/// needs them.
fn keep_levels(app: &mut App, eyes: Entity, size: UVec2) {
    let world = app.world_mut();
    let Some(Projection::Perspective(lens)) = world.get::<Projection>(eyes) else { return };
    let source = DetailSource { fov: lens.fov, picture_height: size.y as f32 };
    world.spawn((Name::new("level source"), ChildOf(eyes), source));
}

fn draw(app: &mut App, drawn: &mut Durations) {
    let start = Instant::now();
    photo::draw(app);
    drawn.push(start.elapsed());
}

fn wait_for_player(app: &mut App, renders: bool) -> Result<Entity> {
    let start = Instant::now();
    while start.elapsed() < PATIENCE {
        app.update();
        let player = app.world_mut().query_filtered::<Entity, With<Player>>().single(app.world());
        // The ground is not drawn before its textures are there.
        if let Ok(player) = player
            && (!renders || app.world().resource::<GroundLoading>().is_ready())
        {
            return Ok(player);
        }
        if app.should_exit().is_some() {
            break;
        }
        std::thread::sleep(Duration::from_millis(2));
    }
    Err("the landscape did not load".into())
}
