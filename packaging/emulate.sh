#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Runs a program for aarch64 on amd64 under qemu, and the programs that it starts, with the libraries of packaging/aarch64_sysroot.sh. With
# --inside, it sees nothing but that Debian. Namespaces of its own keep the machine unchanged; they need Linux 6.7 or newer.
# usage: packaging/emulate.sh [--inside] PROGRAM [ARGUMENT ...]
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)/build/aarch64_sysroot
export root
# The kernel starts qemu for files that begin as programs for aarch64 do.
register='mount -t binfmt_misc none /proc/sys/fs/binfmt_misc
  cat /usr/lib/binfmt.d/qemu-aarch64.conf > /proc/sys/fs/binfmt_misc/register'
if [ "$1" = --inside ]; then
  shift
  exec unshare --user --map-root-user --mount --pid --fork --mount-proc bash -euc "$register"'
    mount --rbind /dev "$root/dev"
    mount --rbind /proc "$root/proc"
    mount -t tmpfs tmpfs "$root/tmp"
    exec chroot "$root" /usr/bin/env -i PATH=/usr/local/bin:/usr/bin:/bin HOME=/tmp "$@"' bash "$@"
fi
# Without OpenGL: Mesa's software renderer crashes under qemu.
export __EGL_VENDOR_LIBRARY_DIRS=/nonexistent
QEMU_LD_PREFIX=$root exec unshare --user --map-root-user --mount bash -euc "$register"'
  exec "$@"' bash "$@"
