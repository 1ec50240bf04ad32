//! Which views are on, and how far they reach.

use bevy::prelude::*;

/// The debug views' switches.
#[derive(Resource, Reflect, Clone, Debug, PartialEq)]
#[reflect(Resource, Default)]
pub struct BurrowDebug {
    /// Chunks that draw something or hold fields, and the borders of tiles.
    pub chunks: bool,
    /// Boxes of fields.
    pub fields: bool,
    /// Cells of the mask.
    pub mask: bool,
    /// Triangles of rings.
    pub rings: bool,
    /// Bricks in the boxes of the latest edits, fading.
    pub dirty: bool,
    /// Normals of vertices.
    pub normals: bool,
    /// Edges of triangles, and which of them tiles and chunks share.
    pub wires: bool,
    /// Edges of triangles, coloured by level of detail.
    pub levels: bool,
    /// Where an agent can walk, as polygons, and the free air above floors.
    #[cfg(feature = "navigation")]
    pub walkable: bool,
    /// The agent of that view, in metres.
    #[cfg(feature = "navigation")]
    pub agent: crate::navigation::WalkSettings,
    /// The point around which views are drawn, in world space; `None` for the point of the ground that the camera looks
    /// at.
    pub focus: Option<Vec3>,
    /// How far views reach, in metres; normals, wires and walkable ground reach [`near`](Self::near).
    pub radius: f32,
    /// How far normals, wires and walkable ground reach, in metres.
    pub near: f32,
    /// The maximum number of lines of a view of one terrain.
    pub max_lines: usize,
    /// How long dirty bricks are shown, in seconds.
    pub fade: f32,
}

impl Default for BurrowDebug {
    /// All views off.
    fn default() -> Self {
        Self {
            chunks: false,
            fields: false,
            mask: false,
            rings: false,
            dirty: false,
            normals: false,
            wires: false,
            levels: false,
            #[cfg(feature = "navigation")]
            walkable: false,
            #[cfg(feature = "navigation")]
            agent: crate::navigation::WalkSettings { height: 1.8, ..Default::default() },
            focus: None,
            radius: 96.0,
            near: 20.0,
            max_lines: 40_000,
            fade: 1.5,
        }
    }
}

/// One of the debug views.
#[derive(Reflect, Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[expect(missing_docs, reason = "the switches of BurrowDebug say what they are")]
#[non_exhaustive]
pub enum DebugView {
    Chunks,
    Fields,
    Mask,
    Rings,
    Dirty,
    Normals,
    Wires,
    Levels,
    #[cfg(feature = "navigation")]
    Walkable,
}

impl DebugView {
    /// All debug views.
    pub const ALL: [Self; if cfg!(feature = "navigation") { 9 } else { 8 }] = [
        Self::Chunks,
        Self::Fields,
        Self::Mask,
        Self::Rings,
        Self::Dirty,
        Self::Normals,
        Self::Wires,
        Self::Levels,
        #[cfg(feature = "navigation")]
        Self::Walkable,
    ];

    /// In plain words.
    pub fn name(self) -> &'static str {
        match self {
            Self::Chunks => "Chunk grid",
            Self::Fields => "Field boxes",
            Self::Mask => "Mask",
            Self::Rings => "Rings",
            Self::Dirty => "Dirty bricks",
            Self::Normals => "Normals",
            Self::Wires => "Seam wires",
            Self::Levels => "Levels of detail",
            #[cfg(feature = "navigation")]
            Self::Walkable => "Walkable ground",
        }
    }
}

impl BurrowDebug {
    /// Whether a view is on.
    pub fn shows(&self, view: DebugView) -> bool {
        match view {
            DebugView::Chunks => self.chunks,
            DebugView::Fields => self.fields,
            DebugView::Mask => self.mask,
            DebugView::Rings => self.rings,
            DebugView::Dirty => self.dirty,
            DebugView::Normals => self.normals,
            DebugView::Wires => self.wires,
            DebugView::Levels => self.levels,
            #[cfg(feature = "navigation")]
            DebugView::Walkable => self.walkable,
        }
    }

    /// The switch of a view.
    pub fn switch(&mut self, view: DebugView) -> &mut bool {
        match view {
            DebugView::Chunks => &mut self.chunks,
            DebugView::Fields => &mut self.fields,
            DebugView::Mask => &mut self.mask,
            DebugView::Rings => &mut self.rings,
            DebugView::Dirty => &mut self.dirty,
            DebugView::Normals => &mut self.normals,
            DebugView::Wires => &mut self.wires,
            DebugView::Levels => &mut self.levels,
            #[cfg(feature = "navigation")]
            DebugView::Walkable => &mut self.walkable,
        }
    }
}
