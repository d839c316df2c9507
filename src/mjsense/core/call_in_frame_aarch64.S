/* SPDX-License-Identifier: Apache-2.0 */
/* mjsense_call_in_frame() of mujoco_call.cc for AArch64. */
  .text
  .globl mjsense_call_in_frame
  .hidden mjsense_call_in_frame
  .type mjsense_call_in_frame, %function
mjsense_call_in_frame:
  .cfi_startproc
  .cfi_personality 0x1b, mjsense_personality
  stp x29, x30, [sp, -16]!
  .cfi_def_cfa_offset 16
  .cfi_offset 29, -16
  .cfi_offset 30, -8
  mov x2, x0
  mov x0, x1
  blr x2
  ldp x29, x30, [sp], 16
  .cfi_restore 29
  .cfi_restore 30
  .cfi_def_cfa_offset 0
  ret
  .cfi_endproc
  .size mjsense_call_in_frame, .-mjsense_call_in_frame
  .section .note.GNU-stack, "", %progbits
