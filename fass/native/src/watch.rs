//! Whether a run is written down.

/// Says so.
pub(crate) trait Watch: Send {
    /// How far the scheduler's clock moves on from one instant to the next.
    ///
    /// Not at all if nobody looks on; else instants must differ, so that what comes
    /// first can be seen.
    const STEP_NS: u64;
}

impl Watch for () {
    const STEP_NS: u64 = 0;
}

/// All is written down.
pub(crate) struct Recorded;

impl Watch for Recorded {
    const STEP_NS: u64 = 1;
}
