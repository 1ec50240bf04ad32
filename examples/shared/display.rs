//! Is there a screen? Examples ask it in common; each takes it in by its path.

/// Can a window be opened? The examples are built for X11 on Linux; elsewhere there is always a desktop.
pub fn has_display() -> bool {
    !cfg!(target_os = "linux") || std::env::var_os("DISPLAY").is_some_and(|display| !display.is_empty())
}
