//! Errors of brushes that are refused.

use thiserror::Error;

/// The error of a [`Brush`](super::Brush) that cannot become an [`Edit`](super::Edit). Lengths are in voxels, volumes
/// in cubic voxels.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum BrushError {
    /// A number is infinite or not a number.
    #[error("`{what}` must be finite, but it is {value}")]
    NotFinite {
        /// The field.
        what: &'static str,
        /// The number.
        value: f32,
    },
    /// A radius or half side is negative, zero or below the minimum.
    #[error("`{what}` is {value} voxels, but the minimum is {least}")]
    TooSmall {
        /// The field.
        what: &'static str,
        /// The length given.
        value: f32,
        /// The least length.
        least: f32,
    },
    /// A size, the box around the shape, or its volume is above the maximum.
    #[error("`{what}` is {value} voxels, but the maximum is {most}")]
    TooLarge {
        /// The field, or `box` (its longest side), or `volume`.
        what: &'static str,
        /// The length or volume.
        value: f32,
        /// The largest length or volume.
        most: f32,
    },
    /// A point lies beyond the lattice.
    #[error("`{what}` has the coordinate {value}, beyond +-{most} voxels")]
    OutOfRange {
        /// The field, or `end` for the base plus the axis.
        what: &'static str,
        /// The coordinate.
        value: f32,
        /// The largest coordinate along that axis: [`LIMIT`](crate::lattice::LIMIT), or
        /// [`REACH`](crate::lattice::REACH).
        most: f32,
    },
    /// The axis of a cylinder or cone is too short to have a direction.
    #[error("`axis` is {length} voxels long, but the minimum is {least}")]
    ZeroAxis {
        /// Length after quantisation.
        length: f32,
        /// The least length.
        least: f32,
    },
    /// The quaternion is not a rotation: its length is not within 1/100 of 1.
    #[error("`rotation` is a quaternion of length {length}, but it must be 1 (within 0.01)")]
    ZeroRotation {
        /// Length of the quaternion.
        length: f32,
    },
    /// The integer quaternion of a deserialised edit has another sign than [`Edit::quantize`](super::Edit::quantize)
    /// gives: the first of w, x, y, z that is not zero must be positive.
    #[error(
        "`rotation` {rotation:?} (x, y, z, w) has the wrong sign: its first non-zero of w, x, y, z must be positive"
    )]
    RotationSign {
        /// The components x, y, z, w.
        rotation: [i16; 4],
    },
    /// The amplitude or scale of the roughness is out of its range.
    #[error("roughness `{what}` is {value} voxels, but it must be {least} to {most}")]
    Roughness {
        /// `amplitude` or `scale`.
        what: &'static str,
        /// The value given.
        value: f32,
        /// The least value.
        least: f32,
        /// The largest value.
        most: f32,
    },
    /// A number of an operation that sculpts is out of its range.
    #[error("`{what}` is {value}, but it must be {least} to {most}")]
    OutOfBounds {
        /// The number.
        what: &'static str,
        /// The value given.
        value: f32,
        /// The least value.
        least: f32,
        /// The largest value.
        most: f32,
    },
    /// A direction has no length.
    #[error("`{what}` is {length} long, but it must have a direction")]
    NoDirection {
        /// The field.
        what: &'static str,
        /// The length of the direction.
        length: f32,
    },
    /// The image of a stamp has too few or too many samples along a side.
    #[error("the stamp is {width} x {height} samples, but a side must have {least} to {most}")]
    StampSize {
        /// Samples in a row.
        width: u32,
        /// Rows.
        height: u32,
        /// The minimum number of samples along a side.
        least: u32,
        /// The maximum number of samples along a side.
        most: u32,
    },
    /// The image of a deserialised stamp does not have as many samples as its sides say.
    #[error("a stamp of {width} x {height} takes {} samples, but {actual} were given", u64::from(*width) * u64::from(*height))]
    StampSamples {
        /// Samples in a row.
        width: u32,
        /// Rows.
        height: u32,
        /// Samples given.
        actual: usize,
    },
    /// A path has too few or too many points.
    #[error(
        "the path has {count} points, but it must have {least} to {most}: divide a longer one into brushes of one stroke"
    )]
    PathPoints {
        /// Points of the path.
        count: usize,
        /// The minimum number of points.
        least: usize,
        /// The maximum number of points.
        most: usize,
    },
    /// A grid of distances has too few or too many samples along a side.
    #[error("the grid has {size:?} samples, but a side must have {least} to {most}")]
    GridSize {
        /// Samples along x, y and z.
        size: [u32; 3],
        /// The minimum number of samples along a side.
        least: u32,
        /// The maximum number of samples along a side.
        most: u32,
    },
    /// The image of a deserialised grid does not hold one.
    #[error("the image holds no grid of distances: make it with `ShapeGrid`")]
    NoGrid,
    /// A stamp has a grid as its shape.
    #[error("a stamp cannot have a grid as its shape: give the brush another shape")]
    StampInGrid,
    /// A mesh has no triangles with an area, is too small or too large to be divided into cells, or has triangles whose
    /// corners have no position.
    #[error(
        "the mesh has no triangles with positions and an area, or is too small or too large: give it a list of triangles, and \
         sides that are normal numbers"
    )]
    NoTriangles,
    /// A mesh does not come with one material for each triangle.
    #[error(
        "{materials} materials for {triangles} triangles: give one for each triangle of the mesh, in their order"
    )]
    MeshMaterials {
        /// Materials given.
        materials: usize,
        /// Triangles of the mesh.
        triangles: usize,
    },
    /// A mesh has a hole, or its triangles face different ways.
    #[error(
        "{edges} edges of the mesh are open: close its holes, and let all triangles that share an edge face the same way"
    )]
    OpenMesh {
        /// Edges with more triangles on the one side than on the other.
        edges: usize,
    },
    /// A road is built in a shape that is not a corridor.
    #[error("a road needs a corridor: make the brush by `Brush::road`")]
    NoCorridor,
    /// The blend of a deserialised edit is missing where its operation sculpts, or given where it does not.
    #[error("a `blend` belongs to operations that sculpt, and to no others")]
    Blend,
}
