//! Digging together: one order, the same world everywhere.

// mod hostile;
// mod server;
