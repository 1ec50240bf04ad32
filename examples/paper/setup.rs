//! How large the experiment is, and what it tests.

use crate::backend::Backend;
use crate::edits::{Run, Scene};
use crate::error::PaperError;
use crate::full::Output;
use crate::published::CHUNK_SIZES;

/// How large the experiment is.
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

    /// The same setup as arguments of this program.
    pub fn arguments(&self) -> Vec<String> {
        vec!["--threads".into(), self.threads.to_string()]
    }

    /// Runs of a hundred edits that the experiment makes with the backends that are there.
    pub fn tests(&self, backends: usize) -> usize {
        (backends * CHUNK_SIZES.len() + Output::BOTH.len()) * Run::BOTH.len() * self.repeats
    }
}

/// What is tested.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Subject {
    /// Heightmap and marching cubes, in chunks.
    Hybrid { backend: Backend, chunk_size: u32 },
    /// One field of marching cubes.
    Full(Output),
}

impl Subject {
    /// Its name in files and arguments.
    pub fn key(self) -> String {
        match self {
            Self::Hybrid { backend, chunk_size } => {
                format!("{}_{chunk_size}", backend.title().to_lowercase())
            }
            Self::Full(output) => output.key().into(),
        }
    }

    /// Its name on the page.
    pub fn title(self) -> String {
        match self {
            Self::Hybrid { backend, chunk_size } => format!("{} {chunk_size}", backend.title()),
            Self::Full(output) => format!("full field, {}", output.title()),
        }
    }

    /// Every test of the paper.
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
