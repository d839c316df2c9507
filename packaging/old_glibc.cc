// SPDX-License-Identifier: Apache-2.0
// What this compiler's standard library names and a glibc before 2.32 lacks.

// "Perhaps there are several threads": atomic operations are used.
extern "C" {
char __libc_single_threaded = 0;
}
