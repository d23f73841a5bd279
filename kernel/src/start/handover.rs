//! The way from the handover by `boot` to the app's function, and the machine's end.
//!
//! Prints the `boot` line, a description of the machine, and warns of hardware that harms real
//! time. Under a hypervisor, which hides the processor's statements about itself, a missing
//! statement is no reason to warn, and shows in the line alone.

use alloc::borrow::Cow;
use alloc::format;
use alloc::vec::Vec;
use core::ops::Range;

use boot::acpi::{self, MAX_IO_APICS, Platform};
use boot::physical::LowMemory;
use boot::{BootInfo, Framebuffer, List, MAX_PROCESSORS, MAX_REGIONS, Module};
use executive::devices::ecam;
use executive::machine::calibration::{self, KnownClock, TscRate};
use executive::machine::paging::MapError;
use executive::machine::power::{self, PowerAction};
use executive::machine::this_core::{self, Core, CoreStacks};
use executive::machine::{
    agreement, avx, clock, counted_time, cpu, interrupt, interrupt_flag, legacy, local_apic,
    processors, screen, serial, time_slice,
};
use executive::run::platform::KERNEL;
use executive::run::{containment, contexts, heartbeat, record, worker};
use executive::text::console;
use executive::{interrupts, memory};
use front::app::ending::{self, AppError, RunVerdict};
use front::app::terms;
use front::json;

use super::{probe, settings};
use crate::app::bare_machine::{BareMachine, Machine};
use crate::options::{CommandLine, UsageError};
use crate::println;
use crate::watch::{self, panic};

/// An app: sets up its DAGs, runs them and reports.
pub(crate) type App = fn(&Machine) -> Result<(), AppError>;

/// The highest APIC id reachable without x2APIC; the next id means all processors.
const LAST_SHORT_ID: u32 = 254;

/// The stack of an interrupt handler, or of an exception's report, in bytes.
const HANDLER_STACK: u64 = 16 * 1024;

/// Brings up memory and interrupts, then continues on the core's own stack, because the boot stack
/// has no guard page.
#[allow(clippy::too_many_lines, reason = "it states the order of the steps")]
pub(crate) fn start(info: &'static BootInfo, name: &'static str, app: App) -> ! {
    // First of all: any later step may have something to report.
    serial::FIRST.initialize();
    // From now on, the port's FIFO holds bytes that arrive for an app's wire.
    serial::SECOND.initialize();
    let screen = screen_pages(info);
    // The boot table maps no address beyond; text for a higher screen shows once the kernel's table
    // is in use.
    let is_early = screen.end <= 1 << 32;
    if is_early {
        show_text(info, &screen);
    }
    // Before anything that may panic: a panic, too, ends the machine in this way.
    match info.value("end") {
        Some("off") => power::set_end(PowerAction::Off),
        Some("reset") => power::set_end(PowerAction::Reset),
        _ => {}
    }
    if let Some(feature) = cpu::missing_feature() {
        panic!("the processor has no {feature}; turn it on in the firmware's settings");
    }
    legacy::silence_interrupt_controllers();
    let probes = info.value("probe") == Some("on");
    interrupt::install(if probes {
        probe::HANDLERS
    } else {
        interrupt::Handlers {
            timer: interrupts::timer_interrupt,
            wake: interrupts::wake_interrupt,
            end: containment::end_at_fault,
            beat: watch::beat,
            exception: panic::exception,
            work: worker::work,
            release: contexts::give_back,
        }
    });
    if info.value("avx") != Some("off") {
        // SAFETY: the boot table maps all memory writable, only the boot processor runs, and it has
        // no interrupt table before `become_core`.
        unsafe { avx::turn_on() };
    }
    let platform = read_platform(info);
    if let Some(warning) = platform.warning {
        println!("warning: {warning}");
    }
    if info.memory.is_cut {
        println!("warning: the memory map has more than {MAX_REGIONS} ranges; some are not used");
    }
    let module = module(info);
    // SAFETY: 1. `boot` handed over with its table in use and the machine's map. 2. Only the boot
    // processor runs, it comes here once, and nothing was allocated before. 3. `module` made sure
    // that the module lies in memory. 4. The tables name the registers, and `screen_pages` returned
    // the whole pages of a screen.
    let layout = unsafe {
        memory::initialize(
            info.memory.as_slice(),
            module,
            devices(&platform).as_slice(),
            screen.clone(),
        )
    };
    let layout = layout.unwrap_or_else(|error| panic!("{error}"));
    if !is_early {
        show_text(info, &screen);
    }
    let mut ids = platform.apic_ids.as_slice().iter();
    let wants_x2apic = info.value("x2apic") == Some("on") || ids.any(|id| *id > LAST_SHORT_ID);
    // SAFETY: `memory::initialize` mapped one page of registers there.
    unsafe { local_apic::choose(platform.local_apic, wants_x2apic) };
    // SAFETY: the tables name these registers, and `devices` had them mapped.
    unsafe { power::set_registers(platform.power) };
    for base in platform.io_apics.as_slice() {
        // SAFETY: likewise, and nothing else in this kernel uses them.
        unsafe { legacy::mask_io_apic(*base) };
    }
    this_core::create(with_stacks(selected(info, &platform)));
    let core = processors::become_core(local_apic::id());
    ecam::note_place(platform.ecam);
    let stack = core.context().stack_top();
    let start = BootHandover {
        info,
        name,
        app,
        platform,
        layout,
        probes,
    };
    // SAFETY: the stack belongs to the context that this core runs first.
    unsafe { cpu::continue_on_stack(stack, &start, start_cores) }
}

/// Returns the addresses of all memory-mapped registers, so that their pages can be mapped.
fn devices(platform: &Platform) -> List<u64, { MAX_IO_APICS + 4 }> {
    let mut devices = List::new(0);
    let apics = platform.io_apics.as_slice().iter().copied();
    let own = core::iter::once(platform.local_apic).chain(platform.hpet);
    for address in own.chain(apics).chain(platform.power.addresses()) {
        devices
            .push(address)
            .expect("there is room for all of them");
    }
    devices
}

/// Returns the pages of the screen, if there is a screen.
#[inline(never)]
fn screen_pages(info: &BootInfo) -> Range<u64> {
    let range = info.screen.as_ref().map(Framebuffer::range);
    let pages = range.and_then(|range| memory::pages_of_screen(range, info.memory.as_slice()));
    pages.unwrap_or(0..0)
}

/// Shows text on the screen with these pages from now on.
#[inline(never)]
fn show_text(info: &BootInfo, pages: &Range<u64>) {
    if let Some(buffer) = info.screen.filter(|_| !pages.is_empty()) {
        // SAFETY: 1. The pages are mapped by the table in use and by the kernel's, and lie in no
        // memory (`pages_of_screen`). 2. `multiboot2` takes no other screen.
        unsafe { screen::initialize(buffer) };
    }
}

/// Returns the first module left in memory by the loader.
fn module(info: &BootInfo) -> Option<Module> {
    let module = *info.modules.as_slice().first()?;
    let (map, image) = (info.memory.as_slice(), boot_entry::image::whole());
    assert!(
        memory::lies_in_memory(module, map, &image),
        "the loader's module at {:#x}..{:#x} is not in free memory; give the machine more memory",
        module.start,
        module.end
    );
    Some(module)
}

/// Returns the bytes of the loader's module, once the module is mapped.
fn module_bytes(info: &'static BootInfo) -> Option<&'static [u8]> {
    let module = module(info)?;
    let length = usize::try_from(module.end - module.start).ok()?;
    let start = (memory::MODULE_WINDOW + module.start) as *const u8;
    // SAFETY: `memory::initialize` mapped the module read-only in its window, for good, and kept
    // its pages from the frames: nobody writes there.
    Some(unsafe { core::slice::from_raw_parts(start, length) })
}

/// The values taken along by the boot processor to its own stack.
struct BootHandover {
    info: &'static BootInfo,
    name: &'static str,
    app: App,
    platform: Platform,
    layout: memory::MemoryLayout,
    /// Whether the probe runs, and no app.
    probes: bool,
}

/// Measures time, starts the other cores and runs the app.
extern "C" fn start_cores(start: &BootHandover) -> ! {
    let BootHandover {
        info,
        name,
        app,
        platform,
        layout,
        probes,
    } = start;
    // Time first: starting the other cores waits by the clock.
    let rate = measure_time(info, platform);
    let cores = this_core::all().len();
    // The host chooses the meaning of time.
    if info.value("mode") == Some("deterministic") {
        counted_time::enable();
        time_slice::enable();
    }
    if cores > 1 {
        start_others(info, layout, cores);
    }
    let may_halt = info.value("idle") == Some("halt");
    if cpu::hypervisor().is_none() && !cpu::has_timer_in_halt() && !may_halt {
        interrupt_flag::stay_awake();
    }
    interrupt_flag::enable();
    // The probe's timer handler takes no heartbeats: a due one would interrupt again and again.
    if !*probes {
        heartbeat::set_heartbeats(0);
    }
    // A second installation would require a second boot, so this cannot fail.
    let _ = fass::platform::install(&KERNEL);
    announce(info, name, layout.total_bytes, &rate);
    finish(if *probes {
        probe::run()
    } else {
        run_app(info, name, *app, by_number(platform).count())
    })
}

/// Measures time by a clock of known rate; the machine must have such a clock.
fn measure_time(info: &BootInfo, platform: &Platform) -> TscRate {
    // SAFETY: the tables name these registers, and `devices` had them mapped.
    let clocks = unsafe { KnownClock::all(platform) };
    let is_counted = info.value("mode") == Some("deterministic");
    let asked = info.value("clock");
    calibration::calibrate(info.entry_tsc, &clocks, asked, is_counted).unwrap_or_else(|| {
        panic!(
            "no clock of known rate: {} does not count here; `clock=` may be acpi-pm-timer, \
             hpet, local-apic-1ghz (of QEMU) or pit, or left out",
            asked.unwrap_or("any")
        )
    })
}

/// Starts the other cores. Panics unless all of them come up.
fn start_others(info: &BootInfo, layout: &memory::MemoryLayout, cores: usize) {
    let page = memory::trampoline_page(info.memory.as_slice(), info.modules.as_slice());
    let page = page.expect("no page below 640 KiB is free for processors to start at");
    // SAFETY: 1. The table identity-maps the image, and all stacks are mapped in it. 2.
    // `trampoline_page` returns usable memory that is mapped, and that no frame is taken from.
    let others = unsafe { processors::start_others(layout.root_table, page, other_core) };
    assert!(
        others as usize + 1 == cores,
        "only {} of {cores} processors came up within {} s; give the machine fewer, or the \
         host less to do",
        others + 1,
        processors::PATIENCE_NS / 1_000_000_000
    );
    if let Some(cores) = agreement::disagreement() {
        panic!(
            "time stamp counters are behind others:{cores} update the firmware, or give the \
             machine one processor"
        );
    }
}

fn read_platform(info: &BootInfo) -> Platform {
    // SAFETY: 1. Until `memory::initialize` the boot table is in use, and the view ends with this
    // function. 2. Nothing writes to the firmware's tables.
    let memory = unsafe { LowMemory::new() };
    acpi::read(&memory, info.rsdp).unwrap_or_else(|error| panic!("{error}"))
}

/// Returns the APIC ids of all processors in the order of their numbers.
fn by_number(platform: &Platform) -> impl Iterator<Item = u32> {
    let own = local_apic::id();
    let ids = platform.apic_ids.as_slice().iter().copied();
    core::iter::once(own).chain(ids.filter(move |id| *id != own))
}

/// Returns the APIC ids of the processors that become cores. Wrong options are refused later, when
/// they can be reported as such.
fn selected(info: &BootInfo, platform: &Platform) -> Vec<u32> {
    let is_right = |list: &&str| settings::check(list, by_number(platform).count()).is_ok();
    let list = info.value("cores").filter(is_right);
    assert!(
        platform.processors <= MAX_PROCESSORS || list.is_some(),
        "ACPI names {} processors, of which {MAX_PROCESSORS} can be used; choose by the word \
         `cores=0-{}`, or turn some off in the firmware's settings",
        platform.processors,
        MAX_PROCESSORS - 1
    );
    let drops_siblings = info.value("smt") == Some("off");
    let bits = drops_siblings.then(processors::sibling_bits);
    settings::select(by_number(platform), list, bits.unwrap_or(0))
}

/// Returns the stacks each core needs, the boot processor's first.
fn with_stacks(ids: Vec<u32>) -> impl Iterator<Item = (u32, CoreStacks)> {
    ids.into_iter().zip(0..).map(|(id, index)| {
        let stacks = stacks(index == 0);
        (
            id,
            stacks.expect("each core needs 144 KiB of memory for stacks, the first one 336 KiB"),
        )
    })
}

fn stacks(is_boot_processor: bool) -> Result<CoreStacks, MapError> {
    let small = || memory::new_stack(HANDLER_STACK, 0);
    Ok(CoreStacks {
        first_context: contexts::create_first(is_boot_processor)?,
        handler: small()?,
        exceptions: [small()?, small()?, small()?, small()?],
    })
}

/// The entry of every other core, which then works until the machine stops.
extern "C" fn other_core(apic_id: u32) -> ! {
    processors::arrive(processors::become_core(apic_id));
    interrupt::begin_work()
}

fn run_app(
    info: &'static BootInfo,
    name: &'static str,
    app: App,
    processors: usize,
) -> Result<(), AppError> {
    let usage = |message: &str| AppError::from(UsageError::new(message));
    if info.is_command_line_cut {
        return Err(usage(&format!(
            "the command line is longer than {} bytes and was cut; give fewer words",
            boot::MOST_COMMAND_LINE_BYTES
        )));
    }
    let line = info
        .command_line()
        .map_err(|_| usage("the command line is not UTF-8"))?;
    let options = CommandLine::parse(line)?;
    let settings = settings::apply(&options, processors)?;
    // In the order of the module's parts: WCETs, a recording, the app's own bytes.
    let (wcets, module) = terms::split_wcets(&options, module_bytes(info))?;
    KERNEL.change(|terms| terms.wcets = wcets.map(Cow::Borrowed));
    let module = settings::set_wish(&options, name, module)?;
    let mode = info.value("mode");
    let verdict = RunVerdict::new(
        settings.chosen.judges_bounds && mode != Some("threads"),
        mode == Some("deterministic") && this_core::all().len() > 1,
    );
    let wishes = settings.wishes;
    let result = Machine::serve(BareMachine::new(wishes), options, module, verdict, app);
    record::finish();
    result
}

/// Prints how the app ended, as the last line, and stops the machine.
fn finish(result: Result<(), AppError>) -> ! {
    let told = ending::tell(&result);
    console::resume();
    power::exit(told)
}

/// Prints the description of the machine, and warnings for the app's users.
pub(super) fn announce(info: &BootInfo, app: &str, memory_bytes: u64, rate: &TscRate) {
    let all = this_core::all();
    let cores = all.len();
    let ids: Vec<u32> = all.iter().map(Core::apic_id).collect();
    let siblings = settings::siblings(&ids, processors::sibling_bits());
    let efficiency_cores = all.iter().filter(|core| core.is_efficient()).count();
    let command_line = info.command_line().unwrap_or("(not UTF-8)");
    json::report("boot", |line| {
        line.text("version", env!("CARGO_PKG_VERSION"))
            .text("app", app)
            .number("cpus", cores as u64)
            .number("siblings", siblings as u64)
            .number("efficiency_cores", efficiency_cores as u64)
            .number("memory_kib", memory_bytes / 1024)
            .text("clock", rate.clock)
            .number("counter_khz", rate.khz)
            .flag("counter_invariant", cpu::has_invariant_counter())
            .flag("timer_in_halt", cpu::has_timer_in_halt())
            .flag("x2apic", local_apic::is_x2apic())
            .flag("avx", avx::is_on())
            .flag("clock_undisputed", rate.is_undisputed());
        if let Some((clock, khz)) = rate.check {
            line.text("clock_check", clock)
                .number("clock_check_khz", khz);
        }
        line.number("skew_ns", agreement::skew_ns())
            .number("ready_ns", clock::now_ns())
            .text("command_line", command_line);
    });
    if siblings > 0 {
        println!(
            "warning: {siblings} of {cores} cores share a physical core with another, and slow it \
             down; `smt=off` leaves them out"
        );
    }
    if efficiency_cores > 0 {
        println!(
            "warning: {efficiency_cores} of {cores} cores are efficiency cores, slower than the \
             others; `cores=` chooses"
        );
    }
    if cpu::hypervisor().is_none() && !cpu::has_invariant_counter() {
        println!(
            "warning: the processor does not state that its counter keeps one rate; if its \
             frequency changes, times are wrong"
        );
    }
    if interrupt_flag::stays_awake() {
        println!(
            "warning: halting may stop the processor's timer, so idle cores stay awake; \
             `idle=halt` lets them halt"
        );
    }
}
