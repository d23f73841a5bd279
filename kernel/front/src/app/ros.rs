//! Nodes of ROS 2: the options that identify a node and its router.
//!
//! | option | meaning |
//! | --- | --- |
//! | `router=udp://ADDRESS:PORT` | the router; without a router the node runs alone |
//! | `domain=0` | the domain, to 232 |
//! | `namespace=/robot` | prefix of relative names of topics |
//! | `lease_ms=1000` | after so long without a datagram the router takes the node for gone |
//! | `identity=HEX` | tells the session from all others; a fresh identity by default |

use alloc::boxed::Box;
use alloc::format;
use core::time::Duration;

use fass::platform::Protocol;
use ros::{Node, NodeOptions, is_name};

use super::ending::AppError;
use super::endpoint;
use super::machine::{Machine, System};
use crate::options::UsageError;

impl<S: System> Machine<S> {
    /// Makes a node by the options of the command line. The app then adds topics to the node and
    /// [joins](Self::join) it.
    ///
    /// # Errors
    ///
    /// [`AppError::Usage`] if the value of an option is not allowed.
    ///
    /// # Panics
    ///
    /// If ROS 2 does not allow the name.
    ///
    /// ```no_run
    /// use core::time::Duration;
    /// use fass::shared::Received;
    /// use fass::{SubtaskAttributes, create_dag, finish_create_dags};
    /// use ros::std_msgs::UInt32;
    ///
    /// fn hear(machine: &kernel::Machine) -> Result<(), kernel::AppError> {
    ///     let mut node = machine.ros_node("ear")?;
    ///     let numbers = node.subscribe::<UInt32>("numbers");
    ///     machine.join(node)?;
    ///     machine.options().finish(&["router"])?;
    ///     let (dag, ms) = (create_dag(), Duration::from_millis);
    ///     dag.relative_deadline(ms(10)).sporadic(ms(10));
    ///     let hear = |numbers: Received<'_, UInt32>| kernel::println!("{} came", numbers.count());
    ///     dag.using(numbers.receiving())
    ///         .source(hear)
    ///         .register(SubtaskAttributes::named("hear"));
    ///     finish_create_dags(&[dag])?;
    ///     machine.run().map(drop)
    /// }
    /// ```
    pub fn ros_node(&self, name: &str) -> Result<Node, AppError> {
        let options = self.options();
        let wrong = |word: &str, allowed: &str| {
            let value = options.text(word).unwrap_or_default();
            UsageError::new(format!("`{word}={value}`: allowed are {allowed}"))
        };
        let namespace = options.text("namespace").unwrap_or_default();
        // The limit leaves room for the names of topics.
        let fits = namespace.is_empty() || is_name(namespace) && namespace.len() <= 128;
        if !fits {
            let allowed = "128 letters, digits and single `_` between `/`, no digit first";
            return Err(wrong("namespace", allowed).into());
        }
        let domain = options.number("domain", 0..=232, 0)?;
        let stated = options.text("identity");
        let identity = stated.map_or(Ok(S::seed().max(1)), |word| u128::from_str_radix(word, 16));
        let identity = identity.ok().filter(|identity| *identity > 0);
        let options = NodeOptions {
            namespace: namespace.into(),
            domain: u32::try_from(domain).unwrap_or_default(),
            identity: identity
                .ok_or_else(|| wrong("identity", "up to 32 hexadecimal digits, not all 0"))?,
            lease: Duration::from_millis(options.number("lease_ms", 100..=60_000, 1_000)?),
        };
        Ok(Node::new(name, options))
    }

    /// Joins a node with its topics to the router named by the option `router=`, and sets the
    /// node's [clock](Node::clock), if the machine keeps the date. Without the option a line says
    /// that the node runs alone. Call before the commit, and before
    /// [`CommandLine::finish`](crate::options::CommandLine::finish).
    ///
    /// See [`ros_node`](Self::ros_node). On Linux the node stays joined until the end of the next
    /// run.
    ///
    /// # Errors
    ///
    /// [`AppError::Usage`] if the option names no router; [`AppError::Failure`] if there is no
    /// network, or a topic has a device already.
    pub fn join(&self, mut node: Node) -> Result<(), AppError> {
        // A machine without a date is fine: the stamps of messages correct the clock, too.
        let _ = self.set_clock(node.clock());
        let Some(word) = self.options.text("router") else {
            // The topics of a lone node have no link.
            let _ = node.begin(0, || ());
            crate::println!(
                "there is no router, as by `router=udp://10.0.2.2:7447`: the node runs alone"
            );
            return Ok(());
        };
        let peer = endpoint::peer(word).ok_or_else(|| {
            UsageError::new(format!("`router={word}`: allowed is udp://ADDRESS:PORT"))
        })?;
        self.system
            .connect_protocol(Box::new(node), peer, &self.options)
    }
}
