#!/usr/bin/env bash
# Uses a wheel as a newcomer does on a Debian 12 that has Python and nothing else: no compiler, ffmpeg, OpenGL or network.
# Debian's Python is 3.11; others are given by the folder they are installed in, which is copied. Root only; the first call makes the
# Debian (debootstrap, 3 minutes). A wheel for aarch64 is used under emulation, in the Debian of packaging/aarch64_sysroot.sh.
# usage: packaging/minimal.sh WHEEL [PREFIX ...]
set -euo pipefail
wheel=$(realpath "$1")
shift
cd "$(dirname "${BASH_SOURCE[0]}")/.."
arch=${wheel##*manylinux_2_28_}
arch=${arch%.whl}
if [ "$arch" = "$(uname -m)" ]; then
  root=$PWD/build/minimal
  platform=()
  [ -x "$root/usr/bin/python3" ] || debootstrap --variant=minbase --include=python3,python3-venv bookworm "$root" >/dev/null
  inside() { unshare --mount bash -ec 'mount -t proc proc "$0/proc"; exec chroot "$0" "$@"' "$root" "$@"; }
else
  root=$PWD/build/${arch}_sysroot
  platform=(--platform "manylinux_2_28_$arch" --platform "manylinux_2_17_$arch" --platform "manylinux2014_$arch")
  "packaging/${arch}_sysroot.sh"
  inside() { packaging/emulate.sh --inside "$@"; }
fi

try() { # VERSION PYTHON
  local wheels=$root/try/wheels-$1
  mkdir -p "$wheels"
  .venv/bin/python -m pip download -q --disable-pip-version-check --only-binary=:all: --python-version "$1" "${platform[@]}" \
    -d "$wheels" "$wheel[video]" h5py
  inside "$2" -m venv "/try/$1"
  inside "/try/$1/bin/python" -m pip install -q --no-index --find-links "/try/wheels-$1" 'mjsense[video]' h5py
  inside /try/newcomer.sh "/try/$1"
  du -sh --apparent-size "$root/try/$1" | sed 's,/.*,with all it depends on,'
}

rm -rf "$root/try"
mkdir "$root/try"
cp packaging/newcomer.sh "$root/try"
echo "== Debian's Python 3.11; $(stat -c %s "$wheel") bytes of wheel"
try 3.11 /usr/bin/python3
for prefix in "$@"; do
  version=$("$prefix/bin/python3" -c 'import sys; print("%d.%d" % sys.version_info[:2])')
  echo "== Python $version"
  mkdir -p "$root$prefix"
  tar -C "$prefix" --exclude=test --exclude=site-packages --exclude=share -cf - . | tar -C "$root$prefix" -xf -
  try "$version" "$prefix/bin/python3"
done
rm -rf "$root/try"
