# What an application processor executes first: real mode, at the start of a
# page below 1 MiB that the startup IPI names. The bytes are copied to that page
# with the last three values filled in; data is addressed relative to it, so
# that they run wherever the page is. (AT&T syntax: it can spell far jumps.)

.section .rodata.trampoline, "a"
.code16
.global trampoline_start
.global trampoline_root_table
.global trampoline_target
.global trampoline_end
trampoline_start:
    cli
    cld
    movw %cs, %ax
    movw %ax, %ds
    movl (trampoline_root_table - trampoline_start), %eax
    movl %eax, %cr3
    lgdtl (trampoline_gdt_pointer - trampoline_start)
    movl $0x11, %eax                # protected mode, ET; caches on
    movl %eax, %cr0
    ljmpl *(trampoline_target - trampoline_start)
    .balign 8
trampoline_gdt_pointer:
    .word 31
    .long boot_gdt
trampoline_root_table:
    .long 0
trampoline_target:                  # selector 0x18 (32-bit code), processor_entry
    .long processor_entry
    .word 0x18
trampoline_end:
.code64
