//! The device: kernels for NVIDIA cards.

#[cfg(test)]
mod kernel_tests;
#[allow(dead_code, reason = "the host side is not here yet")]
mod layout;
