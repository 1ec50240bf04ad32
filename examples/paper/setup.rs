//! The size of the experiment, and its subjects.

use crate::backend::Backend;
use crate::edits::{Run, Scene};
use crate::error::PaperError;
use crate::full::Output;
use crate::published::CHUNK_SIZES;

/// The size of the experiment.
#[derive(Clone, Copy, Debug, serde::Serialize)]
pub struct Setup {
    /// Lattice points along each side of the terrain.
    pub side: u32,
    pub edits: usize,
    pub repeats: usize,
    /// Threads of the pool that edits may use.
    pub threads: usize,
    pub seed: u64,
}

impl Setup {
    pub fn scene(&self) -> Result<Scene, PaperError> {
        Ok(Scene::new(self.side, self.edits, self.seed)?)
    }

    /// This setup as command-line arguments.
    pub fn arguments(&self) -> Vec<String> {
        vec!["--threads".into(), self.threads.to_string()]
    }

    /// Number of runs of a hundred edits, with this number of available backends.
    pub fn tests(&self, backends: usize) -> usize {
        (backends * CHUNK_SIZES.len() + Output::BOTH.len()) * Run::BOTH.len() * self.repeats
    }
}

/// The subject of a test.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Subject {
    /// Heightmap and marching cubes, in chunks.
    Hybrid { backend: Backend, chunk_size: u32 },
    /// One field of marching cubes.
    Full(Output),
}

impl Subject {
    /// The name in files and arguments.
    pub fn key(self) -> String {
        match self {
            Self::Hybrid { backend, chunk_size } => {
                format!("{}_{chunk_size}", backend.title().to_lowercase())
            }
            Self::Full(output) => output.key().into(),
        }
    }

    /// The name in the document.
    pub fn title(self) -> String {
        match self {
            Self::Hybrid { backend, chunk_size } => format!("{} {chunk_size}", backend.title()),
            Self::Full(output) => format!("full field, {}", output.title()),
        }
    }

    /// Every subject of the paper.
    pub fn all() -> impl Iterator<Item = Self> {
        let hybrid = |backend| CHUNK_SIZES.map(|chunk_size| Self::Hybrid { backend, chunk_size });
        Backend::ALL.into_iter().flat_map(hybrid).chain(Output::BOTH.map(Self::Full))
    }
}

impl std::str::FromStr for Subject {
    type Err = String;

    fn from_str(key: &str) -> Result<Self, Self::Err> {
        Self::all().find(|subject| subject.key() == key).ok_or_else(|| format!("there is no test {key}"))
    }
}
