// SPDX-License-Identifier: Apache-2.0
// Symbols that the standard library of this compiler uses and that glibc lacks before 2.32.

// 0: the process may have several threads, so libstdc++ uses atomic operations.
extern "C" {
char __libc_single_threaded = 0;
}
