//! Painted textures on disk, so that a game paints them once.

use std::fs;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::io;
use std::path::{Path, PathBuf};

use bevy::log::{debug, warn};
use bevy::prelude::*;

use super::bake::{Layers, Meter};

/// The folder in which this crate keeps the textures that it paints, so that the next start need not paint them again.
/// Without a folder, the default, nothing is written. Insert it before the first [`GroundLook`](super::GroundLook).
///
/// A file takes 45 MB for textures of 512 texels a side. It is not used if it is damaged, or if another version of this
/// crate would paint other textures; then it is replaced. A folder that can't be written only causes a warning.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_burrow::view::GroundTextureCache;
/// # let mut app = App::new();
/// app.insert_resource(GroundTextureCache(Some("my_game/cache".into())));
/// ```
#[derive(Resource, Clone, Debug, Default, PartialEq)]
pub struct GroundTextureCache(pub Option<PathBuf>);

/// The first bytes of each file.
const MAGIC: [u8; 8] = *b"burrow\x00\x01";

/// The bytes before those of the arrays: what files begin with, and a checksum.
const HEADER: usize = 16;

/// Layers of a size from the folder, or painted and written there. `coarse` are all layers at some smaller size: as
/// recipes decide what they are, their bytes show whether a file is up to date.
pub(super) fn fetch_or_paint(folder: Option<&Path>, coarse: &Layers, side: u32, meter: &Meter) -> Layers {
    let Some(folder) = folder else { return Layers::paint(side, meter) };
    let start = format!("ground_{side}_");
    let path = folder.join(format!("{start}{:016x}.bin", checksum(&coarse.albedo, &coarse.relief)));
    match read(&path, side) {
        Ok(layers) => return layers,
        Err(error) if error.kind() == io::ErrorKind::NotFound => {}
        Err(error) => debug!("{} is painted again: {error}", path.display()),
    }
    let layers = Layers::paint(side, meter);
    if let Err(error) = write(&path, &start, &layers) {
        warn!("ground textures can't be kept in {}: {error}", path.display());
    }
    layers
}

fn checksum(albedo: &[u8], relief: &[u8]) -> u64 {
    let mut hasher = DefaultHasher::new();
    (albedo, relief).hash(&mut hasher);
    hasher.finish()
}

fn read(path: &Path, side: u32) -> io::Result<Layers> {
    let damaged = || io::Error::new(io::ErrorKind::InvalidData, "the file is damaged");
    let size = Layers::size(side);
    // Before it is read: whatever lies there may be large.
    if fs::metadata(path)?.len() != (HEADER + 2 * size) as u64 {
        return Err(damaged());
    }
    let mut albedo = fs::read(path)?;
    if albedo.len() != HEADER + 2 * size {
        return Err(damaged());
    }
    let relief = albedo.split_off(HEADER + size);
    let header: Vec<u8> = albedo.drain(..HEADER).collect();
    if header != [MAGIC, checksum(&albedo, &relief).to_le_bytes()].concat() {
        return Err(damaged());
    }
    Ok(Layers { side, albedo, relief })
}

/// Writes a file whole or not at all, and removes those of other versions.
fn write(path: &Path, start: &str, layers: &Layers) -> io::Result<()> {
    let folder = path.parent().unwrap_or(Path::new("."));
    fs::create_dir_all(folder)?;
    let sum = checksum(&layers.albedo, &layers.relief).to_le_bytes();
    // Another process may write the same file.
    let unfinished = path.with_extension(format!("{}.part", std::process::id()));
    let written = fs::write(&unfinished, [&MAGIC[..], &sum, &layers.albedo, &layers.relief].concat())
        .and_then(|()| fs::rename(&unfinished, path));
    if written.is_err() {
        let _ = fs::remove_file(&unfinished);
        return written;
    }
    for entry in fs::read_dir(folder)?.flatten() {
        let name = entry.file_name();
        let is_old = name.to_str().is_some_and(|name| name.starts_with(start) && name.ends_with(".bin"));
        if is_old && entry.path() != path {
            let _ = fs::remove_file(entry.path());
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The only file of a folder.
    fn only_file(folder: &Path) -> PathBuf {
        let files: Vec<_> =
            fs::read_dir(folder).expect("a folder").flatten().map(|entry| entry.path()).collect();
        let [file] = &files[..] else { panic!("{files:?}") };
        file.clone()
    }

    #[test]
    fn textures_are_painted_once() {
        let folder = std::env::temp_dir().join(format!("burrow_textures_{}", std::process::id()));
        let coarse = Layers::paint(16, &Meter::default());
        let fetch = |coarse: &Layers| {
            let meter = Meter::default();
            let layers = fetch_or_paint(Some(&folder), coarse, 16, &meter);
            (layers, meter.progress() > 0.0)
        };
        assert_eq!(fetch(&coarse), (coarse.clone(), true), "there is no file");
        assert_eq!(fetch(&coarse), (coarse.clone(), false), "there is one");

        // Damaged in any way, it is painted again.
        let file = only_file(&folder);
        let whole = fs::read(&file).expect("readable");
        let damages = [0, 9, HEADER, whole.len() - 1].map(|at| {
            let mut bytes = whole.clone();
            bytes[at] ^= 1;
            bytes
        });
        let cut = [whole[..whole.len() / 2].to_vec(), vec![], [&whole[..], &[0]].concat()];
        for damaged in damages.into_iter().chain(cut) {
            fs::write(&file, damaged).expect("writable");
            assert_eq!(fetch(&coarse), (coarse.clone(), true), "it is damaged");
            assert_eq!(fs::read(&file).expect("readable"), whole, "and written again");
        }

        // Other recipes paint another file, and the old one goes.
        let mut other = coarse.clone();
        other.relief[0] ^= 1;
        assert!(fetch(&other).1);
        assert_ne!(only_file(&folder), file);
        fs::remove_dir_all(&folder).expect("removable");
    }

    #[test]
    fn a_folder_that_cannot_be_written_is_no_error() {
        let file = std::env::temp_dir().join(format!("burrow_no_folder_{}", std::process::id()));
        fs::write(&file, []).expect("writable");
        let coarse = Layers::paint(16, &Meter::default());
        assert_eq!(fetch_or_paint(Some(&file), &coarse, 16, &Meter::default()), coarse);
        assert_eq!(fetch_or_paint(None, &coarse, 16, &Meter::default()), coarse);
        fs::remove_file(&file).expect("removable");
    }
}
