//! What a terrain runs its transactions on.

use std::sync::Arc;

use super::{Backend, Cpu};

/// What transactions run on; clones share it.
#[derive(Clone)]
pub struct Engine(Arc<dyn Backend>);

impl Default for Engine {
    /// The processor.
    fn default() -> Self {
        Self(Arc::new(Cpu))
    }
}

impl Engine {
    pub(crate) fn backend(&self) -> &dyn Backend {
        &*self.0
    }
}
