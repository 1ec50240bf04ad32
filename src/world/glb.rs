//! The drawn surface as a binary glTF file, for other programs.

use std::fmt::Write;

use glam::Vec3;
use thiserror::Error;

use super::state::{MeshKey, World};
use crate::ground::MaterialId;
use crate::lattice::LatticeBox;
use crate::surface::{MaterialMix, SurfaceMesh};

/// Why there is no GLB file of a region.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum GlbError {
    /// Nothing is drawn there.
    #[error("nothing is drawn in the region: choose one that the ground's surface goes through")]
    Empty,
    /// The file would be too large for its format.
    #[error("the file would have {bytes} bytes, but GLB files have at most 4 GiB: export smaller regions")]
    TooLarge {
        /// Bytes of its buffer.
        bytes: u64,
    },
    /// The voxel size is not a positive number, or so large that positions in metres are not finite.
    #[error("the voxel size is {0}, but it must be a positive number with which all positions are finite")]
    VoxelSize(f32),
    /// A vertex has no finite position or normal, so that other programs would refuse the file.
    #[error("the mesh of the {part} has a vertex that is not finite: export a region without it")]
    NotFinite {
        /// The tile or chunk.
        part: String,
    },
}

/// The parts of the buffer, one for each attribute, and the indices.
const VIEWS: usize = 6;
/// Bytes of an element of each part: positions, normals, colours, materials, weights, indices.
const SIZES: [usize; VIEWS] = [12, 12, 12, 4, 4, 4];

/// The file while it is made.
#[derive(Default)]
struct Glb {
    parts: [Vec<u8>; VIEWS],
    /// Lists of JSON.
    nodes: String,
    meshes: String,
    accessors: String,
    count: usize,
}

/// Appends an item to a list of JSON.
fn item(list: &mut String, text: std::fmt::Arguments) {
    if !list.is_empty() {
        list.push(',');
    }
    // Writing to a string does not fail.
    let _ = list.write_fmt(text);
}

/// An `f32` as a number of JSON that is read as the same one.
fn exact(value: f32) -> f64 {
    // No sign for zero.
    f64::from(value) + 0.0
}

impl Glb {
    /// Adds a mesh at a place in metres.
    fn add(
        &mut self,
        name: &str,
        mesh: &SurfaceMesh,
        at: Vec3,
        voxel_size: f32,
        colour: &dyn Fn(MaterialId) -> Vec3,
    ) -> Result<(), GlbError> {
        let starts: [usize; VIEWS] = std::array::from_fn(|view| self.parts[view].len());
        let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        let [positions, normals, colours, materials, weights, indices] = &mut self.parts;
        let put = |to: &mut Vec<u8>, v: Vec3| {
            v.to_array().into_iter().for_each(|part| to.extend_from_slice(&part.to_le_bytes()));
        };
        for vertex in &mesh.vertices {
            let in_voxels = Vec3::from_array(vertex.position_f32());
            let position = in_voxels * voxel_size;
            if !in_voxels.is_finite() || !vertex.normal.is_finite() {
                return Err(GlbError::NotFinite { part: name.into() });
            }
            if !(position + at).is_finite() {
                return Err(GlbError::VoxelSize(voxel_size));
            }
            (low, high) = (low.min(position), high.max(position));
            put(positions, position);
            put(normals, vertex.normal);
            put(colours, mixed(vertex.materials, colour));
            materials.extend_from_slice(&vertex.materials.ids);
            weights.extend_from_slice(&vertex.materials.weights);
        }
        mesh.indices.iter().for_each(|index| indices.extend_from_slice(&index.to_le_bytes()));
        let number = self.count;
        self.count += 1;
        let first = number * VIEWS;
        let vertices = mesh.vertices.len();
        let (low, high) = (low.to_array().map(exact), high.to_array().map(exact));
        for (view, start) in starts.into_iter().enumerate() {
            let (count, kind, shape) = match view {
                0..=2 => (vertices, 5126, "VEC3"),
                3 | 4 => (vertices, 5121, "VEC4"),
                _ => (mesh.indices.len(), 5125, "SCALAR"),
            };
            let more = match view {
                0 => format!(r#","min":{low:?},"max":{high:?}"#),
                4 => r#","normalized":true"#.into(),
                _ => String::new(),
            };
            item(
                &mut self.accessors,
                format_args!(
                    r#"{{"bufferView":{view},"byteOffset":{start},"componentType":{kind},"count":{count},"type":"{shape}"{more}}}"#
                ),
            );
        }
        let [p, n, c, m, w, i] = std::array::from_fn(|view| first + view);
        item(
            &mut self.meshes,
            format_args!(
                r#"{{"name":"{name}","primitives":[{{"attributes":{{"POSITION":{p},"NORMAL":{n},"COLOR_0":{c},"_MATERIALS":{m},"_WEIGHTS":{w}}},"indices":{i},"material":0}}]}}"#
            ),
        );
        let at = at.to_array().map(exact);
        item(&mut self.nodes, format_args!(r#"{{"name":"{name}","mesh":{number},"translation":{at:?}}}"#));
        Ok(())
    }

    fn finish(self) -> Result<Vec<u8>, GlbError> {
        if self.count == 0 {
            return Err(GlbError::Empty);
        }
        let (mut views, mut buffer) = (String::new(), 0);
        for (view, part) in self.parts.iter().enumerate() {
            let (bytes, size) = (part.len(), SIZES[view]);
            let use_of_it = match view {
                5 => r#""target":34963"#.to_owned(),
                _ => format!(r#""byteStride":{size},"target":34962"#),
            };
            item(
                &mut views,
                format_args!(r#"{{"buffer":0,"byteOffset":{buffer},"byteLength":{bytes},{use_of_it}}}"#),
            );
            buffer += bytes;
        }
        let Self { parts, nodes, meshes, accessors, count } = self;
        let all: Vec<usize> = (0..count).collect();
        let mut json = format!(
            r#"{{"asset":{{"version":"2.0","generator":"bevy_burrow"}},"scene":0,"scenes":[{{"nodes":{all:?}}}],"nodes":[{nodes}],"meshes":[{meshes}],"materials":[{{"name":"ground","pbrMetallicRoughness":{{"metallicFactor":0.0,"roughnessFactor":0.9}}}}],"accessors":[{accessors}],"bufferViews":[{views}],"buffers":[{{"byteLength":{buffer}}}]}}"#
        );
        while json.len() % 4 != 0 {
            json.push(' ');
        }
        let bytes = 12 + 8 + json.len() as u64 + 8 + buffer as u64;
        let too_large = |_| GlbError::TooLarge { bytes };
        let mut file = Vec::with_capacity(usize::try_from(bytes).map_err(too_large)?);
        let number = |file: &mut Vec<u8>, number: u64| {
            u32::try_from(number)
                .map(|number| file.extend_from_slice(&number.to_le_bytes()))
                .map_err(too_large)
        };
        file.extend_from_slice(b"glTF");
        number(&mut file, 2)?;
        number(&mut file, bytes)?;
        number(&mut file, json.len() as u64)?;
        file.extend_from_slice(b"JSON");
        file.extend_from_slice(json.as_bytes());
        number(&mut file, buffer as u64)?;
        file.extend_from_slice(b"BIN\0");
        parts.iter().for_each(|part| file.extend_from_slice(part));
        Ok(file)
    }
}

/// The colour of a mix, each part 0 to 1.
fn mixed(mix: MaterialMix, colour: &dyn Fn(MaterialId) -> Vec3) -> Vec3 {
    let parts = mix.ids.iter().zip(mix.weights).filter(|(_, weight)| *weight > 0);
    let all = parts.map(|(&id, weight)| colour(MaterialId(id)) * f32::from(weight) / 255.0).sum::<Vec3>();
    // NaN becomes black.
    Vec3::from_array(all.to_array().map(|part| if part > 0.0 { part.min(1.0) } else { 0.0 }))
}

impl World {
    /// A binary glTF file of everything that is drawn in a box of samples, or in the whole world: its tiles and chunks,
    /// one mesh each, whole where they reach beyond the box. Every triangle that is drawn is there, and no other.
    ///
    /// Positions are in metres, for voxels of this size, y up. Vertices have their normals, the colours that `colours`
    /// gives (linear red, green and blue, 0 to 1), mixed by weight, and the attributes `_MATERIALS` and `_WEIGHTS` with
    /// up to four materials and their weights.
    ///
    /// # Errors
    /// [`GlbError`]
    pub fn to_glb(
        &self,
        region: Option<LatticeBox>,
        voxel_size: f32,
        colours: &dyn Fn(MaterialId) -> Vec3,
    ) -> Result<Vec<u8>, GlbError> {
        if !voxel_size.is_finite() || voxel_size <= 0.0 {
            return Err(GlbError::VoxelSize(voxel_size));
        }
        let mut glb = Glb::default();
        let mut add = |drawn: MeshKey, mesh: &SurfaceMesh| {
            let name = match drawn {
                MeshKey::Tile(tile) => format!("tile {} {}", tile.x, tile.z),
                MeshKey::Chunk(chunk) => format!("chunk {} {} {}", chunk.x, chunk.y, chunk.z),
            };
            // A mesh without a vertex or a triangle has no bounds.
            if mesh.is_empty() || mesh.vertices.is_empty() {
                return Ok(());
            }
            let at = self.origin(drawn).as_vec3() * voxel_size;
            glb.add(&name, mesh, at, voxel_size, colours)
        };
        match region {
            None => self.drawn().try_for_each(|(drawn, mesh)| add(drawn, &mesh))?,
            Some(samples) => self.drawn_near(samples).into_iter().try_for_each(|drawn| match drawn {
                MeshKey::Tile(tile) => add(drawn, &self.tile_mesh(tile)),
                MeshKey::Chunk(chunk) => add(drawn, &self.chunk_mesh(chunk)),
            })?,
        }
        glb.finish()
    }
}
