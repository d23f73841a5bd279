//! A guest's second serial port: what an app's wire is connected to.

use std::ffi::OsString;
use std::path::PathBuf;

use super::file_value;

/// What a guest's second serial port is connected to.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Second {
    /// Hand what is written to [`Running::input`](super::Running::input) to this port; then the first one has none.
    pub is_live: bool,
    /// The file that gets what the guest sends.
    pub output: Option<PathBuf>,
}

impl Second {
    /// Returns QEMU's arguments for it.
    pub(super) fn arguments(&self) -> [OsString; 4] {
        let device = match (&self.output, self.is_live) {
            (None, false) => "null,id=wire".into(),
            (None, true) => "stdio,id=wire,signal=off".into(),
            (Some(output), false) => file_value("file,id=wire,path=", output),
            (Some(output), true) => file_value("stdio,id=wire,signal=off,logfile=", output),
        };
        let port = "isa-serial,chardev=wire,iobase=0x2f8,irq=3";
        ["-chardev".into(), device, "-device".into(), port.into()]
    }
}

#[cfg(test)]
mod tests {
    use super::Second;
    use std::ffi::OsStr;

    #[test]
    fn the_port_has_what_is_connected_to_it() {
        let with = |is_live, output: Option<&str>| {
            let output = output.map(Into::into);
            let words = Second { is_live, output }.arguments();
            words.join(OsStr::new(" ")).into_string().unwrap()
        };
        let device = " -device isa-serial,chardev=wire,iobase=0x2f8,irq=3";
        for (line, port) in [
            (with(false, None), "-chardev null,id=wire"),
            (with(false, Some("a,b")), "-chardev file,id=wire,path=a,,b"),
            (with(true, None), "-chardev stdio,id=wire,signal=off"),
            (
                with(true, Some("a")),
                "-chardev stdio,id=wire,signal=off,logfile=a",
            ),
        ] {
            assert_eq!(line, format!("{port}{device}"));
        }
    }
}
