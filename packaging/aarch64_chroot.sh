#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Runs a command in the Debian of packaging/aarch64_sysroot.sh under qemu, in namespaces of its own, with this checkout as /mjsense. Needs
# Linux 6.7 or newer, where a namespace can have an interpreter for programs of another CPU without changing the machine.
# usage: packaging/aarch64_chroot.sh COMMAND [ARGUMENT ...]
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
export root=$PWD/build/aarch64_sysroot source=$PWD
exec unshare --user --map-root-user --mount --pid --fork bash -euc '
  mount --bind "$source" "$root/mjsense"
  mount --rbind /dev "$root/dev"
  mount -t proc proc "$root/proc"
  mount -t tmpfs tmpfs "$root/tmp"
  mount -t binfmt_misc none "$root/proc/sys/fs/binfmt_misc"
  cat /usr/lib/binfmt.d/qemu-aarch64.conf > "$root/proc/sys/fs/binfmt_misc/register"
  exec chroot "$root" /usr/bin/env -i PATH=/usr/local/bin:/usr/bin:/bin HOME=/tmp "$@"' chroot "$@"
