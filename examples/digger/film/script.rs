//! The script for `--headless`: a tunnel into a hillside, a bridge over a ravine, and a pit around a chunk corner.

use std::process::ExitCode;
use std::time::{Duration, Instant};

use bevy::prelude::*;
use bevy::render::settings::RenderResources;
use bevy_burrow::debug::{BurrowDebug, SeamWires};
use bevy_burrow::lod::{Cut, Node};
use bevy_burrow::plugin::BurrowEngine;
use bevy_burrow::terrain::World as Model;
use indicatif::{ProgressBar, ProgressStyle};

use crate::Options;
use crate::film::places::{Hillside, Places, Ravine, TUNNEL_RADIUS, flat};
use crate::film::report::{EditLog, Report};
use crate::film::scripted_brushes;
use crate::film::studio::Studio;
use crate::tools::{Hand, Tool};
use crate::world::landscape::CONCRETE;

/// The number of pictures.
const PICTURES: usize = 9;

/// Plays the script and prints the summary. It fails if a seam is open, a picture is missing, or ground is
/// missing in a picture.
pub fn run(options: &Options, renderer: Option<RenderResources>) -> ExitCode {
    if renderer.is_none() {
        eprintln!(
            "There is no graphics adapter, not even in software: the script is played without pictures."
        );
    }
    let report = match play(options, renderer) {
        Ok(report) => report,
        Err(error) => {
            eprintln!("The script failed: {error}");
            return ExitCode::FAILURE;
        }
    };
    println!("{report}");
    let summary = options.out.join("summary.txt");
    if let Err(error) = std::fs::write(&summary, format!("{report}\n")) {
        eprintln!("{} can't be written: {error}", summary.display());
        return ExitCode::FAILURE;
    }
    let complete = report.renderer.is_none() || report.pictures.len() == PICTURES;
    // Where levels of detail meet, triangles may have no area, and edges may serve four triangles.
    let drawn = &report.drawn_seams;
    let is_whole = drawn.is_closed() && drawn.worst_normal_at.is_none();
    if is_whole && report.edited_seams.is_flawless() && complete && report.holes.1 == 0 {
        return ExitCode::SUCCESS;
    }
    eprintln!("Seams are not flawless, pictures are missing, or ground is missing in pictures.");
    eprintln!("All that is drawn has {drawn}");
    eprintln!("What was dug and built has {}", report.edited_seams);
    ExitCode::FAILURE
}

/// Plays all scenes, with a progress bar.
fn play(options: &Options, renderer: Option<RenderResources>) -> Result<Report> {
    let start = Instant::now();
    let bar = ProgressBar::new_spinner().with_message("loading the landscape");
    bar.enable_steady_tick(Duration::from_millis(100));
    let studio = Studio::open(options, renderer)?;
    let ready = start.elapsed();
    let places: Places = studio.resource();
    let mut stage = Stage { studio, bar };
    stage.set_up_bar(&places);

    stage.landscape(&places)?;
    stage.hillside(&places.hillside)?;
    stage.tunnel(&places.hillside)?;
    stage.bridge(&places.ravine)?;
    stage.pit(places.corner)?;
    stage.seam(&places.hillside)?;
    stage.bar.set_message("checking every seam");
    let report = stage.report(&places)?;
    let report = Report { ready, took: start.elapsed(), ..report };
    stage.bar.finish_and_clear();
    Ok(report)
}

/// A cut with everything that was dug and built at full detail, and what is next to it, so that levels of detail meet
/// where nobody dug.
fn edited_in_full(world: &Model) -> Cut {
    let grid = world.lod_grid(u8::MAX);
    let near = |Node { level, x, z }: Node| {
        (-1..=1).flat_map(move |dz| (-1..=1).map(move |dx| Node { level, x: x + dx, z: z + dz }))
    };
    Cut::new(grid, |node| near(node).any(|node| world.has_edits(grid, node)))
}

/// The studio and its progress bar.
struct Stage {
    studio: Studio,
    bar: ProgressBar,
}

impl Stage {
    /// Sets the length of the progress bar: each brush and each picture is a step.
    fn set_up_bar(&mut self, places: &Places) {
        let brushes = scripted_brushes::tunnel(&places.hillside).len()
            + scripted_brushes::room(&places.hillside).len()
            + scripted_brushes::bridge(&places.ravine).len()
            + scripted_brushes::pit(places.corner).len();
        self.bar.set_length((brushes + PICTURES) as u64);
        if let Ok(style) = ProgressStyle::with_template("{bar:40} {pos}/{len} {elapsed} {msg}") {
            self.bar.set_style(style);
        }
    }

    fn edit(&mut self, brush: bevy_burrow::brush::Brush) -> Result {
        self.bar.inc(1);
        self.studio.edit(brush)
    }

    fn shoot(&mut self, name: &'static str) -> Result {
        self.bar.inc(1);
        self.studio.shoot(name)
    }

    fn shoot_from(&mut self, name: &'static str, eye: Vec3, at: Vec3) -> Result {
        self.bar.inc(1);
        self.studio.shoot_from(name, eye, at)
    }

    /// A picture of the landscape from above.
    fn landscape(&mut self, places: &Places) -> Result {
        self.bar.set_message("the landscape");
        let mouth = places.hillside.mouth;
        let eye = self.above(
            mouth - flat(places.hillside.inward) * 170.0 + flat(places.hillside.inward.perp()) * 60.0,
            46.0,
        )?;
        self.shoot_from("1_landscape", eye, mouth + flat(places.hillside.inward) * 60.0)
    }

    /// The player walks to the hillside and aims at it.
    fn hillside(&mut self, hillside: &Hillside) -> Result {
        self.bar.set_message("up to the hillside");
        let Hillside { mouth, inward, .. } = *hillside;
        self.studio.walk_to(mouth.xz() - inward * 24.0, false)?;
        self.studio.look_at(mouth + Vec3::Y * 3.5)?;
        self.preview(true);
        self.shoot("2_hillside")?;
        self.preview(false);
        self.studio.walk_to(mouth.xz() - inward * 8.0, true)
    }

    /// The player digs the tunnel and the room with the headlamp on, and takes pictures on the way out.
    fn tunnel(&mut self, hillside: &Hillside) -> Result {
        self.bar.set_message("the tunnel");
        let Hillside { mouth, inward, onward } = *hillside;
        self.studio.lamp(true);
        for (brush, stand) in scripted_brushes::tunnel(hillside) {
            self.edit(brush)?;
            self.studio.walk_to(stand, false)?;
        }
        let [_, bend, end] = hillside.floor();
        let (bend, end) = (bend.xz(), end.xz());
        self.bar.set_message("the room");
        for brush in scripted_brushes::room(hillside) {
            self.edit(brush)?;
        }
        self.studio.walk_to(end - onward * 1.5, false)?;
        self.studio.look_at(hillside.room() - Vec3::Y * 1.5)?;
        self.shoot("5_room")?;
        self.bar.set_message("back to daylight");
        self.studio.walk_to(bend, true)?;
        self.studio.walk_to(bend - inward * 11.0, true)?;
        self.studio.look_at(hillside.floor()[1] + flat(onward) * 2.0 + Vec3::Y * 1.8)?;
        self.shoot("4_tunnel_inside")?;
        self.studio.walk_to(mouth.xz() + inward * 9.0, true)?;
        self.studio.look_at(mouth - flat(inward) * 20.0 + Vec3::Y * 2.0)?;
        self.shoot("6_daylight")?;
        self.studio.walk_to(mouth.xz() - inward * 13.0, true)?;
        self.studio.look_at(mouth + Vec3::Y * 3.0)?;
        self.studio.lamp(false);
        self.shoot("3_tunnel_outside")
    }

    /// The bridge is built, and the player walks over it.
    fn bridge(&mut self, ravine: &Ravine) -> Result {
        self.bar.set_message("the bridge");
        let Ravine { from, to, behind, .. } = *ravine;
        for brush in scripted_brushes::bridge(ravine) {
            self.edit(brush)?;
        }
        let along = (to - from).xz().normalize();
        self.studio.move_to(behind[0].xz() - along)?;
        self.studio.walk_to(behind[1].xz() + along, true)?;
        let middle = from.midpoint(to);
        let aside = [1.0, -1.0].map(|side| middle + flat(along.perp()) * side * 34.0 - flat(along) * 9.0);
        let [left, right] = [self.above(aside[0], 9.0)?, self.above(aside[1], 9.0)?];
        // The side from which more of it is visible; the lower one if both are equal.
        let land = self.studio.land()?;
        let score = |eye: Vec3| (ravine.points_visible_from(&land, eye), -eye.y);
        let eye = if score(right) > score(left) { right } else { left };
        self.shoot_from("7_bridge", eye, middle - Vec3::Y * 3.5)
    }

    fn pit(&mut self, corner: Vec3) -> Result {
        self.bar.set_message("the pit");
        for brush in scripted_brushes::pit(corner) {
            self.edit(brush)?;
        }
        let eye = self.above(corner + Vec3::new(-24.0, 0.0, 20.0), 18.0)?;
        self.shoot_from("8_pit", eye, corner - Vec3::Y * 4.0)
    }

    /// A picture of the tunnel's mouth with the edges of its triangles.
    fn seam(&mut self, hillside: &Hillside) -> Result {
        self.bar.set_message("the seam");
        let Hillside { mouth, inward, .. } = *hillside;
        let edge = mouth + flat(inward) * 3.0 + Vec3::Y * (2.0 * TUNNEL_RADIUS);
        let radius = 16.0;
        let land = self.studio.land()?;
        if SeamWires::around(land.model, edge + land.origin.as_vec3(), radius).shared() == 0 {
            return Err("no tile and chunk share an edge at the tunnel's mouth".into());
        }
        let lines = BurrowDebug { wires: true, focus: Some(edge), near: radius, ..default() };
        self.studio.world().insert_resource(lines);
        let eye = mouth - flat(inward) * 6.0 + flat(inward.perp()) * 4.0 + Vec3::Y * 6.5;
        self.shoot_from("9_seam", eye, edge - Vec3::Y * 1.5)
    }

    /// A point at a height above the ground.
    fn above(&mut self, place: Vec3, metres: f32) -> Result<Vec3> {
        let height = self.studio.land()?.height(place.xz());
        Ok(place.with_y(height.ok_or("a picture would be taken outside the world")? + metres))
    }

    /// Shows the builder's preview, or hides it.
    fn preview(&mut self, on: bool) {
        let mut hand = self.studio.world().resource_mut::<Hand>();
        hand.preview = on;
        hand.tool = if on { Tool::Builder } else { Tool::Pickaxe };
        // The player has some concrete from the start.
        hand.material = CONCRETE;
        hand.set_radius(Tool::Builder, 3.0);
    }

    fn report(&mut self, places: &Places) -> Result<Report> {
        let renderer = self.studio.renderer();
        let engine: BurrowEngine = self.studio.resource();
        let (engine, figures) = (engine.state(), engine.figures());
        let edit_log: EditLog = self.studio.resource();
        let pictures = self.studio.pictures.clone();
        let holes = (self.studio.holes.ground, self.studio.holes.holes);
        let (transactions, receipts) = (self.studio.transactions.clone(), self.studio.receipts.clone());
        let terrain = self.studio.terrain()?;
        let world: &Model = terrain.world();
        let drawn = terrain.drawn_cut().ok_or("the terrain has no levels of detail")?;
        Ok(Report {
            renderer,
            size: (world.grid().width(), world.grid().depth()),
            tunnel: scripted_brushes::tunnel_length(&places.hillside),
            edit_log,
            transactions,
            receipts,
            fields: world.fields().map(|(_, fields)| fields.iter().count()).sum(),
            chunks: world.drawn_chunks().count(),
            drawn_seams: world.check_seams_in(drawn.cut()),
            edited_seams: world.check_seams_in(&edited_in_full(world)),
            memory: world.memory(),
            pictures,
            holes,
            engine,
            stages: (figures.cpu, figures.cuda),
            frames: self.studio.frames.clone(),
            drawn: self.studio.drawn.clone(),
            ready: Duration::ZERO,
            took: Duration::ZERO,
        })
    }
}
