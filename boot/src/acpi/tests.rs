//! Tables as machines have them, and as they must not be.

use super::*;

const RSDP: u64 = 0xf_0000;

/// A machine with `revision` tables: a MADT with APIC ids 0, 2 and a
/// disabled 3, and a FADT with a 24-bit timer at port 0x608.
fn with_tables(revision: u8) -> Vec<u8> {
    let mut machine = vec![0; 0x10_0000];
    let entry = |id: u8, flags: u8| [0, 8, id, id, flags, 0, 0, 0];
    let madt = [
        [0, 0, 0xe0, 0xfe, 0, 0, 0, 0],
        entry(0, 1),
        entry(2, 1),
        entry(3, 0),
        [1, 12, 0, 0, 0, 0, 0xc0, 0xfe],
        [0, 0, 0, 0, 9, 4, 0, 0],
    ]
    .concat();
    put_table(&mut machine, 0x5000, *b"APIC", &madt);
    let mut fadt = [0; 116 - 36];
    fadt[76 - 36..78 - 36].copy_from_slice(&0x608u16.to_le_bytes());
    put_table(&mut machine, 0x6000, *b"FACP", &fadt);
    let mut hpet = [0; 56 - 36];
    hpet[8..12].copy_from_slice(&0xfed0_0000u32.to_le_bytes());
    put_table(&mut machine, 0x7000, *b"HPET", &hpet);
    let tables = [0x6000u32, 0x5000, 0x7000];
    let (signature, entries, pointer) = match revision {
        2.. => (
            *b"XSDT",
            tables.map(u64::from).map(u64::to_le_bytes).concat(),
            24,
        ),
        _ => (*b"RSDT", tables.map(u32::to_le_bytes).concat(), 16),
    };
    put_table(&mut machine, 0x4000, signature, &entries);
    let at = usize::try_from(RSDP).unwrap();
    let root = &mut machine[at..at + 36];
    root[..8].copy_from_slice(b"RSD PTR ");
    root[15] = revision;
    root[pointer..pointer + 2].copy_from_slice(&0x4000u16.to_le_bytes());
    root[8] = complement(&root[..20]);
    machine
}

fn put_table(machine: &mut [u8], at: usize, signature: [u8; 4], body: &[u8]) {
    let length = u32::try_from(36 + body.len()).unwrap();
    let table = &mut machine[at..at + 36 + body.len()];
    table[..4].copy_from_slice(&signature);
    table[4..8].copy_from_slice(&length.to_le_bytes());
    table[36..].copy_from_slice(body);
    table[9] = 0;
    table[9] = complement(table);
}

/// Returns the byte with which the sum of all is 0.
fn complement(bytes: &[u8]) -> u8 {
    (bytes.iter()).fold(0, |sum, byte| sum.wrapping_sub(*byte))
}

#[test]
fn finds_enabled_processors_by_either_root_table() {
    for revision in [0, 2] {
        let platform = read(&with_tables(revision), Some(RSDP)).unwrap();
        assert_eq!(platform.apic_ids.as_slice(), &[0, 2], "revision {revision}");
        assert_eq!(platform.local_apic, 0xfee0_0000);
        assert_eq!(platform.io_apics.as_slice(), &[0xfec0_0000]);
        assert_eq!(platform.hpet, Some(0xfed0_0000));
        assert_eq!(
            platform.pm_timer,
            Some(PmTimer {
                port: 0x608,
                bits: 24
            })
        );
    }
}

#[test]
fn searches_the_bios_area_when_the_loader_names_nothing() {
    assert!(read(&with_tables(2), None).is_ok());
    assert!(read(&with_tables(2), Some(0x1234)).is_ok());
}

#[test]
fn refuses_a_broken_chain_by_its_missing_link() {
    let fault = |machine: &Vec<u8>| read(machine, Some(RSDP)).unwrap_err();
    assert_eq!(fault(&vec![0; 0x10_0000]), AcpiError::NoRootPointer);

    let mut machine = with_tables(2);
    machine[0x4010] ^= 1; // spoils the root table's checksum
    assert_eq!(fault(&machine), AcpiError::NoRootTable);

    let mut machine = with_tables(0);
    machine[0x5010] ^= 1; // spoils the MADT's
    let damaged = fault(&machine);
    assert_eq!(damaged, AcpiError::Damaged(*b"APIC"));
    assert_eq!(
        damaged.to_string(),
        "the ACPI table `APIC` has a wrong length or checksum; update the firmware"
    );
    machine[0x5000] = b'X';
    assert_eq!(fault(&machine), AcpiError::Absent(*b"APIC"));
}

#[test]
fn names_a_damaged_table_that_it_does_without() {
    let mut machine = with_tables(2);
    let whole = read(&machine, Some(RSDP)).unwrap();
    assert_eq!(whole.warning, None);
    machine[0x6010] ^= 1;
    let platform = read(&machine, Some(RSDP)).unwrap();
    assert_eq!(platform.pm_timer, None);
    assert_eq!(platform.hpet, whole.hpet);
    assert_eq!(platform.warning, Some(AcpiError::Damaged(*b"FACP")));
    machine[0x6000] = b'X'; // absent
    assert_eq!(read(&machine, Some(RSDP)).unwrap().warning, None);
}

#[test]
fn finds_processors_with_long_ids_and_each_once() {
    let mut machine = with_tables(2);
    let long = |id: u32, flags: u8| {
        let id = id.to_le_bytes();
        [&[9, 16, 0, 0], &id[..], &[flags, 0, 0, 0, 7, 0, 0, 0]].concat()
    };
    let short = [0, 8, 1, 1, 1, 0, 0, 0].to_vec();
    let entries = [vec![0; 8], short, long(1, 1), long(300, 1), long(301, 0)];
    put_table(&mut machine, 0x5000, *b"APIC", &entries.concat());
    let platform = read(&machine, Some(RSDP)).unwrap();
    assert_eq!(platform.apic_ids.as_slice(), &[1, 300]);
    assert_eq!(platform.processors, 2);

    let many = (0..288).flat_map(|id| long(id, 1));
    let entries = [0; 8].into_iter().chain(many).collect::<Vec<_>>();
    put_table(&mut machine, 0x8000, *b"APIC", &entries);
    let entries = [0x6000u64, 0x8000].map(u64::to_le_bytes).concat();
    put_table(&mut machine, 0x4000, *b"XSDT", &entries);
    let platform = read(&machine, Some(RSDP)).unwrap();
    assert_eq!(platform.processors, 288, "more than there is room for");
    let first: Vec<u32> = (0..255).collect();
    assert_eq!(platform.apic_ids.as_slice(), first);
}

#[test]
fn does_not_loop_on_an_entry_of_length_0() {
    let mut machine = with_tables(2);
    put_table(&mut machine, 0x5000, *b"APIC", &[0; 16]);
    assert_eq!(
        read(&machine, Some(RSDP)).unwrap_err(),
        AcpiError::NoProcessors
    );
}
