/* SPDX-License-Identifier: Apache-2.0 */
/* mjsense_call_in_frame() of mujoco_call.cc for x86-64. */
  .text
  .globl mjsense_call_in_frame
  .hidden mjsense_call_in_frame
  .type mjsense_call_in_frame, @function
mjsense_call_in_frame:
  .cfi_startproc
  .cfi_personality 0x1b, mjsense_personality
  subq $8, %rsp
  .cfi_adjust_cfa_offset 8
  movq %rdi, %rax
  movq %rsi, %rdi
  call *%rax
  addq $8, %rsp
  .cfi_adjust_cfa_offset -8
  ret
  .cfi_endproc
  .size mjsense_call_in_frame, .-mjsense_call_in_frame
  .section .note.GNU-stack, "", @progbits
