//! The baselines of publish and subscribe.

mod properties;
