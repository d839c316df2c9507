#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# A Debian 12 for aarch64 in build/aarch64_sysroot: the libraries of apt.txt, for `cmake --preset aarch64`, and a Python with the packages
# that mjsense needs, which build/aarch64_sysroot/emulated_python runs. Packages are downloaded with an apt configuration of its own and
# unpacked, so that nothing of this machine changes. Fast when it is there. usage: packaging/aarch64_sysroot.sh
#
# Needs g++-aarch64-linux-gnu and qemu-user-static, and .venv (./dev setup).
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
root=$PWD/build/aarch64_sysroot
work=$PWD/build/aarch64_packages
python=$PWD/.venv/bin/python
suite=bookworm
mirror=${MJSENSE_DEBIAN_MIRROR:-http://deb.debian.org/debian}
keyring=/usr/share/keyrings/debian-archive-keyring.gpg

say() { printf '\033[1m%s\033[0m\n' "$*" >&2; }

for program in aarch64-linux-gnu-g++ qemu-aarch64-static; do
  command -v $program >/dev/null || { say "$program was not found: apt-get install g++-aarch64-linux-gnu qemu-user-static"; exit 1; }
done

# The libraries that apt.txt names, the C library, and a Python that creates virtual environments. The compilers run on this machine.
packages="$(sed 's/#.*//' apt.txt | grep -oE '^(lib|zlib|nlohmann|python3)[^ ]*' | grep -v '^libgl1-mesa-dri')
  libc6-dev libstdc++-12-dev libpython3.11 bash coreutils dash"
# Packages that mujoco-core, NumPy, Gymnasium, the binding library and the tests of recordings bring, as for the development environment.
wheels="mujoco-core==$("$python" -c 'import importlib.metadata as m; print(m.version("mujoco-core"))') \
  $(sed 's/#.*//' requirements.txt | grep -E '^(numpy|gymnasium|nanobind-backend|h5py|pytest>)' | tr -d ' ') imageio-ffmpeg"

wanted=$(echo "$suite" $packages $wheels; sha256sum < "${BASH_SOURCE[0]}")
[ "$(cat "$root/made_from" 2>/dev/null)" = "$wanted" ] && exit

say "downloading Debian's arm64 packages"
mkdir -p "$work/lists/partial" "$work/cache/archives/partial" "$work/parts"
: > "$work/status"
echo "deb [signed-by=$keyring] $mirror $suite main" > "$work/sources.list"
arm_apt() {
  apt-get -q -o APT::Architecture=arm64 -o APT::Architectures=arm64 -o APT::Sandbox::User=root -o Debug::NoLocking=1 \
    -o Dir::Etc::sourcelist="$work/sources.list" -o Dir::Etc::sourceparts="$work/parts" -o Dir::State="$work" \
    -o Dir::State::lists="$work/lists" -o Dir::State::status="$work/status" -o Dir::Cache="$work/cache" "$@"
}
arm_apt update >&2
arm_apt install -y --download-only --no-install-recommends $packages >&2

say "unpacking them"
rm -rf "$root"
mkdir -p "$root"/{dev,proc,tmp,mjsense}
for package in "$work"/cache/archives/*.deb; do dpkg-deb -x "$package" "$root"; done
# Links to absolute names lead out of the folder.
find "$root" -type l -lname '/*' -printf '%l\t%p\n' | while IFS=$'\t' read -r target link; do
  ln -sfn "$(realpath -ms --relative-to="$(dirname "$link")" "$root$target")" "$link"
done

say "adding Python packages"
"$python" -m pip install -q --disable-pip-version-check --no-warn-conflicts --only-binary=:all: \
  --implementation cp --python-version 3.11 --abi cp311 --abi abi3 --abi none \
  --platform manylinux_2_28_aarch64 --platform manylinux_2_17_aarch64 --platform manylinux2014_aarch64 \
  --target "$root/usr/lib/python3/dist-packages" --upgrade $wheels
printf '#!/bin/sh\nexec "%s" "%s/usr/bin/python3" "$@"\n' "$PWD/packaging/emulate.sh" "$root" > "$root/emulated_python"
chmod +x "$root/emulated_python"
echo "$wanted" > "$root/made_from"
