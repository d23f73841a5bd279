//! PCI functions: finds them, sizes their ranges of registers, and addresses their messages (PCI
//! Local Bus Specification 3.0, chapter 6).
//!
//! A function's statements are not trusted: chains have an end, sizes are powers of two, and a
//! table of messages lies within its range.

use core::ops::Range;

/// The configuration space of all functions.
pub trait Configuration {
    /// Reads four bytes; all ones if there is no function.
    fn read(&self, place: Place, offset: u16) -> u32;
    /// Writes four bytes.
    fn write(&self, place: Place, offset: u16, value: u32);
}

/// Bus, device and function, as 8, 5 and 3 bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Place(pub u16);

impl core::fmt::Display for Place {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let (bus, device, function) = (self.0 >> 8, self.0 >> 3 & 31, self.0 & 7);
        write!(f, "{bus:02x}:{device:02x}.{function}")
    }
}

/// The most buses searched.
pub const BUSES: usize = 8;

/// The most capabilities that fit into the 192 bytes reserved for them, with 4 bytes each.
const CAPABILITIES: usize = 48;

/// The largest range of registers to be mapped, in bytes.
const LARGEST: u64 = 1 << 28;

/// Offsets in configuration space.
mod offset {
    pub(super) const COMMAND: u16 = 4;
    pub(super) const CLASS: u16 = 8;
    pub(super) const HEADER: u16 = 0xc;
    pub(super) const RANGES: u16 = 0x10;
    pub(super) const BUSES: u16 = 0x18;
    pub(super) const CAPABILITIES: u16 = 0x34;
}

/// Bits of the command register, and one bit of the status above.
mod command {
    pub(super) const MEMORY: u32 = 1 << 1;
    pub(super) const MASTER: u32 = 1 << 2;
    pub(super) const NO_LINE: u32 = 1 << 10;
    pub(super) const HAS_CAPABILITIES: u32 = 1 << 20;
}

/// Why a function cannot be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PciError {
    /// The function has no such range of registers in memory, or no place from the firmware.
    NoRange(u8),
    /// A range has an impossible size or place.
    MalformedRange(u8),
    /// The place of a range belongs to memory, or something else.
    Taken(u8),
    /// The function may reach memory: it has a driver, or the firmware has left it so.
    Driven,
    /// The function sends no messages, neither by MSI-X nor by MSI, or not so many.
    NoMessages,
    /// The function's table of messages is outside its range, or too short.
    MalformedTable,
}

impl core::fmt::Display for PciError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::NoRange(bar) => write!(
                f,
                "has no registers in memory at BAR {bar}; boot it by a firmware that places them"
            ),
            Self::MalformedRange(bar) => write!(f, "states a range that cannot be at BAR {bar}"),
            Self::Taken(bar) => write!(
                f,
                "has BAR {bar} where memory or another device is; update the firmware"
            ),
            Self::Driven => f.write_str(
                "may reach memory already: use it by its driver, or stop it by `Function::enable`",
            ),
            Self::NoMessages => {
                f.write_str("has no MSI-X or MSI of that number; use a device that has")
            }
            Self::MalformedTable => f.write_str("states a table of messages that cannot be"),
        }
    }
}

/// A function of a device.
#[derive(Clone, Copy)]
pub struct Function<'c> {
    configuration: &'c dyn Configuration,
    /// The function's place.
    pub place: Place,
    /// The numbers of vendor and device.
    pub id: (u16, u16),
    /// Class, subclass, interface and revision, a byte each.
    pub class: u32,
}

/// An interrupt in the form sent by a device: a store to an address (Intel SDM volume 3, 11.11).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Message {
    /// The address of the store: selects the core.
    pub address: u32,
    /// The word stored there: the vector.
    pub data: u16,
}

/// The place of a message in a table in memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MessageEntry {
    /// The BAR of the table.
    pub bar: u8,
    /// The entry's offset in that range, in bytes.
    pub offset: u64,
}

/// Calls `each` with every function on bus 0 and behind bridges.
pub fn find<'c>(configuration: &'c dyn Configuration, each: &mut dyn FnMut(Function<'c>)) {
    let mut buses = [0_u8; BUSES];
    let (mut known, mut next) = (1, 0);
    while next < known {
        let bus = buses[next];
        next += 1;
        for device in 0..32 {
            let first = u16::from(bus) << 8 | device << 3;
            for place in (first..first + 8).map(Place) {
                let Some(function) = Function::at(configuration, place) else {
                    // A device without its first function does not exist.
                    if place.0 == first {
                        break;
                    }
                    continue;
                };
                let [.., header, _] = function.read(offset::HEADER).to_le_bytes();
                if header & 0x7f == 1 {
                    let [_, secondary, ..] = function.read(offset::BUSES).to_le_bytes();
                    // A bridge to a known bus would lead in a circle.
                    if known < BUSES && !buses[..known].contains(&secondary) {
                        buses[known] = secondary;
                        known += 1;
                    }
                }
                each(function);
                // A device with one function may answer to all eight numbers.
                if place.0 == first && header & 0x80 == 0 {
                    break;
                }
            }
        }
    }
}

impl<'c> Function<'c> {
    /// Returns the function at a place, if there is one.
    pub(super) fn at(configuration: &'c dyn Configuration, place: Place) -> Option<Self> {
        let [a, b, c, d] = configuration.read(place, 0).to_le_bytes();
        let id = (u16::from_le_bytes([a, b]), u16::from_le_bytes([c, d]));
        (id.0 != u16::MAX && id.0 != 0).then(|| Self {
            configuration,
            place,
            id,
            class: configuration.read(place, offset::CLASS),
        })
    }

    /// Reads four bytes of the function's configuration space.
    pub fn read(&self, offset: u16) -> u32 {
        self.configuration.read(self.place, offset & 0xffc)
    }

    fn write(&self, offset: u16, value: u32) {
        self.configuration.write(self.place, offset, value);
    }

    fn byte(&self, offset: u16) -> u8 {
        self.read(offset).to_le_bytes()[usize::from(offset & 3)]
    }

    /// Returns the offsets of the function's capabilities of a kind, in order.
    pub fn capabilities(&self, kind: u8) -> impl Iterator<Item = u16> {
        let has_some = self.read(offset::COMMAND) & command::HAS_CAPABILITIES != 0;
        let first = has_some.then(|| self.byte(offset::CAPABILITIES) & 0xfc);
        let next = |at: &u8| Some(self.byte(u16::from(*at) + 1) & 0xfc);
        core::iter::successors(first, next)
            .take(CAPABILITIES)
            // Below lies the header; 0 ends the chain.
            .take_while(|at| *at >= 0x40)
            .filter(move |at| self.byte(u16::from(*at)) == kind)
            .map(u16::from)
    }

    /// Lets the function answer at its ranges, and turns its interrupt line off.
    pub fn enable(&self) {
        self.command(command::MEMORY | command::NO_LINE);
    }

    /// Lets the function reach memory, too, and send messages.
    ///
    /// # Safety
    ///
    /// The device writes wherever it is told. The driver therefore tells the device only addresses
    /// of [`DmaMemory`](super::dma::DmaMemory), and of memory owned by the driver and left alone
    /// until the device has finished, each with a length within that memory.
    pub unsafe fn enable_reach(&self) {
        self.command(command::MEMORY | command::MASTER | command::NO_LINE);
    }

    /// Reports whether the function may reach memory.
    pub(super) fn reaches(&self) -> bool {
        self.read(offset::COMMAND) & command::MASTER != 0
    }

    fn command(&self, bits: u32) {
        // Writing ones would clear the status above.
        let kept = self.read(offset::COMMAND) & 0xffff & !command::MASTER;
        self.write(offset::COMMAND, kept | bits);
    }

    /// Returns the addresses of a range of registers.
    ///
    /// # Errors
    ///
    /// [`PciError::NoRange`] and [`PciError::MalformedRange`].
    pub fn range(&self, bar: u8) -> Result<Range<u64>, PciError> {
        let at = offset::RANGES + 4 * u16::from(bar);
        let low = if bar < 6 { self.read(at) } else { 1 };
        // Bit 0 marks I/O ports; a range of 64 bits takes two places.
        let is_wide = low & 6 == 4;
        if low & 1 != 0 || low & !0xf == 0 && !is_wide {
            return Err(PciError::NoRange(bar));
        }
        if is_wide && bar == 5 {
            return Err(PciError::MalformedRange(bar));
        }
        let high = if is_wide { self.read(at + 4) } else { 0 };
        let command = self.read(offset::COMMAND) & 0xffff;
        // While asked for its size, the range must answer nowhere.
        self.write(offset::COMMAND, command & !command::MEMORY);
        let mask = |at, before| {
            self.write(at, u32::MAX);
            let mask = self.read(at);
            self.write(at, before);
            mask
        };
        let low_mask = mask(at, low) & !0xf;
        let high_mask = if is_wide {
            mask(at + 4, high)
        } else {
            u32::MAX
        };
        // Before anything is judged: the function answers as before, even if its range is refused.
        self.write(offset::COMMAND, command);
        let join = |high, low| u64::from(high) << 32 | u64::from(low);
        let (start, mask) = (join(high, low & !0xf), join(high_mask, low_mask));
        if start == 0 || low_mask == 0 && !is_wide {
            return Err(PciError::NoRange(bar));
        }
        // The bits that stay 0 are those within the range, so its size is the mask's negative.
        let length = mask.wrapping_neg();
        let is_right = length.is_power_of_two()
            && length <= LARGEST
            && start.is_multiple_of(length)
            && start.checked_add(length).is_some();
        is_right
            .then(|| start..start + length)
            .ok_or(PciError::MalformedRange(bar))
    }

    /// Makes the function send `message` as its message `number`, and turns sending on. If the
    /// messages are in memory (MSI-X), the caller writes the message to the returned place.
    ///
    /// # Errors
    ///
    /// [`PciError`].
    pub fn send(&self, number: u16, message: Message) -> Result<Option<MessageEntry>, PciError> {
        const MSI_X: u8 = 0x11;
        const MSI: u8 = 5;
        if let Some(at) = self.capabilities(MSI_X).next() {
            return self.table_entry(at, number).map(Some);
        }
        let at = self.capabilities(MSI).next();
        let at = at.filter(|_| number == 0).ok_or(PciError::NoMessages)?;
        let control = self.read(at);
        let is_wide = control & 1 << 23 != 0;
        self.write(at + 4, message.address);
        if is_wide {
            self.write(at + 8, 0);
        }
        let data = if is_wide { at + 12 } else { at + 8 };
        self.write(data, self.read(data) & !0xffff | u32::from(message.data));
        // Turned on for a single message, however many the function could send.
        self.write(at, control & !(7 << 20) | 1 << 16);
        Ok(None)
    }

    fn table_entry(&self, at: u16, number: u16) -> Result<MessageEntry, PciError> {
        const ON: u32 = 1 << 31;
        const MASKED: u32 = 1 << 30;
        let control = self.read(at);
        let count = (control >> 16 & 0x7ff) + 1;
        let table = self.read(at + 4);
        let bar = table.to_le_bytes()[0] & 7;
        let offset = u64::from(table & !7) + 16 * u64::from(number);
        let range = self.range(bar)?;
        if u32::from(number) >= count || offset + 16 > range.end - range.start {
            return Err(PciError::MalformedTable);
        }
        // Turned on as a whole: each entry stays masked by itself until it is written.
        self.write(at, control & !MASKED | ON);
        Ok(MessageEntry { bar, offset })
    }
}

#[cfg(test)]
mod tests {
    use core::cell::RefCell;
    use std::collections::BTreeMap;
    use std::vec::Vec;

    use super::*;
    use crate::devices::registers::Registers;

    /// The words of a function, and the sizes of its ranges, whose bits below stay 0.
    type Words = ([u32; 64], [u32; 6]);

    #[derive(Default)]
    struct Fake(RefCell<BTreeMap<Place, Words>>);

    impl Configuration for Fake {
        fn read(&self, place: Place, offset: u16) -> u32 {
            let functions = self.0.borrow();
            let found = functions.get(&place);
            found.map_or(u32::MAX, |(space, _)| space[usize::from(offset / 4) % 64])
        }

        fn write(&self, place: Place, offset: u16, value: u32) {
            if let Some((space, sizes)) = self.0.borrow_mut().get_mut(&place) {
                let at = usize::from(offset / 4);
                let range = at.wrapping_sub(4);
                let fixed = sizes.get(range).map_or(0, |size| size.wrapping_sub(1));
                let kinds = if range < 6 { space[at] & 0xf } else { 0 };
                space[at] = value & !fixed | kinds;
            }
        }
    }

    impl Fake {
        /// Adds a function with some of its words, and the sizes of its ranges.
        fn with(self, place: u16, words: &[(usize, u32)], sizes: [u32; 6]) -> Self {
            let mut space = [0; 64];
            space[0] = 0x1041_1af4;
            words.iter().for_each(|(at, word)| space[*at] = *word);
            self.0.borrow_mut().insert(Place(place), (space, sizes));
            self
        }

        fn places(&self) -> Vec<u16> {
            let mut places = Vec::new();
            find(self, &mut |function| places.push(function.place.0));
            places
        }

        fn first(&self) -> Function<'_> {
            Function::at(self, Place(8)).unwrap()
        }
    }

    #[test]
    fn functions_are_found_behind_bridges_that_lead_in_no_circle() {
        let bridge = |to: u32| [(3, 1 << 16), (6, to << 8)];
        let fake = Fake::default()
            .with(0, &[], [0; 6])
            .with(3, &[], [0; 6]) // not there: device 0 has one function
            .with(8, &[(3, 0x80 << 16)], [0; 6])
            .with(11, &[], [0; 6])
            .with(16, &bridge(1), [0; 6])
            .with(24, &bridge(1), [0; 6])
            .with(0x100, &bridge(0), [0; 6])
            .with(0x108, &bridge(200), [0; 6])
            .with(200 << 8, &bridge(200), [0; 6]);
        assert_eq!(fake.places(), [0, 8, 11, 16, 24, 0x100, 0x108, 200 << 8]);
        assert_eq!(std::format!("{}", Place(0x10b)), "01:01.3");
        // More bridges than there is room for are left out.
        let many = (0..32).map(|device| (device << 3, u32::from(device) + 1));
        let fake = many.fold(Fake::default(), |fake, (place, to)| {
            fake.with(place, &bridge(to), [0; 6])
        });
        assert_eq!(fake.places().len(), 32);
    }

    #[test]
    fn a_chain_of_capabilities_ends() {
        let words = |next: u32| {
            [
                (1, 1 << 20),
                (13, 0x40),
                (16, 0x5009),
                (20, next << 8 | 0x11),
            ]
        };
        for (next, found) in [(0, 1), (0x3c, 1), (0x40, 24), (0x50, 47), (0xff, 1)] {
            let fake = Fake::default().with(8, &words(next), [0; 6]);
            assert_eq!(fake.first().capabilities(0x11).count(), found, "{next:x}");
        }
        let without = Fake::default().with(8, &words(0)[1..], [0; 6]);
        assert_eq!(without.first().capabilities(0x11).count(), 0);
    }

    #[test]
    fn ranges_have_a_place_and_a_size_that_can_be() {
        let range = |bar: u8, low: u32, high: u32, sizes: [u32; 6]| {
            let at = 4 + usize::from(bar).min(5);
            let words = [(1, 7), (at, low), (at + 1, high)];
            let fake = Fake::default().with(8, &words, sizes);
            let range = fake.first().range(bar);
            // Whatever was asked, nothing has changed.
            assert_eq!(
                (
                    fake.first().read(4),
                    fake.first().read(16 + 4 * u16::from(bar.min(5)))
                ),
                (7, low)
            );
            range
        };
        const KIB: u32 = 4096;
        assert_eq!(
            range(0, 0xfebf_1000, 0, [KIB; 6]),
            Ok(0xfebf_1000..0xfebf_2000)
        );
        assert_eq!(
            range(4, 0x4, 0x10, [KIB; 6]),
            Err(PciError::MalformedRange(4))
        );
        let wide = [KIB, 1, KIB, 1, KIB, 1];
        assert_eq!(
            range(4, 0x1000_000c, 0x10, wide),
            Ok(0x10_1000_0000..0x10_1000_1000)
        );
        assert_eq!(
            range(5, 0x1000_000c, 0, wide),
            Err(PciError::MalformedRange(5))
        );
        for (bar, low) in [(0, 0), (0, 0xc001), (6, 0)] {
            assert_eq!(range(bar, low, 0, [KIB; 6]), Err(PciError::NoRange(bar)));
        }
        assert_eq!(
            range(0, 0x8000_0000, 0, [1 << 30; 6]),
            Err(PciError::MalformedRange(0))
        );
        assert_eq!(
            range(0, 0xfebf_1000, 0, [3 * KIB; 6]),
            Err(PciError::MalformedRange(0))
        );
    }

    #[test]
    fn registers_of_a_function_that_may_reach_memory_are_not_given_out() {
        let words = [(1, command::MASTER), (4, 0xfebf_1000)];
        let fake = Fake::default().with(8, &words, [4096; 6]);
        let given = Registers::of(&fake.first(), 0);
        assert_eq!(given.err(), Some(PciError::Driven));
        fake.first().enable();
        assert!(!fake.first().reaches());
    }

    const MESSAGE: Message = Message {
        address: 0xfee0_0000,
        data: 0x50,
    };

    #[test]
    fn a_message_lies_in_its_table_and_range() {
        let message = |number, control: u32, table: u32| {
            let chain = [(1, 1 << 20), (13, 0x40), (16, control << 16 | 0x11)];
            let words = [&chain[..], &[(17, table), (5, 0xfebf_1000)]].concat();
            let fake = Fake::default().with(8, &words, [4096; 6]);
            let message = fake.first().send(number, MESSAGE);
            let is_on = fake.first().read(0x40) >> 31 == 1;
            assert_eq!(is_on, message.is_ok());
            message
        };
        let at = |offset| Ok(Some(MessageEntry { bar: 1, offset }));
        assert_eq!(message(0, 0, 1), at(0));
        assert_eq!(message(2, 0x4002, 0x801), at(0x820));
        assert_eq!(message(255, 0x7ff, 1), at(4080));
        let malformed = [
            (256, 0x7ff, 1),
            (1, 0, 1),
            (0, 0, 0x1001),
            (0, 0, u32::MAX - 6),
        ];
        for (entry, control, table) in malformed {
            assert_eq!(
                message(entry, control, table),
                Err(PciError::MalformedTable)
            );
        }
        assert_eq!(message(0, 0, 7), Err(PciError::NoRange(7)));
    }

    #[test]
    fn a_message_without_a_table_is_the_only_one() {
        for (wide, data) in [(0, 0x48), (1 << 23, 0x4c)] {
            let words = [
                (1, 1 << 20),
                (13, 0x40),
                (16, 0x70_0005 | wide),
                (18, u32::MAX),
            ];
            let fake = Fake::default().with(8, &words, [0; 6]);
            let device = fake.first();
            assert_eq!(device.send(1, MESSAGE), Err(PciError::NoMessages));
            assert_eq!(device.send(0, MESSAGE), Ok(None));
            assert_eq!(device.read(0x40), 0x1_0005 | wide);
            assert_eq!(device.read(0x44), MESSAGE.address);
            assert_eq!(device.read(data) & 0xffff, 0x50);
        }
        let none = Fake::default().with(8, &[], [0; 6]);
        assert_eq!(none.first().send(0, MESSAGE), Err(PciError::NoMessages));
    }
}
