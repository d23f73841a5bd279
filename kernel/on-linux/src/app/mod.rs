//! What Linux does for an app: for its machine, and for what its instances may share and wait for
//! outside their DAGs. The machine as an app sees it, and how a run is judged, is the front's.

pub(crate) mod console;
pub(crate) mod linux_system;
pub(crate) mod lock;
pub(crate) mod words;
