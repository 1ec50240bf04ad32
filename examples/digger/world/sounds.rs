//! Sounds, computed instead of recorded: blows by material, steps, explosions and falling debris.
//!
//! With the feature `sound`, they are played where things happen.

use std::f32::consts::TAU;

use bevy_burrow::prelude::*;

/// Samples per second.
pub const RATE: u32 = 22_050;
/// The largest sample. Several sounds at once stay below 1.
const PEAK: f32 = 0.7;
/// Seconds at the end over which a sound fades to silence.
const FADE: f32 = 0.02;

/// Something that is heard.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Sound {
    Blow(MaterialId),
    Step(MaterialId),
    /// A piece of this material breaks off and falls.
    Fall(MaterialId),
    Explosion,
}

/// How a material sounds: noise that a filter dulls, and a tone where it rings.
#[derive(Clone, Copy, Debug)]
struct Timbre {
    /// The filter's cutoff frequency, in Hz.
    cutoff: f32,
    /// Seconds after which 1/e of the noise is left.
    decay: f32,
    /// The frequency of the tone in Hz, and its share.
    tone: (f32, f32),
}

const fn timbre(cutoff: f32, decay: f32, pitch: f32, share: f32) -> Timbre {
    Timbre { cutoff, decay, tone: (pitch, share) }
}

/// The timbre of each material, by id: rock, turf, sand, snow, clay, concrete, coal, gold, soil, sandstone, shale,
/// bedrock.
const TIMBRES: [Timbre; 12] = [
    timbre(3200.0, 0.06, 620.0, 0.35),
    timbre(700.0, 0.07, 110.0, 0.10),
    timbre(5200.0, 0.11, 200.0, 0.0),
    timbre(2400.0, 0.09, 150.0, 0.0),
    timbre(420.0, 0.08, 95.0, 0.25),
    timbre(2700.0, 0.05, 410.0, 0.30),
    timbre(4300.0, 0.05, 860.0, 0.15),
    timbre(3600.0, 0.09, 1480.0, 0.70),
    timbre(560.0, 0.08, 100.0, 0.15),
    timbre(2300.0, 0.08, 330.0, 0.20),
    timbre(3900.0, 0.05, 700.0, 0.25),
    timbre(4600.0, 0.03, 1050.0, 0.55),
];

impl Sound {
    /// The sound's samples, mono, between -1 and 1. They start and end in silence, and are the same each time.
    pub fn samples(self) -> Vec<f32> {
        let of = |material: MaterialId| TIMBRES[usize::from(material.0).min(TIMBRES.len() - 1)];
        finished(match self {
            Self::Blow(material) => strike(of(material), 0.35, 1),
            Self::Step(material) => {
                let Timbre { cutoff, decay, .. } = of(material);
                strike(timbre(0.5 * cutoff, 0.7 * decay, 80.0, 0.2), 0.2, 2)
            }
            Self::Fall(material) => fall(of(material)),
            Self::Explosion => explosion(),
        })
    }

    /// The sound's loudness relative to other sounds, from 0 to 1.
    pub const fn volume(self) -> f32 {
        match self {
            Self::Explosion => 1.0,
            Self::Fall(_) => 0.7,
            Self::Blow(_) => 0.5,
            Self::Step(_) => 0.2,
        }
    }
}

/// The times of all samples of a sound of this length.
fn times(seconds: f32) -> impl Iterator<Item = f32> {
    (0..(seconds * RATE as f32) as u32).map(|sample| sample as f32 / RATE as f32)
}

/// Noise between -1 and 1 that is dulled by a filter, whose cutoff frequency may change with time.
fn noise(seconds: f32, seed: u64, cutoff: impl Fn(f32) -> f32) -> impl Iterator<Item = f32> {
    let mut random = fastrand::Rng::with_seed(seed);
    let mut filtered = 0.0;
    times(seconds).map(move |time| {
        let share = 1.0 - (-TAU * cutoff(time) / RATE as f32).exp();
        filtered += share * (2.0 * random.f32() - 1.0 - filtered);
        // A dull noise is quieter; this makes up for it.
        filtered / share.sqrt()
    })
}

fn strike(timbre: Timbre, seconds: f32, seed: u64) -> Vec<f32> {
    let Timbre { cutoff, decay, tone: (pitch, share) } = timbre;
    let noise = noise(seconds, seed, |_| cutoff);
    let strike = times(seconds).zip(noise).map(|(time, noise)| {
        // Two partials that are not multiples of each other: a stone, not a flute.
        let tone = (TAU * pitch * time).sin() + 0.5 * (TAU * 2.76 * pitch * time).sin();
        let start = (time / 0.002).min(1.0);
        start * ((1.0 - share) * noise * (-time / decay).exp() + share * tone * (-time / (1.6 * decay)).exp())
    });
    strike.collect()
}

/// Many strikes, fewer and softer with time.
fn fall(timbre: Timbre) -> Vec<f32> {
    let mut random = fastrand::Rng::with_seed(3);
    let mut all: Vec<f32> = times(1.4).map(|_| 0.0).collect();
    for number in 0..24 {
        let (start, cutoff) = (0.9 * random.f32().powi(2), timbre.cutoff * (0.4 + 0.6 * random.f32()));
        let loudness = 0.3 + 0.7 * random.f32() * (1.0 - start);
        let strike = strike(Timbre { cutoff, ..timbre }, 0.3, number);
        let place = all.iter_mut().skip((start * RATE as f32) as usize);
        place.zip(strike).for_each(|(sum, sample)| *sum += loudness * sample);
    }
    all
}

/// A crack that turns into a rumble.
fn explosion() -> Vec<f32> {
    let noise = noise(2.2, 4, |time| 90.0 + 4000.0 * (-time / 0.08).exp());
    let rumble = times(2.2).zip(noise).map(|(time, noise)| {
        let thump = (TAU * (38.0 * time + 3.0 * (1.0 - (-time / 0.1).exp()))).sin();
        (time / 0.001).min(1.0) * (noise + 0.8 * thump) * (-time / 0.5).exp()
    });
    rumble.collect()
}

/// As loud as any other sound, and silent at its end.
fn finished(mut samples: Vec<f32>) -> Vec<f32> {
    let peak = samples.iter().fold(f32::MIN_POSITIVE, |peak, sample| peak.max(sample.abs()));
    let fade = (FADE * RATE as f32) as usize;
    for (left, sample) in samples.iter_mut().rev().enumerate() {
        *sample *= PEAK / peak * (left as f32 / fade as f32).min(1.0);
    }
    samples
}

#[cfg(feature = "sound")]
pub use playing::SoundPlugin;

#[cfg(feature = "sound")]
mod playing {
    use std::collections::HashMap;

    use bevy::audio::Volume;
    use bevy::prelude::*;
    use bevy_burrow::physics::Debris;
    use bevy_burrow::prelude::*;

    use super::{RATE, Sound};
    use crate::player::Player;
    use crate::player::body::Body;
    use crate::player::camera::PlayerCamera;
    use crate::tools::bombs::Explosion;
    use crate::ui::settings::Settings;
    use crate::world::particles::{Burst, ParticleKind};

    /// Metres from foot to foot.
    const STEP: f32 = 1.7;

    /// Plays sounds where things happen.
    pub struct SoundPlugin;

    impl Plugin for SoundPlugin {
        fn build(&self, app: &mut App) {
            app.init_resource::<Sounds>()
                .add_systems(PostStartup, listen)
                .add_systems(Update, (blows, steps, falls).after(BurrowSystems::Propagate))
                .add_observer(|explosion: On<Explosion>, mut speaker: Speaker| {
                    speaker.play(Sound::Explosion, explosion.place);
                });
        }
    }

    /// Sounds that were computed already.
    #[derive(Resource, Default)]
    struct Sounds(HashMap<Sound, Handle<AudioSource>>);

    #[derive(bevy::ecs::system::SystemParam)]
    struct Speaker<'w, 's> {
        commands: Commands<'w, 's>,
        sounds: ResMut<'w, Sounds>,
        sources: ResMut<'w, Assets<AudioSource>>,
        settings: Res<'w, Settings>,
    }

    impl Speaker<'_, '_> {
        fn play(&mut self, sound: Sound, place: Vec3) {
            let make = || self.sources.add(AudioSource { bytes: wav(&sound.samples()).into() });
            let source = self.sounds.0.entry(sound).or_insert_with(make).clone();
            let settings = PlaybackSettings::DESPAWN
                .with_volume(Volume::Linear(sound.volume() * self.settings.volume))
                // Nothing sounds the same twice.
                .with_speed(0.9 + 0.2 * fastrand::f32())
                .with_spatial(true)
                .with_spatial_scale(bevy::audio::SpatialScale::new(0.1));
            self.commands.spawn((AudioPlayer(source), settings, Transform::from_translation(place)));
        }
    }

    fn listen(mut commands: Commands, camera: Single<Entity, With<PlayerCamera>>) {
        commands.entity(*camera).insert(SpatialListener::new(0.3));
    }

    fn blows(mut bursts: MessageReader<Burst>, mut speaker: Speaker) {
        for burst in bursts.read() {
            if let ParticleKind::Chips(material) = burst.kind {
                speaker.play(Sound::Blow(material), burst.place);
            }
        }
    }

    fn falls(pieces: Query<(&Debris, &Transform), Added<Debris>>, mut speaker: Speaker) {
        for (piece, place) in &pieces {
            speaker.play(Sound::Fall(piece.material), place.translation);
        }
    }

    /// A step for each stretch of way on the ground.
    fn steps(
        players: Query<Body, With<Player>>,
        terrains: Terrains,
        mut speaker: Speaker,
        mut last: Local<Vec3>,
    ) {
        let Some(body) = players.iter().next().filter(|body| body.motion.grounded) else { return };
        let feet = body.feet();
        if feet.distance(*last) < STEP {
            return;
        }
        // A player that was moved somewhere else has not walked there.
        if feet.distance(std::mem::replace(&mut *last, feet)) < 2.0 * STEP
            && let Some(ground) = terrains.raycast(Ray3d::new(feet + Vec3::Y * 0.5, Dir3::NEG_Y), 2.0)
        {
            speaker.play(Sound::Step(ground.material), feet);
        }
    }

    /// A WAV file: mono, 16 bits.
    fn wav(samples: &[f32]) -> Vec<u8> {
        let length = 2 * samples.len() as u32;
        let mut file = Vec::with_capacity(44 + length as usize);
        file.extend(b"RIFF");
        file.extend((36 + length).to_le_bytes());
        file.extend(b"WAVEfmt \x10\0\0\0\x01\0\x01\0");
        file.extend(RATE.to_le_bytes());
        file.extend((2 * RATE).to_le_bytes());
        file.extend(b"\x02\0\x10\0data");
        file.extend(length.to_le_bytes());
        file.extend(samples.iter().flat_map(|sample| ((sample * f32::from(i16::MAX)) as i16).to_le_bytes()));
        file
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::world::landscape::{BEDROCK, CLAY, GOLD, MATERIALS, ROCK, SAND};

    fn all() -> Vec<Sound> {
        let of = |make: fn(MaterialId) -> Sound| MATERIALS.into_iter().chain([BEDROCK]).map(make);
        of(Sound::Blow).chain(of(Sound::Step)).chain(of(Sound::Fall)).chain([Sound::Explosion]).collect()
    }

    #[test]
    fn sounds_neither_clip_nor_click_and_can_be_heard() {
        for sound in all() {
            let samples = sound.samples();
            let loudest = samples.iter().fold(0.0f32, |most, sample| most.max(sample.abs()));
            assert!((0.3..=1.0).contains(&loudest), "{sound:?}: {loudest}");
            assert!((0.1..=1.0).contains(&sound.volume()), "{sound:?}");
            let [first, last] = [samples[0], samples[samples.len() - 1]];
            assert!(first.abs() < 0.05 && last == 0.0, "{sound:?}: {first} {last}");
            assert!((0.1..3.0).contains(&(samples.len() as f32 / RATE as f32)), "{sound:?}");
        }
    }

    #[test]
    fn each_material_has_its_own_sound_which_is_the_same_each_time() {
        let all: Vec<Vec<f32>> = all().into_iter().map(Sound::samples).collect();
        assert_eq!(all, self::all().into_iter().map(Sound::samples).collect::<Vec<_>>());
        for (at, one) in all.iter().enumerate() {
            assert!(all[at + 1..].iter().all(|other| other != one));
        }
        // A material of another game's has some sound too.
        assert!(!Sound::Blow(MaterialId(200)).samples().is_empty());
    }

    #[test]
    fn soft_ground_is_dull_and_metal_rings() {
        // Changes of sign per second: the higher the sound, the more there are.
        let pitch = |sound: Sound| {
            let samples = sound.samples();
            let start = &samples[..samples.len() / 3];
            start.windows(2).filter(|pair| pair[0] * pair[1] < 0.0).count() as f32 * RATE as f32
                / start.len() as f32
        };
        let [clay, rock, sand] = [CLAY, ROCK, SAND].map(|material| pitch(Sound::Blow(material)));
        assert!(clay < 0.6 * rock && rock < sand, "{clay} {rock} {sand}");
        assert!(pitch(Sound::Explosion) < clay);
        // What is left after a fifth of a second.
        let rest = |material| {
            let samples = Sound::Blow(material).samples();
            let energy = |part: &[f32]| part.iter().map(|sample| sample * sample).sum::<f32>();
            energy(&samples[RATE as usize / 10..]) / energy(&samples)
        };
        assert!(rest(GOLD) > rest(ROCK), "{} {}", rest(GOLD), rest(ROCK));
    }
}
