//! The commands for an app's parameters: people set them at the console, or by the option `set`.

use alloc::format;
use alloc::string::{String, ToString};
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::fmt::{self, Display};

use fass::shared::Tunable;
use sched_dag::nearest_of;

use super::{Commands, Refuse};
use crate::options::UsageError;
use crate::println;

/// The parameters offered by an app.
pub struct ParameterTable(pub Vec<Arc<dyn Tunable>>);

impl ParameterTable {
    /// Takes the parameters offered by an app. Returns a message if two parameters share a name.
    pub fn new(parameters: &[&dyn Tunable]) -> Result<Self, String> {
        let mut names = (1..).zip(parameters);
        if let Some((_, twice)) = names.find(|(next, parameter)| {
            let rest = parameters.get(*next..).unwrap_or_default();
            rest.iter().any(|other| other.name() == parameter.name())
        }) {
            let name = twice.name();
            return Err(format!(
                "two parameters have the name `{name}`; give each its own"
            ));
        }
        let shared = parameters.iter().map(|parameter| parameter.share());
        Ok(Self(shared.collect()))
    }

    /// Sets the parameters listed in an option of the command line, as `NAME=VALUE,...`.
    pub fn set_all(&self, word: &str) -> Result<(), UsageError> {
        for part in word.split(',') {
            let mut refusal = None;
            match part.split_once('=') {
                Some((name, value)) => {
                    self.set(name, value, &mut |why| refusal = Some(why.to_string()));
                }
                None => refusal = Some(format!("`set={part}`: give it as NAME=VALUE")),
            }
            if let Some(line) = refusal {
                return Err(UsageError::new(line));
            }
        }
        Ok(())
    }

    /// Sets a single parameter, or explains why not.
    pub fn set(
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

impl Commands for ParameterTable {
    fn help(&self) -> &'static [(&'static str, &'static str)] {
        &[
            ("params", "list the parameters"),
            ("set NAME VALUE", "set a parameter, for the jobs to come"),
        ]
    }

    fn answer(&self, name: &str, rest: &str, refuse: Refuse<'_>) -> bool {
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
