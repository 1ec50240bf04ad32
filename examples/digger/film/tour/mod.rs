//! A minute of play as a film: a flight, a pickaxe, a tunnel, a tree, bombs, a boulder, a bridge, a sunset, and lamps in a
//! cave.

mod camera_path;
mod fade;

use bevy_burrow::brush::shapes::{Capsule, Cone, Cuboid, Cylinder, Sphere};
use std::process::ExitCode;
use std::time::{Duration, Instant};

use bevy::prelude::*;
use bevy::render::settings::RenderResources;
use bevy_burrow::prelude::*;
use camera_path::CameraPath;
use indicatif::{ProgressBar, ProgressStyle};

use crate::Options;
use crate::film::frame_recorder::{FrameRecorder, make_video, remove_frames};
use crate::film::places::{Hillside, Places, flat};
use crate::film::scripted_brushes;
use crate::film::studio::Studio;
use crate::player::input::Action;
use crate::tools::tool_in_hand::ShowTool;
use crate::tools::{Hand, Tool};
use crate::ui::hud::ShowHud;
use crate::world::day::{AFTERNOON, Clock};
use crate::world::landscape::CONCRETE;
use crate::world::particles::{Burst, ParticleKind};
use crate::world::plants::nearest_tree;

/// Seconds of each scene.
const FLIGHT: f32 = 8.0;
const PICKAXE: f32 = 9.0;
const TUNNEL: f32 = 9.5;
/// If plants are drawn.
const TREE: f32 = 6.0;
const BOMBS: f32 = 7.5;
const BOULDER: f32 = 7.0;
const BRIDGE: f32 = 8.5;
const SUNSET: f32 = 4.0;
const LAMPS: f32 = 6.5;
const WITHOUT_PLANTS: f32 = FLIGHT + PICKAXE + TUNNEL + BOMBS + BOULDER + BRIDGE + SUNSET + LAMPS;

/// Records the film, and makes a video of it if ffmpeg is installed.
pub fn run(options: &Options, renderer: Option<RenderResources>) -> ExitCode {
    if renderer.is_none() {
        eprintln!("There is no graphics adapter, not even in software: nothing can be recorded.");
        return ExitCode::FAILURE;
    }
    let seconds = WITHOUT_PLANTS + if options.plants { TREE } else { 0.0 };
    match film(options, seconds, renderer) {
        Ok((frames, took)) => {
            println!(
                "tour: {frames} frames of {seconds} s in {:.0} s, in {}",
                took.as_secs_f64(),
                options.out.display()
            );
            make_video(&options.out, (frames as f32 / seconds).clamp(1.0, options.fps as f32), frames)
        }
        Err(error) => {
            eprintln!("The tour failed: {error}");
            ExitCode::FAILURE
        }
    }
}

fn film(options: &Options, seconds: f32, renderer: Option<RenderResources>) -> Result<(usize, Duration)> {
    let start = Instant::now();
    let studio = Studio::open(options, renderer)?;
    remove_frames(&options.out)?;
    let places: Places = studio.resource();
    let all = (seconds * options.fps as f32).round() as usize;
    let film =
        FrameRecorder::new(studio, options.fps, all, options.frames.map_or(all, |frames| frames as usize));
    // With fewer frames, a fade would be a single black picture.
    let fades = film.rate() * fade::FADE >= 3.0;
    let bar = ProgressBar::new((seconds * 10.0) as u64);
    if let Ok(style) = ProgressStyle::with_template("{bar:40} {elapsed} of about {duration} {msg}") {
        bar.set_style(style);
    }
    let mut tour = Tour { film, bar, fades, is_first: true };
    fade::spawn(tour.studio().world());
    tour.flight(&places)?;
    tour.pickaxe(&places.hillside)?;
    tour.tunnel(&places.hillside)?;
    if options.plants {
        tour.tree(&places)?;
    }
    tour.bombs(&places)?;
    tour.boulder(&places)?;
    tour.bridge(&places)?;
    tour.lamps(&places.hillside)?;
    tour.film.wait_for_pictures(0)?;
    tour.bar.finish_and_clear();
    Ok((tour.film.drawn(), start.elapsed()))
}

struct Tour {
    film: FrameRecorder,
    bar: ProgressBar,
    /// Whether scenes fade.
    fades: bool,
    /// Whether the next scene is the first one.
    is_first: bool,
}

impl Tour {
    fn studio(&mut self) -> &mut Studio {
        &mut self.film.studio
    }

    /// Plays a scene.
    fn scene(
        &mut self,
        name: &'static str,
        seconds: f32,
        mut direct: impl FnMut(&mut Studio, f32) -> Result,
    ) -> Result {
        self.bar.set_message(name);
        self.film.settle()?;
        let (fades, is_first) = (self.fades, std::mem::take(&mut self.is_first));
        self.film.play(seconds, |studio, t| {
            direct(studio, t)?;
            let opacity = if fades { fade::opacity(t, seconds, is_first) } else { 0.0 };
            fade::set_overlay(studio.world(), opacity);
            Ok(())
        })?;
        self.bar.inc((seconds * 10.0) as u64);
        Ok(())
    }

    /// Applies brushes between two scenes.
    fn prepare(&mut self, brushes: impl IntoIterator<Item = Brush>) -> Result {
        for brush in brushes {
            self.studio().world().write_message(brush);
            self.studio().app.update();
        }
        self.film.settle()
    }

    /// Gives the player a tool, and shows it and the display.
    fn equip(&mut self, tool: Tool) {
        let world = self.studio().world();
        world.resource_mut::<Hand>().tool = tool;
        world.resource_mut::<Hand>().preview = true;
        world.resource_mut::<ShowTool>().0 = true;
        world.resource_mut::<ShowHud>().0 = true;
        self.studio().attach_camera();
    }

    /// The camera flies over the ridges and down to the hill.
    fn flight(&mut self, places: &Places) -> Result {
        self.set_hour(AFTERNOON);
        let Hillside { mouth, inward, .. } = places.hillside;
        let (along, aside) = (flat(inward), flat(inward.perp()));
        let path = [
            (mouth - along * 330.0 + aside * 210.0, 75.0),
            (mouth - along * 250.0 + aside * 120.0, 55.0),
            (mouth - along * 150.0 + aside * 70.0, 38.0),
            (mouth - along * 80.0 + aside * 22.0, 20.0),
            (mouth - along * 38.0, 7.0),
        ];
        let path = CameraPath::over(&self.studio().land()?, &path)?;
        let look = CameraPath::through([
            mouth + along * 40.0 - aside * 120.0,
            mouth + along * 60.0 - aside * 40.0,
            mouth + along * 30.0 + Vec3::Y * 6.0,
            mouth + Vec3::Y * 6.0,
            mouth + Vec3::Y * 4.0,
        ])?;
        self.scene("the flight", FLIGHT, |studio, t| {
            let eased = t * t * (3.0 - 2.0 * t);
            studio.detach_camera(path.at(eased), look.at(eased));
            fade::set_logo(studio.world(), 1.0 - ((t * FLIGHT - 2.6) / 0.7).clamp(0.0, 1.0));
            Ok(())
        })
    }

    /// The pickaxe digs into the slope.
    fn pickaxe(&mut self, hillside: &Hillside) -> Result {
        let Hillside { mouth, inward, .. } = *hillside;
        self.film.settle()?;
        self.studio().move_to(mouth.xz() - inward * 9.0)?;
        self.equip(Tool::Pickaxe);
        self.studio().world().resource_mut::<Hand>().set_radius(Tool::Pickaxe, 2.1);
        let wall = mouth + flat(inward) * 3.0;
        let aside = flat(inward.perp());
        self.scene("the pickaxe", PICKAXE, |studio, t| {
            let seconds = t * PICKAXE;
            let digs = seconds > 1.6;
            // Up to the wall, and later into the hole.
            let pace = if seconds < 1.5 {
                0.75
            } else if digs && seconds > 4.0 {
                0.14
            } else {
                0.0
            };
            studio.walk(inward * pace);
            let sweep =
                aside * ((seconds - 1.6) * 1.9).sin() * 1.3 + Vec3::Y * ((seconds * 1.3).cos() * 0.8 + 1.5);
            studio.turn_towards(
                wall + flat(inward) * (0.5 * seconds) + if digs { sweep } else { Vec3::Y * 2.4 },
                3.8,
            )?;
            studio.hold(if digs { &[Action::Use] } else { &[] });
            Ok(())
        })?;
        self.stop();
        Ok(())
    }

    /// The drill digs through seams of clay and coal, by the light of the headlamp.
    fn tunnel(&mut self, hillside: &Hillside) -> Result {
        let [_, bend, end] = hillside.floor();
        let onward = flat(hillside.onward);
        let legs = scripted_brushes::tunnel(hillside);
        let first = legs.len() * 36 / 70 + 1;
        self.prepare(scripted_brushes::strata(hillside))?;
        self.prepare(legs.into_iter().take(first).map(|(brush, _)| brush))?;
        self.studio().stand_at(bend - flat(hillside.inward) * 7.0 + Vec3::Y * 0.2)?;
        self.equip(Tool::Drill);
        self.studio().lamp(true);
        let ahead = end - bend;
        self.scene("the tunnel", TUNNEL, |studio, t| {
            let seconds = t * TUNNEL;
            let feet = studio.feet()?;
            let direction =
                if seconds < 1.5 { (bend - feet).xz() } else { (bend + onward * 60.0 - feet).xz() };
            studio.walk(direction.normalize_or_zero() * if seconds < 1.5 { 0.8 } else { 0.42 });
            let sway = onward.cross(Vec3::Y) * (seconds * 0.9).sin() * 1.2;
            let target = if seconds < 1.4 {
                bend + onward * 1.5 + Vec3::Y * 1.6
            } else {
                feet + onward * 9.0 + Vec3::Y * (1.75 + 9.0 * ahead.y / ahead.xz().length()) + sway
            };
            studio.turn_towards(target, 2.8)?;
            studio.hold(if seconds > 2.2 { &[Action::Use] } else { &[] });
            Ok(())
        })?;
        self.stop();
        self.studio().lamp(false);
        Ok(())
    }

    /// The pickaxe fells a tree.
    fn tree(&mut self, places: &Places) -> Result {
        self.set_hour(15.2);
        // Plants grow around the player.
        self.studio().move_to(places.corner.xz())?;
        self.studio().wait(60);
        let foot =
            nearest_tree(self.studio().world(), places.corner).ok_or("no tree stands near the meadow")?;
        let direction = (foot - places.corner).xz().normalize_or(Vec2::X);
        self.studio().move_to(foot.xz() - direction * 5.0)?;
        self.equip(Tool::Pickaxe);
        self.scene("the tree", TREE, |studio, t| {
            let seconds = t * TREE;
            let height = if seconds < 1.8 { 1.6 } else { 3.0 };
            studio.turn_towards(foot + Vec3::Y * height, 3.8)?;
            studio.hold(if (1.2..1.6).contains(&seconds) { &[Action::Use] } else { &[] });
            studio.walk(if (1.6..3.0).contains(&seconds) { direction * -0.6 } else { Vec2::ZERO });
            Ok(())
        })?;
        self.stop();
        Ok(())
    }

    /// The player throws three bombs into a meadow.
    fn bombs(&mut self, places: &Places) -> Result {
        self.set_hour(15.6);
        let corner = places.corner;
        let direction = Vec2::new(0.86, -0.51);
        self.film.settle()?;
        self.studio().move_to(corner.xz() - direction * 17.0)?;
        self.equip(Tool::Bomb);
        let aside = flat(direction.perp());
        self.scene("the bombs", BOMBS, |studio, t| {
            let seconds = t * BOMBS;
            let throws = [0.7f32, 1.6, 2.5];
            let next = throws.iter().filter(|&&throw| seconds > throw + 0.4).count() as f32 - 1.0;
            let target = if seconds < 3.2 {
                corner + aside * 4.0 * next.min(1.0) + Vec3::Y * 1.6
            } else {
                corner - Vec3::Y * 0.6
            };
            studio.turn_towards(target, 3.2)?;
            let holds = throws.iter().any(|&throw| (throw..throw + 0.1).contains(&seconds));
            studio.hold(if holds { &[Action::Use] } else { &[] });
            studio.walk(if seconds > 5.4 { direction * 0.7 } else { Vec2::ZERO });
            Ok(())
        })?;
        self.stop();
        Ok(())
    }

    /// The player drills through a pillar with a boulder on it, and the boulder falls.
    fn boulder(&mut self, places: &Places) -> Result {
        let direction = Vec2::new(0.51, 0.86);
        let place = places.corner.xz() + direction * 24.0;
        let height = self.studio().land()?.height(place).ok_or("the tour left the world")?;
        let foot = Vec3::new(place.x, height, place.y);
        let boulder = foot + Vec3::Y * 8.0 + flat(direction) * 1.2;
        self.prepare(scripted_brushes::boulder(foot, boulder))?;
        self.studio().move_to(place - direction * 9.0)?;
        self.equip(Tool::Drill);
        self.scene("the boulder", BOULDER, |studio, t| {
            let seconds = t * BOULDER;
            let target = match seconds {
                ..1.4 => boulder - Vec3::Y * 4.0,
                ..3.3 => foot + Vec3::Y * 1.8,
                _ => foot + Vec3::Y * 2.5 + flat(direction) * 3.0,
            };
            studio.turn_towards(target, 2.8)?;
            let reaches = (studio.feet()? - foot).xz().length() < 4.5;
            studio.walk(match seconds {
                ..2.4 if !reaches => direction * 0.6,
                3.4..5.0 => direction * -0.6,
                _ => Vec2::ZERO,
            });
            studio.hold(if (2.4..3.3).contains(&seconds) { &[Action::Use] } else { &[] });
            Ok(())
        })?;
        self.stop();
        Ok(())
    }

    /// A bridge is built from its arch up; then the sun sets behind it.
    fn bridge(&mut self, places: &Places) -> Result {
        let ravine = places.ravine;
        let middle = ravine.from.midpoint(ravine.to);
        let brushes = scripted_brushes::bridge(&ravine);
        let along = (ravine.to - ravine.from).with_y(0.0).normalize();
        let east = along.cross(Vec3::Y) * (along.cross(Vec3::Y).x + 0.01).signum();
        let land = self.studio().land()?;
        let (east, west) =
            (CameraPath::around(&land, middle, east)?, CameraPath::around(&land, middle, -east)?);
        // From the east, so that the sunset is behind it, unless more of it is visible from the west.
        let path =
            if west.visibility(&land, &ravine) > east.visibility(&land, &ravine) { west } else { east };
        let mut sent = 0;
        self.scene("the bridge", BRIDGE + SUNSET, |studio, t| {
            let seconds = t * (BRIDGE + SUNSET);
            studio.detach_camera(
                path.at((seconds / (BRIDGE + SUNSET)).powf(0.8)),
                middle - Vec3::Y * 3.0 + Vec3::Y * (2.0 * t),
            );
            let due = ((seconds - 0.5) / (BRIDGE - 2.0) * brushes.len() as f32) as usize;
            while sent < due.min(brushes.len()) {
                let brush = brushes[sent].clone();
                let place = centre(&brush.shape);
                let dust = Burst {
                    place,
                    direction: Vec3::ZERO,
                    count: 5,
                    speed: 2.0,
                    kind: ParticleKind::Dust(CONCRETE),
                };
                studio.world().write_message(dust);
                studio.world().write_message(brush);
                sent += 1;
            }
            let evening = ((seconds - 2.0) / (BRIDGE + SUNSET - 2.0)).clamp(0.0, 1.0);
            studio.world().resource_mut::<Clock>().hour = 16.3 + 2.15 * evening.powf(0.85);
            Ok(())
        })
    }

    /// At night, the player puts lamps into a room underground.
    fn lamps(&mut self, hillside: &Hillside) -> Result {
        self.set_hour(21.0);
        self.prepare(scripted_brushes::tunnel(hillside).into_iter().map(|(brush, _)| brush))?;
        self.prepare(scripted_brushes::room(hillside))?;
        let onward = flat(hillside.onward);
        let [_, _, end] = hillside.floor();
        let room = hillside.room();
        self.studio().stand_at(end - onward * 2.0 + Vec3::Y * 0.3)?;
        self.equip(Tool::Lamp);
        let aside = onward.cross(Vec3::Y);
        let floor = end.y;
        let spots = [
            (end + onward * 3.5 - aside * 1.0).with_y(floor - 0.2),
            room + aside * 7.0 - onward * 1.0 - Vec3::Y * 2.0,
            room - aside * 7.0 + onward * 1.0 - Vec3::Y * 3.0,
            room + onward * 6.5 + aside * 1.5 + Vec3::Y * 0.5,
        ];
        self.scene("the lamps", LAMPS, |studio, t| {
            let seconds = t * LAMPS;
            let at = ((seconds / 1.35) as usize).min(spots.len());
            let target = spots.get(at).copied().unwrap_or(room);
            studio.turn_towards(target, 5.2)?;
            let within = seconds - 1.35 * at as f32;
            studio.hold(if at < spots.len() && (0.7..0.9).contains(&within) { &[Action::Use] } else { &[] });
            studio.walk(if (0.6..4.6).contains(&seconds) { hillside.onward * 0.32 } else { Vec2::ZERO });
            fade::set_logo(studio.world(), ((seconds - (LAMPS - 1.6)) / 0.6).clamp(0.0, 1.0));
            Ok(())
        })?;
        self.stop();
        Ok(())
    }

    fn set_hour(&mut self, hour: f32) {
        self.studio().world().resource_mut::<Clock>().hour = hour;
    }

    /// Releases all actions.
    fn stop(&mut self) {
        self.studio().hold(&[]);
        self.studio().walk(Vec2::ZERO);
    }
}

/// The approximate middle of a shape.
fn centre(shape: &Shape) -> Vec3 {
    match *shape {
        Shape::Sphere(Sphere { center, .. }) | Shape::Cuboid(Cuboid { center, .. }) => center,
        Shape::Cylinder(Cylinder { base, axis, .. }) | Shape::Cone(Cone { base, axis, .. }) => {
            base + axis / 2.0
        }
        Shape::Capsule(Capsule { from, to, .. }) => from.midpoint(to),
        _ => panic!("the tour has no such shape: {shape:?}"),
    }
}
