//! What of this computer will hurt, each in a line: fact, and remedy after `; do`.

use std::fs;
use std::io;

use crate::sys;

/// Says that SCHED_FIFO is refused, and what that means.
pub(crate) fn no_privilege(top: i32, why: &io::Error) -> String {
    format!(
        "SCHED_FIFO is refused ({why}), so nothing is preempted, and other programs share the \
         cores; do run it as root, or `setcap cap_sys_nice+ep PROGRAM`, or allow `rtprio {top}` \
         in /etc/security/limits.conf"
    )
}

/// Looks at the kernel's settings, those for real-time classes among them if these are used, and
/// locks the memory.
pub(crate) fn look(processors: &[u32], is_real_time: bool) -> Vec<String> {
    let mut found = Vec::new();
    let setting = |name: &str| {
        read(&format!("/proc/sys/kernel/{name}"))?
            .parse::<i64>()
            .ok()
    };
    if let (Some(runtime), Some(period)) = (
        setting("sched_rt_runtime_us"),
        setting("sched_rt_period_us"),
    ) && is_real_time
        && runtime >= 0
        && runtime < period
    {
        found.push(format!(
            "the kernel may take {} of every {period} us from all SCHED_FIFO threads of a core; \
             do `sysctl -w kernel.sched_rt_runtime_us=-1` if they need it for so long at a stretch",
            period - runtime
        ));
    }
    if let Err(why) = sys::lock_memory() {
        found.push(format!(
            "memory is not locked ({why}), so a page fault can delay an instance; do raise the \
             limit (`ulimit -l unlimited`, or LimitMEMLOCK=infinity in the service)"
        ));
    }
    let slow = processors.iter().find_map(|processor| {
        let name = format!("/sys/devices/system/cpu/cpu{processor}/cpufreq/scaling_governor");
        let governor = read(&name)?;
        (governor != "performance").then_some((processor, governor))
    });
    if let Some((processor, governor)) = slow {
        found.push(format!(
            "processor {processor} changes its frequency (governor {governor}), so execution times \
             vary; do `cpupower frequency-set -g performance`"
        ));
    }
    found
}

fn read(name: &str) -> Option<String> {
    let text = fs::read_to_string(name).ok()?;
    Some(text.trim().to_owned())
}
