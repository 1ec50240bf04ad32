//! Is there a screen? Examples ask it in common; each takes it in by its path.

/// Can a window be opened? The examples are built for X11 on Linux; elsewhere there is always a desktop.
pub fn has_display() -> bool {
    let is_set = |name: &str| std::env::var_os(name).is_some_and(|value| !value.is_empty());
    let has_display = !cfg!(target_os = "linux") || is_set("DISPLAY");
    if !has_display && is_set("WAYLAND_DISPLAY") {
        eprintln!("no DISPLAY is set: under Wayland, windows need Xwayland");
    }
    has_display
}
