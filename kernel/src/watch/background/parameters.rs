//! Parameters that a person sets at the console, or the command line's word `set`.

use alloc::sync::Arc;
use alloc::vec::Vec;
use core::fmt;
use core::fmt::Display;

use fass::Tunable;
use sched_dag::nearest_of;

use super::more::Commands;
use crate::println;

/// The parameters that an app offers.
pub(crate) struct Parameters(pub(crate) Vec<Arc<dyn Tunable>>);

impl Parameters {
    /// Sets one of them, or tells why not.
    pub(crate) fn set(
        &self,
        name: &str,
        value: &str,
        refuse: &mut dyn FnMut(&dyn Display),
    ) -> Option<&dyn Tunable> {
        let Some(parameter) = self.0.iter().find(|of| of.name() == name) else {
            refuse(&fmt::from_fn(|f| {
                write!(f, "there is no parameter `{name}`; ")?;
                match nearest_of(name, &mut self.0.iter().map(|of| of.name())) {
                    Some(near) => write!(f, "did you mean `{near}`?"),
                    None => f.write_str("`params` lists them"),
                }
            }));
            return None;
        };
        if !parameter.set_text(value) {
            refuse(&parameter.refusal(value));
            return None;
        }
        Some(&**parameter)
    }
}

impl Commands for Parameters {
    fn help(&self) -> &'static [(&'static str, &'static str)] {
        &[
            ("params", "list the parameters"),
            ("set NAME VALUE", "set a parameter, for the jobs to come"),
        ]
    }

    fn answer(&self, name: &str, rest: &str, refuse: &mut dyn FnMut(&dyn Display)) -> bool {
        match name {
            "params" if rest.is_empty() => self.0.iter().for_each(|of| show(&**of)),
            "params" => refuse(&"`params` wants nothing after it"),
            "set" => match rest.split_once([' ', '=']) {
                Some((name, value)) => {
                    if let Some(parameter) = self.set(name, value.trim(), refuse) {
                        show(parameter);
                    }
                }
                None => refuse(&"`set` wants a name and a value; `params` lists them"),
            },
            _ => return false,
        }
        true
    }
}

fn show(parameter: &dyn Tunable) {
    println!("  {} = {}", parameter.name(), parameter.shown());
}
