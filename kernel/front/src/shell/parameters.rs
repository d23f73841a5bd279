//! What a person says of parameters at the console.

use fass::Tunable;

use super::offered::Parameters;
use super::{Commands, Refuse};
use crate::println;

impl Commands for Parameters {
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
