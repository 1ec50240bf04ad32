//! The studio: the game without a window, run frame by frame by a script that walks, digs and takes pictures.
//!
//! The script is an ordinary player: it steers the same body with the same
//! [`CharacterSteering`] and sends the same [`Brush`]
//! messages. While it only walks and digs, the camera is off and a frame costs next to nothing.

#[path = "../../shared/photo.rs"]
mod photo;

use std::f32::consts::PI;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use avian3d::prelude::Position;
use bevy::prelude::*;
use bevy::render::renderer::RenderAdapterInfo;
use bevy::render::settings::RenderResources;
use bevy_burrow::physics::{Character, CharacterMotion, CharacterSteering, HeldByGround};
use bevy_burrow::prelude::*;
use bevy_burrow::view::GroundLoading;
use photo::Photographer;
pub use photo::{Developed, PATIENCE, pixels};

use crate::Options;
use crate::film::headless::build_app;
use crate::film::report::{EditTime, FrameTimes, Logbook};
use crate::player::game_state::Phase;
use crate::player::input::{Action, Actions};
use crate::player::{Drone, Player, Scripted};
use crate::tools::Hand;
use crate::tools::tool_in_hand::ShowHand;
use crate::ui::hud::ShowHud;
use crate::ui::widgets::scale_for;
use crate::world::day::Clock;
use crate::world::light::{Eyes, LampSwitch};

/// Where the player stands.
#[derive(Clone, Copy, Debug)]
struct Stance {
    feet: Vec3,
    eye: Vec3,
}

/// An app without a window, and what came of its edits and pictures.
pub struct Studio {
    pub app: App,
    eyes: Entity,
    player: Entity,
    /// Who takes the pictures; `None` without a renderer.
    pub photographer: Option<Photographer>,
    /// Where they are written.
    pub folder: PathBuf,
    is_warm: bool,
    /// Frames without a picture.
    pub frames: FrameTimes,
    /// Frames that were drawn.
    pub drawn: FrameTimes,
    /// How long each edit took.
    pub times: Vec<EditTime>,
    /// Pictures that were written.
    pub pictures: Vec<PathBuf>,
}

impl Studio {
    /// Builds the app and waits for the landscape.
    ///
    /// # Errors
    /// When the folder can't be made or the landscape doesn't load.
    pub fn open(options: &Options, renderer: Option<RenderResources>) -> Result<Self> {
        std::fs::create_dir_all(&options.out)
            .map_err(|error| format!("{}: {error}", options.out.display()))?;
        let renders = renderer.is_some();
        let engine = options.backend.engine();
        // The script is not to be over before a card is found, whatever it is played for.
        engine.wait(PATIENCE);
        let mut app = build_app(renderer, engine);
        // One frame, for the systems that spawn the camera.
        app.update();
        let eyes = app.world_mut().query_filtered::<Entity, With<Eyes>>().single(app.world())?;
        // Nobody looks while the land is made.
        let mut photographer = Photographer::new(&mut app, eyes, (options.width, options.height));
        let player = wait_for_player(&mut app, renders)?;
        let world = app.world_mut();
        world.entity_mut(player).insert(Scripted);
        world.resource_mut::<UiScale>().0 = scale_for(options.width as f32, options.height as f32, true);
        // A bright afternoon that lasts, and no title.
        world.resource_mut::<Clock>().runs = false;
        world.resource_mut::<ShowHud>().0 = false;
        world.resource_mut::<ShowHand>().0 = false;
        world.resource_mut::<Hand>().preview = false;
        world.resource_mut::<NextState<Phase>>().set(Phase::Playing);
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
            frames: FrameTimes::default(),
            drawn: FrameTimes::default(),
            times: Vec::new(),
            pictures: Vec::new(),
        })
    }

    /// What draws the pictures.
    pub fn renderer(&self) -> Option<String> {
        self.app.world().get_resource::<RenderAdapterInfo>().map(|info| info.name.clone())
    }

    /// A copy of a resource.
    pub fn resource<R: Resource + Clone>(&self) -> R {
        self.app.world().resource::<R>().clone()
    }

    /// The app's world, for questions that few ask.
    pub fn world(&mut self) -> &mut World {
        self.app.world_mut()
    }

    /// The terrain's model.
    ///
    /// # Errors
    /// When there is not exactly one.
    pub fn terrain(&mut self) -> Result<&Terrain> {
        let world = self.app.world_mut();
        let mut terrains = world.query::<&Terrain>();
        Ok(terrains.single(world)?)
    }

    /// One frame.
    fn step(&mut self) {
        if self.is_held() {
            // Colliders are made in tasks, and frames without pictures are faster than those.
            std::thread::sleep(Duration::from_millis(1));
        }
        let start = Instant::now();
        self.app.update();
        if self.photographer.as_ref().is_some_and(|photographer| photographer.draws_all) {
            photo::finish_drawing(&self.app);
        }
        self.frames.count(start.elapsed());
    }

    /// Lets some time pass.
    pub fn wait(&mut self, frames: u32) {
        for _ in 0..frames {
            self.step();
        }
    }

    /// Switches the headlamp.
    pub fn lamp(&mut self, on: bool) {
        self.app.world_mut().resource_mut::<LampSwitch>().0 = on;
    }

    fn body(&self) -> Result<Stance> {
        let player = self.app.world().get_entity(self.player)?;
        let parts = player.get::<Character>().zip(player.get::<Transform>());
        let (character, place) = parts.ok_or("the player has lost its body")?;
        let middle = place.translation;
        Ok(Stance { feet: character.feet(middle), eye: character.eyes(middle) })
    }

    /// Is there no ground for the player to stand on yet?
    fn is_held(&self) -> bool {
        self.app.world().get::<HeldByGround>(self.player).is_some()
    }

    fn put<C: Component>(&mut self, component: C) -> Result {
        self.app.world_mut().get_entity_mut(self.player)?.insert(component);
        Ok(())
    }

    /// Takes the player to the ground over a place, as only a script can.
    pub fn carry_to(&mut self, place: Vec2) -> Result {
        let at = place.as_dvec2();
        let height = self.terrain()?.world().height(at.x, at.y).ok_or("the script left the world")?;
        self.stand_at(Vec3::new(place.x, height as f32, place.y))?;
        self.wait(10);
        Ok(())
    }

    /// Puts the player's feet to a place, as only a script can.
    ///
    /// # Errors
    /// When the ground there gets no colliders.
    pub fn stand_at(&mut self, feet: Vec3) -> Result {
        let place = Character::default().standing_at(feet);
        self.put(place)?;
        // Physics take it over with their next step only, and between the scenes of a film no time passes.
        self.put(Position(place.translation))?;
        self.put(CharacterMotion::default())?;
        // One frame to see that there is no ground, and the others until there is.
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

    /// Where the player's feet are.
    pub fn feet(&self) -> Result<Vec3> {
        Ok(self.body()?.feet)
    }

    /// Where the player walks from now on, at most 1 long.
    pub fn walk(&mut self, direction: Vec2) {
        if let Some(mut steering) = self.app.world_mut().get_mut::<CharacterSteering>(self.player) {
            *steering = CharacterSteering { direction, run: false, jump: false };
        }
    }

    /// Turns the player's head some part of the way to a place.
    pub fn gaze(&mut self, place: Vec3, part: f32) -> Result {
        let eye = self.body()?.eye;
        let mut player = self.app.world_mut().get_mut::<Player>(self.player).ok_or("there is no player")?;
        let goal = Player::looking(eye, place);
        let turn = (goal.yaw - player.yaw + PI).rem_euclid(2.0 * PI) - PI;
        player.yaw += turn * part;
        player.pitch += (goal.pitch - player.pitch) * part;
        Ok(())
    }

    /// What the player holds down from now on.
    pub fn hold(&mut self, actions: &[Action]) {
        let mut held = self.app.world_mut().resource_mut::<Actions>();
        held.puppet.clear();
        held.puppet.extend_from_slice(actions);
    }

    /// The camera leaves the player.
    pub fn fly_to(&mut self, eye: Vec3, at: Vec3) {
        let place = Transform::from_translation(eye).looking_at(at, Vec3::Y);
        self.app.world_mut().entity_mut(self.eyes).insert((Drone, place));
    }

    /// The camera is back in the player's head.
    pub fn land(&mut self) {
        self.app.world_mut().entity_mut(self.eyes).remove::<Drone>();
    }

    /// Turns the player's head.
    pub fn look_at(&mut self, place: Vec3) -> Result {
        let eye = self.body()?.eye;
        self.put(Player::looking(eye, place))
    }

    /// Walks straight to a place.
    ///
    /// # Errors
    /// When something is in the way.
    pub fn walk_to(&mut self, place: Vec2, run: bool) -> Result {
        const NEAR: f32 = 0.6;
        let start = self.body()?.feet.xz();
        // Twice as long as it should take, and some more.
        let frames = 120 + (24.0 * start.distance(place)) as u32;
        for _ in 0..frames {
            let body = self.body()?;
            let way = place - body.feet.xz();
            if way.length() < NEAR {
                self.put(CharacterSteering::default())?;
                self.wait(15);
                return Ok(());
            }
            self.look_at(Vec3::new(place.x, body.eye.y, place.y))?;
            self.put(CharacterSteering { direction: way.normalize(), run, jump: false })?;
            self.step();
        }
        let body = self.body()?;
        Err(format!("the walk from {start} to {place} ended at {}", body.feet).into())
    }

    /// Sends a brush and waits for its receipt.
    ///
    /// # Errors
    /// When there is none after many frames, or it says that the brush was rejected.
    pub fn edit(&mut self, brush: Brush) -> Result {
        let answered = self.app.world().resource::<Logbook>().answered();
        let start = Instant::now();
        self.app.world_mut().write_message(brush.with_tag(answered as u64 + 1));
        while self.app.world().resource::<Logbook>().answered() == answered {
            self.step();
            if start.elapsed() > PATIENCE {
                return Err("a brush got no receipt".into());
            }
        }
        let receipt = start.elapsed();
        let logbook = self.app.world().resource::<Logbook>();
        if let Some(rejection) = &logbook.rejection {
            return Err(format!("a brush was rejected: {rejection}").into());
        }
        let transaction = self.app.world().resource::<BurrowFigures>().last_transaction;
        self.times.push(EditTime { receipt, transaction });
        Ok(())
    }

    /// Takes a picture through the player's eyes.
    pub fn shoot(&mut self, name: &str) -> Result {
        // Eyes get used to the light.
        self.wait(90);
        let Some(photographer) = &self.photographer else { return Ok(()) };
        let path = self.folder.join(name).with_extension("png");
        // The sky comes in over some frames; later on, lights need a few to find what they shine on.
        let frames = if self.is_warm { 3 } else { 6 };
        self.is_warm = true;
        let drawn = &mut self.drawn;
        photographer.shoot_after(frames, &mut self.app, &path, |app| draw(app, drawn))?;
        self.pictures.push(path);
        Ok(())
    }

    /// Takes a picture from anywhere.
    pub fn shoot_from(&mut self, name: &str, eye: Vec3, at: Vec3) -> Result {
        self.fly_to(eye, at);
        let shot = self.shoot(name);
        self.land();
        shot
    }

    /// Does the camera draw?
    pub fn film_runs(&mut self, runs: bool) {
        if let Some(photographer) = &self.photographer {
            photographer.film_runs(&mut self.app, runs);
        }
    }

    /// One frame, drawn to its end.
    pub fn step_and_draw(&mut self) {
        draw(&mut self.app, &mut self.drawn);
    }
}

fn draw(app: &mut App, drawn: &mut FrameTimes) {
    let start = Instant::now();
    photo::draw(app);
    drawn.count(start.elapsed());
}

fn wait_for_player(app: &mut App, renders: bool) -> Result<Entity> {
    let start = Instant::now();
    while start.elapsed() < PATIENCE {
        app.update();
        let player = app.world_mut().query_filtered::<Entity, With<Player>>().single(app.world());
        // Nobody is filmed on ground that is not painted yet.
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
