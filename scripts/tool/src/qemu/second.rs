//! A guest's second serial port: what an app's wire is connected to.

use std::ffi::OsString;
use std::path::PathBuf;

use super::with_doubled_commas;

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
        let mut device = OsString::from(match (self.is_live, &self.output) {
            (true, _) => "stdio,id=wire,signal=off",
            (false, Some(_)) => "file,id=wire",
            (false, None) => "null,id=wire",
        });
        if let Some(output) = &self.output {
            device.push(if self.is_live { ",logfile=" } else { ",path=" });
            device.push(with_doubled_commas(output));
        }
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
