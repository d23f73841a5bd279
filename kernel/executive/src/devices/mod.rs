//! Devices: PCI functions, their registers, memory that they reach, and their interrupts.
//!
//! A driver finds its [function](pci::Function), maps its [registers](registers::Registers), gives
//! it [memory](dma::DmaMemory), and ties its messages to a [line](lines): an interrupt takes what
//! the device has, and releases a DAG or ends a wait; it never runs an app's code. An app without
//! a driver has none of this in its image.
//!
//! To let a device reach memory is the one step that the compiler cannot judge, as it writes where
//! it is told. So [`enable_reach`](pci::Function::enable_reach) is the one unsafe call of a driver.

pub mod dma;
pub mod ecam;
pub mod lines;
pub mod pci;
pub mod registers;
