# The boot processor from the loader's 32-bit jump to 64-bit Rust.
#
# There are two kinds of loader: PVH (Xen's "x86/HVM direct boot ABI") and Multiboot2 (its
# specification 2.0, 3.3). Both enter with paging off, flat segments, interrupts off, and
# in ebx the physical address of what they tell, by which Rust tells them apart.

# In a group, since a linker keeps any other note, with all that it names. A host program that
# links the kernel's logic may take this file along, and has no use for it.
.section .note.pvh, "aG", @note, pvh, comdat
    .balign 4
    .long 4                         # size of the name
    .long 8                         # size of the descriptor
    .long 18                        # XEN_ELFNOTE_PHYS32_ENTRY
    .asciz "Xen"
    .quad pvh_entry

# A loader of Multiboot2 takes the address of the entry from the ELF header. Under UEFI,
# too, it leaves the firmware and enters in 32-bit mode, as nothing else is asked for.
.section .multiboot2, "a"
    .balign 8
multiboot2_header:
    .long 0xe85250d6                # magic number
    .long 0                         # architecture: 32-bit protected mode
    .long multiboot2_header_end - multiboot2_header
    .long -(0xe85250d6 + multiboot2_header_end - multiboot2_header)
    .word 6, 0                      # modules begin on pages
    .long 8
    .word 5, 1                      # a screen, if there is one, of any size
    .long 20
    .long 0, 0, 32
    .balign 8
    .word 0, 0                      # the end
    .long 8
multiboot2_header_end:

.section .text.pvh_entry, "ax"
.code32
.global pvh_entry
pvh_entry:
    # A processor in 64-bit mode has no loader of ours behind it: it is in a program of Linux.
    # There the byte of `dec eax` is a prefix of `nop` and leaves the zero flag as it is.
    xor eax, eax
    dec eax
    nop
    jz host_entry

    cli
    cld
    mov ebp, ebx                    # nothing below touches ebp

    # A processor that has no 64-bit mode can only say so (Intel SDM volume 2, CPUID).
    mov eax, 0x80000000
    cpuid
    cmp eax, 0x80000001
    jb refuse
    mov eax, 0x80000001
    cpuid
    test edx, 1 << 29
    jz refuse

    # Identity-map the first 4 GiB with 2 MiB pages: 4 directories in a row.
    mov edi, offset boot_page_directories
    mov eax, 0x83                   # present, writable, large
    mov ecx, 2048
1:  mov [edi], eax
    mov dword ptr [edi + 4], 0
    add eax, 0x200000
    add edi, 8
    dec ecx
    jnz 1b

    mov edi, offset boot_directory_pointers
    mov eax, offset boot_page_directories
    or eax, 3
    mov ecx, 4
2:  mov [edi], eax
    add eax, 4096
    add edi, 8
    dec ecx
    jnz 2b

    mov edi, offset boot_root_table
    mov eax, offset boot_directory_pointers
    or eax, 3
    mov [edi], eax
    mov [edi + 8], eax              # from 512 GiB on once more, see boot::physical
    mov cr3, edi

    lgdt [boot_gdt_pointer]
    mov esi, offset boot_long_mode
    jmp enable_long_mode

# Sends a line to the first serial port as the loader has left that, tells QEMU of a failure by
# its debug exit device, which is nobody's port elsewhere, and stops.
refuse:
    mov esi, offset refusal
4:  mov edx, 0x3f8 + 5
5:  in al, dx
    test al, 1 << 5                 # there is room; so it is, too, where there is no port
    jz 5b
    mov edx, 0x3f8
    outsb
    cmp esi, offset refusal_end
    jb 4b
    mov eax, 0x11
    out 0xf4, eax
6:  hlt
    jmp 6b

# Turns on long mode with the tables that cr3 holds, and SSE, which compiled
# code uses from its first instruction on. Continues in 64-bit mode at the address
# in esi. Needs no stack; changes eax, ebx, ecx, edx. Used by every
# processor (Intel SDM volume 3, 10.8.5). No-execute pages are turned on where there are
# any: where a firmware has put them away, the kernel says so.
#
# Nothing is taken over from what ran before: a firmware may leave five-level paging
# on, and after INIT a processor has its caches off (CD, NW).
enable_long_mode:
    mov eax, (1 << 5) | (1 << 9) | (1 << 10)    # PAE, OSFXSR, OSXMMEXCPT
    mov cr4, eax
    mov eax, 0x80000001
    cpuid
    and edx, 1 << 20                            # no-execute pages
    shr edx, 20 - 11
    mov ebx, edx
    mov ecx, 0xc0000080                         # EFER
    rdmsr
    or eax, 1 << 8                              # long mode
    or eax, ebx
    wrmsr
    # Of the page attributes (SDM volume 3, 12.12) entry 1, written through at reset, combines writes.
    # All processors have the same, and no table in use has it before the kernel's.
    mov ecx, 0x277                              # PAT
    mov eax, 0x00070106
    mov edx, 0x00070406
    wrmsr
    # Paging, write protection, NE, ET, MP, protected mode; no emulation, no trap.
    mov eax, (1 << 31) | (1 << 16) | (1 << 5) | (1 << 4) | (1 << 1) | (1 << 0)
    mov cr0, eax
    fninit
    jmp fword ptr [long_mode_pointer]

.code64
long_mode:
    xor eax, eax
    mov ds, eax
    mov es, eax
    mov ss, eax
    mov fs, eax
    mov gs, eax
    mov esi, esi                                # its upper half is undefined by now
    jmp rsi

boot_long_mode:
    lea rsp, [rip + boot_stack_top]
    mov edi, ebp
    xor ebp, ebp
    call {rust_entry}
    ud2

# An application processor, sent here by the trampoline in 32-bit mode with cr3
# loaded and no stack. It finds its own by its APIC id, in a table that is filled before any
# processor is started. An id of more than 8 bits is in CPUID leaf 0xb, if there is that.
.code32
processor_entry:
    mov ax, 0x10
    mov ds, ax
    mov es, ax
    mov ss, ax
    xor eax, eax
    cpuid
    cmp eax, 0xb
    jb 1f
    mov eax, 0xb
    xor ecx, ecx
    cpuid
    mov ebp, edx
    test ebx, ebx
    jnz 2f
1:  mov eax, 1
    cpuid
    shr ebx, 24
    mov ebp, ebx
2:  mov esi, offset processor_long_mode
    jmp enable_long_mode

.code64
processor_long_mode:
    lea rax, [rip + {stacks}]
    lea rcx, [rax + {stacks_bytes}]
3:  cmp [rax], rbp
    je 5f
    add rax, 16
    cmp rax, rcx
    jb 3b
4:  hlt                             # nobody has started this one
    jmp 4b
5:  mov rsp, [rax + 8]
    mov edi, ebp
    xor ebp, ebp
    call {processor_rust_entry}
    ud2

# Somebody has started the image as a program of Linux, and is told so (system calls 1,
# write, and 60, exit).
.section .text.host_entry, "ax"
host_entry:
    mov eax, 1
    mov edi, 2
    lea rsi, [rip + host_message]
    lea rdx, [rip + host_message_end]
    sub rdx, rsi
    syscall
    mov eax, 60
    mov edi, 1
    syscall
    ud2

.section .rodata.host_message, "a"
host_message:
    .ascii "this is an image for the bare machine, and no program of this system; "
    .ascii "boot it by `./scripts/boot FILE`, or by `fass-tool boot FILE`\n"
host_message_end:

.section .rodata.refusal, "a"
refusal:
    .ascii "this processor has no 64-bit mode, which the image needs\r\n"
refusal_end:

.section .rodata.boot_gdt, "a"
    .balign 16
boot_gdt:
    .quad 0
    .quad 0x00af9b000000ffff                    # 0x08: 64-bit code
    .quad 0x00cf93000000ffff                    # 0x10: data
    .quad 0x00cf9b000000ffff                    # 0x18: 32-bit code
boot_gdt_end:
boot_gdt_pointer:
    .word boot_gdt_end - boot_gdt - 1
    .long boot_gdt

long_mode_pointer:
    .long long_mode
    .word 0x08

.section .bss.boot, "aw", @nobits
    .balign 4096
boot_root_table: .skip 4096
boot_directory_pointers: .skip 4096
boot_page_directories: .skip 4 * 4096
    .skip 32768
boot_stack_top:
