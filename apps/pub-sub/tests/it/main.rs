//! The baselines of publish and subscribe: their properties, step by step, and as a workload.

mod properties;
mod steps;
mod workload;
