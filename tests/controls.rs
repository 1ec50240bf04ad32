//! Negative controls: breaking any one seam rule on purpose opens the surface. A reference implementation, which
//! follows the rules cell by cell, draws exactly what the crate draws.

mod worlds;

use std::collections::HashMap;

use bevy_burrow::brush::BAND;
use bevy_burrow::ground::Ground;
use bevy_burrow::lattice::{Column, LatticeBox, ONE, SNAP};
use bevy_burrow::prelude::*;
use bevy_burrow::surface::mask::{cell_sheet, sheet};
use bevy_burrow::surface::vertex::{self, Lattice, WorldView};
use bevy_burrow::surface::{Indices, SeamChecker, SeamReport, SurfaceMesh, Vertex, cases};
use bevy_burrow::terrain::World;
use fastrand::Rng;
use glam::{IVec3, Vec3};

/// The rule that is broken.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Fault {
    /// None.
    None,
    /// Rule 1: pristine samples are stored, clamped to two voxels.
    ClampedPristine,
    /// Rule 2: cells with only one or two edited columns are left out of the mask.
    ThinMask,
    /// Rule 2: a column is judged at its own height, not in all cubes that a steep surface crosses next to it.
    OwnHeights,
    /// Rule 2: heightmap cells leave out the caves below and the rocks above them.
    HeightmapOnly,
    /// Rule 3: heightmap cells keep straight sides against volumetric ones.
    StraightRing,
    /// Rule 4: the ring interpolates the heights itself and rounds differently.
    OwnRingVertices,
    /// Rule 5: the y-range of a footprint ignores its pristine border columns.
    ShortRange,
    /// Case table: cases with more than four solid corners reuse their complement's triangles, reversed.
    ComplementTable,
    /// Normals: cubes at the mask's border take the density gradient, as all other cubes do.
    GradientNormals,
}

/// Samples as marching cubes reads them when rule 1 is broken.
struct Clamped<'a>(WorldView<'a>);

impl Lattice for Clamped<'_> {
    fn distance(&self, point: IVec3) -> i32 {
        self.0.distance(point).clamp(-2 * ONE, 2 * ONE)
    }
    fn is_edited(&self, _: IVec3) -> bool {
        true
    }
    fn stored_material(&self, point: IVec3) -> MaterialId {
        self.0.stored_material(point)
    }
    fn ground(&self) -> &Ground {
        self.0.ground()
    }
    fn is_volumetric(&self, cell: Column) -> Option<bool> {
        self.0.is_volumetric(cell)
    }
}

/// A world whose mask has no border, as seen by marching cubes.
struct Borderless<'a>(WorldView<'a>);

impl Lattice for Borderless<'_> {
    fn distance(&self, point: IVec3) -> i32 {
        self.0.distance(point)
    }
    fn is_edited(&self, point: IVec3) -> bool {
        self.0.is_edited(point)
    }
    fn stored_material(&self, point: IVec3) -> MaterialId {
        self.0.stored_material(point)
    }
    fn ground(&self) -> &Ground {
        self.0.ground()
    }
    fn is_volumetric(&self, cell: Column) -> Option<bool> {
        self.0.is_volumetric(cell).map(|_| true)
    }
}

/// The reference implementation: draws a world cell by cell, as the rules are written.
struct ReferenceMesher<'a> {
    view: WorldView<'a>,
    fault: Fault,
    /// Lowest and highest edited y of each column that has any.
    edited: HashMap<Column, (i32, i32)>,
    triangles: Vec<[Vertex; 3]>,
}

impl<'a> ReferenceMesher<'a> {
    fn draw(world: &'a World, fault: Fault) -> Vec<[Vertex; 3]> {
        let mut edited: HashMap<Column, (i32, i32)> = HashMap::new();
        for (pos, brick) in world.bricks() {
            for (point, ..) in brick.edited_samples(pos) {
                let range = edited.entry(Column::of(point)).or_insert((point.y, point.y));
                *range = (range.0.min(point.y), range.1.max(point.y));
            }
        }
        let mut reference = Self { view: world.view(), fault, edited, triangles: Vec::new() };
        let grid = world.grid();
        for z in 0..grid.depth() {
            for x in 0..grid.width() {
                let cell = Column::new(x, z);
                if reference.is_volumetric(cell) {
                    reference.march(cell, |_| true);
                } else {
                    let sheet = cell_sheet(world.ground(), cell);
                    if fault != Fault::HeightmapOnly {
                        reference.march(cell, |y| !sheet.contains(&y));
                    }
                    reference.heightmap_cell(cell);
                }
            }
        }
        reference.triangles
    }

    fn is_sheet_edited(&self, columns: &[Column], of: &[Column]) -> bool {
        let rows = sheet(of.iter().map(|&column| self.view.ground().height(column)));
        columns.iter().any(|column| (rows.start..=rows.end).any(|y| self.view.is_edited(column.at(y))))
    }

    fn is_volumetric(&self, cell: Column) -> bool {
        let corners = cell.corners();
        match self.fault {
            Fault::OwnHeights => corners.iter().any(|&column| self.is_sheet_edited(&[column], &[column])),
            Fault::ThinMask => {
                let edited = corners.iter().filter(|column| self.edited.contains_key(column)).count();
                edited >= 3 && self.is_sheet_edited(&corners, &corners)
            }
            _ => self.is_sheet_edited(&corners, &corners),
        }
    }

    fn march(&mut self, cell: Column, wanted: impl Fn(i32) -> bool) {
        let corners = cell.corners();
        let own: Vec<Column> = corners.iter().copied().filter(|c| self.edited.contains_key(c)).collect();
        let columns = if self.fault == Fault::ShortRange && !own.is_empty() { own } else { corners.to_vec() };
        let heights = columns.iter().map(|&c| self.view.ground().height(c).div_euclid(ONE));
        let edits = columns.iter().filter_map(|c| self.edited.get(c)).flat_map(|&(low, high)| [low, high]);
        let all: Vec<i32> = heights.chain(edits).collect();
        let (low, high) = (*all.iter().min().unwrap() - 2, *all.iter().max().unwrap() + 3);
        for y in (low..high).filter(|&y| wanted(y)) {
            let cube = cell.at(y);
            let solid = |i| self.view.distance(cube + IVec3::from_array(cases::corner(i))) < 0;
            let case = (0..8).fold(0usize, |case, i| case | usize::from(solid(i)) << i);
            let reversed = self.fault == Fault::ComplementTable && case.count_ones() > 4;
            let entry = if reversed { 255 - case } else { case };
            for mut triangle in cases::table()[entry].triangles() {
                if reversed {
                    triangle.reverse();
                }
                self.triangles.push(triangle.map(|edge| {
                    let (corner, axis) = cases::edge_corners(edge);
                    let p = cube + IVec3::from_array(cases::corner(corner));
                    let own = vertex::vertex(&self.view, p, axis, IVec3::ZERO);
                    match self.fault {
                        Fault::ClampedPristine => {
                            let position = vertex::position(&Clamped(self.view), p, axis, IVec3::ZERO);
                            Vertex { position, ..own }
                        }
                        Fault::GradientNormals => {
                            vertex::vertex(&Borderless(self.view), p, axis, IVec3::ZERO)
                        }
                        _ => own,
                    }
                }));
            }
        }
    }

    fn heightmap_cell(&mut self, cell: Column) {
        let ([a, b, c, d], is_steep) = (cell.corners(), self.is_steep(cell));
        let sides = [(a, b, (-1, 0)), (b, c, (0, 1)), (c, d, (1, 0)), (d, a, (0, -1))];
        let [ab, bc, cd, da] = sides.map(|(from, to, (dx, dz))| {
            let beside = cell.offset(dx, dz);
            let bent = self.fault != Fault::StraightRing
                && self.view.grid.has_cell(beside)
                && (self.is_volumetric(beside) || self.is_steep(beside));
            let mut line = vec![self.height_vertex(from)];
            if bent || is_steep {
                line.extend(self.chain(from, to));
            }
            line.push(self.height_vertex(to));
            line
        });
        let mut diagonal = vec![self.height_vertex(a)];
        if is_steep {
            diagonal.extend(self.diagonal(a, c));
        }
        diagonal.push(self.height_vertex(c));
        let back = diagonal.iter().rev().copied().collect();
        for lines in [[ab, bc, back], [cd, da, diagonal]] {
            let is_level = lines.iter().all(|line| line[0].position.y == lines[0][0].position.y);
            if is_steep && !is_level {
                self.bands(&lines);
            } else {
                self.ring_triangle(&lines[0], &lines[1]);
            }
        }
    }

    /// With strata: do two lattice levels or more separate the heights of two neighbouring columns of a cell, but
    /// nowhere more than 64, while the solid ends of all such edges and the voxels below its corners are of several
    /// materials?
    fn is_steep(&self, cell: Column) -> bool {
        let (ground, [a, b, c, d]) = (self.view.ground(), cell.corners());
        let is_solid = |point: &IVec3| point.y * ONE < ground.height(Column::of(*point));
        let crossed = |(from, to): (Column, Column)| -> Vec<IVec3> {
            let levels = sheet([from, to].map(|column| ground.height(column)));
            let edges = levels.map(|y| [from.at(y), to.at(y)]);
            let crossed = edges.filter(|edge| edge.iter().filter(|end| is_solid(end)).count() == 1);
            crossed.map(|[p, q]| if is_solid(&p) { p } else { q }).collect()
        };
        let lines = [(a, b), (b, c), (c, d), (d, a), (a, c)].map(crossed);
        let tops = [a, b, c, d].map(|column| column.at((ground.height(column) - 1).div_euclid(ONE)));
        let mut voxels = lines.iter().flatten().chain(&tops);
        ground.strata().is_some()
            && (2..=64).contains(&lines.iter().map(Vec::len).max().unwrap_or(0))
            && voxels.any(|&voxel| ground.material(voxel) != ground.material(tops[0]))
    }

    /// The vertices on a cell's diagonal.
    fn diagonal(&self, from: Column, to: Column) -> Vec<Vertex> {
        let [h0, h1] = [from, to].map(|column| self.view.ground().height(column));
        let levels = sheet([h0, h1]).filter(|y| (y * ONE < h0) != (y * ONE < h1));
        let mut vertices: Vec<Vertex> = levels
            .map(|y| {
                let share = f64::from((y * ONE - h0).abs()) / f64::from((h1 - h0).abs());
                let step = ((share * f64::from(SNAP)).round() as i32).clamp(1, SNAP - 1);
                let position = from.at(y) * SNAP + IVec3::new(step, 0, step);
                Vertex { position, ..self.height_vertex(from) }
            })
            .collect();
        if h1 < h0 {
            vertices.reverse();
        }
        vertices
    }

    /// A triangle in bands, by the lines around it. Its vertices in the order of their heights, those of the longest
    /// line last among equals: each makes a triangle with the last one of its own side and the last one of the other.
    fn bands(&mut self, lines: &[Vec<Vertex>; 3]) {
        let height = |corner: &usize| lines[*corner][0].position.y;
        let low = (0..3).min_by_key(height).expect("three");
        let high = (0..3).rev().max_by_key(height).expect("three");
        let mut sides = [Vec::new(), Vec::new()];
        let mut corner = low;
        for line in lines.iter().cycle().skip(low).take(3) {
            // Up to the highest corner, and back down.
            let side = usize::from((corner + 3 - low) % 3 >= (high + 3 - low) % 3);
            sides[side].extend_from_slice(&line[1..]);
            corner = (corner + 1) % 3;
        }
        let [mut up, mut down] = sides;
        let lowest = lines[low][0];
        down.pop();
        down.reverse();
        let highest = up.pop().expect("the highest corner");
        let is_long_up = (low + 1) % 3 == high;
        let up = up.into_iter().map(|vertex| (true, vertex));
        let mut all: Vec<(bool, Vertex)> = up.chain(down.into_iter().map(|vertex| (false, vertex))).collect();
        // Keeps the order of equals on one side.
        all.sort_by_key(|&(is_up, vertex)| (vertex.position.y, is_up == is_long_up));
        let mut last = [lowest; 2];
        for (is_up, vertex) in all {
            let triangle = if is_up { [last[0], vertex, last[1]] } else { [vertex, last[1], last[0]] };
            if last != [lowest; 2] {
                self.triangles.push(triangle);
            }
            last[usize::from(!is_up)] = vertex;
        }
        self.triangles.push([last[0], highest, last[1]]);
    }

    fn height_vertex(&self, column: Column) -> Vertex {
        vertex::height_vertex(self.view.ground(), column, IVec3::ZERO)
    }

    fn chain(&self, from: Column, to: Column) -> Vec<Vertex> {
        let (h0, h1) = (self.view.ground().height(from), self.view.ground().height(to));
        let axis = if from.x != to.x { 0 } else { 2 };
        let low = Column::new(from.x.min(to.x), from.z.min(to.z));
        let rungs = sheet([h0, h1]).filter(|y| (y * ONE < h0) != (y * ONE < h1));
        let mut chain: Vec<Vertex> = rungs
            .map(|y| {
                let mut place = vertex::vertex(&self.view, low.at(y), axis, IVec3::ZERO);
                if self.fault == Fault::OwnRingVertices {
                    let share = f64::from(y * ONE - h0) / f64::from(h1 - h0);
                    let along =
                        |a: i32, b: i32| ((f64::from(a) + f64::from(b - a) * share) * f64::from(SNAP)) as i32;
                    place.position = IVec3::new(along(from.x, to.x), y * SNAP, along(from.z, to.z));
                }
                place
            })
            .collect();
        if h1 < h0 {
            chain.reverse();
        }
        chain
    }

    fn ring_triangle(&mut self, first: &[Vertex], second: &[Vertex]) {
        for pair in first.windows(2) {
            self.triangles.push([pair[0], pair[1], second[1]]);
        }
        for pair in second[1..].windows(2) {
            self.triangles.push([first[0], pair[0], pair[1]]);
        }
    }
}

fn check(world: &World, triangles: &[[Vertex; 3]]) -> SeamReport {
    let vertices = triangles.as_flattened().to_vec();
    let indices = Indices::new(vertices.len(), (0..vertices.len() as u32).collect());
    let mut checker = SeamChecker::default();
    checker.add(&SurfaceMesh { vertices, indices }, IVec3::ZERO);
    checker.check(world.grid())
}

/// One steep world, edited across chunk faces.
fn control_world() -> Terrain {
    let mut rng = Rng::with_seed(3);
    let heights: Vec<f64> = (0..33 * 33).map(|_| rng.f64() * 40.0).collect();
    let ground = Ground::from_fn(32, 32, |x, z| heights[(z * 33 + x) as usize]).expect("finite heights");
    let mut terrain = Terrain::new(ground, &TerrainSettings { chunk_size: 16, ..Default::default() })
        .expect("valid settings");
    let dig = |x: f32, y: f32, z: f32, radius| Brush::dig(Shape::sphere(Vec3::new(x, y, z), radius));
    let mut brushes = vec![dig(9.0, 20.0, 9.0, 4.0), dig(16.0, 10.0, 20.0, 4.0), dig(26.0, 15.0, 26.0, 3.0)];
    brushes.push(Brush::add(Shape::sphere(Vec3::new(22.0, 30.0, 8.0), 4.0), MaterialId(1)));
    brushes.extend((4..29).step_by(2).map(|x| dig(x as f32, -x as f32 / 2.0, 10.0, 3.0)));
    terrain.apply(brushes);
    terrain
}

#[test]
fn unbroken_rules_draw_a_flawless_world() {
    let terrain = control_world();
    let report = check(terrain.world(), &ReferenceMesher::draw(terrain.world(), Fault::None));
    assert!(report.is_flawless(), "{report}");
}

fn expect_open(fault: Fault) {
    let terrain = control_world();
    let report = check(terrain.world(), &ReferenceMesher::draw(terrain.world(), fault));
    assert!(report.open > 0, "{fault:?} went unnoticed: {report}");
}

#[test]
fn without_rule_1_the_border_line_bends() {
    expect_open(Fault::ClampedPristine);
}

#[test]
fn without_rule_2_the_mask_leaves_holes() {
    expect_open(Fault::ThinMask);
    expect_open(Fault::OwnHeights);
    expect_open(Fault::HeightmapOnly);
}

#[test]
fn without_rule_3_the_ring_has_gaps() {
    expect_open(Fault::StraightRing);
}

#[test]
fn without_rule_4_the_ring_misses_the_cubes_by_a_hair() {
    expect_open(Fault::OwnRingVertices);
}

#[test]
fn without_rule_5_steep_borders_are_cut_off() {
    expect_open(Fault::ShortRange);
}

#[test]
fn a_complement_symmetric_case_table_leaves_holes() {
    expect_open(Fault::ComplementTable);
}

#[test]
fn gradient_normals_at_the_masks_border_make_shading_jump() {
    let terrain = control_world();
    let report = check(terrain.world(), &ReferenceMesher::draw(terrain.world(), Fault::GradientNormals));
    // Only the shading is wrong.
    assert!(report.is_closed() && report.first.is_empty(), "{report}");
    assert!(report.worst_normal_jump > 1.0, "gradients went unnoticed: {report}");
    let at = report.worst_normal_at.expect("a jump is somewhere");
    assert!(terrain.world().mask().iter().any(|cell| cell.at(0).as_dvec3().with_y(at.y).distance(at) < 3.0));
}

#[test]
fn rule_6_a_dig_leaves_the_deep_rock_alone() {
    let ground = Ground::flat(64, 64, 0.0).expect("valid ground");
    let mut terrain = Terrain::new(ground, &TerrainSettings::default()).expect("valid settings");
    let (center, radius) = (Vec3::new(32.0, -20.0, 32.0), 5.0);
    terrain.apply([Brush::dig(Shape::sphere(center, radius))]);
    let edited = || terrain.world().bricks().flat_map(|(pos, brick)| brick.edited_samples(pos));
    let band = BAND as f32 / ONE as f32;
    assert!(edited().all(|(point, ..)| point.as_vec3().distance(center) <= radius + band + 1.0 / 256.0));
    // Without the band, every sample whose density the dig could raise would be rewritten.
    let brush = Brush::dig(Shape::sphere(center, radius));
    let evaluator = Edit::quantize(&brush).expect("valid brush").evaluator();
    let rock = LatticeBox::new(IVec3::new(0, -60, 0), IVec3::new(64, 0, 64)).expect("not empty");
    let pristine = |point: IVec3| terrain.world().ground().distance(point);
    let raised = rock.points().filter(|&point| -evaluator.distance(point) > pristine(point)).count();
    assert!(raised > 20 * edited().count(), "{raised} raised, {} edited", edited().count());
}

#[test]
fn the_crate_draws_what_the_reference_draws() {
    for index in 0..worlds::world_count(60) {
        let terrain = worlds::random_world(&mut Rng::with_seed(1000 + index), index);
        let world = terrain.world();
        let canonical = |mut triangle: [IVec3; 3]| {
            let first = (0..3).min_by_key(|&i| triangle[i].to_array()).unwrap_or(0);
            triangle.rotate_left(first);
            triangle.map(|place| place.to_array())
        };
        let places = |triangle: [Vertex; 3]| triangle.map(|vertex| vertex.position);
        let reference = ReferenceMesher::draw(world, Fault::None).into_iter();
        let mut reference: Vec<_> = reference.map(|triangle| canonical(places(triangle))).collect();
        let mut drawn = Vec::new();
        for (what, mesh) in world.drawn() {
            let origin = world.origin(what) * SNAP;
            drawn.extend(mesh.triangles().map(|t| canonical(t.map(|vertex| vertex.position + origin))));
        }
        reference.sort_unstable();
        drawn.sort_unstable();
        assert!(
            reference == drawn,
            "world {index}: {} reference triangles, {} drawn",
            reference.len(),
            drawn.len()
        );
    }
}
