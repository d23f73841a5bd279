//! Devices: PCI functions, their registers, the memory within their reach, and their interrupts.
//!
//! A driver finds its [function](pci::Function), maps its [registers](registers::Registers), gives
//! it [memory](dma::DmaMemory), and ties its messages to a [line](lines): the interrupt handler
//! takes data from the device, and releases a DAG or ends a wait, but never runs a subtask's code.
//! The image of an app without a driver contains none of this code.
//!
//! The compiler cannot judge one step: letting a device reach memory, as the device writes wherever
//! it is told. [`enable_reach`](pci::Function::enable_reach) is therefore the only unsafe call of a
//! driver.

pub mod dma;
pub mod ecam;
pub mod lines;
pub mod pci;
pub mod registers;
