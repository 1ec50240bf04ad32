//! A reference implementation of edits, sample by sample, written from the documentation.

use std::collections::{BTreeSet, HashMap};

use bevy_burrow::brush::shapes::{Capsule, Cone, Cuboid, Cylinder, Sphere};
use bevy_burrow::brush::{BAND, Evaluator};
use bevy_burrow::lattice::LatticeBox;
use bevy_burrow::prelude::*;
use glam::{IVec2, IVec3, Quat, Vec3};

use crate::checked_terrain::{CheckedTerrain, Effect};
use crate::worlds::reference_density;

/// The largest stored density.
const FARTHEST: i32 = 32_767;

/// A length in 1/256 voxel.
fn units(voxels: f32) -> i32 {
    (voxels * 256.0).round_ties_even() as i32
}

/// The largest depth inside a shape, rounded down.
fn deepest(shape: &Shape) -> i32 {
    let length =
        |axis: Vec3| axis.to_array().map(|part| f64::from(units(part)).powi(2)).iter().sum::<f64>().sqrt();
    match *shape {
        Shape::Sphere(Sphere { radius, .. }) | Shape::Capsule(Capsule { radius, .. }) => units(radius),
        Shape::Cuboid(Cuboid { half, .. }) => units(half.min_element()),
        Shape::Cylinder(Cylinder { axis, radius, .. }) => units(radius).min((length(axis) / 2.0) as i32),
        // The radius of the ball that touches base and side: the area of a cross-section divided by half its perimeter.
        Shape::Cone(Cone { axis, radius, .. }) => {
            let (height, radius) = (length(axis), f64::from(units(radius)));
            let slant = (height * height + radius * radius).sqrt();
            (radius * height / (radius + slant)) as i32
        }
        Shape::Torus(torus) => units(torus.tube),
        _ => panic!("{shape:?}"),
    }
}

/// The height of a point above a plane that is parallel to two axes.
fn above_plane(point: IVec3, on: Vec3, normal: Vec3) -> i32 {
    let from = point * 256 - IVec3::from_array(on.to_array().map(units));
    assert_eq!(normal.as_ivec3().as_vec3().abs(), normal.abs(), "only axis-aligned planes");
    (from * normal.as_ivec3()).element_sum()
}

/// The half extents of a stamp.
fn half(stamp: &Stamp) -> IVec2 {
    IVec2::new(units(stamp.size.x / 2.0), units(stamp.size.y / 2.0))
}

/// A point's distance outside the image of an unrotated stamp, and its height above the relief.
fn from_relief(point: IVec3, stamp: &Stamp) -> (i32, i32) {
    assert_eq!(stamp.rotation, Quat::IDENTITY, "only unrotated stamps");
    let (from, half) = (point * 256 - IVec3::from_array(stamp.center.to_array().map(units)), half(stamp));
    let beside = (from.x.abs() - half.x).max(from.z.abs() - half.y);
    // The position on the image, in 1/256 of a step between samples; outside the image, its border continues.
    let place = |from: i32, half: i32, side: u32| {
        let last = (i64::from(side) - 1) * 256;
        (i64::from(from + half) * last / i64::from(2 * half)).clamp(0, last)
    };
    let (x, z) = (place(from.x, half.x, stamp.image.width()), place(from.z, half.y, stamp.image.height()));
    let mut grey = 0;
    for (dx, dz) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
        let share = |along: i64, step: i64| if step == 0 { 256 - along % 256 } else { along % 256 };
        let sample = stamp.image.grey((x / 256 + dx) as u32, (z / 256 + dz) as u32);
        grey += i64::from(sample) * share(x, dx) * share(z, dz);
    }
    let white = 65_535 * 256 * 256;
    let relief = (2 * grey * i64::from(units(stamp.height)) + white).div_euclid(2 * white);
    (beside, from.y - relief as i32)
}

/// The new density of a sample under a fill or a carve, from its distances to the shape and to the surface.
fn rounded(brush: &Brush, before: i32, outside: i32, surface: i32) -> i32 {
    let (is_dig, depth) = (brush.operation == Operation::Carve, bevy_burrow::brush::DEPTH);
    let (radius, shape) = (units(brush.blend.falloff), outside.max(-depth));
    // A carve is a fill of air.
    let (own, is_in) = if is_dig { (-before, before >= 0) } else { (before, before < 0) };
    let mut after = if outside <= BAND { own.min(shape) } else { own };
    if shape < radius && if is_in { own > -depth } else { surface < radius } {
        let near = if is_in { -surface.min(radius.max(depth)) } else { surface };
        let beside = if is_in { shape.max(0) } else { shape };
        let corner = i64::from(radius - near).pow(2) + i64::from(radius - beside).pow(2);
        // The integer root.
        let mut root = (corner as f64).sqrt() as i64;
        while root * root > corner {
            root -= 1;
        }
        while (root + 1) * (root + 1) <= corner {
            root += 1;
        }
        let arc = radius - root as i32;
        let filled = match (is_in, arc > 0 && near < shape) {
            (true, _) => own.min(shape) + arc - near,
            (false, true) => (i64::from(own) * i64::from(arc) / i64::from(near)) as i32,
            (false, false) => arc,
        };
        after = after.min(filled.max(-depth));
    }
    let whole = i64::from(if is_dig { -after } else { after }) - i64::from(before);
    before + (whole.signum() * ((whole.abs() * i64::from(units(brush.blend.strength)) + 255) / 256)) as i32
}

impl CheckedTerrain {
    /// The new density of a sample under a sculpting operation, as the crate's documentation defines it.
    fn sculpted(&self, brush: &Brush, point: IVec3, outside: i32) -> Option<i32> {
        let (mut deepest, mut outside) = (deepest(&brush.shape), outside);
        let target = match &brush.operation {
            Operation::Level { height } => Some(point.y * 256 - units(*height)),
            Operation::Flatten { point: on, normal } => Some(above_plane(point, *on, *normal)),
            Operation::Stamp { stamp } => {
                let (beside, above) = from_relief(point, stamp);
                // Nothing changes outside the shape or outside the stamp's image.
                (outside, deepest) = (outside.max(beside), deepest.min(half(stamp).min_element()));
                Some(above)
            }
            _ => None,
        };
        let (strength, falloff) = (units(brush.blend.strength), units(brush.blend.falloff).min(deepest));
        let weight = match -outside {
            inside if inside < 0 || inside == 0 && falloff > 0 => return None,
            inside if inside >= falloff => strength,
            inside => {
                let t = inside * 256 / falloff;
                ((t * t * (768 - 2 * t) / 65_536) * strength + 128) / 256
            }
        };
        let distance = |at: IVec3| self.distance(self.at_rim(at));
        let (own, depth) = (distance(point), bevy_burrow::brush::DEPTH);
        let stored = |at: IVec3| self.samples.get(&self.at_rim(at)).map(|&(own, _)| own);
        let is_cut = |at: IVec3| stored(at).is_some_and(|own| own.abs() == depth || own.abs() == FARTHEST);
        let away = |whole: i64| (whole.signum() * ((whole.abs() * i64::from(weight) + 255) / 256)) as i32;
        let to = |target: i32| own + away(i64::from(target) - i64::from(own));
        let faces = [IVec3::X, IVec3::Y, IVec3::Z].into_iter().flat_map(|axis| [axis, -axis]);
        let faces: Vec<IVec3> = faces.map(|step| point + step).collect();
        if weight == 0 {
            return None;
        }
        if let Some(target) = target {
            return Some(to(target));
        }
        let is_other = |at: &&IVec3| (distance(**at) < 0) != (own < 0);
        if let Operation::Raise { amount } | Operation::Lower { amount } = brush.operation {
            let by = (units(amount) * weight + 128) / 256;
            let by = if matches!(brush.operation, Operation::Raise { .. }) { -by } else { by };
            let ground = self.terrain.world().ground();
            // The density is exact, and at least a voxel farther from the surface than the pristine one.
            let is_moved = |at: &&IVec3| {
                let (now, nature) = (distance(**at), ground.distance(self.at_rim(**at)));
                !is_cut(**at)
                    && stored(**at).is_some()
                    && (now - nature) * (if now < 0 { -1 } else { 1 }) >= 256
            };
            let middle = if own.abs() >= FARTHEST {
                // At the largest stored density, samples change only towards a surface that was moved beyond
                // the pristine one.
                if (by < 0) == (own < 0) || !faces.iter().filter(is_other).any(|at| is_moved(&at)) {
                    return None;
                }
                own.signum() * 256
            } else if is_cut(point) {
                let known = faces.iter().filter(|&&face| !is_cut(face));
                let nearest = known.map(|&face| distance(face) * own.signum()).min()?;
                if nearest > depth {
                    return None;
                }
                own.signum() * (nearest + 256).max(depth)
            } else {
                own
            };
            let after = middle + by;
            // Only dig and add leave clamped samples.
            return (by != 0).then_some(if after.abs() == depth { after + by.signum() } else { after });
        }
        // Of a clamped sample, only a lower bound is known: a voxel farther than its neighbours that are exact.
        let mut middle = own;
        if is_cut(point) && own.abs() == FARTHEST {
            faces.iter().find(is_other)?;
            middle = own.signum() * 256;
        } else if is_cut(point) {
            let sign = own.signum();
            let known = faces.iter().filter(|&&face| !is_cut(face));
            let nearest = known.map(|&face| distance(face) * sign).min()?;
            let others = faces.iter().filter(|&&face| is_cut(face)).map(|_| depth).min();
            middle = sign * (nearest.min(others.unwrap_or(i32::MAX)).max(0) + 256);
        }
        // 64 times the change towards the average of the 27 samples.
        let average = || {
            let mut sum = 0;
            let steps = (0..27).map(|i| IVec3::new(i % 3, i / 3 % 3, i / 9) - 1);
            for step in steps.filter(|&step| step != IVec3::ZERO) {
                let length = (256.0 * step.as_dvec3().length()).round() as i32;
                let weight = [8, 4, 2, 1][step.abs().element_sum() as usize];
                let is_known = |at: IVec3| !is_cut(at) || middle.abs() + length <= distance(at).abs();
                if is_known(point + step) && is_known(point - step) {
                    sum += weight * (distance(point + step) - middle).clamp(-512, 512);
                }
            }
            sum
        };
        let attached = |after: i32| {
            let same = |at: &IVec3| (distance(*at) < 0) == (after < 0);
            if (own < 0) == (after < 0) || faces.iter().any(same) { after } else { -i32::from(own < 0) }
        };
        match brush.operation {
            Operation::Smooth => match average() * weight / (64 * 256) {
                0 => None,
                by => Some(attached(middle + by)),
            },
            Operation::Sharpen => match (average() * weight / (64 * 256)).clamp(-64, 64) {
                0 => None,
                by => {
                    let around = LatticeBox::point(point).grown(1);
                    let all: Vec<i32> = around.points().map(distance).collect();
                    let (low, high) = (all.iter().min()?, all.iter().max()?);
                    Some(attached((middle - by).clamp(*low, *high)))
                }
            },
            Operation::Terrace { step, base } => {
                let (step, base) = (units(step), units(base));
                let surface = point.y * 256 - middle;
                let tread = (surface - base).div_euclid(step) * step;
                let riser = ((surface - base - tread - step * 3 / 8) * 4).clamp(0, step);
                let by = away(i64::from(surface) - i64::from(base + tread + riser));
                (by != 0).then_some(middle + by)
            }
            _ => panic!("{brush:?}"),
        }
    }

    /// Beyond the world's rim, samples repeat those at the rim.
    fn at_rim(&self, at: IVec3) -> IVec3 {
        let ground = self.terrain.world().ground();
        IVec3::new(at.x.clamp(0, ground.width()), at.y, at.z.clamp(0, ground.depth()))
    }

    /// The distance to the surface, as a fill and a carve define it, of all samples of a box that are nearer to it than the
    /// radius: the shortest way through samples of their own side.
    fn surface_distances(&self, brush: &Brush, samples: LatticeBox) -> HashMap<IVec3, i32> {
        let horizon = units(brush.blend.falloff).max(1024);
        let around = samples.grown(horizon / 256 + 2);
        let distance = |at: IVec3| self.distance(self.at_rim(at));
        let (mut known, mut open) = (HashMap::new(), BTreeSet::new());
        for point in around.points() {
            let own = distance(point);
            // Where the surface crosses the edges to neighbours, in voxels; squares of a plane's normal add up.
            let along = [IVec3::X, IVec3::Y, IVec3::Z].map(|axis| {
                let others = [axis, -axis].map(|step| distance(point + step));
                let crossed = others.into_iter().filter(|other| (*other < 0) != (own < 0));
                let part =
                    |other: i32| f64::from(own.abs()) * 256.0 / f64::from((own.abs() + other.abs()).max(1));
                crossed.map(part).fold(f64::INFINITY, f64::min)
            });
            let squares: f64 = along.iter().map(|length| 1.0 / (length * length)).sum();
            if squares > 0.0 {
                let first = (1.0 / squares.sqrt()).round_ties_even() as i32;
                open.insert((first, point.to_array()));
            }
        }
        while let Some((length, at)) = open.pop_first() {
            let point = IVec3::from_array(at);
            if length >= horizon || !around.contains(point) || known.contains_key(&point) {
                continue;
            }
            known.insert(point, length);
            let is_solid = distance(point) < 0;
            for step in LatticeBox::point(IVec3::ZERO).grown(1).points().filter(|step| *step != IVec3::ZERO) {
                if (distance(point + step) < 0) == is_solid {
                    let way = [256, 362, 443][step.abs().element_sum() as usize - 1];
                    open.insert((length + way, (point + step).to_array()));
                }
            }
        }
        known
    }

    /// The material of a sample that becomes solid.
    fn new_material(&self, brush: &Brush, point: IVec3) -> MaterialId {
        if let Some(material) = brush.blend.material {
            return material;
        }
        let column = (1..=64).map(|by| -by).chain(1..=64).map(|by| point + IVec3::Y * by);
        let beside = [IVec3::NEG_X, IVec3::X, IVec3::NEG_Z, IVec3::Z].map(|step| point + step);
        let solid = column.chain(beside).find(|&at| self.distance(self.at_rim(at)) < 0);
        let stored = solid.and_then(|at| self.samples.get(&at));
        stored.map_or(MaterialId::GROUND, |&(_, material)| material)
    }

    /// Applies a brush to the reference samples.
    pub fn naive(&mut self, brush: &Brush, edit: &Edit) -> Effect {
        let (grid, ground) = (self.terrain.world().grid(), self.terrain.world().ground());
        let mut effect = Effect::default();
        let mut changes = Vec::new();
        let Some(reach) = edit.reach().intersection(grid.edit_bounds()) else { return effect };
        let evaluator: Evaluator = edit.evaluator();
        let rounds = matches!(brush.operation, Operation::Fill | Operation::Carve);
        let surface = if rounds { self.surface_distances(brush, reach) } else { HashMap::new() };
        let mut row = vec![0; reach.size().x as usize];
        for (y, z) in
            (reach.min.y..=reach.max.y).flat_map(|y| (reach.min.z..=reach.max.z).map(move |z| (y, z)))
        {
            evaluator.row(IVec3::new(reach.min.x, y, z), &mut row);
            for (x, &outside) in (reach.min.x..).zip(&row) {
                let point = IVec3::new(x, y, z);
                let stored = self.samples.get(&point).copied();
                let before = stored.map_or_else(|| ground.distance(point), |(distance, _)| distance);
                let own = stored.map_or(MaterialId::GROUND, |(_, material)| material);
                let after = reference_density(&edit.operation(), before, outside);
                let number = after.clamp(-32767, 32767);
                match edit.operation() {
                    operation if operation.is_sculpting() => {
                        let after = match surface.get(&point) {
                            Some(surface) if rounds => Some(rounded(brush, before, outside, *surface)),
                            _ if rounds => Some(rounded(brush, before, outside, i32::MAX)),
                            _ => self.sculpted(brush, point, outside),
                        };
                        let after = after.map(|after| after.clamp(-32767, 32767));
                        let Some(after) = after.filter(|&after| after != before.clamp(-32767, 32767)) else {
                            continue;
                        };
                        let material = match (before < 0, after < 0) {
                            (true, false) => MaterialId::GROUND,
                            (false, true) => self.new_material(brush, point),
                            _ => own,
                        };
                        changes.push((point, before, Some((after, material))));
                    }
                    Operation::Reset => {
                        if outside <= BAND && stored.is_some() {
                            changes.push((point, before, None));
                        }
                    }
                    Operation::Paint { material } => {
                        if outside <= 0 && before < 0 && (stored.is_none() || own != material) {
                            changes.push((point, before, Some((number, material))));
                        }
                    }
                    operation => {
                        if outside <= BAND && after != before && stored.is_none_or(|(d, _)| d != number) {
                            let material = match (before < 0, after < 0) {
                                (true, false) => MaterialId::GROUND,
                                (false, true) => operation.material().unwrap_or(own),
                                _ => own,
                            };
                            changes.push((point, before, Some((number, material))));
                        }
                    }
                }
            }
        }
        for (point, before, change) in changes {
            let old = self.material(point);
            let after = change.map_or_else(|| ground.distance(point), |(after, _)| after);
            match change {
                Some(sample) => drop(self.samples.insert(point, sample)),
                None => drop(self.samples.remove(&point)),
            }
            let new = self.material(point);
            effect.chunks.insert(grid.chunk_of(point));
            LatticeBox::include(&mut effect.bounds, LatticeBox::point(point));
            match (before < 0, after < 0) {
                (true, false) => *effect.removed.entry(old).or_default() += 1,
                (false, true) => *effect.added.entry(new).or_default() += 1,
                (true, true) if old != new => *effect.painted.entry(new).or_default() += 1,
                _ => {}
            }
        }
        effect
    }
}
