//! Particles: chips that bounce, dust that drifts, and fire. They come from pools that are filled when the game starts.

use std::f32::consts::TAU;

use bevy::asset::RenderAssetUsages;
use bevy::image::{CompressedImageFormats, ImageSampler, ImageType};
use bevy::light::{NotShadowCaster, NotShadowReceiver};
use bevy::prelude::*;
use bevy_burrow::prelude::*;

use crate::player::camera::PlayerCamera;
use crate::world::landscape::MATERIALS;

/// Sizes of the pools. When all particles fly, the oldest is used again.
const CHIPS: usize = 260;
const PUFFS: usize = 90;
/// A puff of dust or fire fades in this many steps. Each step has its own material, so no material asset ever changes.
const FADE_STEPS: usize = 6;
const GRAVITY: f32 = 14.0;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ParticleKind {
    Chips(MaterialId),
    Dust(MaterialId),
    Fire,
}

/// Particles fly off.
#[derive(Message, Clone, Debug)]
pub struct Burst {
    pub place: Vec3,
    /// The main direction, of length 1; zero for all directions.
    pub direction: Vec3,
    pub count: usize,
    /// Metres per second.
    pub speed: f32,
    pub kind: ParticleKind,
}

/// A chip or a puff. It is idle and hidden once its age is past its life.
#[derive(Component, Clone, Copy, Debug, Default)]
struct Particle {
    velocity: Vec3,
    spin: Vec3,
    size: f32,
    /// How it is stretched along its own axes.
    stretch: Vec3,
    age: f32,
    life: f32,
    kind: Option<ParticleKind>,
}

impl Particle {
    fn flies(&self) -> bool {
        self.age < self.life
    }
}

/// Puffs are flat and face the camera.
#[derive(Component)]
struct Puff;

/// The pools, and the materials of their particles.
#[derive(Resource)]
struct Pools {
    chips: Vec<Entity>,
    puffs: Vec<Entity>,
    next: [usize; 2],
    chip_materials: Vec<Handle<StandardMaterial>>,
    /// For each ground material, one for each step of fading.
    dust: Vec<Handle<StandardMaterial>>,
    fire: Vec<Handle<StandardMaterial>>,
    random: fastrand::Rng,
}

/// Makes particles fly.
pub struct ParticlesPlugin;

impl Plugin for ParticlesPlugin {
    fn build(&self, app: &mut App) {
        app.add_message::<Burst>()
            .add_systems(Startup, fill_pools)
            .add_systems(Update, (start, fly, face_camera).chain().after(BurrowSystems::Propagate));
    }
}

fn fill_pools(
    mut commands: Commands,
    mut images: ResMut<Assets<Image>>,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) -> Result {
    let matte = StandardMaterial { perceptual_roughness: 1.0, reflectance: 0.0, ..default() };
    let colors = MATERIALS.map(crate::world::landscape::colour);
    // The headlamp is close to chips and dust: at their full brightness they would be overexposed.
    let chip_materials = colors
        .map(|color| StandardMaterial { base_color: (color * 0.5).with_alpha(1.0).into(), ..matte.clone() })
        .map(|material| materials.add(material))
        .to_vec();
    let puff = images.add(Image::from_buffer(
        include_bytes!("puff.png"),
        ImageType::Extension("png"),
        CompressedImageFormats::NONE,
        true,
        ImageSampler::linear(),
        RenderAssetUsages::RENDER_WORLD,
    )?);
    let mut puff_material = |color: LinearRgba, step: usize, unlit: bool| {
        let alpha = 1.0 - (step as f32 + 0.5) / FADE_STEPS as f32;
        materials.add(StandardMaterial {
            base_color: color.with_alpha(alpha * if unlit { 0.9 } else { 0.30 }).into(),
            base_color_texture: Some(puff.clone()),
            alpha_mode: if unlit { AlphaMode::Add } else { AlphaMode::Blend },
            unlit,
            ..matte.clone()
        })
    };
    let (mut dust, mut fire) = (Vec::new(), Vec::new());
    for color in colors {
        let pale = color.mix(&LinearRgba::rgb(0.62, 0.57, 0.5), 0.55) * 0.6;
        dust.extend((0..FADE_STEPS).map(|step| puff_material(pale, step, false)));
    }
    for step in 0..FADE_STEPS {
        let heat = 1.0 - step as f32 / FADE_STEPS as f32;
        fire.push(puff_material(LinearRgba::rgb(2.6, 1.7 * heat, 0.9 * heat * heat), step, true));
    }
    // A pebble with flat faces. Each chip stretches it differently.
    let pebble = Sphere::new(0.6).mesh().ico(0)?;
    let pebble = meshes.add(pebble.with_duplicated_vertices().with_computed_flat_normals());
    let sheet = meshes.add(Rectangle::default());
    let idle = || (Particle::default(), Visibility::Hidden, Transform::default(), NotShadowCaster);
    let chips = (0..CHIPS).map(|_| commands.spawn((idle(), Mesh3d(pebble.clone()))).id()).collect();
    let puffs = (0..PUFFS)
        .map(|_| commands.spawn((idle(), Puff, NotShadowReceiver, Mesh3d(sheet.clone()))).id())
        .collect();
    let random = fastrand::Rng::with_seed(5);
    commands.insert_resource(Pools { chips, puffs, next: [0; 2], chip_materials, dust, fire, random });
    Ok(())
}

impl Pools {
    fn between(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.random.f32()
    }

    /// A random direction of length 1.
    fn direction(&mut self) -> Vec3 {
        let (turn, up) = (self.between(0.0, TAU), self.between(-1.0, 1.0));
        let level = (1.0 - up * up).max(0.0).sqrt();
        Vec3::new(level * turn.cos(), up, level * turn.sin())
    }

    /// The particle that started first.
    fn take(&mut self, is_chip: bool) -> Option<Entity> {
        let pool = if is_chip { &self.chips } else { &self.puffs };
        let next = &mut self.next[usize::from(is_chip)];
        *next = (*next + 1) % pool.len().max(1);
        pool.get(*next).copied()
    }

    /// The material at an age from 0 to 1.
    fn material(&self, kind: ParticleKind, age: f32) -> Option<&Handle<StandardMaterial>> {
        let step = ((age * FADE_STEPS as f32) as usize).min(FADE_STEPS - 1);
        match kind {
            ParticleKind::Chips(MaterialId(id)) => self.chip_materials.get(usize::from(id)),
            ParticleKind::Dust(MaterialId(id)) => self.dust.get(usize::from(id) * FADE_STEPS + step),
            ParticleKind::Fire => self.fire.get(step),
        }
    }
}

fn start(
    mut bursts: MessageReader<Burst>,
    mut pools: ResMut<Pools>,
    mut particles: Query<(&mut Particle, &mut Transform, &mut Visibility)>,
    mut commands: Commands,
) {
    for &Burst { place: origin, direction, count, speed, kind } in bursts.read() {
        let is_chip = matches!(kind, ParticleKind::Chips(_));
        for _ in 0..count {
            let Some(entity) = pools.take(is_chip) else { return };
            let Ok((mut particle, mut place, mut visibility)) = particles.get_mut(entity) else { continue };
            let direction = (direction * 1.2 + pools.direction()).normalize_or(Vec3::Y);
            let (size, life) = match kind {
                // The power makes most chips small and a few large.
                ParticleKind::Chips(_) => {
                    (0.035 + 0.10 * pools.between(0.0, 1.0).powi(3), pools.between(0.7, 1.6))
                }
                ParticleKind::Dust(_) => (pools.between(0.5, 1.1), pools.between(0.7, 1.5)),
                ParticleKind::Fire => (pools.between(0.9, 2.2), pools.between(0.25, 0.55)),
            };
            let velocity = direction * speed * pools.between(0.35, 1.2);
            let stretch = if is_chip { Vec3::ONE + 0.45 * pools.direction() } else { Vec3::ONE };
            let spin = pools.direction() * pools.between(2.0, 14.0);
            *particle = Particle { velocity, spin, size, stretch, age: 0.0, life, kind: Some(kind) };
            *place = Transform::from_translation(origin + pools.direction() * 0.25)
                .with_rotation(Quat::from_scaled_axis(pools.direction() * 3.0))
                .with_scale(stretch * size);
            *visibility = Visibility::Inherited;
            if let Some(material) = pools.material(kind, 0.0) {
                commands.entity(entity).insert(MeshMaterial3d(material.clone()));
            }
        }
    }
}

fn fly(
    time: Res<Time>,
    terrains: Terrains,
    pools: Res<Pools>,
    mut particles: Query<(
        &mut Particle,
        &mut Transform,
        &mut Visibility,
        Option<&mut MeshMaterial3d<StandardMaterial>>,
        Has<Puff>,
    )>,
) {
    let dt = time.delta_secs();
    for (mut particle, mut place, mut visibility, material, is_puff) in &mut particles {
        if !particle.flies() {
            continue;
        }
        particle.age += dt;
        if !particle.flies() {
            *visibility = Visibility::Hidden;
            continue;
        }
        let age = particle.age / particle.life;
        if is_puff {
            particle.velocity *= (-2.2 * dt).exp();
            particle.velocity.y += 0.5 * dt;
            place.translation += particle.velocity * dt;
            place.scale = Vec3::splat(particle.size * (1.0 + 1.8 * age));
            let faded = particle.kind.and_then(|kind| pools.material(kind, age));
            if let (Some(mut material), Some(faded)) = (material, faded) {
                material.set_if_neq(MeshMaterial3d(faded.clone()));
            }
            continue;
        }
        particle.velocity.y -= GRAVITY * dt;
        let next = place.translation + particle.velocity * dt;
        if terrains.is_solid(next) {
            // Chips are so small that they bounce up from any ground, without its normal.
            let velocity = particle.velocity;
            particle.velocity = Vec3::new(velocity.x * 0.5, velocity.y.abs() * 0.35, velocity.z * 0.5);
            particle.spin *= 0.4;
        } else {
            place.translation = next;
        }
        place.rotate(Quat::from_scaled_axis(particle.spin * dt));
        place.scale = particle.stretch * (particle.size * (4.0 * (1.0 - age)).min(1.0));
    }
}

fn face_camera(
    camera: Single<&Transform, With<PlayerCamera>>,
    mut puffs: Query<(&Particle, &mut Transform), (With<Puff>, Without<PlayerCamera>)>,
) {
    for (particle, mut place) in &mut puffs {
        if particle.flies() {
            place.rotation = camera.rotation;
        }
    }
}
