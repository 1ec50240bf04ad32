//! Chips that fly and bounce, dust that drifts, and fire: all from pools that are filled once, when the game starts.

use std::f32::consts::TAU;

use bevy::light::{NotShadowCaster, NotShadowReceiver};
use bevy::prelude::*;
use bevy_burrow::prelude::*;

use crate::ui::art::Art;
use crate::world::landscape::MATERIALS;
use crate::world::light::Eyes;

/// How many of each there are; the oldest flies again when all do.
const CHIPS: usize = 260;
const PUFFS: usize = 90;
/// Steps in which a puff fades: each has a material of its own, so that no material ever changes.
const FADES: usize = 6;
const GRAVITY: f32 = 14.0;

/// What flies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Matter {
    Chips(MaterialId),
    Dust(MaterialId),
    Fire,
}

/// Some of it flies off.
#[derive(Message, Clone, Debug)]
pub struct Burst {
    pub place: Vec3,
    /// Where to, of length 1; zero for all ways.
    pub out: Vec3,
    pub count: usize,
    /// Metres per second.
    pub speed: f32,
    pub matter: Matter,
}

/// A chip or a puff in flight; it rests, unseen, once `age` is past `life`.
#[derive(Component, Clone, Copy, Debug, Default)]
struct Mote {
    velocity: Vec3,
    spin: Vec3,
    size: f32,
    /// Longer or flatter than round, along its own axes.
    form: Vec3,
    age: f32,
    life: f32,
    matter: Option<Matter>,
}

impl Mote {
    fn flies(&self) -> bool {
        self.age < self.life
    }
}

#[derive(Component)]
struct Chip;

#[derive(Component)]
struct Puff;

/// The pools, and the materials that their motes put on.
#[derive(Resource)]
struct Pools {
    chips: Vec<Entity>,
    puffs: Vec<Entity>,
    next: [usize; 2],
    chip_materials: [Handle<StandardMaterial>; MATERIALS.len()],
    dust: Vec<Handle<StandardMaterial>>,
    fire: Vec<Handle<StandardMaterial>>,
    chance: fastrand::Rng,
}

/// Makes things fly.
pub struct ParticlesPlugin;

impl Plugin for ParticlesPlugin {
    fn build(&self, app: &mut App) {
        app.add_message::<Burst>()
            .add_systems(Startup, fill_pools)
            .add_systems(Update, (scatter, fly, face_eyes).chain().after(BurrowSystems::Propagate));
    }
}

fn fill_pools(
    mut commands: Commands,
    art: Res<Art>,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    let colors = MaterialColors::default();
    let color = |at: usize| colors.0.get(at).copied().unwrap_or(LinearRgba::WHITE);
    let chip_materials = std::array::from_fn(|at| {
        materials.add(StandardMaterial {
            // The headlamp shines on chips from a step away: as bright as the wall behind them, they would be white.
            base_color: (color(at) * 0.5).with_alpha(1.0).into(),
            perceptual_roughness: 1.0,
            reflectance: 0.0,
            ..default()
        })
    });
    let mut puff = |base_color: LinearRgba, fade: usize, unlit: bool| {
        let alpha = 1.0 - (fade as f32 + 0.5) / FADES as f32;
        materials.add(StandardMaterial {
            base_color: base_color.with_alpha(alpha * if unlit { 0.9 } else { 0.30 }).into(),
            base_color_texture: Some(art.puff.clone()),
            alpha_mode: if unlit { AlphaMode::Add } else { AlphaMode::Blend },
            perceptual_roughness: 1.0,
            reflectance: 0.0,
            unlit,
            ..default()
        })
    };
    // Nor is dust to glow where the lamp meets it.
    let pale = |at: usize| color(at).mix(&LinearRgba::rgb(0.62, 0.57, 0.5), 0.55) * 0.6;
    let dust = (0..MATERIALS.len()).flat_map(|at| (0..FADES).map(move |fade| (at, fade))).collect::<Vec<_>>();
    let dust = dust.into_iter().map(|(at, fade)| puff(pale(at), fade, false)).collect();
    let fire = (0..FADES)
        .map(|fade| {
            let heat = 1.0 - fade as f32 / FADES as f32;
            puff(LinearRgba::rgb(2.6, 1.7 * heat, 0.9 * heat * heat), fade, true)
        })
        .collect();
    // Pebbles with flat sides; each is stretched in its own way.
    let pebble = Sphere::new(0.6).mesh().ico(0).unwrap_or_else(|_| Sphere::new(0.6).mesh().build());
    let shard = meshes.add(pebble.with_duplicated_vertices().with_computed_flat_normals());
    let sheet = meshes.add(Rectangle::default());
    let mut pool = |count: usize, mesh: &Handle<Mesh>, is_chip: bool| -> Vec<Entity> {
        let mote = |_| {
            let mut mote = commands.spawn((
                Mote::default(),
                Mesh3d(mesh.clone()),
                Visibility::Hidden,
                Transform::default(),
                NotShadowCaster,
            ));
            if is_chip {
                mote.insert(Chip)
            } else {
                mote.insert((Puff, NotShadowReceiver))
            };
            mote.id()
        };
        (0..count).map(mote).collect()
    };
    let (chips, puffs) = (pool(CHIPS, &shard, true), pool(PUFFS, &sheet, false));
    let chance = fastrand::Rng::with_seed(5);
    commands.insert_resource(Pools { chips, puffs, next: [0; 2], chip_materials, dust, fire, chance });
}

impl Pools {
    fn between(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.chance.f32()
    }

    /// Any way, of length 1.
    fn way(&mut self) -> Vec3 {
        let (turn, up) = (self.between(0.0, TAU), self.between(-1.0, 1.0));
        let level = (1.0 - up * up).max(0.0).sqrt();
        Vec3::new(level * turn.cos(), up, level * turn.sin())
    }

    /// The mote that has rested longest.
    fn take(&mut self, is_chip: bool) -> Option<Entity> {
        let pool = if is_chip { &self.chips } else { &self.puffs };
        let next = &mut self.next[usize::from(is_chip)];
        *next = (*next + 1) % pool.len().max(1);
        pool.get(*next).copied()
    }

    fn material(&self, matter: Matter, part: f32) -> Option<&Handle<StandardMaterial>> {
        let fade = ((part * FADES as f32) as usize).min(FADES - 1);
        match matter {
            Matter::Chips(MaterialId(id)) => self.chip_materials.get(usize::from(id)),
            Matter::Dust(MaterialId(id)) => self.dust.get(usize::from(id) * FADES + fade),
            Matter::Fire => self.fire.get(fade),
        }
    }
}

fn scatter(
    mut bursts: MessageReader<Burst>,
    mut pools: ResMut<Pools>,
    mut motes: Query<(&mut Mote, &mut Transform, &mut Visibility)>,
    mut commands: Commands,
) {
    for burst in bursts.read() {
        let is_chip = matches!(burst.matter, Matter::Chips(_));
        for _ in 0..burst.count {
            let Some(entity) = pools.take(is_chip) else { return };
            let Ok((mut mote, mut place, mut visibility)) = motes.get_mut(entity) else { continue };
            let way = (burst.out * 1.2 + pools.way()).normalize_or(Vec3::Y);
            let (size, life) = match burst.matter {
                // Many crumbs, and a lump now and then.
                Matter::Chips(_) => (0.035 + 0.10 * pools.between(0.0, 1.0).powi(3), pools.between(0.7, 1.6)),
                Matter::Dust(_) => (pools.between(0.5, 1.1), pools.between(0.7, 1.5)),
                Matter::Fire => (pools.between(0.9, 2.2), pools.between(0.25, 0.55)),
            };
            let speed = burst.speed * pools.between(0.35, 1.2);
            let form = if is_chip { Vec3::ONE + 0.45 * pools.way() } else { Vec3::ONE };
            *mote = Mote {
                velocity: way * speed,
                spin: pools.way() * pools.between(2.0, 14.0),
                size,
                form,
                age: 0.0,
                life,
                matter: Some(burst.matter),
            };
            *place = Transform::from_translation(burst.place + pools.way() * 0.25)
                .with_rotation(Quat::from_scaled_axis(pools.way() * 3.0))
                .with_scale(form * size);
            *visibility = Visibility::Inherited;
            if let Some(material) = pools.material(burst.matter, 0.0) {
                commands.entity(entity).insert(MeshMaterial3d(material.clone()));
            }
        }
    }
}

fn fly(
    time: Res<Time>,
    terrains: Terrains,
    pools: Res<Pools>,
    mut motes: Query<(
        &mut Mote,
        &mut Transform,
        &mut Visibility,
        Option<&mut MeshMaterial3d<StandardMaterial>>,
        Has<Chip>,
    )>,
) {
    let dt = time.delta_secs();
    for (mut mote, mut place, mut visibility, material, is_chip) in &mut motes {
        if !mote.flies() {
            continue;
        }
        mote.age += dt;
        if !mote.flies() {
            *visibility = Visibility::Hidden;
            continue;
        }
        let part = mote.age / mote.life;
        if is_chip {
            mote.velocity.y -= GRAVITY * dt;
            let next = place.translation + mote.velocity * dt;
            if terrains.is_solid(next) {
                // No normal is looked for: a chip is too small for anyone to see where it bounces to.
                mote.velocity =
                    Vec3::new(mote.velocity.x * 0.5, mote.velocity.y.abs() * 0.35, mote.velocity.z * 0.5);
                mote.spin *= 0.4;
            } else {
                place.translation = next;
            }
            place.rotate(Quat::from_scaled_axis(mote.spin * dt));
            place.scale = mote.form * (mote.size * (4.0 * (1.0 - part)).min(1.0));
        } else {
            mote.velocity *= (-2.2 * dt).exp();
            mote.velocity.y += 0.5 * dt;
            place.translation += mote.velocity * dt;
            place.scale = Vec3::splat(mote.size * (1.0 + 1.8 * part));
            let fresh = mote.matter.and_then(|matter| pools.material(matter, part));
            if let (Some(mut material), Some(fresh)) = (material, fresh)
                && material.0 != *fresh
            {
                material.0 = fresh.clone();
            }
        }
    }
}

/// Puffs are flat, and nobody is to notice.
fn face_eyes(
    eyes: Single<&Transform, With<Eyes>>,
    mut puffs: Query<(&Mote, &mut Transform), (With<Puff>, Without<Eyes>)>,
) {
    for (mote, mut place) in &mut puffs {
        if mote.flies() {
            place.rotation = eyes.rotation;
        }
    }
}
