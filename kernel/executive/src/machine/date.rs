//! The PC's battery-backed clock, which keeps the date (Motorola MC146818A).

use super::port;

/// The registers of second, minute, hour, day, month and year, and of their format.
const DATE: [u8; 7] = [0, 2, 4, 7, 8, 9, 0xb];

/// The register whose top bit announces a change of the others.
const STATUS: u8 = 0xa;

/// The most looks at the clock: a change takes 2 ms, and a look some microseconds.
const LOOKS: u32 = 10_000;

/// Returns the seconds since 1970, within one second, in this century; `None` if the machine has no
/// such clock. For the boot processor, before a run.
pub fn unix_s() -> Option<u64> {
    let look = |_| {
        let is_steady = register(STATUS) & 0x80 == 0;
        let read = || DATE.map(register);
        let first = read();
        (is_steady && first == read()).then_some(first)
    };
    (0..LOOKS).find_map(look).and_then(seconds)
}

fn register(number: u8) -> u8 {
    // SAFETY: the ports are this clock's, which nothing else here uses. The top bit lets
    // non-maskable interrupts through.
    unsafe { port::write_u8(0x70, number) };
    // SAFETY: as above; reading these registers changes nothing.
    unsafe { port::read_u8(0x71) }
}

/// Returns the Unix time of the registers, in seconds, if they hold a date.
fn seconds([second, minute, hour, day, month, year, form]: [u8; 7]) -> Option<u64> {
    /// The days of a year before each month.
    const BEFORE: [u64; 12] = [0, 31, 59, 90, 120, 151, 181, 212, 243, 273, 304, 334];
    /// The days from 1970 to 2000.
    const FIRST_DAY: u64 = 10_957;
    let number = |value: u8, most: u8| {
        let (tens, ones) = (value >> 4, value & 0xf);
        let decimal = (tens < 10 && ones < 10).then(|| tens * 10 + ones);
        let number = if form & 4 != 0 { Some(value) } else { decimal };
        number.filter(|number| *number <= most)
    };
    let hour = match form & 2 != 0 {
        true => number(hour, 23)?,
        // With hours 1 to 12, the top bit means afternoon.
        false => number(hour & 0x7f, 12)? % 12 + hour / 0x80 * 12,
    };
    let [second, minute] = [number(second, 59)?, number(minute, 59)?];
    let [day, month, year] = [number(day, 31)?, number(month, 12)?, number(year, 99)?];
    let (year, month) = (u64::from(year), usize::from(month.checked_sub(1)?));
    let leap_days = year.div_ceil(4) + u64::from(month > 1 && year % 4 == 0);
    let days = year * 365 + leap_days + BEFORE[month] + u64::from(day.checked_sub(1)?);
    let minutes = u64::from(hour) * 60 + u64::from(minute);
    Some(((FIRST_DAY + days) * 1_440 + minutes) * 60 + u64::from(second))
}

#[cfg(test)]
mod tests {
    use super::seconds;

    #[test]
    fn a_date_is_read_in_each_of_its_forms_and_none_is_made_up() {
        for (registers, expected) in [
            ([0, 0, 0, 1, 1, 0, 2], Some(946_684_800)),
            ([0x59, 0x59, 0x23, 0x31, 0x12, 0x99, 2], Some(4_102_444_799)),
            ([56, 34, 12, 29, 2, 24, 6], Some(1_709_210_096)),
            ([0, 0, 0, 1, 3, 0x24, 2], Some(1_709_251_200)),
            ([0x30, 0x15, 0x91, 0x29, 0x11, 0x26, 0], Some(1_795_994_130)), // at 11 p.m., 12 h
            ([0x30, 0x15, 0x12, 0x29, 0x11, 0x26, 0], Some(1_795_911_330)), // after midnight
            ([0xff; 7], None),
            ([0, 0, 0, 0, 1, 0, 2], None),
            ([0, 0, 0, 1, 0, 0, 2], None),
            ([0x0a, 0, 0, 1, 1, 0, 2], None),
            ([0, 0, 0x24, 1, 1, 0, 2], None),
        ] {
            assert_eq!(seconds(registers), expected, "{registers:x?}");
        }
    }
}
