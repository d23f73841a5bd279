# Entry and exit of every interrupt and exception.
#
# Interrupts (vector 32 and up) arrive on IST 1, which points to the end of the
# register area of the context that runs: the processor's frame and the pushes
# below fill it, so that the context is saved where it is kept. The handler then
# runs on the core's handler stack and returns the register area to resume, the
# same one or another context's.
#
# Exceptions (below 32) arrive on stacks of their own (IST 2 to 5) and are
# handled there, in the same layout.
#
# The layout, from low to high: vector state, then `Registers`. Compiled code uses
# vector registers and the red zone everywhere: hence the fxsave, and hence no handler
# ever pushes to the interrupted stack.
#
# Where AVX is on, `avx.rs` puts xsaveopt and xrstor in the place of two instructions.
# Those take the parts of the state that edx:eax names, of what the processor was told to
# have: all, as edx names parts that there are not. The others ignore eax.

.section .text.interrupt_entry, "ax"

.balign 16
.global interrupt_stubs
interrupt_stubs:
.set vector, 0
.rept 32 + {other} - {timer} + 1
    .balign 16
    .if vector == 32
    .set vector, {timer}
    .endif
    # The processor pushes an error code for these alone (Intel SDM 3, 6.13).
    .if (vector == 8) || ((vector >= 10) && (vector <= 14)) || (vector == 17) || (vector == 21) || (vector == 29) || (vector == 30)
    .else
    push 0
    .endif
    push vector
    .if vector < 32
    jmp exception_common
    .else
    jmp interrupt_common
    .endif
    .set vector, vector + 1
.endr

.macro save_registers
    push rax
    push rbx
    push rcx
    push rdx
    push rsi
    push rdi
    push rbp
    push r8
    push r9
    push r10
    push r11
    push r12
    push r13
    push r14
    push r15
    cld
.endm

interrupt_common:
    save_registers
    mov eax, -1
.global save_vectors
save_vectors:
    fxsave64 [rsp - {vector_bytes}]
    mov rdi, rsp
    mov rsp, gs:[{handler_stack}]
    call {handle_interrupt}
resume_rax:
    mov rsp, rax

# Resumes the context whose register area rsp points to, from anywhere in code that
# has interrupts disabled and will not go on.
.global resume_context
resume_context:
    mov eax, -1
.global restore_vectors
restore_vectors:
    fxrstor64 [rsp - {vector_bytes}]
pop_registers:
    pop r15
    pop r14
    pop r13
    pop r12
    pop r11
    pop r10
    pop r9
    pop r8
    pop rbp
    pop rdi
    pop rsi
    pop rdx
    pop rcx
    pop rbx
    pop rax
    add rsp, 16                     # vector and error code
    iretq

exception_common:
    save_registers
    mov rdi, rsp
    sub rsp, 512
    fxsave64 [rsp]
    call {handle_exception}
    test rax, rax
    jnz resume_rax
    # The interrupted code goes on. The kernel's code keeps the upper halves of vectors.
    fxrstor64 [rsp]
    add rsp, 512
    jmp pop_registers

.section .rodata.vectors_with_avx, "a"
.global vectors_with_avx
vectors_with_avx:
    xsaveopt64 [rsp - {vector_bytes}]
    xrstor64 [rsp - {vector_bytes}]
