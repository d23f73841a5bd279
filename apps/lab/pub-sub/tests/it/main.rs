//! The baselines of publish and subscribe: their properties, and step by step.

mod properties;
mod steps;
