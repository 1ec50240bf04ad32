//! Detects a display. Shared by examples, which include this file by path.

/// Whether a window can be opened. On Linux, the examples are built for X11; elsewhere there is always a desktop.
pub fn has_display() -> bool {
    let is_set = |name: &str| std::env::var_os(name).is_some_and(|value| !value.is_empty());
    let has_display = !cfg!(target_os = "linux") || is_set("DISPLAY");
    if !has_display && is_set("WAYLAND_DISPLAY") {
        eprintln!("no DISPLAY is set: under Wayland, windows need Xwayland");
    }
    has_display
}
