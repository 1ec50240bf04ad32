//! Models from glTF files: all meshes of a file, which have to be closed, become a shape of the brush.

use std::path::{Path, PathBuf};
use std::{fs, io};

use bevy::prelude::*;
use bevy::tasks::{AsyncComputeTaskPool, Task, futures::check_ready};
use bevy_burrow::brush::ShapeGrid;
use bevy_burrow::panel::{BrushTool, BurrowPanel, ToolModel, ToolShape};
use bevy_burrow::prelude::*;
use gltf::buffer::Source;
use gltf::mesh::Mode;

/// Samples along a model's longest side.
const SAMPLES: u32 = 64;

/// The most bytes of a file.
const MOST: u64 = 256 << 20;

/// Reads models in a task: with many triangles it takes a second.
pub struct ModelsPlugin;

impl Plugin for ModelsPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<Reading>().add_systems(Update, take_read);
    }
}

/// The file that is being read.
#[derive(Resource, Default)]
pub struct Reading(Option<(PathBuf, Task<Result<ToolModel, ModelError>>)>);

impl Reading {
    /// Begins to read a file. An earlier one is forgotten.
    pub fn start(&mut self, file: PathBuf) {
        let path = file.clone();
        self.0 = Some((file, AsyncComputeTaskPool::get().spawn(async move { read(&path) })));
    }
}

/// Why a file cannot be used as a model.
#[derive(Debug, thiserror::Error)]
pub enum ModelError {
    /// A file cannot be read.
    #[error("the file cannot be read: {0}")]
    File(#[from] io::Error),
    /// It has more than [`MOST`] bytes.
    #[error("it has more than {} MiB", MOST >> 20)]
    TooLarge,
    /// It is no valid glTF file.
    #[error(transparent)]
    Gltf(#[from] gltf::Error),
    /// Its data is written as text.
    #[error("its data is embedded as text: export it as .glb")]
    Embedded,
    /// A part is made of lines, points, strips or fans.
    #[error("a part is no list of triangles: export all meshes as triangles")]
    NoTriangles,
    /// A node is below itself, or below two others.
    #[error("its nodes are no tree")]
    Cycle,
    /// The mesh is not closed, for example.
    #[error(transparent)]
    Brush(#[from] BrushError),
}

/// Whether a file may be a model, by its name.
pub fn is_model(file: &Path) -> bool {
    file.extension()
        .is_some_and(|extension| ["glb", "gltf"].iter().any(|own| extension.eq_ignore_ascii_case(own)))
}

/// Digs and builds in the form of a file that was read. On an error, the tool stays as it is.
fn take_read(mut reading: ResMut<Reading>, mut tool: ResMut<BrushTool>, mut panel: ResMut<BurrowPanel>) {
    let Some((file, task)) = &mut reading.bypass_change_detection().0 else { return };
    let Some(read) = check_ready(task) else { return };
    panel.report(match read {
        Ok(model) => {
            (tool.model, tool.shape) = (model, ToolShape::Model);
            Ok(format!("{} is the brush's shape now", file.display()))
        }
        Err(why) => Err(format!("{} can't be used as a shape: {why}", file.display())),
    });
    reading.0 = None;
}

/// The grid of all meshes of a file's default scene, or of its first.
fn read(file: &Path) -> Result<ToolModel, ModelError> {
    let gltf = gltf::Gltf::from_slice(&bytes(file)?)?;
    let mut buffers = Vec::new();
    for buffer in gltf.buffers() {
        buffers.push(match buffer.source() {
            Source::Bin => gltf.blob.clone().unwrap_or_default(),
            Source::Uri(uri) if uri.starts_with("data:") => return Err(ModelError::Embedded),
            Source::Uri(uri) => bytes(&file.with_file_name(uri.replace("%20", " ")))?,
        });
    }
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    let mut count = 0;
    let scene = gltf.default_scene().or_else(|| gltf.scenes().next());
    let mut nodes: Vec<(gltf::Node, Mat4)> =
        scene.iter().flat_map(gltf::Scene::nodes).map(|node| (node, Mat4::IDENTITY)).collect();
    while let Some((node, parent)) = nodes.pop() {
        let place = parent * Mat4::from_cols_array_2d(&node.transform().matrix());
        let is_mirrored = place.determinant() < 0.0;
        count += 1;
        if count > gltf.nodes().len() {
            return Err(ModelError::Cycle);
        }
        nodes.extend(node.children().map(|child| (child, place)));
        let parts = node.mesh().into_iter().flat_map(|mesh| mesh.primitives().collect::<Vec<_>>());
        for part in parts {
            if part.mode() != Mode::Triangles {
                return Err(ModelError::NoTriangles);
            }
            let reader = part.reader(|buffer| buffers.get(buffer.index()).map(Vec::as_slice));
            let first = positions.len() as u32;
            let own = reader.read_positions().into_iter().flatten();
            positions.extend(own.map(|at| place.transform_point3(at.into())));
            let corners: Vec<u32> = match reader.read_indices() {
                Some(indices) => indices.into_u32().map(|index| first.saturating_add(index)).collect(),
                None => (first..positions.len() as u32).collect(),
            };
            // Mirrored, a mesh would be inside out.
            let (second, third) = if is_mirrored { (2, 1) } else { (1, 2) };
            triangles.extend(corners.chunks_exact(3).map(|own| [own[0], own[second], own[third]]));
        }
    }
    let grid = ShapeGrid::from_mesh(&positions, &triangles, SAMPLES)?.grid;
    Ok(ToolModel::new(file.file_stem().unwrap_or_default().to_string_lossy().into_owned(), grid))
}

fn bytes(file: &Path) -> Result<Vec<u8>, ModelError> {
    if fs::metadata(file)?.len() > MOST { Err(ModelError::TooLarge) } else { Ok(fs::read(file)?) }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A .glb file with a mesh of these triangles, at twice its size below a node.
    fn glb(corners: &[Vec3], triangles: &[[u16; 3]]) -> Vec<u8> {
        let mut binary: Vec<u8> =
            corners.iter().flat_map(|at| at.to_array()).flat_map(f32::to_le_bytes).collect();
        let (start, count) = (binary.len(), 3 * triangles.len());
        binary.extend(triangles.iter().flatten().flat_map(|index| index.to_le_bytes()));
        binary.resize(binary.len().next_multiple_of(4), 0);
        let (low, high) = corners.iter().fold((Vec3::MAX, Vec3::MIN), |(a, b), &at| (a.min(at), b.max(at)));
        let json = serde_json::json!({
            "asset": { "version": "2.0" },
            "scene": 0,
            "scenes": [{ "nodes": [0] }],
            "nodes": [{ "children": [1], "scale": [2.0, 2.0, 2.0] }, { "mesh": 0 }],
            "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 }, "indices": 1 }] }],
            "buffers": [{ "byteLength": binary.len() }],
            "bufferViews": [
                { "buffer": 0, "byteLength": start },
                { "buffer": 0, "byteOffset": start, "byteLength": 2 * count },
            ],
            "accessors": [
                { "bufferView": 0, "componentType": 5126, "count": corners.len(), "type": "VEC3",
                  "min": low.to_array(), "max": high.to_array() },
                { "bufferView": 1, "componentType": 5123, "count": count, "type": "SCALAR" },
            ],
        });
        let mut json = json.to_string().into_bytes();
        json.resize(json.len().next_multiple_of(4), b' ');
        let chunk =
            |kind: &[u8; 4], bytes: &[u8]| [&(bytes.len() as u32).to_le_bytes()[..], kind, bytes].concat();
        let chunks = [chunk(b"JSON", &json), chunk(b"BIN\0", &binary)].concat();
        [b"glTF", &2u32.to_le_bytes()[..], &(12 + chunks.len() as u32).to_le_bytes(), &chunks].concat()
    }

    fn read_bytes(name: &str, bytes: &[u8]) -> Result<ToolModel, ModelError> {
        let file = std::env::temp_dir().join(format!("sculpt_model_{}_{name}.glb", std::process::id()));
        fs::write(&file, bytes).expect("a file");
        let found = read(&file);
        let _ = fs::remove_file(file);
        found
    }

    #[test]
    fn a_closed_mesh_becomes_a_shape() {
        let corners = [Vec3::ZERO, Vec3::X * 9.0, Vec3::Y * 9.0, Vec3::Z * 9.0];
        let closed = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
        let model = read_bytes("closed", &glb(&corners, &closed)).expect("a tetrahedron");
        let grid = model.grid.as_ref().expect("a grid");
        assert_eq!(grid.size().max_element(), SAMPLES);
        let inside = (grid.size() / 4).as_ivec3();
        assert!(grid.distance(inside) < 0 && grid.distance((grid.size() * 3 / 4).as_ivec3()) > 0);
        assert!(model.name.is_some_and(|name| name.ends_with("closed")));
    }

    #[test]
    fn other_files_are_refused_with_a_reason() {
        let corners = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z];
        let open = read_bytes("open", &glb(&corners, &[[0, 2, 1], [0, 1, 3]]));
        assert!(matches!(open, Err(ModelError::Brush(BrushError::OpenMesh { .. }))), "{open:?}");
        // An index beyond the vertices.
        let wrong = read_bytes("wrong", &glb(&corners, &[[0, 2, 9]]));
        assert!(wrong.is_err(), "{wrong:?}");
        let noise = read_bytes("noise", &[7; 300]);
        assert!(matches!(noise, Err(ModelError::Gltf(_))), "{noise:?}");
        let whole = glb(&corners, &[[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]);
        for length in 0..whole.len() {
            assert!(read_bytes("cut", &whole[..length]).is_err(), "{length} bytes of {}", whole.len());
        }
        assert!(matches!(read(Path::new("none.glb")), Err(ModelError::File(_))));
    }
}
